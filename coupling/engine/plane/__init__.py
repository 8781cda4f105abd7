"""Planar bodies: blocks and discs that move in the plane of their cavity, hit with their corners, tilt and lift.

In order: subsystems and flow_assembly (exact motion while contacts keep their states), state, friction_problem,
contact_states (which contacts carry, stick or slip), impacts, event_functions, energy_balance, automaton (the loop from
event to event), columns and scenes (one scene or many in a compiled call), planar_run.

Tilts are small, so that gaps and slips are linear in the coordinates: between events the motion has a closed form, and
the search for events keeps its guarantee. A friction force is bounded by the normal force of its contact, which is a
function of time.
"""
