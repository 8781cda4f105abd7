"""What a JSON Schema of an input file says about tables."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from typing import Any

from jsonschema import Draft202012Validator

from tests.tools.processes import ROOT, environment
from vanedamp.studies.file_kinds import KINDS

PROGRAM = """
import json
from vanedamp.studies.file_kinds import KINDS
print(json.dumps({name: kind.schema for name, kind in KINDS.items()}))
"""


@cache
def shipped_schemas() -> dict[str, dict[str, Any]]:
    """The schemas by kinds of files in a process of its own, without the records that tests have registered here."""
    command = [sys.executable, "-c", PROGRAM]
    printed = subprocess.run(command, cwd=ROOT, env=environment(), capture_output=True, text=True, check=True)
    schemas: dict[str, dict[str, Any]] = json.loads(printed.stdout)
    return schemas


@cache
def validator(kind: str) -> Draft202012Validator:
    """The validator of a kind of files, whose schema is one itself."""
    schema = KINDS[kind].file_schema
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def faults(kind: str, tables: dict[str, Any]) -> list[str]:
    """What is wrong with the tables of a file."""
    return [f"{error.json_path}: {error.message}" for error in validator(kind).iter_errors(tables)]


def kind_of(tables: dict[str, Any]) -> str:
    """The kind of a file, from its tables."""
    names = {
        "matrices": "external", "numbers": "identification", "optimise": "study", "mesh": "case", "report": "pipeline",
        "life": "life", "deviations": "deviations", "envelope": "design",
    }  # fmt: skip
    return next((kind for table, kind in names.items() if table in tables), "scene")
