"""The public names: written once, in the stub, with docstrings and a page; `help` tells of the keys of files."""

import ast
import pydoc
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import vanedamp as vd
from docs._ext import python_api
from tests.tools.processes import environment
from vanedamp.coupling.scene.contact_laws.newton import Newton
from vanedamp.coupling.scene.shapes.block import Block
from vanedamp.files.extensions import ExtensionError
from vanedamp.files.key_tables import tables
from vanedamp.studies.file_kinds import KINDS

STUB = Path(vd.__file__).with_suffix(".pyi")
IMPORTS = {
    name.asname: (node.module, name.name)
    for node in ast.parse(STUB.read_text(encoding="utf-8")).body
    if isinstance(node, ast.ImportFrom)
    for name in node.names
}


def test_the_stub_has_every_name_and_they_are_exported():
    assert sorted(IMPORTS) == dir(vd)
    assert set(vd.__all__) < set(IMPORTS)
    assert {"ContactLaw", "Method", "Scene", "Shape", "Waveform", "register"} <= set(vd.__all__)


@pytest.mark.parametrize("name", sorted(IMPORTS))
def test_a_name_is_that_of_its_module_with_a_docstring(name):
    module, own = IMPORTS[name]
    assert own == name  # `import A as A`: an editor takes it for public
    value = getattr(vd, name)
    assert value is (
        import_module(f"vanedamp.{name}") if module == "vanedamp" else getattr(import_module(module), name)
    )
    assert getattr(value, "__module__", module) == module, "name the module that defines it"
    assert pydoc.getdoc(value)


def test_every_name_stands_in_one_group_that_help_and_reference_show():
    groups = re.findall(r"\n([A-Z][a-z ]+): [a-z].+\n\n((?:    .+\n)+)", vd.__doc__)
    shown = [name for _, names in groups for name in re.split(r",\s+", names.strip())]
    assert sorted(shown) == sorted(IMPORTS) and len(groups) == STUB.read_text(encoding="utf-8").count("\n\n# ") - 1 > 9
    pages = dict(python_api.pages())
    for title, names in groups[1:]:  # the first is that of the parts
        page = pages[f"names-{title.lower().replace(' ', '-')}"]
        assert re.findall(r":: vanedamp\.(\w+)$", page, re.M) == re.split(r",\s+", names.strip())
    assert sorted(re.findall(r"^- :py:obj:`~vanedamp\.(\w+)`: \S", pages["vanedamp"], re.M)) == sorted(vd.__all__)


def test_names_are_loaded_when_they_are_used():
    code = "import sys, vanedamp; print(len([name for name in sys.modules if name.startswith('vanedamp.')]))"
    done = subprocess.run([sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout == "0\n"


def test_a_name_that_is_not_there():
    with pytest.raises(AttributeError, match="no attribute 'Scenes'"):
        _ = vd.Scenes


@pytest.mark.parametrize(("record", "kind"), [(vd.Scene, "scene"), (vd.Case, "case")])
def test_help_lists_keys_units_and_defaults(record, kind):
    text = " ".join(pydoc.render_doc(record, renderer=pydoc.plaintext).replace("\n |", "").split())
    for table in tables(KINDS[kind].schema):
        assert table.heading in text
        for key in table.keys:
            unit = f" [{key.unit}]" if key.unit else ""
            assert " ".join(f"{key.name}: {key.meaning}{unit}".split()) in text
    if kind == "scene":
        assert "from the left wall to the right one [m]; number > 0; required left: interface label" in text
        assert "mass: mass of the body [kg]; number > 0; required friction: Coulomb coefficient" in text


def test_register_takes_parts_of_scenes_only():
    assert vd.register(Newton) is Newton
    assert vd.register(Block) is Block  # that is there under its name
    with pytest.raises(ExtensionError, match="derive it from ContactLaw or Waveform"):
        vd.register(dict)
