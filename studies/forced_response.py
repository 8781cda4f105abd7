"""Forced responses: what a sweep says along one axis, beside the linear curves of the structure."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from coupling.scene import Prescribed, Rigid, Rom, Scene
from coupling.sweep import Sweep
from modal.store import frozen

FREQUENCY = "excitation.frequency"
_LEVEL = "excitation.resonance_amplitude"
#: a damped response within this share of the undamped one has not been touched by the bodies
UNTOUCHED = 0.01


@dataclass(frozen=True, eq=False)
class ForcedResponse:
    """Curves along an axis of a sweep, each of shape (n,); displacements in m.

    reference          the largest undamped amplitude: what amplitudes are divided by in charts
    damped_max, _mean  absolute maximum of the evaluated periods and mean of the periods' peaks
    energy_share       (n, 4) of viscous, friction, impact and contact loss
    trouble            number of points whose status is not ok
    source             the file it comes from
    """

    name: str
    axis: str
    units: str
    x: np.ndarray
    reference: float
    undamped: np.ndarray
    fixed: np.ndarray
    damped_max: np.ndarray
    damped_mean: np.ndarray
    attached_mass_fraction: np.ndarray
    impacts_per_period: np.ndarray
    energy_share: np.ndarray
    trouble: int
    source: str = ""

    def peak(self, curve: str) -> tuple[Any, float]:
        """Position on the axis and height, relative to the reference, of the top of a curve; nan if all failed."""
        values = getattr(self, curve)
        top = int(np.argmax(np.where(np.isnan(values), -np.inf, values)))
        return self.x[top], float(values[top] / self.reference)

    @property
    def onset(self) -> Any:
        """The first point at which the bodies change the mean response by more than 1 %; None if they never do."""
        touched = np.flatnonzero(np.abs(self.damped_mean - self.undamped) > UNTOUCHED * self.undamped)
        return self.x[touched[0]] if touched.size else None


def model_name(scene: Scene) -> str:
    """The rung of the model ladder, in words."""
    structure = scene.structure
    if isinstance(structure, Rom):
        return "reduced model" if structure.modes is None else f"reduced model, {structure.modes} modes"
    return {Rigid: "rigid model", Prescribed: "prescribed motion"}[type(structure)]


def forced_responses(sweep: Sweep, name: str | None = None) -> list[ForcedResponse]:
    """One forced response for every combination of the other axes.

    They run along the excitation frequency if the sweep has it, or else along its longest axis of numbers.
    """
    paths = list(sweep.axes)
    lengths = [len(values) * (values.dtype.kind in "if") for values in sweep.axes.values()]
    along = paths.index(FREQUENCY) if FREQUENCY in paths else int(np.argmax(lengths))
    order = np.argsort(sweep.axes[paths[along]], kind="stable")
    others = [sweep.axes[path] for index, path in enumerate(paths) if index != along]
    labels = [path for index, path in enumerate(paths) if index != along]
    responses = []
    for combination in itertools.product(*(range(len(values)) for values in others)):
        point: tuple[Any, ...] = (*combination[:along], order, *combination[along:])
        units = sweep.units()
        values = [
            f"{path.split('.', 1)[-1]} = {quantity(axis[index], units[path])}"
            for path, axis, index in zip(labels, others, combination, strict=True)
        ]
        responses.append(_response(sweep, point, paths[along], ", ".join([name or model_name(sweep.scene), *values])))
    return responses


def _response(sweep: Sweep, point: tuple[Any, ...], axis: str, name: str) -> ForcedResponse:
    curves = {
        "undamped": sweep.amplitude_undamped, "fixed": sweep.amplitude_fixed, "damped_max": sweep.amplitude_max,
        "damped_mean": sweep.amplitude_mean, "attached_mass_fraction": sweep.attached_mass_fraction,
        "impacts_per_period": sweep.impacts_per_period, "energy_share": sweep.energy_share,
    }  # fmt: skip
    cut = {key: frozen(values[point]) for key, values in curves.items()}
    return ForcedResponse(
        name=name,
        axis=axis,
        units=sweep.units()[axis],
        x=sweep.axes[axis][point[list(sweep.axes).index(axis)]],
        reference=reference_amplitude(sweep, point),
        trouble=int(np.count_nonzero(sweep.status[point] != "ok")),
        source="",
        **cut,
    )


def reference_amplitude(sweep: Sweep, point: tuple[Any, ...] = ()) -> float:
    """The undamped maximum that amplitudes of a sweep or a part of it are related to, m; nan without excitation."""
    resonance = sweep.scene.excitation.resonance_amplitude
    if resonance is None or _LEVEL in sweep.axes:
        resonance = float(np.nan_to_num(sweep.amplitude_undamped[point]).max())
    return resonance or math.nan


def shown(value: Any) -> str:
    """A value of an axis in a few digits; text as it is."""
    return str(value) if isinstance(value, str) else f"{value:.6g}"


def for_people(units: str) -> tuple[float, str]:
    """Factor and unit in which values of a unit are shown."""
    return (1e6, "µm") if units == "m" else (1.0, units)


def quantity(value: Any, units: str) -> str:
    """A value with its unit, lengths in micrometres."""
    factor, larger = for_people(units)
    if factor != 1.0 and not isinstance(value, str):
        return f"{value * factor:.4g} {larger}"
    return f"{shown(value)} {units}".removesuffix(" 1")


def resonance_grid(start: float, stop: float, peaks: list[float], width: float, num: int) -> np.ndarray:
    """(num,) ascending frequencies from start to stop, half of them evenly and half around the peaks.

    peaks: frequencies, each of which is a point of the grid; width: of a peak, as a share of its frequency.
    """
    fine = np.linspace(start, stop, 4001)
    bells = sum(1 / (1 + ((fine - peak) / (width * peak)) ** 2) for peak in peaks)
    share = np.cumsum(1 / len(fine) + bells / np.sum(bells))
    grid = np.interp(np.linspace(share[0], share[-1], num), share, fine)
    for peak in peaks:
        grid[np.argmin(np.abs(grid - peak))] = peak
    return grid
