"""`vanedamp new`: a short commented file to start from, which works as it is, with its schema for editors beside it."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from vanedamp.studies.commands.support.arguments import add_output

ORDER = 2
SUMMARY = "write a commented scene, case or study to start from"


def add_arguments(parser: ArgumentParser) -> None:
    """Take a kind of files, the file, and the reduced model of a scene or study."""
    parser.add_argument("kind", metavar="KIND", choices=["scene", "case", "study"], help="scene, case or study")
    add_output(parser, "FILE.toml")
    parser.add_argument("--rom", metavar="ROM.h5", help="reduced model that a scene or study is to have")


def run(arguments: Namespace) -> None:
    """Write the file and the schema of its kind."""
    from vanedamp.files.toml_input import InputError
    from vanedamp.files.toml_output import schema_name, write_commented
    from vanedamp.studies import templates
    from vanedamp.studies.commands.support.outputs import check_outputs
    from vanedamp.studies.file_kinds import KINDS

    kind = arguments.kind
    arguments.output = arguments.output or f"{kind}.toml"
    path = Path(arguments.output)
    check_outputs(arguments, beside=path.with_name(schema_name(kind)))
    if path.exists():
        raise InputError(f"--output {path}: exists already, and may be yours; name another file")
    if kind == "case":
        if arguments.rom is not None:
            raise InputError("--rom: is for a scene or a study; a case is what a reduced model is made from")
        made = templates.case_template(path)
    else:
        template = templates.scene_template if kind == "scene" else templates.study_template
        made = template(path, None if arguments.rom is None else Path(arguments.rom))
    write_commented(path, made.data, KINDS[kind], made.notes)
    print(f"{path}: a {kind} to start from; its keys complete in editors by {path.with_name(schema_name(kind))}")
