"""`vanedamp new`: a short commented file to start from, which works as it is, and its schema for editors."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from vanedamp.files.toml_input import InputError
from vanedamp.files.toml_output import commented, schema_name, write_commented
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.commands.support.messages import print_note, print_warnings
from vanedamp.studies.commands.support.outputs import check_outputs
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.hot_spots import level_warnings
from vanedamp.studies.templates import template


def run(arguments: Namespace) -> None:
    """Write the file and the schema of its kind, or show the file."""
    kind, output = arguments.kind, arguments.output
    path = Path(output or f"{kind}.toml")
    if output is not None:
        check_outputs(arguments, beside=path.with_name(schema_name(kind)))
        if path.exists():
            raise InputError(f"--output {path}: exists already, and may be yours; name another file")
    data, notes = template(
        kind, path, None if arguments.rom is None else Path(arguments.rom),
        None if arguments.case is None else Path(arguments.case),
    )  # fmt: skip
    if output is None:
        print(commented(data, KINDS[kind].schema, kind, notes).split("\n", 2)[2], end="")
        print_note(f"new {kind}", f"nothing written; -o {path} writes the file, and beside it its schema for editors")
    else:
        write_commented(path, data, KINDS[kind], notes)
        print(f"{path}: a {kind} to start from; its keys complete in editors by {path.with_name(schema_name(kind))}")
    if arguments.rom is not None:
        print_warnings(arguments.rom, level_warnings(ReducedModel.load(arguments.rom).provenance.get("fatigue")))
