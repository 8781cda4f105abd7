"""`vanedamp matrices`: stiffness, mass, nodes and sets for other codes."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vanedamp.studies.commands.support.arguments import add_input, add_output

ORDER = 40
SUMMARY = "stiffness, mass, nodes and sets for other codes (Matrix Market, CSV)"


def add_arguments(parser: ArgumentParser) -> None:
    """Take a case and a folder."""
    add_input(parser, "CASE.toml")
    add_output(parser, "DIR", required=True)


def run(arguments: Namespace) -> None:
    """Assemble the matrices and write them."""
    from vanedamp.studies.case.tables import Case
    from vanedamp.studies.commands.support.outputs import output_folder, refuse_input

    folder = output_folder(arguments)
    case = Case.load(arguments.input)
    from vanedamp.modal.matrix_files import FILES, write_folder

    for name in FILES:
        refuse_input("--output", folder / name, [arguments.input, *case.files])
    from vanedamp.studies.case.stages import assemble

    system = assemble(case).matrices
    write_folder(system, folder)
    print(f"{folder}: stiffness and mass ({system.size} x {system.size}), nodes, sets, fixed nodes")
