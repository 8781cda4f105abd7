"""Two sets of mode shapes side by side: which mode is which, by the modal assurance criterion.

The second set may come from another analysis, another mesh, or a measurement at a few points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from vanedamp.files.errors import VanedampError
from vanedamp.files.store import frozen
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.records.modes import Modes

#: a pair of modes below this MAC is no pair
LEAST_MAC = 0.5
# an affine field has four coefficients; twice as many nodes keep its fit well-posed in all but flat patches
_NEIGHBOURS = 8
# fraction of a shape's largest displacement
_UNSEEN = 1e-6


class CorrelationError(VanedampError):
    """Shapes or points that do not fit the structure; the message names the argument and the remedy."""


@dataclass(frozen=True, eq=False)
class MeasuredShapes:
    """Mode shapes at measured degrees of freedom: displacements at points along directions.

    points          (p, 3) m, one row per measured displacement; three rows of one point for a triaxial sensor
    directions      (p, 3), scaled to length one
    shapes          (m, p), real or complex, of any scale
    frequencies_hz  (m,), nan where not known
    damping_ratios  (m,), nan where not known
    """

    points: np.ndarray
    directions: np.ndarray
    shapes: np.ndarray
    frequencies_hz: np.ndarray = field(default_factory=lambda: np.empty(0))
    damping_ratios: np.ndarray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        shapes = np.atleast_2d(np.asarray(self.shapes))
        count, size = shapes.shape
        values = {
            "points": frozen(np.reshape(self.points, (-1, 3))),
            "directions": frozen(np.reshape(self.directions, (-1, 3))),
            "shapes": frozen(shapes, complex if np.iscomplexobj(shapes) else float),
        }
        for name in ("points", "directions"):
            if values[name].shape != (size, 3) or not np.all(np.isfinite(values[name])):
                raise CorrelationError(f"{name}: expected {size} rows of three numbers, one for every value of a shape")
        lengths = np.linalg.norm(values["directions"], axis=1)
        if not np.all(lengths > 0.0):
            raise CorrelationError(f"directions: row {int(np.argmin(lengths))} has no length")
        if not np.all(np.isfinite(shapes)) or not np.all(np.abs(shapes).max(axis=1, initial=0.0) > 0.0):
            raise CorrelationError("shapes: every shape needs finite values that are not all zero")
        values["directions"] = frozen(values["directions"] / lengths[:, None])
        for name in ("frequencies_hz", "damping_ratios"):
            per_shape = np.asarray(getattr(self, name), dtype=float)
            if per_shape.size not in (0, count):
                raise CorrelationError(f"{name}: {per_shape.size} values for {count} shapes")
            values[name] = frozen(per_shape if per_shape.size else np.full(count, np.nan))
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.shapes)


@dataclass(frozen=True, eq=False)
class Pairing:
    """Modes of a first set with their partners in a second one; the others have none.

    mac            (m1, m2) of every first with every second shape
    first, second  (k,) indices of the pairs, the first ascending
    """

    mac: np.ndarray
    first: np.ndarray
    second: np.ndarray

    @property
    def pair_mac(self) -> np.ndarray:
        """(k,) MAC of the pairs."""
        return np.array(self.mac[self.first, self.second])


def modal_assurance(first: np.ndarray, second: np.ndarray, mass: sparse.csr_array | None = None) -> np.ndarray:
    """Return the modal assurance criterion (m1, m2) of shapes (m1, N) and (m2, N), weighted by a mass matrix if given.

    |a^H W b|^2 / ((a^H W a)(b^H W b)), 1 for shapes that agree up to a (complex) factor (Allemang and Brown 1982); 0
    for a shape without motion.
    """
    weighted = [shapes if mass is None else shapes @ mass for shapes in (first, second)]
    norms = [np.einsum("ij,ij->i", s.conj(), w).real for s, w in zip((first, second), weighted, strict=True)]
    products = np.outer(*norms)
    return np.abs(first.conj() @ weighted[1].T) ** 2 / np.where(products > 0.0, products, np.inf)


def pair_modes(mac: np.ndarray, least: float = LEAST_MAC) -> Pairing:
    """Return the pairs with the largest sum of MAC values, each mode once; pairs below `least` are dropped.

    An optimal assignment (Crouse 2016, IEEE Trans. Aerosp. Electron. Syst. 52) does not depend on the order of the
    modes, and two shapes cannot claim one partner, as they do when each takes its best.
    """
    values = np.asarray(mac, dtype=float)
    if values.ndim != 2 or not np.all(np.isfinite(values)):
        raise CorrelationError(f"mac: expected a finite matrix (m1, m2), not shape {values.shape}")
    # values below the threshold count as zero, so that they displace no pair above it
    first, second = linear_sum_assignment(-np.where(values >= least, values, 0.0))
    is_pair = values[first, second] >= least
    return Pairing(frozen(values), frozen(first[is_pair], np.int64), frozen(second[is_pair], np.int64))


def interpolation(coordinates: np.ndarray, points: np.ndarray, directions: np.ndarray) -> sparse.csr_array:
    """Return the matrix (p, N) of displacements at points along directions, interpolated from the nodes around each.

    Weights of the least-squares affine field through the eight nearest nodes, the near ones weighing more (Lancaster
    and Salkauskas 1981, moving least squares): exact for rigid motion and constant strain where the nodes span space;
    it needs no elements, so that shapes of other meshes and codes can be compared.
    """
    nodes, weights = _affine_weights(coordinates, points)
    rows = np.repeat(np.arange(len(nodes)), 3 * nodes.shape[1])
    columns = (3 * nodes[:, :, None] + np.arange(3)).ravel()
    values = (weights[:, :, None] * directions[:, None, :]).ravel()
    return sparse.csr_array((values, (rows, columns)), shape=(len(nodes), coordinates.size))


def observed_shapes(modes: Modes, matrices: SystemMatrices, measured: MeasuredShapes) -> np.ndarray:
    """Return computed modes (m, p) at the measured degrees of freedom.

    Raises CorrelationError for points that lie away from the structure: their coordinates are then in another frame or
    another unit.
    """
    check_points(matrices.coordinates, measured.points)
    seen = interpolation(matrices.coordinates, measured.points, measured.directions)
    return np.asarray((seen @ modes.shapes.T).T)


def measured_mac(modes: Modes, matrices: SystemMatrices, measured: MeasuredShapes) -> np.ndarray:
    """Return the MAC (computed, measured) at the measured degrees of freedom."""
    seen = observed_shapes(modes, matrices, measured)
    # a mode without motion at the sensors is round-off there, which may resemble any shape
    unseen = np.abs(seen).max(axis=1) < _UNSEEN * np.abs(modes.shapes).max(axis=1)
    seen[unseen] = 0.0
    return modal_assurance(seen, measured.shapes)


def compare(first: Modes, first_matrices: SystemMatrices, second: Modes, second_matrices: SystemMatrices) -> np.ndarray:
    """Return the MAC (m1, m2) of two analyses, weighted by the first one's mass, at the nodes of its mesh."""
    shapes, coordinates = second.shapes, first_matrices.coordinates
    same = coordinates.shape == second_matrices.coordinates.shape
    if not (same and np.allclose(coordinates, second_matrices.coordinates, rtol=0.0, atol=1e-9)):
        check_points(second_matrices.coordinates, coordinates)
        nodes, weights = _affine_weights(second_matrices.coordinates, coordinates)
        fields = shapes.reshape(len(shapes), -1, 3)
        shapes = np.einsum("mpka,pk->mpa", fields[:, nodes], weights).reshape(len(shapes), -1)
    return modal_assurance(first.shapes, shapes, first_matrices.mass)


