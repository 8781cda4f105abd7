"""Open choices of scenes: the number of modes (selection), then the shape of the bodies (body_choice).

All points of a sweep have the same choices, so that a curve belongs to one model.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.model_order import selection
from vanedamp.coupling.model_order.body_choice import (
    WORTH,
    Advice,
    judge_all,
    needs_body,
    unjudged,
    with_blocks,
    with_sliders,
)
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.sectors import unrolled

#: points of a sweep whose bodies are judged, evenly spread
_POINTS = 5


class Choices(NamedTuple):
    """The choices: numbers of modes by model, and the advice on bodies, None where none was open."""

    modes: selection.Choices
    body: Advice | None = None


#: nothing was open
NOTHING = Choices({})


class Chosen(NamedTuple):
    """A scene without open choices, the estimate of its model and the advice on its bodies (None: were not open).

    start: the state with which it begins, instead of its own initial one (None).
    """

    scene: Scene
    estimate: dict[str, Any] | None
    advice: dict[str, Any] | None = None
    start: RestartState | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """Notes to read before the scene's results are used."""
        apart = (self.estimate or {}).get("states_apart", 0.0)
        states = (
            f"structure.modes: steady states differ by {100.0 * apart:.2g} % of the peak without bodies, more than the "
            "tolerance, and the start decides which is reached; run several starts",
        )  # fmt: skip
        return selection.warnings_of(self.scene) + (states if apart else ())


def leaves_open(scene: Scene) -> bool:
    """Whether a scene leaves something open."""
    return selection.needs_selection(scene) or needs_body(scene)


def choose(scene: Scene, more: bool = False) -> Chosen:
    """Return a scene with its open choices made. Raises InputError when there is no good choice.

    more: as of choices_of.
    """
    return with_choices(scene, choices_of([scene], more))


def choices_of(scenes: Iterable[Scene], more: bool = False) -> Choices:
    """Return the choices that suit all of these scenes. Raises InputError when there is no good one.

    more: whether many more periods follow: fewer are not worth a choice.
    """
    scenes = [unrolled(scene) for scene in scenes]
    modes = selection.choices_of(scenes, more)
    undecided = [scene for scene in scenes if needs_body(scene)]
    if not undecided:
        return Choices(modes)
    if not more and (periods := selection.periods_of(undecided)) <= WORTH:
        return Choices(modes, unjudged(undecided, periods))
    tried = np.unique(np.linspace(0, len(undecided) - 1, _POINTS).round().astype(int))
    return Choices(modes, judge_all([selection.with_choice(undecided[index], modes).scene for index in tried]))


def with_choices(scene: Scene, choices: Choices) -> Chosen:
    """Return the scene with the choices that were made for it, and ring repetitions written out."""
    scene = unrolled(scene)
    selected, body = selection.with_choice(scene, choices.modes), choices.body
    if body is None or not needs_body(scene):
        return Chosen(*selected)
    made = (with_sliders(selected.scene), None) if body.shape == "slider" else with_blocks(selected.scene)
    return Chosen(made[0], selected.estimate, body.to_json(), made[1])
