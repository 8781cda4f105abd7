"""Interface coordinates: the displacements that loads and contacts act on, as functionals of a structure's DOFs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from vanedamp.files import store
from vanedamp.files.display import Displayed
from vanedamp.files.errors import VanedampError
from vanedamp.modal.algebra import first_largest
from vanedamp.modal.matrices import Patch, SystemMatrices, patch_average, unit_direction
from vanedamp.rom.reduced import NORMAL, ROTATION

KINDS = ("average", "rigid", "node", "full")
MOTIONS = ("translation", "rotation")
# relative to the largest singular value: below it, a functional or a patch's rigid motion depends on the others
_DEPENDENT = 1e-10
# same for constraints between rigid patches: an edge, straight within this fraction of its length, is a hinge
_STRAIGHT = 1e-5
# a shorter mean normal belongs to a closed surface, or to surfaces that face different ways
_FLAT, _ONE_WAY = 0.5, 0.9
# sine of the least angle between the directions along and across that span a plane
_APART = 0.5**0.5


class InterfaceError(VanedampError):
    """Interface coordinates that the structure does not have, or that depend on each other; the message names them."""


@dataclass(frozen=True)
class InterfaceCoordinate:
    """One displacement of a structure.

    label      its name in the reduced model
    facets     the patch of the system matrices, or several that are taken as one
    direction  three numbers, scaled to length one
    kind       "average": mean displacement over the area; the patch deforms freely, a load on it is a constant
               traction. "rigid": the patch moves as a rigid body, which stiffens the structure, and this is the
               translation of its centroid; such patches with a common edge are hinged along it, and at supports a
               patch makes the motions that these leave to it. "node": the node nearest to the centroid. "full": the
               mean displacement of a patch of which every node is a boundary coordinate; the reduction keeps the
               lowest characteristic constraint modes of these (Castanier, Tan and Pierre 2001)
    motion     "translation", or "rotation": the small rotation about the direction through the centroid, rad
    point      where the rigid motion of an average patch is taken, m, or to what the node is nearest; None: the
               centroid, where that motion is the mean

    A patch that deforms has the rigid motion that fits it best over the area (least squares); its
    translation is the mean displacement. Raises InterfaceError or modal.matrices.MatricesError.
    """

    label: str
    facets: str | tuple[str, ...]
    direction: tuple[float, float, float]
    kind: str = "average"
    motion: str = "translation"
    point: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.facets, str):
            object.__setattr__(self, "facets", tuple(self.facets))
        if self.kind not in KINDS:
            raise InterfaceError(f"{self.label}: kind must be one of {', '.join(KINDS)}, not {self.kind!r}")
        if self.motion not in MOTIONS:
            raise InterfaceError(f"{self.label}: motion must be one of {', '.join(MOTIONS)}, not {self.motion!r}")
        if self.point is not None and (self.kind not in ("average", "node") or self.motion != "translation"):
            raise InterfaceError(f'{self.label}: a point is for the translation of a patch of kind "average" or "node"')
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


def plane_motion(
    matrices: SystemMatrices,
    label: str,
    facets: str | Sequence[str],
    along: Sequence[float] | np.ndarray,
    across: Sequence[float] | np.ndarray,
    kind: str = "patch",
) -> list[InterfaceCoordinate]:
    """Return the motion of a surface of a cavity in the plane of two directions: along, across and rotation.

    "<label>" is the displacement along, "<label>.normal" the one in the plane across it, "<label>.rotation" the small
    rotation that turns the first into the second. Of kind "patch" they are the means over it and the rotation of
    its best rigid motion (area-weighted least squares, an RBE3); a "cavity" is the same for all surfaces of a cavity,
    with the displacements at the middle of its floor, its lowest transverse position; a "node" has no rotation. Raises
    InterfaceError for directions that span no plane, and a "patch" that faces several ways.
    """
    first, second = unit_direction(along), unit_direction(across)
    second = second - (second @ first) * first
    if np.linalg.norm(second) < _APART:
        angle = np.degrees(np.arcsin(np.linalg.norm(second)))
        raise InterfaceError(
            f"{label}: the direction across is at {angle:.0f} degrees to that along; give another `normal`, out of the "
            "floor into the cavity"
        )
    second /= np.linalg.norm(second)
    groups = (facets,) if isinstance(facets, str) else tuple(facets)
    (patch, centroid, offsets), point = _around(matrices, groups), None
    oriented = any(matrices.patch(group).normal.any() for group in groups)
    if kind == "patch" and oriented and np.linalg.norm(patch.normal) < _ONE_WAY:
        raise InterfaceError(
            f'{label}: {", ".join(groups)} faces several ways; take kind = "cavity" for all surfaces of a cavity, or '
            "one entry for each surface"
        )
    if kind == "cavity":
        middle = 0.5 * (np.min(offsets @ first) + np.max(offsets @ first))
        point = _triple(centroid + middle * first + np.min(offsets @ second) * second)
    point_kind, surface = "node" if kind == "node" else "average", facets if isinstance(facets, str) else groups
    motion = [
        InterfaceCoordinate(label, surface, _triple(first), point_kind, point=point),
        InterfaceCoordinate(label + NORMAL, surface, _triple(second), point_kind, point=point),
    ]
    if kind == "node":
        return motion
    axis = _triple(np.cross(first, second))
    return [*motion, InterfaceCoordinate(label + ROTATION, surface, axis, point_kind, "rotation")]


def normal_direction(matrices: SystemMatrices, facets: str | Sequence[str]) -> tuple[float, float, float]:
    """Return the normal of a patch of facets, with the same sign for walls that face each other.

    Its largest component is positive, the first of all within a tenth of the largest. Raises InterfaceError for a
    patch without a normal, such as a node set or a closed surface.
    """
    normal = np.array(outward_normal(matrices, facets))
    size = np.abs(normal)
    return _triple(normal * np.sign(normal[np.argmax(size > 0.9 * size.max())]))


def outward_normal(matrices: SystemMatrices, facets: str | Sequence[str]) -> tuple[float, float, float]:
    """Return the unit normal of a patch of facets, out of the material. Raises InterfaceError for one without."""
    normal = _normal(matrices.patch(facets))
    if not normal.any():
        raise InterfaceError(f"{facets!r} has no normal: it is a node set, or curves too much; give three numbers")
    return _triple(normal)


def _triple(vector: np.ndarray) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


def _normal(patch: Patch) -> np.ndarray:
    """Return the unit normal (3,) of a patch; zeros where it has none."""
    length = np.linalg.norm(patch.normal)
    return patch.normal / length if length > _FLAT else np.zeros(3)


@dataclass(frozen=True, eq=False, repr=False)
class Interface(Displayed):
    """k interface coordinates on a structure with N DOFs.

    coordinates  their definitions, in order
    vectors      (N, k) functionals: the displacements are vectors^T q
    motions      (N, n) sparse, the motions q = motions @ y that supports and rigid patches leave to the structure
    full         (m,) sorted DOFs of the patches of kind "full" that can move
    normals      (k, 3) unit normals of the patches, out of the material; zeros where unknown
    positions    (k, 3) m, where these motions are: the centroids of the patches, their nodes, or points of their own
    arms         (k,) m, radii of gyration of the patches about the axes of rotations; zeros for displacements
    """

    coordinates: tuple[InterfaceCoordinate, ...]
    vectors: np.ndarray
    motions: sparse.csr_array
    full: np.ndarray
    normals: np.ndarray
    positions: np.ndarray
    arms: np.ndarray

    def __post_init__(self) -> None:
        object.__setattr__(self, "coordinates", tuple(self.coordinates))
        for name in ("vectors", "normals", "positions", "arms"):
            object.__setattr__(self, name, store.frozen(getattr(self, name)))

    @classmethod
    def on_patches(cls, matrices: SystemMatrices, coordinates: Sequence[InterfaceCoordinate]) -> Interface:
        """Return the interface of these coordinates.

        Raises InterfaceError for labels that occur twice, and coordinates that cannot move or depend on others;
        modal.matrices.MatricesError for an unknown patch.
        """
        labels = [coordinate.label for coordinate in coordinates]
        if not labels:
            raise InterfaceError("interface: no coordinates; name at least one facet group and direction")
        twice = sorted({label for label in labels if labels.count(label) > 1})
        if twice:
            raise InterfaceError(f"{twice[0]}: this label occurs twice; interface labels must be unique")
        resolved = [_resolved(matrices, coordinate) for coordinate in coordinates]
        functionals, normals, positions, arms = (np.array(values) for values in zip(*resolved, strict=True))
        vectors = functionals.T
        motions = _motions(matrices, list(dict.fromkeys(item.facets for item in coordinates if item.kind == "rigid")))
        _check_independent(coordinates, vectors, motions.T @ vectors)
        return cls(tuple(coordinates), vectors, motions, _full_dofs(matrices, coordinates), normals, positions, arms)

    @property
    def labels(self) -> tuple[str, ...]:
        """The k labels."""
        return tuple(coordinate.label for coordinate in self.coordinates)

    @property
    def directions(self) -> np.ndarray:
        """(k, 3) unit directions; zeros for a rotation, which has none that a base can move along."""
        return np.array([item.direction if item.motion == "translation" else (0.0,) * 3 for item in self.coordinates])

    def restrict(self, matrices: SystemMatrices) -> tuple[sparse.csr_array, sparse.csr_array, np.ndarray]:
        """Return stiffness (n, n), mass (n, n) and functionals (n, k) in the motions that are left to the structure.

        They are the motions left by the supports when the interface was made, even if `matrices` has other supports.
        """
        free = self.motions.nonzero()[0]

        def restricted(matrix: sparse.csr_array) -> sparse.csr_array:
            if len(free) == self.motions.shape[1]:  # no rigid patch: free DOFs only
                return matrix[free][:, free]
            return sparse.csr_array(self.motions.T @ matrix @ self.motions)

        return restricted(matrices.stiffness), restricted(matrices.mass), self.motions.T @ self.vectors


def _resolved(matrices: SystemMatrices, item: InterfaceCoordinate) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return functional (N,), normal of the patch (3,), place of the motion (3,), m, and radius of gyration, m.

    The radius refers to the axis of a rotation; it is 0 for a displacement.
    """
    patch, centroid, offsets = _around(matrices, item.facets)
    normal = _normal(patch)
    if item.motion == "rotation":
        squares = np.square(np.cross(offsets, item.direction)).sum(axis=1)
        arm = float(np.sqrt(patch.weights @ squares / patch.area))
        return _rotation(matrices, item, np.array(item.direction)), normal, centroid, arm
    if item.kind == "node":
        at = centroid if item.point is None else np.array(item.point)
        nearest = int(patch.nodes[first_largest(-np.linalg.norm(centroid + offsets - at, axis=1))])
        functional = np.zeros(matrices.size)
        functional[3 * nearest : 3 * nearest + 3] = item.direction
        return functional, normal, matrices.coordinates[nearest], 0.0
    functional = patch_average(matrices, item.facets, item.direction)
    if item.point is None:
        return functional, normal, centroid, 0.0
    # the rotation moves a point by (theta x offset) . direction = theta . (offset x direction)
    axis = np.cross(np.array(item.point) - centroid, item.direction)
    return functional + _rotation(matrices, item, axis), normal, np.array(item.point), 0.0


