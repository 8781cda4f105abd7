"""Every error about input has one base, which users and the command line catch."""

import ast
import re
from pathlib import Path

import pytest

import vanedamp
from vanedamp.files.store import StoreError, load
from vanedamp.files.toml_input import InputError, read_toml

ROOT = Path(__file__).resolve().parent.parent.parent
PARTS = ("files", "meshes", "modal", "rom", "coupling", "studies")


def test_errors_of_all_parts_have_one_base():
    texts = [source.read_text() for part in PARTS for source in (ROOT / part).rglob("*.py")]
    of_errors = [text for text in texts if re.search(r"class \w+\([^)]*Error", text)]
    classes = [node for text in of_errors for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef)]
    bases = {node.name: [base.id for base in node.bases if isinstance(base, ast.Name)] for node in classes}
    assert [name for name, of in bases.items() if "ValueError" in of] == ["VanedampError"]
    assert {"InputError", "StoreError", "MeshError", "ReducedModelError", "SweepError"} <= {
        name for name, of in bases.items() if of == ["VanedampError"]
    }


def test_bad_files_raise_it(tmp_path):
    with pytest.raises(vanedamp.VanedampError, match="no such file") as bad_input:
        read_toml(tmp_path / "case.toml")
    with pytest.raises(vanedamp.VanedampError, match="no such file") as bad_record:
        load(tmp_path / "rom.h5", "reduced-model")
    assert (bad_input.type, bad_record.type) == (InputError, StoreError)
    assert issubclass(vanedamp.VanedampError, ValueError)
