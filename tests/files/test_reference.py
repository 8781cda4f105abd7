"""Reference of the keys of input files: JSON Schema made from the records, and commented files made from the schema."""

from __future__ import annotations

import json
import string
import tomllib
from dataclasses import dataclass as plain_dataclass

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.bodies import Damper
from vanedamp.coupling.scene.units import unit_of
from vanedamp.files.reference import field_docstrings, schema
from vanedamp.files.toml_input import STRICT, Positive
from vanedamp.files.toml_output import commented, toml, write_commented
from vanedamp.studies.file_kinds import KINDS


@dataclass(frozen=True, config=STRICT)
class Base:
    """A table."""

    length: Positive
    """its length [m]"""
    name: str | None = None
    """its
    name"""


@dataclass(frozen=True, config=STRICT)
class Derived(Base):
    """A table with one key more."""

    ratio: Positive = 2.0
    """width over length [-]"""


def test_docstrings_are_those_after_the_fields_bases_included() -> None:
    assert field_docstrings(Derived) == {
        "length": "its length [m]", "name": "its name", "ratio": "width over length [-]",
    }  # fmt: skip


def test_no_docstrings_without_source() -> None:
    made = plain_dataclass(type("Made", (), {"__annotations__": {"x": int}, "__module__": "nowhere"}))
    assert field_docstrings(made) == {}


def test_schema_of_a_record() -> None:
    made = schema(Derived)
    assert made["$schema"].endswith("2020-12/schema")
    assert made["properties"] == {
        "length": {"type": "number", "exclusiveMinimum": 0, "description": "its length [m]", "x-unit": "m"},
        "name": {"type": "string", "description": "its name"},
        "ratio": {
            "type": "number", "exclusiveMinimum": 0, "default": 2.0, "description": "width over length [-]",
            "x-unit": "-",
        },
    }  # fmt: skip
    assert made["required"] == ["length"] and made["additionalProperties"] is False


def test_every_key_of_a_body_is_in_the_scene_s_schema() -> None:
    properties = KINDS["scene"].schema["$defs"]["Damper"]["properties"]
    assert set(properties) == set(Damper.__dataclass_fields__) - {"added"}
    assert properties["mass"]["x-unit"] == "kg" and properties["friction"]["x-unit"] == "-"


SCENE = {
    "structure": {"model": "rigid", "mass": 0.1, "stiffness": 3.4e7, "damping": 0.1},
    "excitation": {"frequency": 2414.0, "force": 1.0, "harmonic": [{"order": 2, "amplitude": 1.0}]},
    "cavity": [{"name": "c1", "gap": 2e-5}, {"name": "c2", "gap": 1.0 / 3.0}],
    "damper": [{"cavity": "c1", "mass": 0.003, "shape": "block"}],
    "sweep": {"excitation.frequency": {"start": 1.0, "stop": 2.0, "num": 3}, "cavity.gap": [1e-5, 2e-5]},
}


def test_commented_file_reads_back_and_says_what_its_keys_mean() -> None:
    text = commented(SCENE | {"rotation": None}, KINDS["scene"].schema, "scene")
    assert tomllib.loads(text) == SCENE
    lines = text.splitlines()
    assert lines[0] == "#:schema ./scene.schema.json"
    assert "mass = 0.003 # mass of the body [kg]" in lines
    assert "stiffness = 3.4e7" in text and '"excitation.frequency" = {start = 1.0, stop = 2.0, num = 3}' in text
    assert text.count("total free travel") == 1  # of two cavities the first has the comments
    assert max(map(len, lines)) <= 120


def test_write_commented_writes_the_schema_beside_the_file(tmp_path) -> None:
    write_commented(tmp_path / "mine.toml", SCENE, KINDS["scene"])
    assert json.loads((tmp_path / "scene.schema.json").read_text()) == KINDS["scene"].file_schema
    assert (tmp_path / "mine.toml").read_text().startswith("#:schema ./scene.schema.json\n")


CHARACTERS = string.printable + "µé😀\0\x7f\x85\u2028"
KEYS = st.text(CHARACTERS, min_size=1, max_size=8)
VALUES = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(CHARACTERS, max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=12,
)  # fmt: skip


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_any_tables_read_back(data) -> None:
    assert tomllib.loads(toml(data)) == data


@pytest.mark.parametrize("kind", KINDS)
def test_schemas_are_plain_data(kind: str) -> None:
    assert json.loads(json.dumps(KINDS[kind].schema)) == KINDS[kind].schema


@pytest.mark.parametrize(
    ("path", "unit"),
    [
        ("excitation.frequency", "Hz"), ("cavity.c1.gap", "m"), ("cavity.gap", "m"), ("damper.0.mass", "kg"),
        ("damper.friction", "1"), ("structure.stiffness", "N/m"), ("structure.damping", "N s/m"),
        ("gravity.orientation_deg", "degree"), ("rotation.rpm", "rpm"), ("rotation.speed", "rad/s"),
        ("excitation.load.1.phase", "degree"), ("excitation.harmonic.0.amplitude", "1"), ("cavity.c1.play", "m"),
        ("damper.tilt", "rad"), ("contact.stiffness", "N/m"), ("solver.contact_stiffness", "N/m"),
        ("friction_damper.0.normal_force", "N"), ("excitation.waveform.crest_factor", "1"), ("time.periods", "1"),
        ("continuation.direction", "1"), ("nothing.here", "1"),
    ],
)  # fmt: skip
def test_units_of_paths_are_those_of_the_records(path: str, unit: str) -> None:
    assert unit_of(path) == unit