def _rotation(matrices: SystemMatrices, coordinate: InterfaceCoordinate, axis: np.ndarray) -> np.ndarray:
    """Return the functional (N,) of axis . theta, theta the rotation in a patch's best rigid motion.

    axis: (3,) of any length. Raises InterfaceError for nodes whose motion does not determine it.
    """
    patch, _, offsets = _around(matrices, coordinate.facets)
    length = np.abs(offsets).max() or 1.0
    root = np.sqrt(np.maximum(np.repeat(patch.weights, 3), 0.0))
    wanted = np.concatenate([np.zeros(3), axis])
    weighted = root[:, None] * rigid_motions(offsets / length)
    fit = wanted @ np.linalg.pinv(weighted, rcond=_DEPENDENT)
    if not np.allclose(fit @ weighted, wanted, atol=1e-6 * float(np.linalg.norm(axis))):
        raise InterfaceError(f"{coordinate.label}: the nodes of {coordinate.facets!r} have no rotation about that axis")
    functional = np.zeros((len(matrices.coordinates), 3))
    functional[patch.nodes] = (fit * root / length).reshape(-1, 3)
    return functional.ravel()


def _full_dofs(matrices: SystemMatrices, coordinates: Sequence[InterfaceCoordinate]) -> np.ndarray:
    """Return the sorted DOFs of all nodes of patches of kind "full", except at the supports."""
    full = {item.facets: item.label for item in coordinates if item.kind == "full"}
    nodes = np.unique(np.concatenate([np.empty(0, np.int64), *(matrices.patch(facets).nodes for facets in full)]))
    dofs = np.setdiff1d((3 * nodes[:, None] + np.arange(3)).ravel(), matrices.fixed)
    for item in coordinates:
        if item.kind == "rigid" and np.intersect1d(matrices.patch(item.facets).nodes, nodes).size:
            raise InterfaceError(f'{item.label}: the rigid patch {item.facets!r} shares nodes with one of kind "full"')
    return dofs


