"""CONTRIBUTING.md and docs/developer: the examples work, the list of modules is whole, a word has one meaning."""

import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent
from typing import Any, Literal

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from docs._ext.layout import folders, sentence
from tests.tools.input_files import SCENE
from vanedamp.coupling.quantities.quantity import quantity
from vanedamp.coupling.quantities.quantity import table as quantities
from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element
from vanedamp.coupling.scene.registration import register
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.formats.meshes.labelled_mesh import LabelledMesh, MeshError, deck_lines
from vanedamp.files.store import Variable
from vanedamp.files.toml_input import STRICT, Positive, validate
from vanedamp.studies.facts import Fact, Found

ROOT = Path(__file__).parent.parent.parent
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
PAGES = sorted((ROOT / "docs" / "developer").glob("*.md"))
PARTS = ("files", "meshes", "modal", "rom", "coupling", "studies", "benchmarks", "paper")


def example(title: str) -> str:
    """The code of a section."""
    section = TEXT.partition(f"## {title}\n")[2].partition("\n## ")[0]
    return dedent("".join(re.findall(r"(?m)^(?:    .*\n|\n)", section)))


def test_its_law_strikes_with_half_of_the_restitution():
    names = {"ContactLaw": ContactLaw, "Element": Element, "Literal": Literal, "Positive": Positive, "STRICT": STRICT,
             "dataclass": dataclass, "__name__": __name__}  # fmt: skip
    exec(example("A contact law"), names)
    register(names["Falling"])
    data = tomllib.loads(SCENE)
    del data["damper"][0]["restitution"]
    data |= {"contact": {"law": "falling", "half": 0.5}, "time": {"periods": 1, "transient": 0}}
    data["damper"][0]["velocity"], data["gravity"] = 0.5, {"acceleration": 0.0}
    data["excitation"] = {"frequency": 15.9, "force": 1e-9}
    response = simulate(validate(Scene, data, "scene"), events=True)
    first = next(event for event in response.event_list if event.kind == "impact")
    # the restitution at the speed of approach, whatever it is
    speed = abs(first.relative_velocity_before)
    assert -first.relative_velocity_after / first.relative_velocity_before == pytest.approx(1 / (1 + speed / 0.5))
    assert speed > 0.4 and response.energy_residual < 1e-9


def test_its_quantity_is_that_of_the_package():
    names = {"quantity": quantity, "Any": Any, "np": np}
    exec(example("A quantity"), names)
    own, found = quantities()["amplitude_rms"], names["amplitude_rms"]
    known = {"square": 3.0, "counted": 4.0, "period": 0.5}
    assert (found.name, found.unit, found.of(known)) == (own.name, own.unit, own.of(known))


def test_its_kind_says_what_it_is():
    names = {"Iterator": Iterator, "Fact": Fact, "Found": Found}
    exec(example("A kind of result"), names)
    variables = {"error": Variable(np.array([1e-6, 2e-6]), ("speed",))}
    (fact,) = names["facts"](Found("file.h5", variables, {}))
    assert fact.value == 2e-6 and names["NAME"] == "campbell"


def test_its_format_reads_and_refuses(tmp_path):
    names = {"Path": Path, "LabelledMesh": LabelledMesh, "deck_lines": deck_lines, "np": np}
    exec(example("A format"), names)
    file = tmp_path / "mesh.txt"
    file.write_text("node 1 0 0 0\nnode 2 1 0 0\nnode 3 0 1 0\nnode 4 0 0 1.5D+00\ntetra 1 1 2 3 4\n")
    mesh = names["read"](file)
    assert mesh.elements == {1: ("tetra", [1, 2, 3, 4])} and mesh.nodes[4][2] == 1.5
    for text, told in (("tetra 1 1 2 3 4\n", "node 1"), ("beam 1 1 2\n", "no element"), ("node 1 0 0 x\n", "numbers")):
        file.write_text(text)
        with pytest.raises(MeshError, match=f"line 1: .*{told}"):
            names["read"](file)


def test_every_folder_and_module_says_what_it_is():
    for part in PARTS:
        for package, modules in folders(part):
            assert all(sentence(file) for file in (package / "__init__.py", *modules)), package
    assert all(f"```{{layout}} {part}\n" in (ROOT / "docs/developer/layout.md").read_text() for part in PARTS)


def test_files_that_pages_name_are_there():
    known = {file.name for file in ROOT.rglob("*.py") if ".venv" not in file.parts}
    for page in (ROOT / "CONTRIBUTING.md", *PAGES):
        named = re.findall(r"[\w/]+\.py\b", page.read_text(encoding="utf-8"))
        missing = [name for name in named if Path(name).name not in known | {"NN_name.py"}]
        assert not missing, f"{page.name}: {missing}"


def test_no_line_stands_twice():
    lines = [line.strip() for page in (ROOT / "CONTRIBUTING.md", *PAGES) for line in page.read_text().splitlines()]
    assert [line for line, times in Counter(lines).items() if times > 1 and len(line) > 40] == []


def test_a_newcomer_reads_it_in_ten_minutes():
    assert len(TEXT.encode()) <= 6000


def test_the_glossary_has_a_word_once():
    text = (ROOT / "docs" / "developer" / "words.md").read_text(encoding="utf-8")
    words = [word for row in re.findall(r"^\| (.+?) \| .+ \|$", text, re.MULTILINE)[1:] for word in row.split(", ")]
    assert len(words) > 30 and len(words) == len(set(words))
