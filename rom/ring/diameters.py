"""Waves of a ring by nodal diameter: natural modes, and static responses to the forces of interface and deviations.

In the subset of nominal modes (Yang and Griffin 2001, J. Eng. Gas Turbines Power 123(4)), deviations couple the tuned
ring's own modes. What they lack to first order are the static responses to the forces of deviations, K_p z of all
modes z at one sector, which all nodal diameters share: with these, frequencies hold to the third order of the
deviations. Static responses to the interface's forces make its flexibility exact, as in Rubin's basis (bases.free_
interface). One factorisation per diameter serves all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, sparse

from vanedamp.modal.algebra import added_by_speed
from vanedamp.modal.cyclic import CyclicSector, Diameter
from vanedamp.modal.cyclic_modes import ring_modes
from vanedamp.modal.records.ring_modes import RingModes
from vanedamp.rom.bases.projection import Factorize
from vanedamp.rom.ring.deviations import RingError

# relative change of a squared frequency, per squared deviation, that static responses to deviations may leave out
_LEFT_OUT = 1e-5
# fraction of the strain energy of a static response to the interface: below it, the response depends on others
_DEPENDENT = 1e-9
# points of the receptance, and where they end: over the first family, if the last one reaches so far
_POINTS, _REACH = 17, 1.5


@dataclass(frozen=True, eq=False)
class DeviatingPart:
    """Deviating part of a sector: stiffness and mass (n, n), sparse, such as of the blade."""

    stiffness: sparse.csr_array
    mass: sparse.csr_array


@dataclass(frozen=True, eq=False)
class DiameterWaves:
    """Fields (b, n), complex, of a diameter, of modal mass 1, the natural modes first; squares (b,)."""

    problem: Diameter
    fields: np.ndarray
    squares: np.ndarray
    modes: int
    factor: float

    @property
    def real_fields(self) -> np.ndarray:
        """The real fields (n, N) on sector 0: real and imaginary part of each that travels."""
        if not self.problem.travels:
            return np.asarray(self.fields.real)
        return np.stack([self.fields.real, self.fields.imag], axis=1).reshape(-1, self.fields.shape[1])


class Bases(NamedTuple):
    """The waves of all nodal diameters of a ring, and the estimate of the errors that they leave."""

    waves: list[DiameterWaves]
    estimate: dict[str, Any]


def ring_waves(
    sector: CyclicSector, vectors: np.ndarray, families: int, max_frequency: float | None, part: DeviatingPart,
    by_speed: Sequence[sparse.csr_array], greatest_speed: float, factorize: Factorize,
    report: Callable[[int, int], None] | None,
) -> Bases:  # fmt: skip
    """Return natural modes and static responses of every nodal diameter; vectors (k, n) of the interface.

    Other arguments and errors: see rom.ring.reduction.reduce_ring.
    """
    sectors = [sector]
    if by_speed:
        stiffness = sector.matrices.stiffness + added_by_speed(greatest_speed, greatest_speed, by_speed)
        sectors.append(replace(sector, matrices=replace(sector.matrices, stiffness=stiffness)))
    modes_at = [ring_modes(sector_at, families, max_frequency) for sector_at in sectors]
    if modes_at[0].frequencies_hz.min() == 0.0:
        raise RingError("support: the ring can move freely; hold it, since its static responses are part of the model")
    forces = np.vstack([_forces(modes, part) for modes in modes_at])
    waves, errors, total, top = [], [], len(sector.diameters), _top(modes_at[0])
    for done, number in enumerate(sector.diameters):
        if report is not None:
            report(done, total)
        wave, error = _of_diameter(sectors, modes_at, number, vectors, forces, factorize, top)
        waves.append(wave)
        errors.append(error)
    receptance, remainder = (max(values) for values in zip(*errors, strict=True))
    count = sum(wave.modes * (1 + wave.problem.travels) for wave in waves)
    return Bases(waves, {
        "receptance": receptance, "deviation": remainder, "frequencies_hz": [0.0, top / (2.0 * np.pi)],
        "sentence": f"{count} natural modes of the ring: estimated error {100 * receptance:.2g} % of the "
        "interface's receptance",
    })  # fmt: skip


def _forces(modes: RingModes, part: DeviatingPart) -> np.ndarray:
    """Return real forces (f, n) that span the forces of deviations in a sector, on modes of unit strain energy.

    The strain energy of the static response to K_p z is at most z K_p z, to M_p z at most z M_p z over the lowest
    squared frequency: forces with less energy are left out.
    """
    omegas, fields = 2.0 * np.pi * modes.frequencies_hz, np.vstack([modes.shapes.real, modes.shapes.imag])
    lowest, spans = omegas.min(), []
    for matrix, scales, factor in ((part.stiffness, 1.0 / omegas, 1.0), (part.mass, omegas / lowest, lowest)):
        scaled = np.tile(scales, 2)[:, None] * fields
        loads = np.asarray((matrix @ scaled.T).T)
        energies, vectors = linalg.eigh(loads @ scaled.T)
        spans.append(factor * vectors[:, modes.sectors * energies > _LEFT_OUT].T @ loads)
    return np.vstack(spans)


def _of_diameter(
    sectors: Sequence[CyclicSector], modes_at: Sequence[RingModes], number: int, vectors: np.ndarray,
    forces: np.ndarray, factorize: Factorize, top: float,
) -> tuple[DiameterWaves, tuple[float, float]]:  # fmt: skip
    """Return the waves of a diameter, and the errors of the receptance and of deviations that they leave.

    sectors, modes_at: at standstill, and at the greatest speed, and their modes; vectors (k, n) of the interface.
    """
    statics = [DiameterStatics(sector, number, factorize) for sector in sectors]
    first = statics[0]
    lead = first.of_diameter(_shapes(modes_at[0], number))
    lead_squares = _squares(modes_at[0], number)
    wanted = [first.response(vectors)]
    for static, modes in zip(statics[1:], modes_at[1:], strict=True):
        wanted += [static.response(vectors), static.of_diameter(_shapes(modes, number))]
    attachments, _ = first.independent(np.vstack(wanted), lead, _DEPENDENT, unit=True)
    responses, remainder = first.independent(
        np.vstack([static.response(forces) for static in statics]), np.vstack([lead, attachments]), _LEFT_OUT
    )
    squares, fields = first.ritz(np.vstack([attachments, responses]))
    waves = DiameterWaves(
        first.problem, np.vstack([lead, fields]), np.r_[lead_squares, squares], len(lead), first.factor
    )
    return waves, (first.receptance_error(waves, vectors, top), remainder)


def _top(modes: RingModes) -> float:
    """Return the angular frequency up to which errors count: over the first family, and not over the last one."""
    lasts = [modes.frequencies_hz[modes.diameters == number].max() for number in np.unique(modes.diameters)]
    return float(2.0 * np.pi * min(*lasts, _REACH * modes.frequencies_hz[modes.families == 0].max()))


def _shapes(modes: RingModes, number: int) -> np.ndarray:
    return modes.shapes[modes.diameters == number]


def _squares(modes: RingModes, number: int) -> np.ndarray:
    return np.asarray((2.0 * np.pi * modes.frequencies_hz[modes.diameters == number]) ** 2)


class DiameterStatics:
    """Static responses in a nodal diameter, and products of complex fields (p, n) over the ring."""

    def __init__(self, sector: CyclicSector, number: int, factorize: Factorize) -> None:
        self.problem = sector.at(number)
        matrices = self.problem.matrices
        self._free = matrices.free
        self._factors = factorize(matrices.of_free(matrices.stiffness))
        self._stiffness = sector.stiffness(number)
        self._mass = sector.matrices.mass
        self.factor = sector.sectors * (0.5 if self.problem.travels else 1.0)

    def response(self, loads: np.ndarray) -> np.ndarray:
        """Return the fields (p, n) under loads (p, n), real or complex, on a sector."""
        rows = np.zeros((len(loads), self.problem.matrices.size))
        rows[:, self._free] = self._factors.solve(self.problem.forces(loads.T)[self._free]).T
        return self.of_diameter(self.problem.fields(rows))

    def of_diameter(self, values: np.ndarray) -> np.ndarray:
        """Return fields, or products of them, as the diameter has them: real where it does not travel."""
        return values if self.problem.travels else np.asarray(values.real)

    def energies(self, fields: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return fields^H K others over the ring."""
        return self.of_diameter(self.factor * fields.conj() @ (self._stiffness @ others.T))

    def masses(self, fields: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return fields^H M others over the ring."""
        return self.of_diameter(self.factor * fields.conj() @ (self._mass @ others.T))

    def residual_energies(self, waves: np.ndarray, squares: np.ndarray, forces: np.ndarray) -> np.ndarray:
        """Return r^H K^-1 r over the ring (p,), of r = K z - q M z + f of waves z (p, n), squares q and forces f.

        The waves are sums over sectors, so that the forces may act on one of them.
        """
        residual = (self._stiffness @ waves.T - squares * (self._mass @ waves.T)).T + forces
        displacements = self.response(self.of_diameter(residual))
        return np.asarray(np.einsum("pn,pn->p", residual.conj(), displacements).real / self.factor)

    def independent(
        self, fields: np.ndarray, basis: np.ndarray, least: float, unit: bool = False
    ) -> tuple[np.ndarray, float]:
        """Return combinations (q, n) without the known ones, of more strain energy than the least, of unit energy.

        unit: the fields are scaled to unit energy first. Also returns the most energy that is left out.
        """
        if not len(fields):
            return fields, 0.0
        if unit:
            fields = fields / np.sqrt(np.einsum("ii->i", self.energies(fields, fields)).real)[:, None]
        inner = self.energies(basis, basis)
        for _ in range(2):
            fields = fields - np.linalg.solve(inner, self.energies(basis, fields)).T @ basis
        energies, vectors = linalg.eigh(self.energies(fields, fields))
        independent = energies > least
        remainder = max(float(energies[~independent].max(initial=0.0)), 0.0)
        return (vectors[:, independent] / np.sqrt(energies[independent])).T @ fields, remainder

    def ritz(self, fields: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return squared frequencies (q,) and fields (q, n) of modal mass 1 in the span of fields."""
        if not len(fields):
            return np.empty(0), fields
        inverse, vectors = linalg.eigh(self.masses(fields, fields), self.energies(fields, fields))
        return 1.0 / inverse, (vectors / np.sqrt(inverse)).T @ fields

    def receptance_error(self, waves: DiameterWaves, vectors: np.ndarray, top: float) -> float:
        """Return the largest error of the interface's receptance by modes and static response, relative.

        Against a basis with the next block of quasi-static responses, up to an angular frequency.
        """
        attached = waves.fields[waves.modes :]
        further, _ = self.independent(self.response((self._mass @ attached.T).T), waves.fields, _DEPENDENT, unit=True)
        squares, fields = self.ritz(np.vstack([attached, further]))
        modes, residuals = (vectors @ block.T for block in (waves.fields[: waves.modes], fields))
        lowest = waves.squares[: waves.modes]
        static = (residuals / squares) @ residuals.conj().T
        ratio = self.problem.matrices.damping_ratio
        worst = 0.0
        for omega in np.linspace(0.0, top, _POINTS):
            modal = (modes / (lowest - omega**2 + 2j * ratio * omega * np.sqrt(lowest))) @ modes.conj().T
            dynamic = (residuals / (squares - omega**2 + 2j * ratio * omega * np.sqrt(squares))) @ residuals.conj().T
            worst = max(worst, float(np.linalg.norm(static - dynamic) / np.linalg.norm(modal + dynamic)))
        return worst