def _motions(matrices: SystemMatrices, rigid: Sequence[str | tuple[str, ...]]) -> sparse.csr_array:
    """Return columns for the free DOFs outside rigid patches, then for the motions that the patches can make.

    A single patch has up to six. Patches with common nodes have only motions in which these nodes move with both
    patches, such as the rotation about a common edge. Where a patch has nodes at the supports, these stay at rest.
    """
    free = np.zeros(matrices.size, dtype=bool)
    free[matrices.free] = True
    outside, count, blocks = free.copy(), np.zeros(matrices.size), []
    for facets in rigid:
        patch, _, offsets = _around(matrices, facets)
        dofs = (3 * patch.nodes[:, None] + np.arange(3)).ravel()
        outside[dofs] = False
        count[dofs] += 1.0
        basis = rigid_basis(offsets)
        columns = np.tile(np.arange(basis.shape[1]), len(dofs))
        shape = (matrices.size, basis.shape[1])
        blocks.append(sparse.csr_array((basis.ravel(), (np.repeat(dofs, basis.shape[1]), columns)), shape=shape))
    if np.any(count > 1.0) or np.any(count[~free]):
        blocks = [_joined(blocks, count, free)]
    others = np.flatnonzero(outside)
    identity = sparse.csr_array((np.ones(others.size), (others, np.arange(others.size))), (matrices.size, others.size))
    return sparse.csr_array(sparse.hstack([identity, *blocks]))


