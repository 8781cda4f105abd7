"""Cases of a command, loaded and checked before the finite elements are."""

from __future__ import annotations

from argparse import Namespace

from vanedamp.files.toml_input import InputError
from vanedamp.rom.basis import basis_named
from vanedamp.studies.case.tables import Case, check_interface


def read_case(arguments: Namespace) -> Case:
    """Load a case, none of whose files may be an output. Raises InputError."""
    case = Case.load(arguments.input)
    arguments.outputs.keep(case.files)
    return case


def read_campbell_case(arguments: Namespace) -> Case:
    """Load a case with a table for a Campbell diagram; as read_case."""
    case = read_case(arguments)
    if case.campbell is None:
        raise InputError(
            f"{arguments.input}: campbell: missing; give its speeds and engine orders, such as "
            "rpm = {start = 0, stop = 6000, num = 31} and engine_orders = [1, 2, 3]"
        )
    return case


def read_reducible_case(arguments: Namespace) -> Case:
    """Load a case with an interface, for a valid basis; as read_case."""
    case = read_case(arguments)
    if case.ring is None:
        basis_named(arguments.basis)
    check_interface(case)
    return case


def read_ring_case(arguments: Namespace) -> Case:
    """Load a case of a sector; as read_case."""
    case = read_case(arguments)
    if case.ring is None:
        raise InputError(
            f"{arguments.input}: ring: missing; give the number of sectors and the faces, such as sectors = 36, "
            'low = "low" and high = "high"'
        )
    return case
