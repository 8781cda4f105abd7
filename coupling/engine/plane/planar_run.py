"""A run of the exact engine for planar bodies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import ClassVar

import numpy as np

from vanedamp.coupling.engine.columns import Columns, system_in
from vanedamp.coupling.engine.plane.columns import BY_UNIT, columns
from vanedamp.coupling.engine.plane.flow_assembly import empty_flows, new_assembly_scratch
from vanedamp.coupling.engine.plane.scenes import run
from vanedamp.coupling.engine.plane.state import new_event_functions, new_scratch, new_state
from vanedamp.coupling.engine.plane.subsystems import known_subsystems
from vanedamp.coupling.engine.run import EventDrivenRun
from vanedamp.coupling.numerics.codes import BOUNDED, FLOW, PERIOD, REDUCED, ROOT
from vanedamp.coupling.response.event_log import rows_of_units
from vanedamp.coupling.response.plane import Plane, plane_of
from vanedamp.coupling.response.records import IMPACT, IMPACT_LOSS, WIDTH, Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import START, Begun, Segment, SegmentEnd, no_event
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System


def is_common(system: System, modes: int) -> bool:
    """Whether this is the most common scene, with lengths compiled in.

    One mode, one block between rigid walls, one harmonic.
    """
    one = system.modes == system.bodies == len(system.frequency) == 1 and modes == 3
    rigid = not len(system.tangential) and np.isinf(system.spring).all()
    return bool(one and rigid and len(system.rest) == system.contacts == 8)


class PlanarRun(EventDrivenRun):
    """A run of planar bodies."""

    NUMBERS: ClassVar = EventDrivenRun.NUMBERS | {"reduced_impacts": REDUCED}
    rows_of: ClassVar = staticmethod(rows_of_units)
    compiled: ClassVar = staticmethod(run)
    is_common: ClassVar = staticmethod(is_common)
    rooms: ClassVar = (
        known_subsystems, empty_flows, new_assembly_scratch, new_state, new_event_functions, new_scratch
    )  # fmt: skip
    key: ClassVar = "state"

    def __init__(
        self, system: System, start: RestartState, records: Records, events: bool, max_events: int,
        linearisation: float = 0.01,
    ) -> None:  # fmt: skip
        super().__init__(system, system, start, records, events, max_events)
        self.linearisation = linearisation

    def check(self) -> None:
        """Take any structure."""

    def columns_of(
        self, scene: Scene, start: RestartState, values: Mapping[str, np.ndarray]
    ) -> tuple[Columns, Iterable[int]]:
        """Return the columns of scenes (EventDrivenRun)."""
        return columns(scene, self.whole, start, values)

    def whole_in(self, table: Columns, k: int) -> System:
        """Return the system of scene k."""
        system = system_in(self.whole, table, k, np.arange(len(self.whole.rest)))
        return system._replace(**{name: getattr(table, name)[k] for name in BY_UNIT})

    def reuse(self, earlier: PlanarRun) -> None:
        """Take over the flows that an earlier run has met, if it is one of the same system."""
        alike = map(partial(np.array_equal, equal_nan=True), self.system, earlier.system)
        if self.system is earlier.system or all(alike):
            self.flows = earlier.flows

    def rows_of_trace(self) -> np.ndarray:
        """Return the units."""
        return np.arange(len(self.whole.rest))

    def _segment(self) -> Segment:
        self.watched.status[:] = BOUNDED  # roots of other segments do not apply
        st, flows = self.state, self.flows
        s = int(st.counters[FLOW])
        modes = slice(int(flows.modes[s]))
        rate, shape = flows.eigenvalue[s, modes].copy(), flows.motion[s, :, modes].copy()
        none = np.zeros(len(rate), complex)
        return Segment(
            system=self.system, period=int(st.counters[PERIOD]), time=float(st.time[0]), state=st.state.copy(),
            q=st.q.copy(), v=st.v.copy(), bend=st.bend.copy(), speed=float(st.scale[0]), rate=rate,
            amplitude=st.amplitude[modes].copy(), shape=shape, rate_shape=shape * rate, force=st.force.copy(),
            force_shape=flows.force[s, :, modes].copy(), drive=none, driver=none, open_force=st.prestress.copy(),
        )  # fmt: skip

    def _event(self, log: list[np.ndarray], since: Begun) -> tuple[float, SegmentEnd]:
        system, st, watched = self.system, self.state, self.watched
        unit, event, elapsed, u = -1, 0, 0.0, len(system.rest)
        if since is not START:
            roots = np.flatnonzero(watched.status == ROOT)
            first = roots[np.argmin(watched.no_root_before[roots])]
            unit, event = int(watched.unit[first]), int(watched.what[first])
            elapsed = float(st.time[0]) - since.time
        hits = np.concatenate([*log, np.zeros((0, WIDTH))])
        hits = hits[hits[:, 1] == IMPACT]
        struck, impulse, compression = hits[:, 2].astype(int), np.zeros(2 * u), np.zeros(2 * u)
        np.add.at(impulse, struck, hits[:, 5])
        np.add.at(impulse, u + struck, hits[:, 6])
        if system.two_phases and len(struck):
            compression = self.scratch.compression.copy()
        return elapsed, no_event(system)._replace(
            unit=unit, what=event, impulse=impulse, compression=compression, struck=struck, before=hits[:, 3],
            after=hits[:, 4], loss=float(st.ledger[IMPACT_LOSS]) - since.loss,
            reduced=int(st.counters[REDUCED]) > since.reduced,
        )  # fmt: skip

    def _plane(self) -> Plane:
        return plane_of(self.whole, self.records, self.linearisation)
