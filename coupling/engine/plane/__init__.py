"""Bodies with extent: blocks and discs that move in the plane of their cavity, hit with their corners, tilt and lift.

In order: constraints (from a scene to coordinates and contacts), contact_flow (exact motion while the contacts stay as
they are), state, contact_decisions (which contacts carry, stick or slip), impacts, exponential_integrals and quadrature
(energies, peaks), automaton (the loop from event to event), planar_run.

Tilts are small, so that gaps and slips are linear in the coordinates: between events the motion has a closed form, and
the search for events keeps its guarantee. A friction force is bounded by the normal force of its contact, which is a
function of time.
"""
