"""The only file that uses dolfinx's API, from 0.5.2 to 0.11, in serial.

Differences between the versions are settled here; the rest of the package sees meshes with named groups, and UFL forms
that become scipy matrices.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import inspect
import logging
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.files.errors import VanedampError
from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.modal import gmsh_on_demand as gmsh
from vanedamp.modal import msh
from vanedamp.modal.stack import loading

with loading():
    import cffi
    import dolfinx
    import dolfinx.fem.petsc
    import dolfinx.io
    import dolfinx.mesh
    import dolfinx.plot
    import petsc4py
    import ufl
    from dolfinx import fem
    from mpi4py import MPI

    try:
        gmshio: Any = importlib.import_module("dolfinx.io.gmsh")
    except ModuleNotFoundError:  # its name before 0.10
        gmshio = importlib.import_module("dolfinx.io.gmshio")

_UNNAMED = "unnamed"


class CompilerError(VanedampError):
    """A machine on which no form can be compiled; the message names the missing part."""


@dataclass(frozen=True, eq=False)
class Domain:
    """A tetrahedral or hexahedral mesh with named groups.

    mesh           dolfinx.mesh.Mesh, metres
    volumes        volume group name -> cell indices; cells outside every group are in the group "unnamed"
    facets         facet group name -> indices of boundary facets
    edges, points  groups of element edges and of vertices: name -> their indices, except on facets of that name
    path, sha256   the file and the hash of its bytes, including the files that it includes
    """

    mesh: Any
    volumes: Mapping[str, np.ndarray]
    facets: Mapping[str, np.ndarray]
    edges: Mapping[str, np.ndarray]
    points: Mapping[str, np.ndarray]
    path: str
    sha256: str

    @property
    def groups(self) -> dict[str, list[tuple[int, np.ndarray]]]:
        """Name -> (dimension, indices) of the entities that supports and interfaces can act on.

        A name means the facets, edges and points of that name together.
        """
        entities_of: dict[str, list[tuple[int, np.ndarray]]] = {}
        for dimension, groups in ((2, self.facets), (1, self.edges), (0, self.points)):
            for name, entities in groups.items():
                entities_of.setdefault(name, []).append((dimension, entities))
        return entities_of

    def group(self, name: str) -> list[tuple[int, np.ndarray]]:
        """Return one of `groups`. Raises MeshError with the existing groups by kind."""
        if name not in self.groups:
            kinds = {"edge": self.edges, "point": self.points}
            lower = "".join(f"; {kind} groups: {', '.join(sorted(names))}" for kind, names in kinds.items() if names)
            raise self._no_facets(name, lower)
        return self.groups[name]

    def facet_group(self, name: str) -> np.ndarray:
        """Return the facet indices of a group. Raises MeshError with the groups that exist, and for other members."""
        if name not in self.facets:
            raise self._no_facets(name)
        if len(self.groups[name]) > 1:
            raise MeshError(
                f"{self.path}: group {name!r} holds edges or points besides its facets; take them out of it"
            )
        return self.facets[name]

    def _no_facets(self, name: str, others: str = "") -> MeshError:
        names = ", ".join(sorted(self.facets)) or "none"
        return MeshError(f"{self.path}: no facet group {name!r}; there are: {names}{others}")


def versions() -> dict[str, str]:
    """Return the versions of the libraries behind this file, for provenance."""
    return {"dolfinx": dolfinx.__version__, "petsc4py": petsc4py.__version__, "gmsh": gmsh.__version__}


def read(path: str | os.PathLike[str], scale: float = 1.0, source: Sequence[str | os.PathLike[str]] = ()) -> Domain:
    """Read a gmsh mesh, `scale` metres its unit of length.

    source: the user's file of which it is a copy, and the files that this includes; they name it in results and errors.

    Raises MeshError: no file, not a mesh, no or mixed volume elements, inverted elements, loose parts, overlapping
    groups.
    """
    files = [Path(file) for file in source or [path]]
    file, sha256 = (
        files[0],
        hashlib.sha256(b"".join(item.read_bytes() for item in files if item.is_file())).hexdigest(),
    )
    with msh.session("read"):
        msh.merge(Path(path))
        try:
            _prepare_groups()
            lines, nodes = msh.taken(1), msh.taken(0)
            names = {dimension: msh.groups(dimension) for dimension in (2, 3)}
            with _compiling():
                # three fields up to 0.9, more after them since
                mesh, cells, tags = gmshio.model_to_mesh(gmsh.model, MPI.COMM_SELF, 0, gdim=3)[:3]
            mesh.geometry.x[:] *= scale
            edges, points = _lower_groups(mesh, lines, nodes)
            facets = _members(tags, names[2])
            _check_boundary(mesh.topology, facets)
            edges, points = (_beyond(mesh.topology, facets, groups, d) for d, groups in ((1, edges), (0, points)))
        except MeshError as error:
            raise MeshError(f"{file}: {error}") from error
    return Domain(mesh, _members(cells, names[3]), facets, edges, points, str(file), sha256)


def vector_space(mesh: Any, degree: int) -> Any:
    """Return the continuous Lagrange displacements of a degree on a dolfinx mesh, three components per node."""
    with _compiling():
        if hasattr(fem, "functionspace"):
            return fem.functionspace(mesh, ("Lagrange", degree, (3,)))
        return fem.VectorFunctionSpace(mesh, ("Lagrange", degree))


def discontinuous_space(domain: Domain, degree: int) -> Any:
    """Return the scalar polynomials of a degree in every cell, without continuity."""
    family = "DQ" if domain.mesh.topology.cell_name() == "hexahedron" else "DG"
    with _compiling():
        create = getattr(fem, "functionspace", None) or fem.FunctionSpace
        return create(domain.mesh, (family, degree))


def cell_constants(domain: Domain, values: Mapping[str, float]) -> Any:
    """Return a function that is constant in every cell, its value given by volume group."""
    function = fem.Function(discontinuous_space(domain, 0))
    dofs = _cell_dofs(function.function_space)
    for name, value in values.items():
        function.x.array[dofs[domain.volumes[name]]] = value
    return function


def cell_functions(domain: Domain, values: Callable[[str, np.ndarray], np.ndarray]) -> Any:
    """Return a function that is linear in every cell, with values (n,) by volume group and points (n, 3), m."""
    space = discontinuous_space(domain, 1)
    function = fem.Function(space)
    points = node_coordinates(space)
    dofs = _cell_dofs(space)
    for name, cells in domain.volumes.items():
        inside = dofs[cells].ravel()
        function.x.array[inside] = values(name, points[inside])
    return function


def field(space: Any, values: np.ndarray | float) -> Any:
    """Return a function from the values of its DOFs, or one for all."""
    function = fem.Function(space)
    function.x.array[:] = values
    return function


def node_coordinates(space: Any) -> np.ndarray:
    """Return the coordinates (n_nodes, 3), m, in the order of the DOF blocks."""
    return np.array(space.tabulate_dof_coordinates())


def linear_shapes(points: np.ndarray, corners: int) -> np.ndarray:
    """Return the linear shape functions (n, corners) of a tetrahedron (4) or hexahedron (8) at its points (n, 3)."""
    if corners == 4:
        return np.column_stack([1.0 - points.sum(axis=1), points])
    # the first coordinate changes the fastest from vertex to vertex
    x, y, z = (np.column_stack([1.0 - points[:, axis], points[:, axis]]) for axis in range(3))
    return np.asarray(np.einsum("nk,nj,ni->nkji", z, y, x).reshape(len(points), -1))


def vertex_weights(space: Any) -> sparse.csr_array:
    """Return the linear shape functions of the vertices at the nodes, (n_nodes, n_vertices)."""
    topology = space.mesh.topology
    points = space.element.interpolation_points
    points = np.asarray(points() if callable(points) else points)
    shapes = linear_shapes(points, 4 if topology.cell_name() == "tetrahedron" else 8)
    nodes = _cell_dofs(space)
    topology.create_connectivity(3, 0)
    corners = _array(topology.connectivity(3, 0)).reshape(len(nodes), -1)
    # every node from one of the cells that it is in
    _, first = np.unique(nodes, return_index=True)
    cells, local = np.divmod(first, nodes.shape[1])
    starts = corners.shape[1] * np.arange(first.size + 1)
    size = (first.size, topology.index_map(0).size_local)
    weights = sparse.csr_array((shapes[local].ravel(), corners[cells].ravel(), starts), shape=size)
    weights.data[np.abs(weights.data) < 1e-12] = 0.0
    weights.eliminate_zeros()
    return weights


def group_nodes(space: Any, entities: np.ndarray, dimension: int = 2) -> np.ndarray:
    """Return the sorted indices of the nodes on facets (dimension 2), edges (1) or vertices (0)."""
    space.mesh.topology.create_connectivity(dimension, 3)
    return np.sort(fem.locate_dofs_topological(space, dimension, entities))


def matrix(form: Any) -> sparse.csr_array:
    """Assemble a bilinear UFL form, without boundary conditions, to CSR without stored zeros."""
    with _compiling():
        compiled = fem.form(form)
    assembled = fem.petsc.assemble_matrix(compiled)
    try:
        assembled.assemble()
        row_start, columns, values = assembled.getValuesCSR()
        result = sparse.csr_array((values, columns, row_start), shape=assembled.getSize())
    finally:
        assembled.destroy()
    result.eliminate_zeros()
    return result


def vector(form: Any) -> np.ndarray:
    """Assemble a linear UFL form, without boundary conditions."""
    with _compiling():
        compiled = fem.form(form)
    return np.array(fem.assemble_vector(compiled).array)


def over(domain: Domain, dimension: int, entities: np.ndarray) -> Any:
    """Return the UFL measure of the integral over boundary facets (dimension 2) or cells (3)."""
    # one tag value for all groups, so that one compiled form serves them all
    tags = dolfinx.mesh.meshtags(domain.mesh, dimension, entities, np.ones_like(entities))
    return ufl.Measure({2: "ds", 3: "dx"}[dimension], domain=domain.mesh, subdomain_data=tags)(1)


def constant(domain: Domain, values: float | Sequence[float]) -> Any:
    """Return a number or vector in UFL whose value is no part of the compiled form."""
    return fem.Constant(domain.mesh, np.array(values, dtype=float))


def facet_weights(domain: Domain, space: Any, facets: np.ndarray) -> np.ndarray:
    """Return the integral (n_nodes,), m^2, of every nodal shape function over the facets."""
    along_x = constant(domain, [1.0, 0.0, 0.0])
    return vector(ufl.inner(along_x, ufl.TestFunction(space)) * over(domain, 2, facets)).reshape(-1, 3)[:, 0]


def facet_normal(domain: Domain, facets: np.ndarray) -> np.ndarray:
    """Return the integral (3,), m^2, of the outward unit normal over boundary facets."""
    axis = constant(domain, [1.0, 0.0, 0.0])
    with _compiling():
        compiled = fem.form(ufl.inner(axis, ufl.FacetNormal(domain.mesh)) * over(domain, 2, facets))
    normal = np.empty(3)
    for i, unit in enumerate(np.eye(3)):
        axis.value[:] = unit
        normal[i] = fem.assemble_scalar(compiled)
    return normal


def sampler(expression: Any, mesh: Any, points: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """Return a call that gives the values (cells, points, size) of a UFL expression at points of the reference cell.

    It takes cells (int32), and the functions in the expression as they are when it is called.
    """
    with _compiling():
        compiled: Any = fem.Expression(expression, points)
    # the mesh is an argument since 0.7
    of_mesh = () if "cells" in inspect.signature(compiled.eval).parameters else (mesh,)

    def values(cells: np.ndarray) -> np.ndarray:
        return np.array(compiled.eval(*of_mesh, cells)).reshape(len(cells), len(points), -1)

    return values


def corners(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices (cells, k) of every cell, and their coordinates (n, 3), m."""
    topology = mesh.topology
    topology.create_connectivity(3, 0)
    cells = topology.index_map(3).size_local
    vertices = _array(topology.connectivity(3, 0)).reshape(cells, -1)
    coordinates = np.empty((topology.index_map(0).size_local, 3))
    coordinates[vertices] = mesh.geometry.x[_corner_nodes(mesh, *vertices.shape)]
    return vertices, coordinates


