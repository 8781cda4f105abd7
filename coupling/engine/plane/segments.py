"""Segments and events of a run of bodies in the plane (response.segment)."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.engine.plane.contact_flow import ContactFlows
from vanedamp.coupling.engine.plane.state import Guards, PlanarState, Scratch
from vanedamp.coupling.numerics.codes import FLOW, PERIOD, REDUCED, ROOT
from vanedamp.coupling.response.event_log import WIDTH
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS
from vanedamp.coupling.response.segment import START, Begun, Event, Segment, no_event
from vanedamp.coupling.system.system import System


def segment_of(system: System, flows: ContactFlows, st: PlanarState) -> Segment:
    """Return the motion from a state on."""
    s = int(st.counters[FLOW])
    modes = slice(int(flows.modes[s]))
    rate, shape = flows.eigenvalue[s, modes].copy(), flows.motion[s, :, modes].copy()
    none = np.zeros(len(rate), complex)
    return Segment(
        system=system, period=int(st.counters[PERIOD]), time=float(st.time[0]), state=st.state.copy(),
        q=st.q.copy(), v=st.v.copy(), bend=st.bend.copy(), speed=float(st.scale[0]), rate=rate,
        amplitude=st.amplitude[modes].copy(), shape=shape, rate_shape=shape * rate, force=st.force.copy(),
        force_shape=flows.force[s, :, modes].copy(), drive=none, driver=none, open_force=st.prestress.copy(),
    )  # fmt: skip


def event_of(
    system: System, st: PlanarState, guards: Guards, work: Scratch, log: list[np.ndarray], since: Begun
) -> tuple[float, Event]:
    """Return the last event and the time from the segment's begin to it. log: entries since then, in chunks."""
    unit, what, elapsed, u = -1, 0, 0.0, len(system.rest)
    if since is not START:
        roots = np.flatnonzero(guards.status == ROOT)
        first = roots[np.argmin(guards.no_root_before[roots])]
        unit, what, elapsed = int(guards.unit[first]), int(guards.what[first]), float(st.time[0]) - since.time
    hits = np.concatenate([*log, np.zeros((0, WIDTH))])
    hits = hits[hits[:, 1] == IMPACT]
    struck, impulse, compression = hits[:, 2].astype(int), np.zeros(2 * u), np.zeros(2 * u)
    np.add.at(impulse, struck, hits[:, 5])
    np.add.at(impulse, u + struck, hits[:, 6])
    if system.two_phases and len(struck):
        compression = work.compression.copy()
    return elapsed, no_event(system)._replace(
        unit=unit, what=what, impulse=impulse, compression=compression, struck=struck, before=hits[:, 3],
        after=hits[:, 4], loss=float(st.ledger[IMPACT_LOSS]) - since.loss,
        reduced=int(st.counters[REDUCED]) > since.reduced,
    )  # fmt: skip
