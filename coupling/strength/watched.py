"""Runs with what their modal coordinates tell: stress at hot spots, and the response of the sectors of a ring."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.coordinate_watch import CoordinateWatch, Taker
from vanedamp.coupling.strength.sector_watch import SectorTaker, sectors_of
from vanedamp.coupling.strength.spots import spots_of
from vanedamp.coupling.strength.stress_watch import StressTaker


def watched(
    scene: Scene,
    events: bool = False,
    samples_per_period: int = 0,
    start: RestartState | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Response:
    """Return the response of a scene without open choices, with the stress at its hot spots and its sectors if any.

    Arguments as in coupling.simulation.simulate.
    """
    spots, sectors = spots_of(scene), sectors_of(scene)
    stress = None if spots is None else StressTaker(spots)
    ring = None if sectors is None else SectorTaker(sectors)
    takers: list[Taker] = [taker for taker in (stress, ring) if taker is not None]
    if not takers:
        return respond(scene, events, samples_per_period, start, progress)
    watch = CoordinateWatch(takers)
    response = respond(scene, events, samples_per_period, start, progress, watch)
    if stress is not None:
        response = replace(response, stress=stress.result(scene, response))
    if ring is not None and watch.outcome is not None:
        response = replace(response, sectors=ring.result(scene, response, watch.outcome))
    return response
