"""Runs that confirm a choice of modes: the model chosen compared with the whole one, start by start.

The estimate weighs errors of forces; it does not predict which of several steady states a start reaches. So both models
run until they are steady from the same two starts, the scene's own and one whose bodies fly, and a smaller model is
taken if its mean amplitude is the whole one's from each, within the tolerance. The whole model is taken where
its own steady states differ by more, since other starts may then reach another one on a smaller model, where a run
does not become steady, and where so few periods are to be run that no choice pays.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.response.response import Response, Status
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.scene.solver_options import options_of
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.resonance import chosen_resonance, excitation_force
from vanedamp.coupling.system.transient import timed
from vanedamp.rom.error_estimate import Choice, Rung

#: periods up to which the whole model runs before a choice of one takes its time: a choice takes as long as some 10,000
#: periods of the whole model, for 10 to 100 coordinates (docs/reduction.md)
WORTH = 20_000
#: scenes that are tried, fewest and most, evenly spread over their frequencies, and periods to be run for each
_SCENES, _EACH = (3, 9), 10_000
#: models that are tried
_MODELS = 4
#: safety factor on a difference of means, fraction of the tolerance to which they are known, and the longest run for it
_SAFETY, _KNOWN, _LONGEST = 1.5, 0.3, 16_000


@dataclass(frozen=True)
class Confirmed(Choice):
    """A choice that runs have confirmed, or the whole model.

    difference: largest difference of the mean amplitude from the whole model's from the same start, relative to the
    peak without bodies; None where no smaller model was run. apart: the difference of the whole model's own means from
    two starts of a scene, where it exceeds the tolerance; 0 otherwise.
    """

    difference: float | None = None
    apart: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return plain data: `estimate` of the results."""
        states = {"several_states": self.apart > 0.0, "states_apart": self.apart}
        return super().to_json() | {"difference": self.difference} | states


def with_modes(scene: Scene, modes: int | None, attached: bool = False) -> Scene:
    """Return the scene with a number of natural modes of its structure; None: with the coordinates of its file."""
    structure = scene.structure
    assert isinstance(structure, Rom)
    return replace(scene, structure=replace(structure, modes=modes, natural=modes is not None, attached=attached))


def peak(scene: Scene) -> float:
    """Return the amplitude of the resonance without bodies, m."""
    whole = with_modes(scene, None)
    return excitation_force(whole) * chosen_resonance(whole).flexibility


def unconfirmed(choice: Choice, periods: float) -> Confirmed:
    """Return the whole model for so few periods that no choice pays. choice: has it only."""
    why = f"the whole model, as {periods:.0f} periods are run and a choice takes as long as {WORTH // 2} or more of it"
    return replace(_with(choice, choice.chosen, ""), sentence=f"{_named(choice.chosen)}, {why}")


