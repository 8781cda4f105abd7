"""SystemMatrices: stiffness and mass with labels, the border between finite elements and everything downstream.

Plain numpy and scipy: users of another FE code enter here with their own sparse matrices and node lists.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import numpy as np
from scipy import sparse

from vanedamp.files import store
from vanedamp.files.errors import LARGEST, VanedampError
from vanedamp.files.record import Array, Own, Record, SparseMatrix
from vanedamp.files.sparse_indices import SparseError, within_shape

# assembly adds the same numbers in another order above and below the diagonal
_ASYMMETRY = 1e-10


class MatricesError(VanedampError):
    """System matrices or a patch of them that do not fit together; the message names the field and the remedy."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A group of nodes and their weights in the patch.

    nodes    (k,) node indices, each once
    weights  (k,) m^2, integral of the node's shape function over the facet group; ones for nodes of edges and points
             and for a bare list
    normal   (3,) mean over the facets of the unit normal out of the material: of length one where they are plane, zero
             where they are closed or unknown
    """

    nodes: np.ndarray
    weights: np.ndarray
    normal: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        nodes, weights = store.frozen(self.nodes, np.int64), store.frozen(self.weights)
        normal = store.frozen(self.normal)
        if nodes.ndim != 1 or nodes.size == 0 or nodes.shape != weights.shape:
            raise MatricesError(
                f"patch: nodes {nodes.shape} and weights {weights.shape} must be lists of the same length, not empty"
            )
        if np.unique(nodes).size != nodes.size:
            raise MatricesError("patch: a node occurs twice; list every node once and add up its weights")
        if not np.all(np.isfinite(weights)) or weights.sum() <= 0.0:
            raise MatricesError(f"patch: weights must be finite with a positive sum (an area), not {weights.sum()}")
        if normal.shape != (3,) or not np.all(np.isfinite(normal)):
            raise MatricesError(f"patch: normal must be three numbers, not {self.normal}")
        for name, value in (("nodes", nodes), ("weights", weights), ("normal", normal)):
            object.__setattr__(self, name, value)

    @property
    def area(self) -> float:
        """Sum of the weights, m^2 (the number of nodes for a bare list)."""
        return float(self.weights.sum())


def _patch_variables(patches: Mapping[str, Patch]) -> dict[str, store.Variable]:
    """Return patches as variables of a file."""
    values = list(patches.values())
    return {
        "patch": store.Variable(np.array(list(patches), dtype=object), ("patch",)),
        "patch_offset": store.Variable(np.cumsum([0] + [patch.nodes.size for patch in values]), ("patch_edge",)),
        "patch_nodes": store.Variable(
            np.concatenate([np.empty(0, np.int64), *(patch.nodes for patch in values)]), ("patch_entry",)
        ),
        "patch_weights": store.Variable(
            np.concatenate([np.empty(0), *(patch.weights for patch in values)]), ("patch_entry",), "m^2"
        ),
        "patch_normal": store.Variable(np.reshape([patch.normal for patch in values], (-1, 3)), ("patch", "axis")),
    }


def _patches_of(values: Mapping[str, Any]) -> dict[str, Patch]:
    """Return the patches in the variables of a file."""
    offsets = values["patch_offset"]
    normals = values.get("patch_normal", np.zeros((len(offsets) - 1, 3)))
    return {
        str(label): Patch(values["patch_nodes"][start:stop], values["patch_weights"][start:stop], normal)
        for label, start, stop, normal in zip(values["patch"], offsets[:-1], offsets[1:], normals, strict=True)
    }


@dataclass(frozen=True, eq=False, repr=False)
class SystemMatrices(Record):
    """Unconstrained finite element matrices in displacement DOFs, dof = 3 * node + component, N = 3 * n_nodes."""

    KIND: ClassVar[str] = "system-matrices"
    stiffness: Annotated[sparse.csr_array, SparseMatrix("N/m")]
    """(N, N), symmetric"""
    mass: Annotated[sparse.csr_array, SparseMatrix("kg")]
    """(N, N), symmetric"""
    coordinates: Annotated[np.ndarray, Array(("node", "axis"), "m")]
    """of the nodes"""
    fixed: Annotated[np.ndarray, Array(("fixed_dof",), dtype=np.int64)]
    """sorted indices of the DOFs that the supports hold at zero"""
    patches: Annotated[Mapping[str, Patch], Own(_patch_variables, _patches_of)]
    """by label: in files `patch`, whose `patch_nodes` and `patch_weights` begin at its `patch_offset`"""
    damping_ratio: float
    """modal damping ratio of every mode"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """where the numbers come from: mesh hash, versions, parameters (JSON-able)"""
    vertices: Annotated[sparse.csr_array | None, Own()] = None
    """(n_nodes, n_vertices) linear shape functions of the mesh's vertices at the nodes, of elements of a higher degree,
    for the iterative solver; None: unknown, as after `load`"""

    def __post_init__(self) -> None:
        coordinates = store.frozen(self.coordinates)
        if coordinates.ndim != 2 or coordinates.shape[1] != 3:
            raise MatricesError(f"coordinates: expected shape (n_nodes, 3), not {coordinates.shape}")
        size = coordinates.size
        values = {
            "coordinates": coordinates,
            "stiffness": _symmetric("stiffness", self.stiffness, size),
            "mass": _symmetric("mass", self.mass, size),
            "fixed": store.frozen(np.unique(self.fixed), np.int64),
            "patches": dict(self.patches),
            "provenance": dict(self.provenance),
            "damping_ratio": float(self.damping_ratio),
        }
        _check_range("fixed", values["fixed"], size, "DOFs")
        for label, patch in self.patches.items():
            _check_range(f"patch {label}", patch.nodes, len(coordinates), "nodes")
        if self.vertices is not None and self.vertices.shape[0] != len(coordinates):
            raise MatricesError(f"vertices: expected one row for each of {len(coordinates)} nodes")
        if not 0.0 <= self.damping_ratio < 1.0:
            raise MatricesError(f"damping_ratio: expected 0 <= ratio < 1, not {self.damping_ratio}")
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def size(self) -> int:
        """Number of DOFs N, fixed ones included."""
        return int(self.coordinates.size)

    @property
    def free(self) -> np.ndarray:
        """(N - n_fixed,) sorted indices of the DOFs that can move."""
        mask = np.ones(self.size, dtype=bool)
        mask[self.fixed] = False
        return np.flatnonzero(mask)

    def of_free(self, matrix: sparse.csr_array) -> sparse.csr_array:
        """Return the rows and columns of a matrix (N, N) that belong to the free DOFs."""
        return matrix[self.free][:, self.free]

    def rigid_translations(self) -> np.ndarray:
        """Return unit translations (N, 3) of every DOF along x, y and z."""
        return np.tile(np.eye(3), (len(self.coordinates), 1))

    @property
    def total_mass(self) -> float:
        """Mass of the whole structure, supports included, kg."""
        translations = self.rigid_translations()
        return float(np.einsum("ij,ij->", translations, self.mass @ translations) / 3.0)

    def movable_translations(self) -> np.ndarray:
        """Return unit translations (N, 3) of the free DOFs, zero at the fixed ones."""
        translations = self.rigid_translations()
        translations[self.fixed] = 0.0
        return translations

    @property
    def movable_mass(self) -> np.ndarray:
        """Mass (3,) along x, y and z, kg: r^T M r of the free DOFs, the sum of the effective masses of all modes.

        Less than the total mass by the part of the elements at the supports that their fixed nodes carry.
        """
        translations = self.movable_translations()
        return np.einsum("ij,ij->j", translations, self.mass @ translations)

    def patch(self, label: str | Sequence[str]) -> Patch:
        """Return the patch of that label, or of several as one. Raises MatricesError with the labels that exist."""
        if not isinstance(label, str):
            return _merged([self.patch(name) for name in label])
        if label not in self.patches:
            raise MatricesError(f"no patch {label!r}; there are: {', '.join(sorted(self.patches)) or 'none'}")
        return self.patches[label]


def _merged(patches: Sequence[Patch]) -> Patch:
    """Return several patches as one; a common node has the sum of its weights."""
    if not patches:
        raise MatricesError("patch: no label; name at least one")
    nodes, indices = np.unique(np.concatenate([patch.nodes for patch in patches]), return_inverse=True)
    weights = np.bincount(indices, np.concatenate([patch.weights for patch in patches]))
    areas = np.array([patch.area for patch in patches])
    return Patch(nodes, weights, areas @ [patch.normal for patch in patches] / areas.sum())


def unit_direction(direction: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the direction (3,) scaled to length one. Raises MatricesError for a wrong shape or no length."""
    vector = np.asarray(direction, dtype=float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)) or not np.any(vector):
        raise MatricesError(f"direction: expected three numbers, not all zero, such as [0, 1, 0]; not {direction}")
    return vector / np.linalg.norm(vector)