def mode_like(
    modes: Modes, matrices: SystemMatrices, measured: MeasuredShapes, shape: int = 0, least: float = LEAST_MAC
) -> int:
    """Return the index of the computed mode that is most like one measured shape.

    Raises CorrelationError when none has a MAC of `least`.
    """
    mac = measured_mac(modes, matrices, measured)[:, shape]
    best = int(np.argmax(mac))
    if not mac[best] >= least:
        listed = ", ".join(f"{f:.5g} Hz: {value:.2g}" for f, value in zip(modes.frequencies_hz, mac, strict=True))
        raise CorrelationError(
            f"shape: no mode has a MAC of {least} with it ({listed}); "
            "compute more modes, or check points and directions"
        )
    return best


def check_points(coordinates: np.ndarray, points: Sequence[Sequence[float]] | np.ndarray) -> None:
    """Raise CorrelationError for a point farther from every node than a tenth of the structure's size."""
    distances, _ = cKDTree(coordinates).query(points)
    size = float(np.linalg.norm(np.ptp(coordinates, axis=0)))
    far = int(np.argmax(distances))
    if distances[far] > 0.1 * size:
        raise CorrelationError(
            f"points: {np.asarray(points)[far].tolist()} (row {far}) lies {distances[far]:.3g} m away from the "
            f"structure, whose size is {size:.3g} m; give points in its frame, in metres"
        )


def _affine_weights(coordinates: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return nodes (p, k) around points, and weights (p, k) that evaluate there the affine field fitted to them."""
    count = min(_NEIGHBOURS, len(coordinates))
    distances, nodes = cKDTree(coordinates).query(points, k=count)
    distances, nodes = distances.reshape(-1, count), nodes.reshape(-1, count)
    reach = distances[:, -1:] if count > 1 else np.ones_like(distances)
    nearness = reach / np.maximum(distances, 1e-9 * reach)
    offsets = (coordinates[nodes] - np.asarray(points)[:, None, :]) / reach[:, :, None]
    basis = np.concatenate([np.ones((*nodes.shape, 1)), offsets], axis=2)
    fitted = np.linalg.pinv(basis * nearness[:, :, None], rcond=1e-6)[:, 0, :] * nearness
    at_node = distances[:, 0] <= 1e-9 * reach[:, 0]
    fitted[at_node] = np.eye(count)[0]
    return nodes, fitted