def confirmed(choice: Choice, scenes: Sequence[Scene], periods: float) -> Confirmed:
    """Return the choice, or a larger model, whose mean amplitudes are the whole one's from the same starts.

    periods: that are to be run.
    """
    whole, tolerance = choice.ladder[-1], choice.tolerance
    if choice.chosen == whole:
        return _with(choice, whole, "")
    by_frequency = sorted(scenes, key=lambda scene: scene.frequency)
    count = min(len(scenes), int(np.clip(periods // _EACH, *_SCENES)))
    pairs = []
    for index in np.unique(np.linspace(0, len(scenes) - 1, count).round().astype(int)):
        pairs.append(_Pair(by_frequency[index], whole, tolerance, min(_LONGEST, periods / (2 * count))))
        apart = pairs[-1].apart
        if np.isnan(apart):
            return _with(choice, whole, "the whole model, as its runs are not steady enough to compare a smaller one")
        if apart:
            why = "the whole model, as it has several steady states and a smaller one may reach another"
            return _with(choice, whole, why, apart=apart)
    larger = [rung for rung in choice.ladder if rung.size > choice.chosen.size and rung.error <= tolerance]
    failed = "as the estimate's choice did not hold in runs"
    for rung in [choice.chosen, *(larger[2**k - 1] for k in range(_MODELS - 1) if 2**k - 1 < len(larger))]:
        difference = max(pair.difference(rung) for pair in pairs)
        if rung != whole and _SAFETY * difference <= tolerance:
            return _with(choice, rung, "" if rung == choice.chosen else failed, difference)
    return _with(choice, whole, f"the whole model, {failed}")


def _named(rung: Rung) -> str:
    """Return a model in words."""
    words = f"{rung.modes} mode{'s' * (rung.modes != 1)}"
    extra = rung.size - rung.modes
    return f"{words} and {extra} attachment mode{'s' * (extra != 1)}" if rung.attached else words


def _with(choice: Choice, rung: Rung, why: str, difference: float | None = None, apart: float = 0.0) -> Confirmed:
    """Return the choice of a model, with the sentence on its runs."""
    sentence = f"{_named(rung)}, {why}: {choice.sentence}" if why else choice.sentence
    if difference is not None:
        sentence += f"; in runs from equal starts {100 * difference:.2g} % off the whole model's mean amplitude"
    values = {item.name: getattr(choice, item.name) for item in fields(Choice)} | {"chosen": rung, "sentence": sentence}
    return Confirmed(**values, difference=difference, apart=apart)


class _Pair:
    """A scene from two starts on the whole model, with which others are compared. Relative to the peak without bodies.

    apart: difference of the means, where it exceeds the tolerance, else 0; nan where one is not known.
    """

    def __init__(self, scene: Scene, whole: Rung, tolerance: float, longest: float) -> None:
        self._peak, self._known, self._longest = peak(scene) or math.inf, _KNOWN * tolerance, longest
        scene = replace(scene, solver=options_of({}), sweep={}, time=Time())
        # they cross their cavities in a sixth of a period
        speeds = [2.0 * math.pi * scene.frequency * scene.cavity[scene.cavity_of(body)].gap for body in scene.damper]
        flying = [
            replace(body, velocity=body.velocity + speed) for body, speed in zip(scene.damper, speeds, strict=True)
        ]
        self._starts = (scene, *([replace(scene, damper=tuple(flying))] if flying else []))
        self._whole, widths = self._means(whole)
        apart = float(abs(self._whole[-1] - self._whole[0]))
        self.apart = 0.0 if apart <= tolerance + np.linalg.norm(widths) else apart

    def difference(self, rung: Rung) -> float:
        """Return the largest difference of a model's means from the whole one's; inf where one is not known."""
        difference = np.abs(self._means(rung)[0] - self._whole).max()
        return float(np.inf if np.isnan(difference) else difference)

    def _means(self, rung: Rung) -> np.ndarray:
        """Return means and confidences (2, starts) of a model."""
        return np.array([self._mean(with_modes(start, rung.modes, rung.attached)) for start in self._starts]).T

    def _mean(self, scene: Scene) -> tuple[float, float]:
        """Return mean amplitude and confidence of a scene, from a run that is continued until it is steady and the
        mean is known; else nan."""
        time = timed(scene).time
        length, done = time.simulated, time.simulated
        run = respond(replace(scene, time=Time(length, time.dropped)))
        while not self._knows(run) and run.final is not None and done + 2 * length <= self._longest:
            length *= 2
            done += length
            run = respond(replace(scene, time=Time(length, length // 4)), start=run.final)
        known = run.amplitude_mean, run.amplitude_mean_confidence or 0.0
        return (known[0] / self._peak, known[1] / self._peak) if self._knows(run) else (math.nan, math.nan)

    def _knows(self, run: Response) -> bool:
        confidence = run.amplitude_mean_confidence
        return run.status is Status.OK and confidence is not None and confidence <= self._known * self._peak
