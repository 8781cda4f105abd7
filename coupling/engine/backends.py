"""Common entry of both engines, for sliders and for planar bodies: the contents of a system decide which runs."""

from __future__ import annotations

from typing import Any

from vanedamp.coupling.response.records import Records
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.segment import EventRun
from vanedamp.coupling.system.line_system import line_system
from vanedamp.coupling.system.system import System


def engine_run(
    system: System, start: RestartState, records: Records, events: bool, max_events: int, linearisation: float = 0.01
) -> EventRun:  # fmt: skip
    """Return a run of the engine that takes all of a system: of sliders, or for planar bodies.

    linearisation: largest shortening of a tilted body over its play for a status ok. Kernels are loaded when they are
    wanted.
    """
    if system.in_plane:
        from vanedamp.coupling.engine.plane.planar_run import PlanarRun

        return PlanarRun(system, start, records, events, max_events, linearisation)
    from vanedamp.coupling.engine.line.event_driven import EngineRun

    return EngineRun(system, line_system(system), start, records, events, max_events)


def reuse_subsystems(run: Any, earlier: Any) -> None:
    """Let a run take over the subsystems that an earlier one has met, where both are of one engine that can."""
    if earlier is not None and type(earlier) is type(run) and hasattr(run, "reuse"):
        run.reuse(earlier)