def patch_average(
    matrices: SystemMatrices, patch_label: str | Sequence[str], direction: Sequence[float] | np.ndarray
) -> np.ndarray:
    """Return the functional w (N,) of the area-averaged displacement of a patch along a direction (of any length).

    w^T q = sum(weights * (q . direction)) / sum(weights). Raises MatricesError for an unknown patch or no direction.
    """
    patch = matrices.patch(patch_label)
    functional = np.zeros((len(matrices.coordinates), 3))
    functional[patch.nodes] = np.outer(patch.weights / patch.area, unit_direction(direction))
    return functional.ravel()


def _symmetric(name: str, matrix: Any, size: int) -> sparse.csr_array:
    """Return a canonical read-only CSR copy of a symmetric matrix."""
    if np.iscomplexobj(matrix):
        raise MatricesError(
            f"{name}: complex; expected a real matrix, the damping as damping_ratio (half a loss factor)"
        )
    try:
        copy = sparse.csr_array(within_shape(matrix), dtype=float, copy=True)
    except SparseError as error:
        raise MatricesError(f"{name}: {error}") from error
    if copy.shape != (size, size):
        raise MatricesError(
            f"{name}: shape {copy.shape} does not fit {size // 3} nodes of three DOFs each, expected {(size, size)}"
        )
    copy.sum_duplicates()
    largest = abs(copy.data).max(initial=0.0)
    if not np.isfinite(largest):
        raise MatricesError(f"{name}: holds entries that are not finite")
    if largest > LARGEST:
        raise MatricesError(f"{name}: has an entry of {largest:.3g}; expected up to {LARGEST:g} in SI units")
    # entries that differ make products differ; the transpose as a matrix would take several times the memory
    rows = np.random.default_rng(0).standard_normal((size, 3))
    if abs(copy @ rows - copy.T @ rows).max(initial=0.0) > _ASYMMETRY * largest:
        raise MatricesError(
            f"{name}: not symmetric; if only one triangle is stored, add the transpose of its strict part"
        )
    for array in (copy.data, copy.indices, copy.indptr):
        array.setflags(write=False)
    return copy


def _check_range(what: str, indices: np.ndarray, size: int, unit: str) -> None:
    if indices.size and (indices.min() < 0 or indices.max() >= size):
        raise MatricesError(f"{what}: indices {indices.min()}..{indices.max()} out of range, there are {size} {unit}")
