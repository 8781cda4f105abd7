"""Interface coordinates: the displacements that loads and contacts act on, as functionals of a structure's DOFs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vanedamp.files import store
from vanedamp.files.errors import VanedampError
from vanedamp.modal.matrices import Patch, SystemMatrices, patch_average, unit_direction

KINDS = ("average", "rigid", "node", "full")
MOTIONS = ("translation", "rotation")
# of the largest singular value: below it a functional, or a rigid motion of a patch, is a combination of the others
_DEPENDENT = 1e-10
# a mean normal shorter than this is that of a surface which faces everywhere
_FLAT = 0.5


class InterfaceError(VanedampError):
    """Interface coordinates that the structure does not have, or that depend on each other; the message names them."""


@dataclass(frozen=True)
class InterfaceCoordinate:
    """One displacement of a structure.

    label      its name in the reduced model
    facets     the patch of the system matrices
    direction  three numbers, scaled to length one
    kind       "average": mean displacement over the area; the patch deforms freely, a load on it is a constant
               traction. "rigid": the patch moves as a rigid body, which stiffens the structure, and this is the
               translation of its centroid. "node": the node nearest to the centroid. "full": the mean displacement of
               a patch of which every node is a boundary coordinate; the reduction keeps the lowest characteristic
               constraint modes of these (Castanier, Tan and Pierre 2001)
    motion     "translation", or "rotation": the small rotation about the direction through the centroid, rad

    The motion of a patch that deforms is that of the rigid motion which fits it best over the area (least squares); its
    translation is the mean displacement. Raises InterfaceError or modal.matrices.MatricesError.
    """

    label: str
    facets: str
    direction: tuple[float, float, float]
    kind: str = "average"
    motion: str = "translation"

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InterfaceError(f"{self.label}: kind must be one of {', '.join(KINDS)}, not {self.kind!r}")
        if self.motion not in MOTIONS:
            raise InterfaceError(f"{self.label}: motion must be one of {', '.join(MOTIONS)}, not {self.motion!r}")
        if self.motion == "rotation" and self.kind == "node":
            raise InterfaceError(f'{self.label}: a node has no rotation; take kind "average" or "rigid"')
        object.__setattr__(self, "direction", tuple(unit_direction(self.direction).tolist()))


def patch_motions(
    label: str, facets: str, motions: Sequence[str] = ("x", "y", "z", "rx", "ry", "rz"), kind: str = "rigid"
) -> list[InterfaceCoordinate]:
    """Return translations and rotations of a patch along and about the axes, all six or those named: "<label>.rx" ...

    Raises InterfaceError for a name other than x, y, z, rx, ry, rz.
    """
    axes = dict(zip("xyz", np.eye(3).tolist(), strict=True))
    for name in motions:
        if name.removeprefix("r") not in axes:
            raise InterfaceError(f"{label}: expected motions out of x, y, z, rx, ry, rz, not {name!r}")
    return [
        InterfaceCoordinate(
            f"{label}.{name}", facets, axes[name[-1]], kind, "rotation" if len(name) == 2 else "translation"
        )
        for name in motions
    ]


def normal_direction(matrices: SystemMatrices, facets: str) -> tuple[float, float, float]:
    """Return the normal of a patch of facets, with the same sign for walls that face each other.

    Its largest component is positive, the first of those within a tenth of the largest. Raises InterfaceError for a
    patch without a normal, such as a node set or a closed surface.
    """
    normal = _normal(matrices, facets)
    if not normal.any():
        raise InterfaceError(f"{facets!r} has no normal: it is a node set, or curves too much; give three numbers")
    size = np.abs(normal)
    x, y, z = (normal * np.sign(normal[np.argmax(size > 0.9 * size.max())])).tolist()
    return x, y, z


def _normal(matrices: SystemMatrices, facets: str) -> np.ndarray:
    """Return the unit normal (3,) of a patch; zeros where it has none."""
    normal = matrices.patch(facets).normal
    length = np.linalg.norm(normal)
    return normal / length if length > _FLAT else np.zeros(3)


@dataclass(frozen=True, eq=False)
class Interface:
    """k interface coordinates on a structure with N DOFs.

    coordinates  their definitions, in order
    vectors      (N, k) functionals: the displacements are vectors^T q
    motions      (N, n) sparse, the motions q = motions @ y that supports and rigid patches leave to the structure
    full         (m,) sorted DOFs of the patches of kind "full" that can move
    normals      (k, 3) unit normals of the patches, out of the material; zeros where unknown
    """

    coordinates: tuple[InterfaceCoordinate, ...]
    vectors: np.ndarray
    motions: sparse.csr_array
    full: np.ndarray
    normals: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "coordinates", tuple(self.coordinates))
        object.__setattr__(self, "vectors", store.frozen(self.vectors))
        object.__setattr__(self, "normals", store.frozen(self.normals))

    @classmethod
    def on_patches(cls, matrices: SystemMatrices, coordinates: Sequence[InterfaceCoordinate]) -> Interface:
        """Return the interface of these coordinates.

        Raises InterfaceError for labels that occur twice, rigid patches that touch the supports or each other, and
        coordinates that cannot move or depend on others; modal.matrices.MatricesError for an unknown patch.
        """
        labels = [coordinate.label for coordinate in coordinates]
        if not labels:
            raise InterfaceError("interface: no coordinates; name at least one facet group and direction")
        twice = sorted({label for label in labels if labels.count(label) > 1})
        if twice:
            raise InterfaceError(f"{twice[0]}: this label occurs twice; interface labels must be unique")
        vectors = np.column_stack([_functional(matrices, coordinate) for coordinate in coordinates])
        motions = _motions(matrices, {item.facets: item.label for item in coordinates if item.kind == "rigid"})
        _check_independent(labels, motions.T @ vectors)
        normals = np.array([_normal(matrices, coordinate.facets) for coordinate in coordinates])
        return cls(tuple(coordinates), vectors, motions, _full_dofs(matrices, coordinates), normals)

    @property
    def labels(self) -> tuple[str, ...]:
        """The k labels."""
        return tuple(coordinate.label for coordinate in self.coordinates)

    @property
    def directions(self) -> np.ndarray:
        """(k, 3) unit directions; zeros for a rotation, which has none that a base can move along."""
        return np.array([item.direction if item.motion == "translation" else (0.0,) * 3 for item in self.coordinates])

    def restrict(self, matrices: SystemMatrices) -> tuple[sparse.csr_array, sparse.csr_array, np.ndarray]:
        """Return stiffness (n, n), mass (n, n) and functionals (n, k) in the motions that are left to the structure."""
        stiffness, mass = (
            sparse.csr_array(self.motions.T @ matrix @ self.motions) for matrix in (matrices.stiffness, matrices.mass)
        )
        return stiffness, mass, self.motions.T @ self.vectors


def _functional(matrices: SystemMatrices, coordinate: InterfaceCoordinate) -> np.ndarray:
    if coordinate.motion == "rotation":
        return _rotation(matrices, coordinate)
    if coordinate.kind != "node":
        return patch_average(matrices, coordinate.facets, coordinate.direction)
    patch = matrices.patch(coordinate.facets)
    positions = matrices.coordinates[patch.nodes]
    nearest = patch.nodes[np.argmin(np.linalg.norm(positions - _centroid(matrices, patch), axis=1))]
    functional = np.zeros(matrices.size)
    functional[3 * nearest : 3 * nearest + 3] = coordinate.direction
    return functional


def _rotation(matrices: SystemMatrices, coordinate: InterfaceCoordinate) -> np.ndarray:
    """Return the functional (N,) of the rotation in a patch's best rigid motion. Raises InterfaceError without one."""
    patch = matrices.patch(coordinate.facets)
    offsets = matrices.coordinates[patch.nodes] - _centroid(matrices, patch)
    length = np.abs(offsets).max() or 1.0
    root = np.sqrt(np.maximum(np.repeat(patch.weights, 3), 0.0))
    wanted = np.concatenate([np.zeros(3), coordinate.direction])
    weighted = root[:, None] * rigid_motions(offsets / length)
    fit = wanted @ np.linalg.pinv(weighted, rcond=_DEPENDENT)
    if not np.allclose(fit @ weighted, wanted, atol=1e-6):
        raise InterfaceError(f"{coordinate.label}: the nodes of {coordinate.facets!r} have no rotation about that axis")
    functional = np.zeros((len(matrices.coordinates), 3))
    functional[patch.nodes] = (fit * root / length).reshape(-1, 3)
    return functional.ravel()


