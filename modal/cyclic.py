"""A ring of equal sectors from the finite elements of one: a real symmetric problem for every nodal diameter.

Sector j of N is sector 0 turned by j alpha, alpha = 2 pi / N, with displacements u_j in its own, turned axes. The
ring's motions split into waves u_j = z exp(i h j alpha) of the nodal diameters h = 0 .. N // 2. On the face `high` a
sector moves as its neighbour on `low`: z(high) = exp(i h alpha) R z(low), R the turn by alpha. With z = T_h y, the
matrices T_h^H K T_h are Hermitian: symmetric for h = 0 and N / 2, else of a real form with twice as many freedoms, in
which every frequency is a pair: a cosine and a sine around the ring. Thomas (1979), Int. J. Numer. Methods Eng. 14.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from pydantic import ConfigDict
from scipy import linalg, sparse

from vanedamp.files import store
from vanedamp.files.toml_input import STRICT, Axes
from vanedamp.modal.algebra import rotation
from vanedamp.modal.cyclic_faces import TOLERANCE, CyclicError, check_sides, paired
from vanedamp.modal.matrices import SystemMatrices, patch_average, unit_direction

# directions in which a node on the axis obeys u = exp(i h alpha) R u to this
_NULL = 1e-9


def aliased(order: int, sectors: int) -> tuple[int, int]:
    """Return the nodal diameter h that an engine order excites, and its sense.

    Sense: 1 for an order k N + h, whose phase goes from sector to sector as that of the order h; -1 for k N - h, whose
    phase goes the other way; 0 for h = 0 and N / 2, which have no sense. Raises CyclicError for no whole order.
    """
    if order != int(order) or order < 0:
        raise CyclicError(f"order: expected a whole number of at least 0, not {order}")
    remainder = int(order) % sectors
    if remainder == 0 or 2 * remainder == sectors:
        return remainder, 0
    return (remainder, 1) if 2 * remainder < sectors else (sectors - remainder, -1)


@dataclass(frozen=True)
class SectorSpring:
    """Springs from every sector to the next, between the mean displacements of two facet groups."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    low: str
    """facet group of the next sector"""
    high: str
    """facet group of the sector itself"""
    stiffness: Axes
    """stiffness in all directions, or along [x, y, z], axes that turn with the sector [N/m]"""

    def __post_init__(self) -> None:
        values = self.stiffness
        if len(values) != 3 or not all(math.isfinite(value) and value >= 0.0 for value in values) or not any(values):
            raise CyclicError("stiffness: expected N/m above zero, such as 1e7 or [1e7, 5e6, 1e7]")


@dataclass(frozen=True, eq=False)
class Diameter:
    """The problem of one nodal diameter.

    number     h
    matrices   real and symmetric; 3 m freedoms, 6 m of the real form (real parts, then imaginary parts)
    expansion  (N, 3 m) complex CSR: T_h, from its freedoms to displacements of a sector
    """

    number: int
    matrices: SystemMatrices
    expansion: sparse.csr_array

    @property
    def travels(self) -> bool:
        """Whether it has waves of two senses: 0 < h < N / 2."""
        return self.matrices.size > self.expansion.shape[1]

    def real_form(self, matrix: sparse.csr_array) -> sparse.csr_array:
        """Return T^H A T of a sector's matrix A (N, N), symmetric, skew or Hermitian, as a real matrix."""
        return _real_form(self.expansion, matrix, self.travels)

    def fields(self, rows: np.ndarray) -> np.ndarray:
        """Return displacements (k, N), complex, of rows (k, size) of the problem's freedoms, complex ones too."""
        if not self.travels:
            return np.asarray((self.expansion @ rows.T).T)
        half = rows.shape[1] // 2
        return np.asarray((self.expansion @ (rows[:, :half] + 1j * rows[:, half:]).T).T)

    def forces(self, load: np.ndarray) -> np.ndarray:
        """Return the load (size,) on the problem's freedoms of a real or complex one (N,) on a sector."""
        reduced = self.expansion.conj().T @ load
        return np.concatenate([reduced.real, reduced.imag]) if self.travels else np.asarray(reduced.real)


