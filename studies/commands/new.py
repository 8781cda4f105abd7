"""`vanedamp new`: a short commented file to start from, which works as it is, with its schema for editors beside it."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from vanedamp.files.toml_input import InputError
from vanedamp.files.toml_output import schema_name, write_commented
from vanedamp.studies import templates
from vanedamp.studies.commands.support.outputs import check_outputs
from vanedamp.studies.file_kinds import KINDS


def run(arguments: Namespace) -> None:
    """Write the file and the schema of its kind."""
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
