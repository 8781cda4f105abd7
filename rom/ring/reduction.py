"""Reduction of a cyclic sector to a RingModel: natural modes of every nodal diameter, and static responses.

In the subset of nominal modes (Yang and Griffin 2001, J. Eng. Gas Turbines Power 123(4)), deviations couple the tuned
ring's own modes. What they lack to first order are the static responses to the forces of deviations, K_p z of all
modes z at one sector, which all nodal diameters share: with these, frequencies hold to the third order of the
deviations. Static responses to the interface's forces make its flexibility exact, as in Rubin's basis (bases.free_
interface). One factorisation per diameter serves all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from scipy import linalg, sparse

from vanedamp.modal.cyclic import CyclicSector, Diameter
from vanedamp.modal.cyclic_modes import RingModes, ring_modes
from vanedamp.rom.bases.projection import Factorize, superlu
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.ring.deviations import RingError
from vanedamp.rom.ring.ring_model import RingModel

# relative change of a squared frequency, per squared deviation, that static responses to deviations may leave out
_LEFT_OUT = 1e-5
# of the strain energy of a static response to the interface: below it the others determine it
_DEPENDENT = 1e-9
# points of the receptance, and where they end: over the first family, if the last one reaches so far
_POINTS, _REACH = 17, 1.5


@dataclass(frozen=True, eq=False)
class Part:
    """What of a sector deviates: stiffness and mass (n, n), sparse, such as those of the blade."""

    stiffness: sparse.csr_array
    mass: sparse.csr_array


@dataclass(frozen=True, eq=False)
class _Waves:
    """Fields (b, n), complex, of a diameter, of modal mass 1, the natural modes first; squares (b,)."""

    problem: Diameter
    fields: np.ndarray
    squares: np.ndarray
    modes: int
    factor: float


def reduce_ring(
    sector: CyclicSector,
    interface: Interface | Sequence[InterfaceCoordinate],
    families: int = 3,
    max_frequency: float | None = None,
    part: Part | None = None,
    centrifugal: sparse.csr_array | None = None,
    greatest_speed: float = 0.0,
    factorize: Factorize = superlu,
    report: Callable[[int, int], None] | None = None,
) -> RingModel:
    """Reduce a ring to its modes of every nodal diameter and the interface of every sector.

    sector         at standstill
    interface      of one sector, of kinds "average" and "node"
    families       modes of every diameter; or all up to max_frequency, Hz
    part           what deviates (default: the whole sector)
    centrifugal    (n, n) kg, what a squared speed adds to the sector's stiffness, with the greatest_speed, rad/s
    report         called with the number of diameters done, and of all

    The estimate of the error is `estimate` of the provenance: of the interface's receptance, up to 1.5 times the first
    family's frequencies or the last family's lowest, and of squared frequencies per squared deviation. Raises RingError
    for an interface of rigid or full patches, and what ring_modes and the factorisation raise.
    """
    if not isinstance(interface, Interface):
        interface = Interface.on_patches(sector.matrices, interface)
    if any(item.kind not in ("average", "node") for item in interface.coordinates):
        raise RingError('interface: patches of a ring are of kind "average" or "node"')
    part = part or Part(sector.matrices.stiffness, sector.matrices.mass)
    speeds = [0.0] if centrifugal is None else [0.0, greatest_speed]
    sectors = [sector] + [_at(sector, centrifugal, speed) for speed in speeds[1:]]
    found = [ring_modes(one, families, max_frequency) for one in sectors]
    forces = np.vstack([_forces(modes, part) for modes in found])
    waves, errors, total, top = [], [], len(sector.diameters), _top(found[0])
    for done, number in enumerate(sector.diameters):
        if report is not None:
            report(done, total)
        one, error = _of_diameter(sectors, found, number, interface.vectors.T, forces, factorize, top)
        waves.append(one)
        errors.append(error)
    return _model(sector, interface, part, waves, errors, top, centrifugal, greatest_speed)


def _at(sector: CyclicSector, centrifugal: sparse.csr_array | None, speed: float) -> CyclicSector:
    assert centrifugal is not None
    stiffness = sector.matrices.stiffness + speed**2 * centrifugal
    return replace(sector, matrices=replace(sector.matrices, stiffness=stiffness))


def _forces(modes: RingModes, part: Part) -> np.ndarray:
    """Return real forces (f, n) that span those of deviations in a sector, on modes of unit strain energy.

    The strain energy of the static response to K_p z is at most z K_p z, to M_p z at most z M_p z over the lowest
    squared frequency: what has less of it is left out.
    """
    omegas, fields = 2.0 * np.pi * modes.frequencies_hz, np.vstack([modes.shapes.real, modes.shapes.imag])
    lowest, spans = omegas.min(), []
    for matrix, scales, factor in ((part.stiffness, 1.0 / omegas, 1.0), (part.mass, omegas / lowest, lowest)):
        scaled = np.tile(scales, 2)[:, None] * fields
        loads = np.asarray((matrix @ scaled.T).T)
        energies, turns = linalg.eigh(loads @ scaled.T)
        spans.append(factor * turns[:, modes.sectors * energies > _LEFT_OUT].T @ loads)
    return np.vstack(spans)


def _of_diameter(
    sectors: Sequence[CyclicSector], found: Sequence[RingModes], number: int, vectors: np.ndarray, forces: np.ndarray,
    factorize: Factorize, top: float,
) -> tuple[_Waves, tuple[float, float]]:  # fmt: skip
    """Return the waves of a diameter, and the errors of the receptance and of deviations that they leave.

    sectors, found: at standstill, and at the greatest speed, and their modes; vectors (k, n) of the interface.
    """
    statics = [_Statics(sector, number, factorize) for sector in sectors]
    first = statics[0]
    lead = first.own(_shapes(found[0], number))
    lead_squares = _squares(found[0], number)
    wanted = [first.response(vectors)]
    for static, modes in zip(statics[1:], found[1:], strict=True):
        wanted += [static.response(vectors), static.own(_shapes(modes, number))]
    rest, _ = first.independent(np.vstack(wanted), lead, _DEPENDENT, unit=True)
    others, left = first.independent(np.vstack([static.response(forces) for static in statics]),
                                     np.vstack([lead, rest]), _LEFT_OUT)  # fmt: skip
    squares, fields = first.ritz(np.vstack([rest, others]))
    waves = _Waves(first.problem, np.vstack([lead, fields]), np.r_[lead_squares, squares], len(lead), first.factor)
    return waves, (first.receptance_error(waves, vectors, top), left)


def _top(modes: RingModes) -> float:
    """Return the angular frequency up to which errors count: over the first family, and not over the last one."""
    lasts = [modes.frequencies_hz[modes.diameters == number].max() for number in np.unique(modes.diameters)]
    return float(2.0 * np.pi * min(*lasts, _REACH * modes.frequencies_hz[modes.families == 0].max()))


def _shapes(modes: RingModes, number: int) -> np.ndarray:
    return modes.shapes[modes.diameters == number]


def _squares(modes: RingModes, number: int) -> np.ndarray:
    return np.asarray((2.0 * np.pi * modes.frequencies_hz[modes.diameters == number]) ** 2)


class _Statics:
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
        return self.own(self.problem.fields(rows))

    def own(self, values: np.ndarray) -> np.ndarray:
        """Return fields, or products of them, as the diameter has them: real where it does not travel."""
        return values if self.problem.travels else np.asarray(values.real)

    def energies(self, fields: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return fields^H K others over the ring."""
        return self.own(self.factor * fields.conj() @ (self._stiffness @ others.T))

    def masses(self, fields: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return fields^H M others over the ring."""
        return self.own(self.factor * fields.conj() @ (self._mass @ others.T))

    def independent(
        self, fields: np.ndarray, known: np.ndarray, least: float, unit: bool = False
    ) -> tuple[np.ndarray, float]:
        """Return combinations (q, n) without the known ones, of more strain energy than the least, of unit energy.

        unit: the fields are scaled to unit energy first. Also returns the most energy that is left out.
        """
        if unit:
            fields = fields / np.sqrt(np.einsum("ii->i", self.energies(fields, fields)).real)[:, None]
        inner = self.energies(known, known)
        for _ in range(2):
            fields = fields - np.linalg.solve(inner, self.energies(known, fields)).T @ known
        energies, turns = linalg.eigh(self.energies(fields, fields))
        own = energies > least
        left = max(float(energies[~own].max(initial=0.0)), 0.0)
        return (turns[:, own] / np.sqrt(energies[own])).T @ fields, left

    def ritz(self, fields: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return squared frequencies (q,) and fields (q, n) of modal mass 1 in the span of fields."""
        if not len(fields):
            return np.empty(0), fields
        inverse, turns = linalg.eigh(self.masses(fields, fields), self.energies(fields, fields))
        return 1.0 / inverse, (turns / np.sqrt(inverse)).T @ fields

    def receptance_error(self, waves: _Waves, vectors: np.ndarray, top: float) -> float:
        """Return the largest error of the interface's receptance by modes and static response, relative.

        Against a basis with the next block of quasi-static responses, up to an angular frequency.
        """
        attached = waves.fields[waves.modes :]
        further, _ = self.independent(self.response((self._mass @ attached.T).T), waves.fields, _DEPENDENT, unit=True)
        squares, fields = self.ritz(np.vstack([attached, further]))
        kept, rest = (vectors @ block.T for block in (waves.fields[: waves.modes], fields))
        lowest = waves.squares[: waves.modes]
        static = (rest / squares) @ rest.conj().T
        ratio = self.problem.matrices.damping_ratio
        worst = 0.0
        for omega in np.linspace(0.0, top, _POINTS):
            modal = (kept / (lowest - omega**2 + 2j * ratio * omega * np.sqrt(lowest))) @ kept.conj().T
            dynamic = (rest / (squares - omega**2 + 2j * ratio * omega * np.sqrt(squares))) @ rest.conj().T
            worst = max(worst, float(np.linalg.norm(static - dynamic) / np.linalg.norm(modal + dynamic)))
        return worst


def _model(
    sector: CyclicSector, interface: Interface, part: Part, waves: Sequence[_Waves],
    errors: Sequence[tuple[float, float]], top: float, centrifugal: sparse.csr_array | None, greatest_speed: float,
) -> RingModel:  # fmt: skip
    """Return the reduced ring of the waves of all diameters: natural modes first."""
    fields = _real([one.fields for one in waves], waves)
    squares = np.concatenate([np.repeat(one.squares, 1 + one.problem.travels) for one in waves])
    diameters = np.repeat([one.problem.number for one in waves], [len(one.squares) * (1 + one.problem.travels)
                                                                  for one in waves])  # fmt: skip
    lead = np.concatenate([np.arange(len(one.squares)).repeat(1 + one.problem.travels) < one.modes for one in waves])
    order = np.argsort(~lead, kind="stable")
    spinning = None
    if centrifugal is not None:
        blocks = [_hermitian(one.factor * one.fields.conj() @ (centrifugal @ one.fields.T), one) for one in waves]
        spinning = linalg.block_diag(*blocks)[np.ix_(order, order)]
    fields, matrices = fields[order], sector.matrices
    translations = matrices.rigid_translations()
    receptance, left = (max(values) for values in zip(*errors, strict=True))
    estimate: dict[str, Any] = {
        "receptance": receptance, "deviation": left, "frequencies_hz": [0.0, top / (2.0 * np.pi)],
        "sentence": f"{lead.sum()} natural modes of the ring: estimated error {100 * receptance:.2g} % of the "
        f"interface's receptance, {100 * left:.1g} % of squared frequencies per squared deviation",
    }  # fmt: skip
    return RingModel(
        sectors=sector.sectors, axis=sector.axis, point=sector.point, diameters=diameters[order],
        squares=squares[order], modes=int(lead.sum()), interface=interface.labels,
        selection=(fields @ interface.vectors).T,
        directions=interface.directions, normals=interface.normals, positions=interface.positions, arms=interface.arms,
        base_load=fields @ (matrices.mass @ translations), part_load=fields @ (part.mass @ translations),
        stiffness=fields @ (part.stiffness @ fields.T), mass=fields @ (part.mass @ fields.T),
        damping_ratio=matrices.damping_ratio, centrifugal_stiffness=spinning, greatest_speed=greatest_speed,
        provenance={
            "matrices": dict(matrices.provenance), "estimate": estimate,
            "versions": {"numpy": np.__version__, "scipy": scipy.__version__},
        },
    )  # fmt: skip


def _real(fields: Sequence[np.ndarray], waves: Sequence[_Waves]) -> np.ndarray:
    """Return the real fields (n, N) of all waves on sector 0: real and imaginary part of those that travel."""
    return np.vstack([
        np.stack([block.real, block.imag], axis=1).reshape(-1, block.shape[1]) if one.problem.travels else block.real
        for block, one in zip(fields, waves, strict=True)
    ])  # fmt: skip


def _hermitian(matrix: np.ndarray, one: _Waves) -> np.ndarray:
    """Return the real form of a Hermitian matrix (b, b) in the pairs of a diameter's waves."""
    if not one.problem.travels:
        return np.asarray(matrix.real)
    block = np.array([[matrix.real, matrix.imag], [-matrix.imag, matrix.real]])
    return np.asarray(block.transpose(2, 0, 3, 1).reshape(2 * len(matrix), -1))
