"""SystemMatrices: stiffness and mass with labels, the border between finite elements and everything downstream.

Plain numpy and scipy: users of another FE code enter here with their own sparse matrices and node lists.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from scipy import sparse

from vanedamp.files import store
from vanedamp.files.display import Displayed
from vanedamp.files.errors import LARGEST, VanedampError
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


@dataclass(frozen=True, eq=False, repr=False)
class SystemMatrices(Displayed):
    """Unconstrained finite element matrices in displacement DOFs, dof = 3 * node + component, N = 3 * n_nodes.

    stiffness      (N, N) symmetric CSR, N/m
    mass           (N, N) symmetric CSR, kg
    coordinates    (n_nodes, 3) m
    fixed          (n_fixed,) sorted indices of the DOFs that the supports hold at zero
    patches        label -> Patch
    damping_ratio  modal damping ratio of every mode
    provenance     where the numbers come from: mesh hash, versions, parameters (JSON-able)
    vertices       (n_nodes, n_vertices) linear shape functions of the mesh's vertices at the nodes, of elements of a
                   higher degree, for the iterative solver; None: unknown, as after `load`
    """

    KIND: ClassVar[str] = "system-matrices"
    stiffness: sparse.csr_array
    mass: sparse.csr_array
    coordinates: np.ndarray
    fixed: np.ndarray
    patches: Mapping[str, Patch]
    damping_ratio: float
    provenance: Mapping[str, Any] = field(default_factory=dict)
    vertices: sparse.csr_array | None = None

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
            return _merged([self.patch(one) for one in label])
        if label not in self.patches:
            raise MatricesError(f"no patch {label!r}; there are: {', '.join(sorted(self.patches)) or 'none'}")
        return self.patches[label]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write an HDF5 record."""
        patches = list(self.patches.values())
        offsets = np.cumsum([0] + [patch.nodes.size for patch in patches])
        nodes = np.concatenate([np.empty(0, np.int64), *(patch.nodes for patch in patches)])
        weights = np.concatenate([np.empty(0), *(patch.weights for patch in patches)])
        variables = {
            "coordinates": store.Variable(self.coordinates, ("node", "axis"), "m"),
            "fixed": store.Variable(self.fixed, ("fixed_dof",)),
            "patch": store.Variable(np.array(list(self.patches), dtype=object), ("patch",)),
            "patch_offset": store.Variable(offsets, ("patch_edge",)),
            "patch_nodes": store.Variable(nodes, ("patch_entry",)),
            "patch_weights": store.Variable(weights, ("patch_entry",), "m^2"),
            "patch_normal": store.Variable(np.reshape([patch.normal for patch in patches], (-1, 3)), ("patch", "axis")),
        }
        for name, matrix, units in (("stiffness", self.stiffness, "N/m"), ("mass", self.mass, "kg")):
            variables[name] = store.Variable(matrix.data, (f"{name}_entry",), units)
            variables[f"{name}_column"] = store.Variable(matrix.indices, (f"{name}_entry",))
            variables[f"{name}_row_start"] = store.Variable(matrix.indptr, ("row_edge",))
        store.save(
            path, self.KIND, variables, {"damping_ratio": self.damping_ratio, "provenance": dict(self.provenance)}
        )

    @classmethod
    @store.reader
    def load(cls, path: str | os.PathLike[str]) -> SystemMatrices:
        """Read the record that `save` wrote. Raises files.store.StoreError."""
        values, attributes = store.load(path, cls.KIND)
        offsets = values["patch_offset"]
        normals = values.get("patch_normal", np.zeros((len(offsets) - 1, 3)))
        patches = {
            str(label): Patch(values["patch_nodes"][start:stop], values["patch_weights"][start:stop], normal)
            for label, start, stop, normal in zip(values["patch"], offsets[:-1], offsets[1:], normals, strict=True)
        }
        size = values["coordinates"].size
        found = {
            name: sparse.csr_array((values[name], values[f"{name}_column"], values[f"{name}_row_start"]), (size, size))
            for name in ("stiffness", "mass")
        }
        return cls(
            **found,
            coordinates=values["coordinates"],
            fixed=values["fixed"],
            patches=patches,
            damping_ratio=attributes["damping_ratio"],
            provenance=json.loads(attributes["provenance"]),
        )


def _merged(patches: Sequence[Patch]) -> Patch:
    """Return several patches as one; a common node has the sum of its weights."""
    if not patches:
        raise MatricesError("patch: no label; name at least one")
    nodes, places = np.unique(np.concatenate([patch.nodes for patch in patches]), return_inverse=True)
    weights = np.bincount(places, np.concatenate([patch.weights for patch in patches]))
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
