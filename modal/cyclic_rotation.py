"""Waves of a ring that rotates, with the gyroscopic coupling.

In the rotating frame a wave Re(z exp(i (omega t + h j alpha))), omega > 0, of a nodal diameter 0 < h < N / 2 runs
against the turn about the axis, and one with -h runs with it. Both solve the Hermitian problem of the diameter,

    (K_h + i omega W G_h - omega^2 M_h) z = 0,

the second with omega < 0. Its real form has every |omega| once, which proves that no wave is missed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from vanedamp.modal.cyclic import CyclicSector, Diameter
from vanedamp.modal.cyclic_modes import Family, gathered, independent, scaled
from vanedamp.modal.gyroscopic import dense_modes, gyroscopic_modes
from vanedamp.modal.records.ring_modes import RingModes
from vanedamp.modal.rotating import RotatingMatrices


def rotating_diameter(sector: CyclicSector, rotating: RotatingMatrices, diameter: int) -> RotatingMatrices:
    """Return the real form of a diameter of a ring that rotates, without its load; sector: for the ring's geometry."""
    problem = replace(sector, matrices=rotating.standing).at(diameter)
    return RotatingMatrices(
        standing=problem.matrices,
        centrifugal_stiffness=problem.real_form(rotating.centrifugal_stiffness),
        gyroscopic=problem.real_form(rotating.gyroscopic),
        load=np.zeros(problem.matrices.size),
        axis=rotating.axis,
        point=rotating.point,
        greatest=rotating.greatest,
        higher=tuple(map(problem.real_form, rotating.higher)),
        neglected=None if rotating.neglected is None else problem.real_form(rotating.neglected),
    )


def gyroscopic_ring_modes(
    sector: CyclicSector,
    rotating: RotatingMatrices,
    speed: float,
    count: int = 10,
    diameters: Iterable[int] | None = None,
    report: Callable[[int, int], None] | None = None,
) -> RingModes:
    """Return the lowest `count` modes of every nodal diameter, and of both of its waves, at a speed (rad/s).

    sector    for the ring's geometry; diameters and report: as in `ring_modes`

    Raises the errors of `ring_modes` and modal.gyroscopic.gyroscopic_modes.
    """
    stiffness = rotating.standing.stiffness + rotating.added(speed)
    here = replace(sector, matrices=replace(rotating.standing, stiffness=stiffness))
    wanted = list(sector.diameters if diameters is None else diameters)
    families: list[Family] = []
    for done, number in enumerate(wanted):
        if report is not None:
            report(done, len(wanted))
        problem, turning = here.at(number), rotating_diameter(sector, rotating, number)
        if problem.travels:
            families += _waves(here, problem, turning, rotating, speed, count)
            continue
        modes = gyroscopic_modes(turning, speed, min(count, problem.matrices.free.size))
        shapes = scaled(here, problem.fields(modes.shapes), False)
        families.append(Family(number, modes.frequencies_hz, modes.residuals, shapes))
    return gathered(here, families, dict(here.matrices.provenance) | {"speed": speed})


def _waves(
    sector: CyclicSector, problem: Diameter, turning: RotatingMatrices, rotating: RotatingMatrices, speed: float,
    count: int,
) -> list[Family]:  # fmt: skip
    """Return the modes of both waves of a diameter."""
    most = problem.matrices.free.size
    count = min(count, most // 2)
    asked = 2 * count
    while True:
        modes = gyroscopic_modes(turning, speed, asked)
        # q exp(i omega t) of the real form holds a wave with +omega and one with -omega, of which one is zero
        fields = np.vstack([problem.fields(modes.shapes), problem.fields(modes.shapes.conj())])
        basis = independent(fields, sector.matrices.mass)
        stiffness, coupling = (
            basis.conj() @ (matrix @ basis.T)
            for matrix in (sector.stiffness(problem.number), speed * rotating.gyroscopic)
        )
        waves = [(problem.number, basis, *dense_modes(stiffness, coupling)),
                 (-problem.number, basis.conj(), *dense_modes(stiffness.conj(), coupling.conj()))]  # fmt: skip
        # the lowest of both in size are the modes of the real form; the basis has no others
        last = modes.frequencies_hz[-1] * 2.0 * np.pi * (1.0 + 1e-9)
        fewest = min(int(np.count_nonzero(omega <= last)) for _, _, omega, _ in waves)
        if fewest >= count or asked == most:
            break
        asked = min(asked + 2 * (count - fewest), most)
    return [
        Family(
            number,
            omega[:count] / (2.0 * np.pi),
            np.full(count, modes.residuals.max()),
            scaled(sector, vectors[:, :count].T @ fields, True),
        )
        for number, fields, omega, vectors in waves
    ]