@dataclass(frozen=True, eq=False)
class CyclicSector:
    """One sector of a ring.

    matrices     of the sector, with both faces free
    sectors      N, at least 2
    axis, point  (3,) unit vector, and (3,) m, a point of the axis: a positive turn brings `low` to `high`
    low, high    (k,) nodes in pairs; none of separate structures. A node on the axis is paired with itself
    distance     m, largest of a pair, once turned
    couplings    springs between neighbours
    """

    matrices: SystemMatrices
    sectors: int
    axis: np.ndarray
    point: np.ndarray
    low: np.ndarray
    high: np.ndarray
    distance: float = 0.0
    couplings: tuple[SectorSpring, ...] = ()

    @property
    def angle(self) -> float:
        """Angle of a sector, rad."""
        return 2.0 * math.pi / self.sectors

    @property
    def diameters(self) -> range:
        """All nodal diameters, 0 to N // 2."""
        return range(self.sectors // 2 + 1)

    def turn(self, sectors: int = 1) -> np.ndarray:
        """Return the matrix (3, 3) that turns a vector by so many sectors."""
        return rotation(self.axis, sectors * self.angle)

    def at(self, diameter: int) -> Diameter:
        """Return the problem of a nodal diameter. Raises CyclicError for one that the ring does not have."""
        if diameter not in self.diameters:
            raise CyclicError(f"diameter: expected 0 to {self.sectors // 2} of {self.sectors} sectors, not {diameter}")
        sector, travels = self.matrices, self.travels(diameter)
        expansion, nodes, fixed = self._expansion(diameter, travels)
        copies = 2 if travels else 1
        if self._terms is None:
            stiffness, mass = (
                _real_form(expansion, matrix, travels) for matrix in (self.stiffness(diameter), sector.mass)
            )
        else:
            stiffness, mass = (terms.real_form(diameter * self.angle, travels) for terms in self._terms)
        matrices = SystemMatrices(
            stiffness=stiffness,
            mass=mass,
            coordinates=np.tile(sector.coordinates[nodes], (copies, 1)),
            fixed=np.concatenate([fixed + copy * 3 * nodes.size for copy in range(copies)]),
            patches={},
            damping_ratio=sector.damping_ratio,
            provenance=dict(sector.provenance) | {"sectors": self.sectors, "diameter": diameter},
        )
        return Diameter(diameter, matrices, expansion)

    def couplers(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Return for every spring the functionals (3, N) of `high` and of the next sector's `low`, and its stiffness.

        The stretch is high q_j - low q_(j+1), in the axes of sector j.
        """
        matrices, rotation = self.matrices, self.turn()
        return [
            (
                np.array([patch_average(matrices, spring.high, axis) for axis in np.eye(3)]),
                rotation @ np.array([patch_average(matrices, spring.low, axis) for axis in np.eye(3)]),
                np.array(spring.stiffness),
            )
            for spring in self.couplings
        ]

    def travels(self, diameter: int) -> bool:
        """Whether a nodal diameter has waves of two senses: 0 < h < N / 2."""
        return 0 < 2 * diameter < self.sectors

    def stiffness(self, diameter: int) -> sparse.csr_array:
        """Return the stiffness (N, N) for a wave z exp(i h j alpha), Hermitian: with the springs between neighbours."""
        total = self.matrices.stiffness
        for high, low, stiffness in self.couplers():
            stretch = sparse.csr_array(high - np.exp(1j * diameter * self.angle) * low)
            total = total + stretch.conj().T @ (sparse.diags(stiffness) @ stretch)
        return sparse.csr_array(total)

    @cached_property
    def _terms(self) -> tuple[_Terms, _Terms] | None:
        """Stiffness and mass by their dependence on the diameter; None with springs or nodes on the axis."""
        if self.couplings or np.any(self.low == self.high):
            return None
        expansion = self._expansion(0, False)[0].real
        beyond = sparse.diags(np.repeat(np.isin(np.arange(len(self.matrices.coordinates)), self.high), 3) * 1.0)
        turned = sparse.csr_array(beyond @ expansion)
        unturned = sparse.csr_array(expansion - turned)
        return _Terms.of(self.matrices.stiffness, unturned, turned), _Terms.of(self.matrices.mass, unturned, turned)

    def _expansion(self, diameter: int, travels: bool) -> tuple[sparse.csr_array, np.ndarray, np.ndarray]:
        """Return T_h (N, 3 m), the kept nodes (m,), and the fixed ones (f,) of its freedoms."""
        count, phase = len(self.matrices.coordinates), np.exp(1j * diameter * self.angle)
        central = self.low[self.low == self.high]
        off = self.low != self.high
        low, high = self.low[off], self.high[off]
        nodes = np.setdiff1d(np.arange(count), high)
        index = np.full(count, -1)
        index[nodes] = np.arange(nodes.size)
        plain = np.setdiff1d(nodes, central)
        blocks = [(plain, plain, np.eye(3)), (high, low, phase * self.turn())]
        fixed = np.isin(3 * nodes[:, None] + np.arange(3), self.matrices.fixed)
        for node in central:
            directions = self._on_axis(np.flatnonzero(fixed[index[node]]), phase, travels)
            blocks.append((np.array([node]), np.array([node]), directions))
            fixed[index[node]] = ~np.any(directions, axis=0)
        rows = [3 * node[:, None, None] + np.arange(3)[:, None] + np.zeros((1, 3), int) for node, _, _ in blocks]
        columns = [3 * index[of][:, None, None] + np.zeros((3, 1), int) + np.arange(3) for _, of, _ in blocks]
        values = [np.broadcast_to(block, (node.size, 3, 3)) for node, _, block in blocks]
        joined = (np.concatenate([array.ravel() for array in arrays]) for arrays in (values, rows, columns))
        data, row, column = joined
        expansion = sparse.csr_array((data, (row, column)), shape=(3 * count, 3 * nodes.size), dtype=complex)
        expansion.eliminate_zeros()
        return expansion, nodes, np.flatnonzero(fixed)

    def _on_axis(self, fixed: np.ndarray, phase: complex, travels: bool) -> np.ndarray:
        """Return the motions (3, 3) of a node on the axis, u = exp(i h alpha) R u, as columns, zeros after the last."""
        bound = np.vstack([phase * self.turn() - np.eye(3), np.eye(3)[fixed]])
        free = linalg.null_space(bound if travels else bound.real, rcond=_NULL)
        return np.pad(free, ((0, 0), (0, 3 - free.shape[1])))


class _Terms(NamedTuple):
    """A symmetric matrix in the freedoms of all diameters, on one pattern: even.real + even.imag cos + i odd sin."""

    even: sparse.csr_array
    odd: sparse.csr_array

    @classmethod
    def of(cls, matrix: sparse.csr_array, unturned: sparse.csr_array, turned: sparse.csr_array) -> _Terms:
        """Return the parts for T_h = unturned + exp(i h alpha) turned."""
        forces = matrix @ turned
        diagonal, across = unturned.T @ (matrix @ unturned) + turned.T @ forces, sparse.csr_array(unturned.T @ forces)
        return cls(*(sparse.csr_array(term) for term in (diagonal + 1j * (across + across.T), across - across.T)))

    def real_form(self, angle: float, travels: bool) -> sparse.csr_array:
        """Return the real form at h alpha (rad); zeros stay, so that all diameters have one pattern."""
        even = _same_pattern(self.even, self.even.data.real + math.cos(angle) * self.even.data.imag)
        return _doubled(even, _same_pattern(self.odd, math.sin(angle) * self.odd.data)) if travels else even


def _same_pattern(matrix: sparse.csr_array, data: np.ndarray) -> sparse.csr_array:
    return sparse.csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


def _real_form(expansion: sparse.csr_array, matrix: sparse.csr_array, travels: bool) -> sparse.csr_array:
    product = sparse.csr_array(expansion.conj().T @ (matrix @ expansion))
    real, imaginary = product.real, product.imag
    imaginary.eliminate_zeros()
    return _doubled(real, imaginary) if travels else sparse.csr_array(real)


def _doubled(real: sparse.csr_array, imaginary: sparse.csr_array) -> sparse.csr_array:
    return sparse.csr_array(sparse.bmat([[real, -imaginary], [imaginary, real]], format="csr"))


def cyclic_sector(
    matrices: SystemMatrices,
    low: str | None,
    high: str | None,
    sectors: int,
    axis: Sequence[float] | np.ndarray = (0.0, 0.0, 1.0),
    point: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
    couplings: Sequence[SectorSpring] = (),
    tolerance: float = TOLERANCE,
) -> CyclicSector:
    """Return the sector of a ring, the nodes of its faces in pairs.

    low, high  patches: the faces, of which a positive turn about the axis by the angle of a sector brings the first to
               the second; None of separate structures, which only springs couple
    tolerance  largest distance of two nodes that are one, over the size of the sector

    Raises CyclicError where the faces do not fit, and MatricesError for unknown patches and no axis.
    """
    if sectors != int(sectors) or sectors < 2:
        raise CyclicError(f"ring.sectors: expected a whole number of at least 2, not {sectors}")
    if (low is None) != (high is None) or (low is None and not couplings):
        raise CyclicError("ring.low: give the faces low and high, or springs between separate structures")
    direction, origin = store.frozen(unit_direction(axis)), store.frozen(point)
    nodes = ends = np.empty(0, dtype=np.int64)
    distance = 0.0
    if low is not None and high is not None:
        nodes, ends, distance = paired(matrices, low, high, int(sectors), direction, origin, tolerance)
    for spring in couplings:
        check_sides(matrices, spring.low, spring.high, int(sectors), direction, origin)
    return CyclicSector(matrices, int(sectors), direction, origin, nodes, ends, distance, tuple(couplings))
