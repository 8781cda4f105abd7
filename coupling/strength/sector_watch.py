"""Response of the sectors of a ring over a run, period by period as it advances."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.response.evaluation import Outcome
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.sector_response import SectorResponse
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.spots import Functionals
from vanedamp.coupling.strength.stress import tops
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.modal_basis import basis_of, interface_row
from vanedamp.coupling.system.reduced_model_file import ring_in_file
from vanedamp.coupling.system.resonance import chosen_resonance, excitation_force
from vanedamp.coupling.system.system import System
from vanedamp.files.toml_input import InputError


def sectors_of(scene: Scene) -> Functionals | None:
    """Return the displacement of `excitation.at` in every sector of a ring, (1, N, n); None for other structures."""
    ring = ring_in_file(scene.structure)
    if ring is None:
        return None
    name, basis = str(scene.excitation.at).partition("@")[0], basis_of(scene)
    rows = [interface_row(basis, f"{name}@{sector}", "excitation.at") for sector in range(ring.sectors)]
    return Functionals(np.array(rows)[None], basis.stiffness)


class SectorTaker:
    """Takes the displacement of every sector (coordinate_watch.Taker)."""

    def __init__(self, sectors: Functionals) -> None:
        self.functionals = sectors
        self._parts: list[tuple[int, np.ndarray]] = []  # (3, N, p) m: largest, smallest and mean of each period

    def take(self, begin: int, coordinates: np.ndarray, each: int) -> None:
        """Take periods from number `begin` on: coordinates (p each + 2, n), with a sample more at both ends."""
        x = self.functionals.rows[0] @ coordinates.T
        mean = x[:, 1:-1].reshape(len(x), -1, each).mean(axis=-1)
        self._parts.append((begin, np.stack([tops(x, each), -tops(-x, each), mean])))

    def result(self, scene: Scene, response: Response, outcome: Outcome) -> SectorResponse | None:
        """Return the response of the sectors over the periods evaluated; None if there is none."""
        first = response.transient
        kept = [part[:, :, max(first - begin, 0) :] for begin, part in self._parts]
        if not any(part.shape[-1] for part in kept):
            return None
        high, low, mean = np.concatenate(kept, axis=-1)
        static = mean.mean(axis=-1, keepdims=True) if response.static_deflection else 0.0
        peak = np.maximum(high - static, static - low)
        undamped, fixed = self._linear(scene)
        found, shown = peak.mean(axis=-1), str(scene.excitation.at).partition("@")[2]
        exact = response.amplitude_mean_dynamic if response.static_deflection else response.amplitude_mean
        sampled = float(found[int(shown or 0) % len(found)])
        error = abs(sampled - exact) / exact if exact > 0.0 else 0.0
        return SectorResponse(
            found, peak.max(axis=-1), undamped, fixed, self._impacts(scene, outcome, first), error, _tuned(scene)
        )

    def _linear(self, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
        """Return the amplitudes (N,) without bodies, and with every body fixed, m."""
        rows = self.functionals.rows[0]
        if scene.excitation.signal is not None:
            return np.full(len(rows), np.nan), np.full(len(rows), np.nan)
        free, fixed = (response.amplitudes(scene.frequency, rows) for response in linear_responses(scene))
        return free, fixed

    def _impacts(self, scene: Scene, outcome: Outcome, first: int) -> np.ndarray:
        """Return the impacts per period (N,) of the bodies in each sector; nan if they are not counted."""
        hits = outcome.records.hits
        found = np.zeros(len(self.functionals.rows[0]))
        if not hits.shape[1]:
            return found * np.nan
        owner = sectors_of_bodies(scene, outcome.system)
        counts = hits[first : outcome.periods].sum(axis=0) / max(outcome.periods - first, 1)
        for row, (body, _, _) in enumerate(outcome.rows.places):
            if not outcome.rows.without_body[row] and owner[body] >= 0:
                found[owner[body]] += counts[row]
        return found


def sectors_of_bodies(scene: Scene, system: System) -> list[int]:
    """Return the sector of each body, from the label of its floor; -1 where that names none."""
    floors = [str(scene.cavity[cavity].labels()[2]).partition("@")[2].partition(".")[0] for cavity in system.cavity]
    return [int(number) if number.isdecimal() else -1 for number in floors]


def _tuned(scene: Scene) -> float | None:
    """Return the amplitude of the tuned ring without bodies at its resonance, m; None without a force or damping."""
    if scene.excitation.base_acceleration is not None or scene.excitation.signal is not None:
        return None
    try:
        return excitation_force(scene) * chosen_resonance(scene).flexibility or None
    except InputError:
        return None
