"""JSON Schemas of the input files: every key is described, and they accept what the readers accept, but no faults."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Iterator
from typing import Any

import pytest

from tests.tools.input_files import BLOCK, CLUSTER, DAMPED_BLOCK, SCENE
from tests.tools.processes import ROOT
from tests.tools.random_scenes import random_scene
from tests.tools.schemas import faults, kind_of, shipped_schemas
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.reference import options
from vanedamp.files.toml_input import InputError, validate
from vanedamp.studies.demo.demo import FIGURES, RIGID_FIGURES
from vanedamp.studies.demo.figure_file import FigureScenes, FigureStructure
from vanedamp.studies.file_kinds import KINDS

SHIPPED = [
    *sorted((ROOT / "docs" / "examples").glob("*.toml")),
    ROOT / "benchmarks" / "cluster_case.toml",
    ROOT / "studies" / "demo" / "scenes" / "case.toml",
    ROOT / "paper" / "scenes" / "blade.toml",
]


def tables_of(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables in a schema: the file's own, those that have a name, and those of the methods."""
    yield "file", schema
    nodes = [*schema["$defs"].items(), ("solver", schema["properties"].get("solver", {}))]
    for name, node in nodes:
        yield from ((name, option) for option in options(schema, node) if "properties" in option)


def is_quantity(schema: dict[str, Any], node: dict[str, Any]) -> bool:
    """Whether a key may have numbers that are no counts."""
    if not isinstance(node, dict) or not node:
        return False
    found = options(schema, node)
    inner = [entry for one in found for entry in [*one.get("prefixItems", ()), one.get("items")]]
    return any(one.get("type") == "number" for one in found) or any(is_quantity(schema, one) for one in inner)


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_is_described_and_every_quantity_has_a_unit(kind):
    schema = shipped_schemas()[kind]
    keys = {f"{name}.{key}": node for name, table in tables_of(schema) for key, node in table["properties"].items()}
    assert len(keys) > 5
    assert not [key for key, node in keys.items() if not node.get("description")]
    assert not [key for key, node in keys.items() if is_quantity(schema, node) and "x-unit" not in node]
    assert not [key for key, node in keys.items() if not re.fullmatch(r"[\w /^(),.-]+", node.get("x-unit", "-"))]
    assert not [key for key, node in keys.items() if len(node["description"]) > 240]


# what is accepted


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_shipped_files(path):
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    assert faults(kind_of(tables), tables) == []


@pytest.mark.parametrize("name", RIGID_FIGURES)
def test_scenes_of_the_paper_s_figures(name):
    for scene in FigureScenes.load(FIGURES[name].file, FigureStructure.shipped()).scenes.values():
        assert faults("scene", scene.to_dict()) == []


@pytest.mark.parametrize("structure", ["rigid", "prescribed", "rom"])
def test_random_scenes(structure):
    for seed in range(20):
        assert faults("scene", random_scene(seed, structure, 1 + seed % 3).to_dict()) == []


CASES = {"block": BLOCK, "damped": DAMPED_BLOCK, "cluster": CLUSTER}
OTHER_FORMS = {
    "no clamps": '[support]\nclamped = []\n',
    "components": '[support]\nclamped = ["a", {b = "yz"}]\n',
    "one table of components": '[support.clamped]\na = "y"\n',
    "stiffness": "[support.elastic.a]\nstiffness = 5e12\n",
    "stiffnesses": "[support.elastic.a]\nstiffness = [5e12, 0, 1e12]\n",
    "groups": '[interface.a]\nfacets = ["a", "b"]\ndirection = "normal"\n',
    "normal": '[interface.a]\nfacets = "a"\ndirection = [0, 1, 0]\nkind = "patch"\nnormal = "b"\n',
    "range": "[rotation]\naxis = [0, 0, 2]\n[campbell]\nrpm = {start = 0, stop = 100, num = 3}\n",
    "list": "[rotation]\naxis = [0, 0, 2]\n[campbell]\nspeed = [0, 50.0]\n",
}  # fmt: skip


