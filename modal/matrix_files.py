"""System matrices from and for other codes, with nodes and sets as CSV.

A folder holds stiffness.mtx, mass.mtx, nodes.csv (node, x, y, z), sets.csv (set, node, weight) and fixed.csv (node,
components); the degrees of freedom are x, y, z of the nodes in the order of nodes.csv.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import io, sparse

from vanedamp.files.csv_input import csv_table
from vanedamp.files.foreign import existing
from vanedamp.files.formats.matrices.abaqus import GlobalMatrix
from vanedamp.files.formats.matrices.matlab import read_mat
from vanedamp.files.formats.matrices.registry import read_mtx, read_npz
from vanedamp.files.formats.matrices.table import read_table
from vanedamp.files.store import replacing, write_csv
from vanedamp.modal.algebra import symmetric_part
from vanedamp.modal.matrices import MatricesError, Patch, SystemMatrices

#: files that `write_folder` writes
FILES = ("stiffness.mtx", "mass.mtx", "nodes.csv", "sets.csv", "fixed.csv")
_COMPONENTS = "xyz"
_LETTERS = {"stiffness": "K", "mass": "M"}
_READERS: dict[str, Callable[[str], Any]] = {
    ".npz": read_npz, ".mtx": read_mtx, ".mat": read_mat, ".csv": read_table, ".sti": read_mtx, ".mas": read_mtx,
}  # fmt: skip
#: endings of CalculiX's matrices of the coordinates that its .dof file names
_CALCULIX = (".sti", ".mas")


def read_matrices(
    stiffness: str | os.PathLike[str],
    mass: str | os.PathLike[str],
    nodes: str | os.PathLike[str],
    sets: str | os.PathLike[str] | None = None,
    fixed: Mapping[str, str] | None = None,
    damping_ratio: float = 0.0,
    scale: float = 1.0,
    mass_scale: float = 1.0,
) -> SystemMatrices:
    """Read the matrices of another code.

    stiffness, mass  .mtx (Matrix Market, symmetric or general, or Abaqus), .npz (scipy.sparse.save_npz), .csv (dense),
                     .mat, or CalculiX's .sti and .mas with their .dof, N/m and kg; of a file with several matrices
                     the ones named stiffness and mass, or K and M
    nodes            CSV: node, x, y, z (m), in the order of the degrees of freedom; any whole numbers as labels, in
                     any order for CalculiX, and for Abaqus' matrices that name their nodes. Degrees of freedom that
                     CalculiX's .dof leaves out are held
    sets             CSV: set, node and perhaps weight (area, m^2); every set becomes a patch
    fixed            sets that are held, with their components: {"root": "xyz"}
    scale            metres per unit of length of the nodes: 1e-3 for mm
    mass_scale       kg per unit of mass, with seconds: 1e3 for matrices in t, N and mm; it multiplies both

    Raises MatricesError, with the file, for shapes that do not fit, one triangle only, unknown nodes or sets.
    """
    labels, coordinates = _nodes(Path(nodes))
    patches = {} if sets is None else _patches(Path(sets), labels)
    dofs = [np.empty(0, dtype=int)]
    for name, components in (fixed or {}).items():
        if name not in patches:
            raise MatricesError(f"{sets}: no set {name!r} to hold; there are: {', '.join(sorted(patches)) or 'none'}")
        dofs += [3 * patches[name].nodes + _component(sets, component) for component in components]
    fixed_dofs = np.concatenate(dofs)
    return _system(stiffness, mass, labels, coordinates, fixed_dofs, patches, damping_ratio, scale, mass_scale)


def read_folder(
    folder: str | os.PathLike[str], damping_ratio: float = 0.0, scale: float = 1.0, mass_scale: float = 1.0
) -> SystemMatrices:
    """Read a folder as `write_folder` writes it; scales as in `read_matrices`. Raises MatricesError."""
    home = Path(folder)
    labels, coordinates = _nodes(home / "nodes.csv")
    patches = _patches(home / "sets.csv", labels) if (home / "sets.csv").is_file() else {}
    fixed = np.empty(0, dtype=int)
    if (home / "fixed.csv").is_file():
        rows = _rows(home / "fixed.csv", ("node", "components"))
        dofs = [
            3 * _index(home / "fixed.csv", labels, node) + _component(home / "fixed.csv", component)
            for node, components in rows
            for component in components.strip()
        ]
        fixed = np.array(dofs, dtype=int)
    stiffness, mass = (_either(home, name) for name in ("stiffness", "mass"))
    return _system(stiffness, mass, labels, coordinates, fixed, patches, damping_ratio, scale, mass_scale)


def write_folder(matrices: SystemMatrices, folder: str | os.PathLike[str]) -> None:
    """Write the matrices for other codes; see the module's docstring. Nodes are numbered from 1."""
    home = Path(folder)
    home.mkdir(parents=True, exist_ok=True)
    for name, matrix in (("stiffness", matrices.stiffness), ("mass", matrices.mass)):
        # round-off of the assembly differs above and below the diagonal; a symmetric file holds one of them
        whole = sparse.coo_matrix(symmetric_part(matrix))
        with replacing(home / f"{name}.mtx") as temporary, temporary.open("wb") as stream:
            io.mmwrite(stream, whole, symmetry="symmetric", precision=17)
    nodes = [[index, *xyz] for index, xyz in enumerate(matrices.coordinates.tolist(), 1)]
    write_csv(home / "nodes.csv", ("node", "x", "y", "z"), nodes)
    entries = [
        [label, int(node) + 1, float(weight)]
        for label, patch in matrices.patches.items()
        for node, weight in zip(patch.nodes, patch.weights, strict=True)
    ]
    write_csv(home / "sets.csv", ("set", "node", "weight"), entries)
    components: dict[int, str] = {}
    for dof in matrices.fixed.tolist():
        components[dof // 3 + 1] = components.get(dof // 3 + 1, "") + _COMPONENTS[dof % 3]
    write_csv(home / "fixed.csv", ("node", "components"), [list(item) for item in components.items()])


def _system(
    stiffness: str | os.PathLike[str],
    mass: str | os.PathLike[str],
    labels: Mapping[int, int],
    coordinates: np.ndarray,
    fixed: np.ndarray,
    patches: dict[str, Patch],
    damping_ratio: float,
    scale: float,
    mass_scale: float,
) -> SystemMatrices:
    """Return the checked system in SI units."""
    provenance = {"stiffness": os.path.basename(stiffness), "mass": os.path.basename(mass)}
    loaded = {}
    for name, path in (("stiffness", stiffness), ("mass", mass)):
        matrix = _matrix(Path(path), name)
        if Path(path).suffix.lower() in _CALCULIX:
            matrix, missing = _placed(Path(path).with_suffix(".dof"), matrix, labels)
            fixed = np.union1d(fixed, missing)
        elif getattr(matrix, "freedoms", None) is not None:
            matrix = _by_node(Path(path), matrix, matrix.freedoms, labels)
        loaded[name] = matrix
        if matrix.shape != (coordinates.size, coordinates.size):
            raise MatricesError(
                f"{path}: shape {matrix.shape} for {len(coordinates)} nodes; expected "
                f"{(coordinates.size, coordinates.size)}, three degrees of freedom a node"
            )
        diagonal = matrix.diagonal()
        if diagonal.min(initial=0.0) < 0.0:
            dof = int(diagonal.argmin())
            raise MatricesError(
                f"{path}: degree of freedom {dof} has {diagonal[dof]:.3g} on the diagonal; check its sign"
            )
    system = SystemMatrices(
        **loaded,
        coordinates=coordinates,
        fixed=fixed,
        patches=patches,
        damping_ratio=damping_ratio,
        provenance=provenance,
    )
    for name, value in (("scale", scale), ("mass_scale", mass_scale)):
        if not (np.isfinite(value) and value > 0.0):
            raise MatricesError(f"{name}: expected a positive number, not {value}")
    return replace(
        system,
        stiffness=mass_scale * system.stiffness,
        mass=mass_scale * system.mass,
        coordinates=scale * system.coordinates,
    )


def _matrix(path: Path, name: str) -> sparse.csr_array:
    existing(path, MatricesError, "matrix file")
    if path.suffix.lower() not in _READERS:
        raise MatricesError(
            f"{path}: expected a matrix as .mtx (Matrix Market, Abaqus), .npz (scipy.sparse.save_npz), .mat (MATLAB), "
            ".csv, or .sti and .mas (CalculiX)"
        )
    try:
        content = _READERS[path.suffix.lower()](str(path))
        matrix = _named(path, name, content) if isinstance(content, dict) else content
        return matrix if isinstance(matrix, GlobalMatrix) else sparse.csr_array(matrix)
    except MatricesError:
        raise
    except Exception as error:  # the readers raise many types
        raise MatricesError(f"{path}: not a readable matrix ({error})") from error


def _placed(path: Path, matrix: sparse.csr_array, labels: Mapping[int, int]) -> tuple[sparse.csr_array, np.ndarray]:
    """Return a matrix over all degrees of freedom, and those missing in a .dof file (lines of node.direction)."""
    words = existing(path, MatricesError, "file of the matrix's coordinates").read_text(errors="replace").split()
    dofs = []
    for number, word in enumerate(words, 1):
        node, _, direction = word.partition(".")
        if direction not in ("1", "2", "3"):
            raise MatricesError(f"{path}: line {number}: expected node.direction with directions 1 to 3, not {word!r}")
        dofs.append(3 * _index(path, labels, node) + int(direction) - 1)
    if len(set(dofs)) < len(dofs) or matrix.shape != (len(dofs), len(dofs)):
        raise MatricesError(f"{path}: {len(set(dofs))} different coordinates for a matrix {matrix.shape}")
    entries, size = sparse.coo_array(matrix), 3 * len(labels)
    rows, columns = (np.array(dofs)[index] for index in (entries.row, entries.col))
    placed = sparse.csr_array((entries.data, (rows, columns)), shape=(size, size))
    return placed, np.setdiff1d(np.arange(size), dofs)


def _by_node(path: Path, matrix: GlobalMatrix, rows: np.ndarray, labels: Mapping[int, int]) -> sparse.csr_array:
    """Return a matrix in the order of the nodes; rows: node and freedom (n, 2) of its own."""
    nodes, freedoms = rows.T
    if np.any((freedoms < 1) | (freedoms > 3)):
        raise MatricesError(f"{path}: node {nodes[0]} has the freedom {max(freedoms)}; expected 1, 2 and 3")
    dofs = np.array([3 * _index(path, labels, str(node)) for node in nodes.tolist()]) + freedoms - 1
    if len(dofs) != 3 * len(labels):
        lost = next(label for label, index in labels.items() if 3 * index not in set(dofs.tolist()))
        raise MatricesError(f"{path}: the matrix has no node {lost}; give the nodes of the matrix only")
    entries = sparse.coo_array(matrix)
    return sparse.csr_array((entries.data, (dofs[entries.row], dofs[entries.col])), shape=matrix.shape)


def _named(path: Path, name: str, matrices: Mapping[str, Any]) -> Any:
    """Return the only matrix of a file, or the matrix with that name or letter."""
    names = [key for key in matrices if len(matrices) == 1 or key.lower() == name] or [
        key for key in matrices if key == _LETTERS[name]
    ]
    if len(names) != 1:
        raise MatricesError(
            f"{path}: expected one matrix, or one named {name} or {_LETTERS[name]}; there are: "
            f"{', '.join(matrices) or 'none'}"
        )
    return matrices[names[0]]


def _either(home: Path, name: str) -> Path:
    """Return the file of a matrix in a folder; .mtx where there is none."""
    return next((file for ending in _READERS if (file := home / f"{name}{ending}").is_file()), home / f"{name}.mtx")


def _nodes(path: Path) -> tuple[dict[int, int], np.ndarray]:
    rows = _rows(path, ("node", "x", "y", "z"))
    try:
        labels = [int(row[0]) for row in rows]
        coordinates = np.array([[float(word) for word in row[1:4]] for row in rows]).reshape(-1, 3)
    except ValueError as error:
        raise MatricesError(f"{path}: expected a whole number and three coordinates a line ({error})") from error
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise MatricesError(f"{path}: node {twice} occurs twice")
    return {label: index for index, label in enumerate(labels)}, coordinates


def _patches(path: Path, labels: dict[int, int]) -> dict[str, Patch]:
    members: dict[str, list[tuple[int, float]]] = {}
    for row in _rows(path, ("set", "node")):
        try:
            weight = float(row[2]) if len(row) > 2 else 1.0
        except ValueError as error:
            raise MatricesError(f"{path}: set {row[0]!r}: expected a weight, not {row[2]!r}") from error
        members.setdefault(row[0], []).append((_index(path, labels, row[1]), weight))
    try:
        return {
            name: Patch(np.array([node for node, _ in pairs]), np.array([weight for _, weight in pairs]))
            for name, pairs in members.items()
        }
    except MatricesError as error:
        raise MatricesError(f"{path}: {error}") from error


def _index(path: Path, labels: Mapping[int, int], word: str) -> int:
    if not word.strip().isdecimal() or int(word) not in labels:
        raise MatricesError(f"{path}: node {word!r} is not among the nodes")
    return labels[int(word)]


def _component(path: str | os.PathLike[str] | None, component: str) -> int:
    if component not in _COMPONENTS:
        raise MatricesError(f"{path}: expected components out of 'xyz', not {component!r}")
    return _COMPONENTS.index(component)


def _rows(path: Path, columns: tuple[str, ...]) -> list[list[str]]:
    """Return the lines of a CSV, without its header."""
    kind = f"file; expected the columns {', '.join(columns)}"
    rows = [words for _, words in csv_table(path, MatricesError, kind)]
    if rows and rows[0][0].lower() == columns[0]:
        rows = rows[1:]
    for number, row in enumerate(rows, start=1):
        if len(row) < len(columns):
            raise MatricesError(f"{path}: row {number} has {len(row)} columns; expected {', '.join(columns)}")
    return rows
