"""`vanedamp matrices`: stiffness, mass, nodes and sets for other codes."""

from __future__ import annotations

from argparse import Namespace

from vanedamp.modal.matrix_files import FILES, write_folder
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case
from vanedamp.studies.commands.support.outputs import Outputs


def run(arguments: Namespace, case: Case) -> None:
    """Assemble the matrices and write them."""
    folder = arguments.folder
    Outputs(tuple(("--output", folder / name) for name in FILES)).keep([arguments.input, *case.files])
    system = assemble(case).matrices
    write_folder(system, folder)
    print(f"{folder}: stiffness and mass ({system.size} x {system.size}), nodes, sets, fixed nodes")