def _full_dofs(matrices: SystemMatrices, coordinates: Sequence[InterfaceCoordinate]) -> np.ndarray:
    """Return the sorted DOFs of all nodes of patches of kind "full", without those at the supports."""
    full = {item.facets: item.label for item in coordinates if item.kind == "full"}
    nodes = np.unique(np.concatenate([np.empty(0, np.int64), *(matrices.patch(facets).nodes for facets in full)]))
    dofs = np.setdiff1d((3 * nodes[:, None] + np.arange(3)).ravel(), matrices.fixed)
    for item in coordinates:
        if item.kind == "rigid" and np.intersect1d(matrices.patch(item.facets).nodes, nodes).size:
            raise InterfaceError(f'{item.label}: the rigid patch {item.facets!r} shares nodes with one of kind "full"')
    return dofs


def _motions(matrices: SystemMatrices, rigid: dict[str, str]) -> sparse.csr_array:
    """Return columns for the free DOFs outside rigid patches, then up to six for every rigid patch."""
    free = np.zeros(matrices.size, dtype=bool)
    free[matrices.free] = True
    blocks = []
    for facets, label in rigid.items():
        patch = matrices.patch(facets)
        dofs = (3 * patch.nodes[:, None] + np.arange(3)).ravel()
        if not np.all(free[dofs]):
            raise InterfaceError(
                f"{label}: the rigid patch {facets!r} touches the supports or another rigid patch; "
                'take kind "average", or rigid patches without common nodes'
            )
        free[dofs] = False
        basis = rigid_basis(matrices.coordinates[patch.nodes] - _centroid(matrices, patch))
        columns = np.tile(np.arange(basis.shape[1]), len(dofs))
        shape = (matrices.size, basis.shape[1])
        blocks.append(sparse.csr_array((basis.ravel(), (np.repeat(dofs, basis.shape[1]), columns)), shape=shape))
    rest = np.flatnonzero(free)
    identity = sparse.csr_array((np.ones(rest.size), (rest, np.arange(rest.size))), shape=(matrices.size, rest.size))
    return sparse.csr_array(sparse.hstack([identity, *blocks]))