@pytest.mark.parametrize("text", CASES.values(), ids=CASES)
def test_cases(text):
    assert faults("case", tomllib.loads(text)) == []


@pytest.mark.parametrize("text", OTHER_FORMS.values(), ids=OTHER_FORMS)
def test_other_forms_of_a_value(text):
    """What the reader turns into a record of one form is accepted in each of its forms."""
    tables = {"mesh": {"file": "a.msh"}, "material": {"default": {"young": 2e11, "poisson": 0.3, "density": 8e3}}}
    tables |= tomllib.loads(text)
    validate(KINDS["case"].record, tables, "case")
    assert faults("case", tables) == []


@pytest.mark.parametrize(
    "change",
    [
        {"ramp": {"from": 1.0, "to": 2.0, "rate": 3.0}},
        {"ramp": {"from": 1.0, "to": 2.0, "rate": [3.0, 4]}},
        {"sweep": {"damper.0.mass": [1, 2.0], "structure.model": ["rigid"]}},
        {"sweep": {"time.periods": {"start": 1, "stop": 9, "num": 3}}},
        {"sweep": {"time.periods": [1, 2], "sections": 8, "exponents": 50}},
        {"solver": {}},
        {"solver": {"max_events": 7}},
        {"solver": {"method": "cosim", "substeps": 3}},
        {"contact": {"law": "compliant", "stiffness": 1e9}},
    ],
)  # fmt: skip
def test_other_forms_in_a_scene(change):
    tables = tomllib.loads(SCENE) | change
    validate(Scene, tables, "scene")
    assert faults("scene", tables) == []


@pytest.mark.parametrize("bounds", [{"mass_ratio": 0.02, "bodies": 2}, {"gap_ratio": [0.1, 1], "bodies": [1, 4]}])
def test_other_forms_in_a_study(bounds):
    tables = tomllib.loads(SCENE) | {"optimise": {"band": [1.0, 2.0], "variables": bounds}}
    validate(KINDS["study"].record, tables, "study")
    assert faults("study", tables) == []


# what is not


def places(data: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The places of all keys in tables."""
    for key, value in data.items() if isinstance(data, dict) else enumerate(data):
        if isinstance(data, dict):
            yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def at(data: Any, path: tuple[Any, ...]) -> Any:
    for step in path:
        data = data[step]
    return data


#: tables whose keys are names of the user's
NAMES = {"material", "interface", "elastic", "clamped", "sweep"}


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.name)
def test_a_misspelt_key_and_a_word_for_a_number_are_faults(path):
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    kind, tried = kind_of(tables), 0
    for *before, key in list(places(tables)):
        named = before and before[-1] in NAMES
        if not named:
            other = copy.deepcopy(tables)
            table = at(other, tuple(before))
            table[f"{key}_"] = table.pop(key)
            assert faults(kind, other), (before, key)
            tried += 1
        if isinstance(at(tables, (*before, key)), int | float):
            other = copy.deepcopy(tables)
            at(other, tuple(before))[key] = "ten"
            assert faults(kind, other), (before, key)
            tried += 1
    assert tried > 10


@pytest.mark.parametrize(
    "change",
    [
        {"solver": {"steps_per_period": 100}},  # belongs to methods that must be named
        {"solver": {"method": "exact", "steps_per_period": 100}},
        {"solver": {"method": "nothing"}},
        {"contact": {"stiffness": 1e9}},
        {"contact": {"law": "newton", "stiffness": 1e9}},
        {"sweep": {"damper.0.mass": 1.0}},
        {"sweep": {"damper.0.mass": []}},
        {"gravity": {"acceleration": -1.0}},
        {"time": {"tolerance": 1.0}},
        {"gravity": {"direction": [0, 1]}},
    ],
)
def test_faults_of_a_scene(change):
    tables = tomllib.loads(SCENE) | change
    with pytest.raises(InputError):
        validate(Scene, tables, "scene")
    assert faults("scene", tables)
