"""Runs that confirm a choice of modes: the model chosen compared with the whole one, with the bodies as they are.

The estimate weighs errors of forces; it does not predict which of several steady states is reached. So both models
run from the scene's own start, and each once more from the other's motion. Where their mean amplitudes differ by more
than the tolerance a larger model is tried. A difference is one of steady states that both models have if each keeps the
other's motion: then no number of modes decides between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.scene.solver_options import options_of
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.modal_basis import ModalBasis, basis_of
from vanedamp.coupling.system.transient import short_transient
from vanedamp.files.store import frozen
from vanedamp.rom.error_estimate import Choice, Rung

#: scenes that are run, evenly spread over their frequencies; models that are tried; periods of which means are taken
_SCENES, _MODELS, _WINDOW = 3, 4, 400
#: periods after which a run counts as settled at the latest
_LONGEST = 2000
#: safety factor on a difference of means, which scatter themselves
_SAFETY = 1.5


@dataclass(frozen=True)
class Confirmed(Choice):
    """A choice that runs have confirmed, or that rests on the estimate only.

    difference: largest difference of the mean amplitude from the whole model's, relative to the peak without bodies;
    None where nothing was run. several: whether both models have several steady states between which they differ.
    """

    difference: float | None = None
    several: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return plain data: `estimate` of the results."""
        return super().to_json() | {"difference": self.difference, "several_states": self.several}


def confirmed(choice: Choice, scenes: Sequence[Scene], peak: float) -> Confirmed:
    """Return the choice, or a larger model, whose runs differ from the whole model's by the tolerance at most.

    peak: largest amplitude without bodies, m. Where only steady states differ that both models have, the smallest such
    model is taken, and its sentence says so; where no model tried will do, it is the whole one.
    """
    whole, tolerance = choice.ladder[-1], choice.tolerance
    by_frequency = sorted(scenes, key=lambda scene: scene.frequency)
    places = np.unique(np.linspace(0, len(scenes) - 1, _SCENES).round().astype(int))
    pairs = [_Pair(by_frequency[place], whole, peak, tolerance) for place in places]
    larger = [rung for rung in choice.ladder if rung.size > choice.chosen.size and rung.error <= tolerance]
    tried = [choice.chosen, *(larger[2**k - 1] for k in range(_MODELS - 1) if 2**k - 1 < len(larger))]
    alike: Confirmed | None = None
    for rung in tried:
        if (rung.modes, rung.attached) == (whole.modes, whole.attached):
            break
        difference, several = max(pair.compare(rung) for pair in pairs)
        found = _with(choice, rung, difference, several)
        if _SAFETY * difference <= tolerance:
            return found
        alike = alike or (found if several else None)
    return alike or _with(choice, whole, 0.0, False)


def _with(choice: Choice, rung: Rung, difference: float, several: bool) -> Confirmed:
    """Return the choice of a model, with the sentence on its runs."""
    what = f"{rung.modes} mode{'s' * (rung.modes != 1)}"
    if rung.attached:
        what += f" and {rung.size - rung.modes} attachment mode{'s' * (rung.size - rung.modes != 1)}"
    sentence = choice.sentence
    if rung != choice.chosen:
        sentence = f"{what}, as the estimate's choice did not hold in runs: {sentence}"
    sentence += f"; in runs of both {100 * difference:.2g} % off the whole model's mean amplitude"
    if several:
        sentence += ", as both have several steady states and the start decides which is reached"
    values = {item.name: getattr(choice, item.name) for item in fields(Choice)} | {"chosen": rung, "sentence": sentence}
    return Confirmed(**values, difference=difference, several=several)


class _Pair:
    """A scene with the whole model, with which other models are compared. Differences are relative to a peak, m."""

    def __init__(self, scene: Scene, whole: Rung, peak: float, tolerance: float) -> None:
        self.peak, self.tolerance = peak, tolerance
        self.scene = replace(scene, solver=options_of({}), sweep={})
        settled = min(short_transient(self._with(whole)), _LONGEST)
        self.scene = replace(self.scene, time=Time(settled + _WINDOW, settled))
        self.whole = self._with(whole)
        self.reference = respond(self.whole)

    def _with(self, rung: Rung) -> Scene:
        structure = self.scene.structure
        assert isinstance(structure, Rom)
        return replace(self.scene, structure=replace(structure, modes=rung.modes, natural=True, attached=rung.attached))

    def compare(self, rung: Rung) -> tuple[float, bool]:
        """Return the difference of mean amplitudes, and whether one that is too large is of common steady states."""
        made = self._with(rung)
        own, whole = [respond(made)], [self.reference]
        if own[0].final is not None and whole[0].final is not None:
            small, large = basis_of(made), basis_of(self.whole)
            own.append(respond(made, start=_in_modes(whole[0].final, large, small)))
            whole.append(respond(self.whole, start=_in_modes(own[0].final, small, large)))
        means = [np.array([run.amplitude_mean for run in runs]) / self.peak for runs in (own, whole)]
        scatter = self._scatter(own[0], whole[0])
        difference = max(abs(means[0].mean() - means[1].mean()), abs(means[0][0] - means[1][0]) - scatter)
        kept = np.abs(means[0] - means[1][::-1]).max() <= self.tolerance + scatter
        return float(difference), bool(_SAFETY * difference > self.tolerance and kept and len(own) == 2)

    def _scatter(self, *runs: Response) -> float:
        """Return the confidence of a difference of means, over the peak."""
        return float(np.linalg.norm([run.amplitude_mean_confidence or 0.0 for run in runs])) / self.peak


def _in_modes(state: RestartState, before: ModalBasis, after: ModalBasis) -> RestartState:
    """Return a state in the modes of another model of the structure: its lowest modes, in their order."""
    one, other = (np.array(list(basis.rows.values())) for basis in (before, after))
    count = min(one.shape[1], other.shape[1])
    sign = np.where((one[:, :count] * other[:, :count]).sum(axis=0) < 0.0, -1.0, 1.0)
    moved = np.zeros((2, other.shape[1]))
    moved[:, :count] = sign * np.array([state.displacement, state.velocity])[:, :count]
    return replace(state, displacement=frozen(moved[0]), velocity=frozen(moved[1]), speed=frozen(()))