def rigid_motions(offsets: np.ndarray) -> np.ndarray:
    """Return unit translations along and small unit rotations about x, y, z (3 n, 6) of points at (n, 3) offsets."""
    rotations = np.cross(np.eye(3), offsets[:, None, :])
    translations = np.broadcast_to(np.eye(3), rotations.shape)
    return np.concatenate([translations, rotations], axis=1).swapaxes(1, 2).reshape(-1, 6)


def rigid_basis(offsets: np.ndarray) -> np.ndarray:
    """Return orthonormal rigid motions (3 n, 6) of points; fewer columns for points on one line or a single one."""
    length = np.abs(offsets).max() or 1.0
    left, singular, _ = np.linalg.svd(rigid_motions(offsets / length), full_matrices=False)
    return left[:, singular > _DEPENDENT * singular[0]]


def _centroid(matrices: SystemMatrices, patch: Patch) -> np.ndarray:
    return patch.weights @ matrices.coordinates[patch.nodes] / patch.area


def _check_independent(labels: list[str], vectors: np.ndarray) -> None:
    lengths = np.linalg.norm(vectors, axis=0)
    for label, length in zip(labels, lengths, strict=True):
        if length == 0.0:
            raise InterfaceError(f"{label}: cannot move, it lies on the supports")
    _, singular, right = np.linalg.svd(vectors / lengths, full_matrices=False)
    if singular[-1] < _DEPENDENT * singular[0]:
        involved = [label for label, share in zip(labels, right[-1], strict=True) if abs(share) > 1e-6]
        raise InterfaceError(f"{', '.join(involved)}: linearly dependent displacements; drop one of them")
