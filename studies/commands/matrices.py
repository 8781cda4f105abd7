"""`vanedamp matrices`: stiffness, mass, nodes and sets for other codes."""

from __future__ import annotations

from argparse import Namespace

from vanedamp.modal.matrix_files import FILES, write_folder
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case
from vanedamp.studies.commands.support.outputs import refuse_input


def run(arguments: Namespace, case: Case) -> None:
    """Assemble the matrices and write them."""
    folder = arguments.folder

    for name in FILES:
        refuse_input("--output", folder / name, [arguments.input, *case.files])

    system = assemble(case).matrices
    write_folder(system, folder)
    print(f"{folder}: stiffness and mass ({system.size} x {system.size}), nodes, sets, fixed nodes")
