"""A parametric vane cluster: outer shroud, airfoils, and an inner shroud with cavities for damper bodies.

The machine's axis is x. The cluster is centred on the z axis: there z is radial and y tangential, so that a bending of
the airfoils moves the inner shroud along y. The casing holds the outer shroud on its outer surface.
"""

from __future__ import annotations

import os
from pathlib import Path

from vanedamp.meshes.cluster_geometry import facets, solids
from vanedamp.meshes.parameters import ParameterError, VaneCluster
from vanedamp.modal import gmsh_on_demand as gmsh
from vanedamp.modal import msh

__all__ = ["SHIPPED", "ParameterError", "VaneCluster", "build"]

SHIPPED = Path(__file__).with_name("vane_cluster.msh")


def build(parameters: VaneCluster, path: str | os.PathLike[str]) -> Path:
    """Mesh the cluster and write it as gmsh 4.1 text. Returns the path.

    Raises ParameterError for a geometry that does not come out as it should, MeshError when groups overlap and
    files.store.StoreError when there is no folder to write to.
    """
    if Path(path).suffix != ".msh":
        raise ParameterError(f"path: expected a file name ending in .msh, not {path}")
    with msh.session("vane_cluster"):
        volumes = solids(parameters)
        for name, tags in volumes.items():
            gmsh.model.addPhysicalGroup(3, tags, name=name)
        for name, tags in facets(parameters).items():
            gmsh.model.addPhysicalGroup(2, tags, name=name)
        for option in ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax"):
            gmsh.option.setNumber(option, parameters.element_size)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.optimize("Netgen")
        gmsh.model.mesh.setOrder(parameters.order)
        if parameters.order > 1 and msh.inverted():
            # flat elements at a coarse arc fold over when they are bent to it
            gmsh.model.mesh.optimize("HighOrder")
        gmsh.model.mesh.renumberNodes()
        msh.check_disjoint(2, "facet")
        return msh.write(path)
