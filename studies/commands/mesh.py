"""`vanedamp mesh`: the mesh of a case that names a generator."""

from __future__ import annotations

from argparse import Namespace

from vanedamp.files.toml_input import InputError
from vanedamp.meshes.generators import build
from vanedamp.studies.case.tables import Case, MeshFile


def run(arguments: Namespace, case: Case) -> None:
    """Write the mesh."""
    if isinstance(case.mesh, MeshFile):
        raise InputError("mesh.file: the mesh exists already; to make one, name mesh.generator instead")
    build(case.mesh, arguments.output)
    print(f"{arguments.output}: mesh of {case.mesh.generator}")