def _joined(blocks: Sequence[sparse.csr_array], count: np.ndarray, free: np.ndarray) -> sparse.csr_array:
    """Return the motions of rigid patches in which common nodes move with all of theirs, and supports not at all.

    blocks  (N, n_i) the rigid motions of each patch
    count   (N,) in how many patches a DOF is; free: (N,) whether it can move
    """
    every = sparse.csr_array(sparse.hstack(blocks))
    mean = sparse.csr_array(sparse.diags(free / np.maximum(count, 1.0)) @ every)
    tied = np.flatnonzero((count > 1.0) | (~free & (count > 0.0)))
    # every patch's motion of a tied DOF is the mean of the patches', zero at supports
    gaps, start = [], 0
    for block in blocks:
        motions = np.zeros((tied.size, every.shape[1]))
        motions[:, start : start + block.shape[1]] = block[tied].toarray()
        inside = motions.any(axis=1)
        gaps.append(motions[inside] - mean[tied[inside]].toarray())
        start += block.shape[1]
    _, singular, right = np.linalg.svd(np.linalg.qr(np.concatenate(gaps), mode="r"))
    compatible = right[np.count_nonzero(singular > _STRAIGHT * singular[0]) :].T
    return sparse.csr_array(mean @ compatible)


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


def _around(matrices: SystemMatrices, facets: str | Sequence[str]) -> tuple[Patch, np.ndarray, np.ndarray]:
    """Return a patch, its centroid (3,) and the positions of its nodes about that (k, 3), m."""
    patch = matrices.patch(facets)
    points = matrices.coordinates[patch.nodes]
    centroid = patch.weights @ points / patch.area
    return patch, centroid, points - centroid


def _check_independent(coordinates: Sequence[InterfaceCoordinate], vectors: np.ndarray, restricted: np.ndarray) -> None:
    lengths = np.linalg.norm(restricted, axis=0)
    for item, length, whole in zip(coordinates, lengths, np.linalg.norm(vectors, axis=0), strict=True):
        if length <= _DEPENDENT * whole:
            raise InterfaceError(f"{item.label}: cannot move, it lies on the supports")
    _, singular, right = np.linalg.svd(restricted / lengths, full_matrices=False)
    if singular[-1] < _DEPENDENT * singular[0]:
        involved = [item for item, share in zip(coordinates, right[-1], strict=True) if abs(share) > 1e-6]
        rigid = {str(item.facets): None for item in involved if item.kind == "rigid"}
        hint = (
            f', or take kind "average": the rigid patches {", ".join(rigid)} move as one where they have common nodes'
            if len(rigid) > 1
            else ""
        )
        labels = ", ".join(item.label for item in involved)
        raise InterfaceError(f"{labels}: linearly dependent displacements; drop one of them{hint}")
