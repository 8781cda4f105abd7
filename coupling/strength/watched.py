"""Runs with what a model tells beside its response: stress at hot spots, and the response of the sectors of a ring."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.coordinate_watch import CoordinateWatch
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
    spots = spots_of(scene)
    stress = None if spots is None else StressTaker(spots)
    watch = None if stress is None else CoordinateWatch(stress)
    response = respond(scene, events, samples_per_period, start, progress, watch, outputs=True)
    return response if stress is None else replace(response, stress=stress.result(scene, response))
