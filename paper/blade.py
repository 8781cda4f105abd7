"""Study `campbell`: a slender blade on a hub, its modes over the speed, and its reduced model over the same range."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import simpson

from paper.scene_files import FOLDER
from vanedamp.modal.campbell import campbell
from vanedamp.modal.eigen import solve_modes
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.participation import effective_masses
from vanedamp.modal.records.campbell import Campbell

TITLE = "Campbell diagram of a blade on a hub"
#: engine orders of the diagram, and modes that are followed
ORDERS, COUNT = (1, 2, 3, 4, 5, 6), 5
#: speeds, from standstill to the greatest
_SPEEDS = 9
#: fixed-interface modes of the reduced model
_MODES = 10
#: share of the movable mass that a bending mode carries at least
_BENDING = 0.01


@dataclass(frozen=True, eq=False)
class Blade:
    """What is known of the blade at s speeds (rad/s, ascending, the first zero).

    names              of the modes by their motion at standstill: "bending 1", "edge bending 1", "torsion 1", ...
    flapwise, lagwise  the diagrams with the first bending along the axis of rotation and across it
    full, reduced      (s, m) Hz: the lowest flapwise modes of the finite elements and of the reduced model, ascending
    hub                hub radius over the blade's length
    """

    names: tuple[str, ...]
    flapwise: Campbell
    lagwise: Campbell
    full: np.ndarray
    reduced: np.ndarray
    hub: float

    @property
    def revolutions(self) -> np.ndarray:
        """Speeds (s,) as revolutions a second, Hz."""
        return self.flapwise.speeds[self.flapwise.asked] / (2 * np.pi)

    def frequencies(self, diagram: Campbell, name: str) -> np.ndarray:
        """Return the frequencies (s,) of a mode in a diagram, Hz."""
        return np.asarray(diagram.frequencies_hz[self.names.index(name)][diagram.asked])


def blade() -> Blade:
    """Compute both diagrams and the reduced model."""
    from vanedamp.studies.case.stages import assemble, reduction
    from vanedamp.studies.case.tables import Case

    case = Case.load(FOLDER / "blade.toml")
    assert case.rotation is not None
    structure = assemble(case)
    rotating = structure.rotating
    assert rotating is not None
    speeds = np.linspace(0.0, case.rotation.greatest, _SPEEDS)
    across = structure.solid.rotating(
        rotating.standing, (0.0, 1.0, 0.0), case.rotation.point, speed=case.rotation.greatest
    )
    flapwise, lagwise = (campbell(each, speeds, ORDERS, COUNT) for each in (rotating, across))
    model = reduction(structure, _MODES)
    return Blade(
        names=_names(rotating.standing),
        flapwise=flapwise,
        lagwise=lagwise,
        full=np.array([solve_modes(rotating.at(speed), COUNT).frequencies_hz for speed in speeds]),
        reduced=np.array([model.at_speed(speed).natural_frequencies_hz[:COUNT] for speed in speeds]),
        hub=-case.rotation.point[0] / case.mesh.length,  # type: ignore[union-attr]
    )


def save(found: Blade, folder: Path) -> list[str]:
    """Write the case and both diagrams, for `vanedamp campbell` and `vanedamp report`. Returns the results' names."""
    shutil.copyfile(FOLDER / "blade.toml", folder / "blade.toml")
    names = ["campbell_flapwise.h5", "campbell_lagwise.h5"]
    for name, diagram in zip(names, (found.flapwise, found.lagwise), strict=True):
        diagram.save(folder / name)
    return names


def _names(standing: SystemMatrices) -> tuple[str, ...]:
    """Return names of the modes at standstill, by the direction in which they carry mass."""
    modes = solve_modes(standing, COUNT)
    share = effective_masses(modes, standing) / standing.movable_mass
    kinds = ["torsion" if row.max() < _BENDING else ("", "edge bending", "bending")[int(row.argmax())] for row in share]
    return tuple(f"{kind} {kinds[: place + 1].count(kind)}" for place, kind in enumerate(kinds))


def southwell(revolutions: np.ndarray, frequencies: np.ndarray) -> tuple[float, float, float]:
    """Return f0, B and the largest relative error of f^2 = f0^2 + B n^2 (Southwell), fitted over speeds (s,)."""
    slope, square = np.polyfit(revolutions**2, frequencies**2, 1)
    fitted = np.sqrt(square + slope * revolutions**2)
    return float(np.sqrt(square)), float(slope), float(np.abs(fitted / frequencies - 1).max())


#: roots of cos(x) cosh(x) = -1: wave numbers of a clamped and free beam, times its length
_WAVES = (1.875104068711961, 4.694091132974175, 7.854757438237612)


def beam_southwell(bending: int, hub: float) -> float:
    """Return Southwell's coefficient of a uniform slender beam's flapwise bending (1, 2, 3), by Rayleigh's quotient.

    With the shape at standstill, hub: over the length. B = int T phi'^2 / int phi^2, T = hub (1 - x) + (1 - x^2)/2.
    """
    wave = _WAVES[bending - 1]
    x = np.linspace(0.0, 1.0, 4001)
    ratio = (np.cosh(wave) + np.cos(wave)) / (np.sinh(wave) + np.sin(wave))
    shape = np.cosh(wave * x) - np.cos(wave * x) - ratio * (np.sinh(wave * x) - np.sin(wave * x))
    slope = wave * (np.sinh(wave * x) + np.sin(wave * x) - ratio * (np.cosh(wave * x) - np.cos(wave * x)))
    tension = hub * (1 - x) + (1 - x**2) / 2
    return float(simpson(tension * slope**2, x=x) / simpson(shape**2, x=x))
