"""`vanedamp info`: kind and origin of a result, and its main values."""

from __future__ import annotations

import json
from argparse import Namespace
from collections import Counter
from collections.abc import Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from vanedamp.files.store import Variable, decoding, finite, json_text, load_any
from vanedamp.studies import kinds
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.facts import Fact, Found, fact_lines, plain_facts

#: ending of the kinds of checkpoints
_CHECKPOINT = "-checkpoint"


def run(arguments: Namespace) -> None:
    """Print the facts. Raises StoreError for a damaged file, or one that vanedamp did not write."""
    path = arguments.input
    kind, variables, attributes = load_any(path)
    checkpoint = kind.endswith(_CHECKPOINT)
    module = kinds.of_command(kind.removesuffix(_CHECKPOINT)) if checkpoint else kinds.kind(kind)
    about = kind if module is None else module.ABOUT
    what = f"what {about} had finished" if checkpoint else about
    with decoding(path):
        record = Found(path, variables, {name: _nested(value) for name, value in attributes.items()})
        facts = [
            Fact("command", f"vanedamp {' or '.join(module.COMMANDS)}" if module and module.COMMANDS else None),
            Fact("record", module and module.RECORD, "", "in Python"),
            *_origin(record),
        ]
        facts += (
            [Fact("finished", record.attributes.get("finished"))]
            if checkpoint
            else (module.facts if module else plain_facts)(record)
        )
        facts += [Fact("sizes", {} if checkpoint else _sizes(variables)), Fact("warnings", _warnings(record))]
        result = {"kind": kind} | {fact.key: fact.value for fact in facts} | {"scene": _scene(record)}
        lines = list(fact_lines(f"{path}: {kind}, {what}", facts))
        json_text(finite(result))  # fails for types that our records do not contain
    write_result(arguments, result, lines)


def _nested(value: Any) -> Any:
    """Return the data of a JSON text; any other value unchanged."""
    if isinstance(value, str) and value[:1] in "{[":
        try:
            return json.loads(value)
        except ValueError:  # a text that only begins like JSON
            return value
    return value


def _origin(record: Found) -> Iterator[Fact]:
    """Yield date, software and input of the file."""
    path, attributes = Path(record.path), record.attributes
    provenance = attributes.get("provenance", {})
    matrices = provenance.get("matrices", attributes.get("matrices"))
    matrices = matrices if isinstance(matrices, dict) else provenance  # of an imported model: their names
    written = datetime.fromtimestamp(path.stat().st_mtime).astimezone()
    yield Fact(
        "written", written.isoformat(" ", "seconds"), "", f"time of the file, {path.stat().st_size / 1e6:.3g} MB"
    )
    versions = matrices.get("versions", {}) | provenance.get("versions", {}) | attributes.get("versions", {})
    yield Fact("versions", versions)
    if "mesh" in matrices:
        yield Fact("mesh", {"file": matrices["mesh"], "sha256": matrices["mesh_sha256"]})
    if scene := _scene(record):
        structure = scene["structure"]
        yield Fact("structure", structure["model"], "", structure.get("file", ""))
        yield Fact("bodies", dict(Counter(body["shape"] for body in scene["damper"])))
    yield Fact("files", attributes.get("model"), "", "SHA-256 of the other input files")


def _scene(record: Found) -> dict[str, Any] | None:
    """Return the scene in a file, as plain data; None without."""
    of_study, provenance = record.attributes.get("study", {}), record.attributes.get("provenance", {})
    scene: dict[str, Any] | None = record.attributes.get("scene") or of_study.get("scene") or provenance.get("scene")
    return scene


def _sizes(variables: Mapping[str, Variable]) -> dict[str, int]:
    """Return the lengths of the dimensions."""
    return {
        name: length
        for variable in variables.values()
        for name, length in zip(variable.dims, np.shape(variable.values), strict=True)
    }


def _warnings(record: Found) -> list[str]:
    warnings = record.attributes.get("warnings") or record.attributes.get("provenance", {}).get("warnings", [])
    return list(warnings)
