"""`vanedamp mesh`: the mesh of a case that names a generator."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vanedamp.studies.commands.support.arguments import add_input, add_output

ORDER = 10
SUMMARY = "write the mesh of a case that names a generator"


def add_arguments(parser: ArgumentParser) -> None:
    """Take a case and the mesh file."""
    add_input(parser, "CASE.toml")
    add_output(parser, "MESH.msh", required=True)


def run(arguments: Namespace) -> None:
    """Write the mesh."""
    from vanedamp.files.toml_input import InputError
    from vanedamp.studies.case.tables import Case, MeshFile
    from vanedamp.studies.commands.support.outputs import check_outputs

    outputs = check_outputs(arguments, output=(".msh",))
    case = Case.load(arguments.input)
    outputs.keep(case.files)
    if isinstance(case.mesh, MeshFile):
        raise InputError("mesh.file: the mesh exists already; to make one, name mesh.generator instead")
    case.mesh.build(arguments.output)
    print(f"{arguments.output}: mesh of {case.mesh.generator}")