def write_fields(space: Any, fields: Mapping[str, np.ndarray], path: str | os.PathLike[str]) -> None:
    """Write named displacement fields at the nodes of the mesh, as XDMF."""
    # XDMF carries one set of nodes
    geometry = space.mesh.geometry
    coordinate_map = geometry.cmaps[0] if hasattr(geometry, "cmaps") else geometry.cmap
    at_nodes = vector_space(space.mesh, coordinate_map.degree)
    with dolfinx.io.XDMFFile(MPI.COMM_SELF, os.fspath(path), "w") as file:
        file.write_mesh(space.mesh)
        for name, values in fields.items():
            function = fem.Function(at_nodes)
            function.interpolate(field(space, values))
            function.name = name
            file.write_function(function)


def vtk_mesh(space: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return cells, VTK cell types and points of the nodes of a space, as pyvista.UnstructuredGrid takes them."""
    create = getattr(dolfinx.plot, "vtk_mesh", None) or dolfinx.plot.create_vtk_mesh
    cells, types, points = create(space)
    return np.asarray(cells), np.asarray(types), np.asarray(points)


def _prepare_groups() -> None:
    """Reject faults that dolfinx's reader does not report, and bring the model to a form that every version reads."""
    _check_kinds()
    grouped = {
        entity for tag in msh.groups(3).values() for entity in gmsh.model.getEntitiesForPhysicalGroup(3, tag).tolist()
    }
    ungrouped = [tag for _, tag in gmsh.model.getEntities(3) if tag not in grouped]
    if ungrouped:
        gmsh.model.addPhysicalGroup(3, ungrouped, name=_UNNAMED)
    msh.check_elements()
    msh.drop_strays()
    gmsh.model.mesh.renumberNodes()


def _check_kinds() -> None:
    """Raise MeshError unless the current model holds volume elements of one kind, with facets of the same order."""
    kinds = gmsh.model.mesh.getElementTypes(3)
    if len(kinds) == 0:
        raise MeshError("no volume elements; mesh the volumes and save them (a volume outside all groups is not saved)")
    if len(kinds) > 1:
        names = ", ".join(gmsh.model.mesh.getElementProperties(kind)[0] for kind in kinds)
        raise MeshError(f"mixed volume elements ({names}); use one kind, tetrahedra or hexahedra")
    order = gmsh.model.mesh.getElementProperties(kinds[0])[2]
    for kind in gmsh.model.mesh.getElementTypes(2):
        if gmsh.model.mesh.getElementProperties(kind)[2] != order:
            raise MeshError(f"facets are not of the volume elements' order {order}; set the order of the whole mesh")


def _cell_dofs(space: Any) -> np.ndarray:
    """Return the DOFs (cells, k) of every cell."""
    return _array(space.dofmap.list).reshape(space.mesh.topology.index_map(3).size_local, -1)


def _members(tags: Any, names: Mapping[str, int]) -> dict[str, np.ndarray]:
    if tags is None:
        return {}
    return {name: np.sort(tags.indices[tags.values == tag]).astype(np.int32) for name, tag in names.items()}


def _lower_groups(
    mesh: Any, lines: Mapping[str, np.ndarray], nodes: Mapping[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return edges and vertices of groups from their gmsh nodes, by the numbers that the mesh keeps of its input."""
    topology, geometry = mesh.topology, mesh.geometry
    if not (lines or nodes):
        return {}, {}
    for dimension in (0, 1):
        topology.create_entities(dimension)
        topology.create_connectivity(dimension, 3)
    topology.create_connectivity(3, 0)
    topology.create_connectivity(1, 0)
    cells = _array(topology.connectivity(3, 0))
    count = topology.index_map(3).size_local
    corners = _corner_nodes(mesh, count, cells.size // count).ravel()
    tags = np.empty(topology.index_map(0).size_local, dtype=np.int64)
    tags[cells] = np.asarray(geometry.input_global_indices)[corners] + 1
    ends = tags[_array(topology.connectivity(1, 0)).reshape(-1, 2)]
    return (
        {name: _indices(ends, group, "edge", name) for name, group in lines.items()},
        {name: _indices(tags[:, None], group, "point", name) for name, group in nodes.items()},
    )


def _corner_nodes(mesh: Any, cells: int, corners: int) -> np.ndarray:
    """Return the nodes of the geometry at the corners of every cell, (cells, corners)."""
    geometry = mesh.geometry
    # one for every kind of cell since 0.11
    of_cells = geometry.dofmaps[0] if hasattr(geometry, "dofmaps") else geometry.dofmap
    # the vertices come first among the nodes of a cell, in the same order
    return _array(of_cells).reshape(cells, -1)[:, :corners]


def _indices(entities: np.ndarray, wanted: np.ndarray, kind: str, name: str) -> np.ndarray:
    """Return the indices (int32) of wanted entities, rows of gmsh nodes. Raises MeshError for a missing one."""
    width = int(max(entities.max(), wanted.max())) + 1
    keys, asked = (np.sort(rows, axis=1) @ width ** np.arange(rows.shape[1])[::-1] for rows in (entities, wanted))
    order = np.argsort(keys)
    positions = np.minimum(np.searchsorted(keys, asked, sorter=order), keys.size - 1)
    if np.any(keys[order[positions]] != asked):
        what = "an edge" if kind == "edge" else "a corner"
        raise MeshError(f"{kind} group {name!r} holds what is not {what} of a volume element; mesh it with the volumes")
    return np.unique(order[positions]).astype(np.int32)


def _beyond(
    topology: Any, facets: Mapping[str, np.ndarray], lower: Mapping[str, np.ndarray], dimension: int
) -> dict[str, np.ndarray]:
    """Return groups of edges (dimension 1) or vertices (0), except those on facets of the same name."""
    remaining = {}
    for name, entities in lower.items():
        if name in facets:
            topology.create_connectivity(2, dimension)
            links = topology.connectivity(2, dimension)
            entities = np.setdiff1d(entities, np.concatenate([links.links(facet) for facet in facets[name]]))
        if entities.size:
            remaining[name] = entities
    return remaining


def _check_boundary(topology: Any, groups: Mapping[str, np.ndarray]) -> None:
    topology.create_connectivity(2, 3)
    neighbours = np.diff(topology.connectivity(2, 3).offsets)
    for name, facets in groups.items():
        if facets.size == 0 or np.any(neighbours[facets] != 1):
            raise MeshError(
                f"facet group {name!r} is not on the boundary of the meshed volumes; interfaces and supports act on "
                "outer faces"
            )


def _array(adjacency: Any) -> np.ndarray:
    return np.asarray(getattr(adjacency, "array", adjacency)).ravel()


@contextlib.contextmanager
def _compiling() -> Iterator[None]:
    """Silence the form compiler: its log, at INFO of the root logger, and its advice to take fewer points in a cell.

    Raises CompilerError.
    """
    before = logging.root.manager.disable
    logging.disable(max(before, logging.INFO))
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Number of integration points", UserWarning)
            yield
    except cffi.VerificationError as error:
        raise CompilerError(
            f"the finite elements' forms cannot be compiled ({shorten(str(error), 100)}); they need a C compiler and "
            "Python's headers: apt install gcc libc6-dev python3-dev"
        ) from None
    finally:
        logging.disable(before)
