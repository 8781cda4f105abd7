"""`vanedamp schema`: the JSON Schema of a kind of input file, by which editors complete and check keys."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from vanedamp.files.toml_output import schema_text, write_schema
from vanedamp.studies.file_kinds import KINDS


def add_kind(parser: ArgumentParser) -> None:
    """Declare the kind of file."""
    parser.add_argument("kind", metavar="KIND", choices=sorted(KINDS), help=", ".join(sorted(KINDS)))


def run(arguments: Namespace) -> None:
    """Print the schema, or write it."""
    schema = KINDS[arguments.kind].file_schema
    if arguments.output is None:
        print(schema_text(schema), end="")
        return
    write_schema(arguments.output, schema)
    print(f"{arguments.output}: for files beside it that begin with #:schema ./{Path(arguments.output).name}")
