"""Another package adds a command, a section, a benchmark and parts of scenes by entry points; no file changes."""

import base64
import csv
import io
import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest

from tests.docs.test_examples import examples_of
from tests.tools.processes import ROOT, environment, without_stages
from vanedamp.studies.cli import BAD_INPUT, main

#: a command that writes a record of its own kind, the section that shows it and its template, and a format
COMMAND, SECTION, TEMPLATE, FORMAT = (
    next(example.text for example in examples_of(ROOT / "docs" / "howto" / "own_commands.md") if word in example.text)
    for word in ("add_arguments(parser)", "KIND =", "endfor", "ENDINGS =")
)
BENCHMARK = '''
"""Time of a sum."""

SUMMARY = "how long a sum of numbers takes"
ORDER = 1


def run(folder, quick):
    from vanedamp.files.store import write_json

    folder.mkdir(parents=True, exist_ok=True)
    total = sum(range(10 if quick else 1000))
    write_json(folder / "bench_sum.json", {"total": total})
    print(f"the sum is {total}")
'''
LAW = '''
"""A restitution that falls with the speed."""

from typing import Literal

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element
from vanedamp.files.toml_input import STRICT, Positive


@dataclass(frozen=True, config=STRICT)
class Slower(ContactLaw):
    half: Positive
    law: Literal["slower"] = "slower"

    @staticmethod
    def restitution_at(speed, coefficient):
        return 1.0 / (1.0 + speed / coefficient)

    def element(self, restitution, mass, flexibility=None):
        return Element(self.half)
'''
#: a spring that holds the structure back, and a square that stands on a corner
ELEMENT = '''
"""A leash between the structure and the ground."""

from typing import ClassVar

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import Element
from vanedamp.coupling.scene.elements.element import SceneElement, Unit
from vanedamp.files.toml_input import STRICT, Positive


@dataclass(frozen=True, config=STRICT)
class Leash(SceneElement):
    on_structure: ClassVar[bool] = True
    yields: ClassVar[bool] = True
    length: Positive
    """displacement at which it pulls [m]"""
    stiffness: Positive
    """stiffness [N/m]"""

    def units(self, number, parts):
        normal = -parts.motion(None, "leash")
        yield Unit(normal, 0 * normal, self.length, element=Element(1.0, self.stiffness), play=self.length, body=number)
'''
SHAPE = '''
"""A square on a corner."""

import numpy as np

from vanedamp.coupling.scene.shapes.shape import Polygon


class Diamond(Polygon):
    measures = {"edge": "edge [m]"}

    def corners(self, body):
        return body.measure("edge") / 2**0.5 * np.array([(0, -1), (1, 0), (0, 1), (-1, 0)])
'''
ENTRY_POINTS = """
[vanedamp.commands]
body-masses = acme.command

[vanedamp.report_sections]
masses = acme.section

[vanedamp.export_formats]
npz = acme.npz_format

[vanedamp.benchmarks]
sum = acme.benchmark

[vanedamp.contact_laws]
slower = acme.law:Slower

[vanedamp.elements]
leash = acme.element:Leash

[vanedamp.shapes]
diamond = acme.shape:Diamond
"""
SCENE = """
[structure]
model = "rigid"
mass = 2.0
stiffness = 1e4
damping_ratio = 0.01
[excitation]
frequency = 10.0
force = 1.0
[[cavity]]
name = "c1"
gap = 1e-4
[[damper]]
cavity = "c1"
mass = 0.05
[[damper]]
cavity = "c1"
mass = 0.0135
"""


def install(folder, package, entry_points, **files):
    """Lay out a package as pip does: its files (name__ending), and beside them the description with entry points."""
    (folder / package).mkdir(parents=True)
    (folder / package / "__init__.py").touch()
    for name, text in files.items():
        (folder / package / name.replace("__", ".")).write_text(text)
    described = folder / f"{package}-1.0.dist-info"
    described.mkdir()
    (described / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (described / "entry_points.txt").write_text(entry_points)


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """A folder of packages with the one that adds all."""
    folder = tmp_path_factory.mktemp("site")
    parts = {"command__py": COMMAND, "section__py": SECTION, "section__html": TEMPLATE, "benchmark__py": BENCHMARK}
    parts |= {"npz_format__py": FORMAT}
    parts |= {"law__py": LAW, "element__py": ELEMENT, "shape__py": SHAPE}
    install(folder, "acme", ENTRY_POINTS, **parts)
    return folder


#: runs command lines, each in its folder, as they come
SERVER = """
import contextlib, io, json, os, sys
from vanedamp.studies.cli import main
for line in sys.stdin:
    folder, *arguments = json.loads(line)
    os.chdir(folder)
    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        try:
            status = main(arguments)
        except SystemExit as end:
            status = end.code
    print(json.dumps([status, out.getvalue(), error.getvalue()]), flush=True)
"""


@pytest.fixture(scope="module")
def server(site):
    """A process that finds the package."""
    with subprocess.Popen(
        [sys.executable, "-c", SERVER], env=environment() | {"PYTHONPATH": os.pathsep.join([str(site), str(ROOT)])},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        yield process
        process.stdin.close()
    assert process.returncode == 0


@pytest.fixture
def vanedamp(server, tmp_path):
    """The command line in that process, in a folder with a scene."""
    (tmp_path / "scene.toml").write_text(SCENE)

    def run(*arguments):
        print(json.dumps([str(tmp_path), *arguments]), file=server.stdin, flush=True)
        status, out, error = json.loads(server.stdout.readline())
        return subprocess.CompletedProcess(arguments, status, out, without_stages(error))

    return run


def succeeds(finished):
    assert (finished.returncode, finished.stderr) == (0, "")
    return finished.stdout


def test_help_lists_the_command_after_ours(vanedamp):
    lines = succeeds(vanedamp("--help")).splitlines()
    names = [line.split()[0] for line in lines if re.match(r"    \S", line)]
    assert names[0] == "new" and names[-1] == "body-masses"
    assert "Masses of the bodies over that of the structure." in succeeds(vanedamp("body-masses", "--help"))


def test_command_writes_a_record_that_the_report_shows(vanedamp, tmp_path):
    told = succeeds(vanedamp("body-masses", "scene.toml", "-o", "masses.h5", "--table", "masses.csv"))
    assert told == "bodies of 0.0318 of the mass\n"
    assert (tmp_path / "masses.csv").read_text().split() == ["ratio", "0.025", "0.00675"]
    succeeds(vanedamp("report", ".", "-o", "report.html"))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert ">Masses of the bodies</h2>" in page
    assert "masses.h5: together 0.0318 of the structure." in page
    assert 'id="masses-0"' in page and "acme 1.0" in page
    (link,) = re.findall(r'download="masses-0.csv" href="data:text/csv;charset=utf-8;base64,([^"]+)"', page)
    table = list(csv.DictReader(io.StringIO(base64.b64decode(link).decode())))
    assert [float(row["ratio"]) for row in table] == [0.025, 0.00675]


def test_export_has_the_format(vanedamp, tmp_path):
    succeeds(vanedamp("body-masses", "scene.toml", "-o", "masses.h5"))
    succeeds(vanedamp("export", "masses.h5", "-o", "masses.npz"))
    with np.load(tmp_path / "masses.npz") as arrays:
        assert arrays["ratio"].tolist() == [0.025, 0.00675]
    assert "all variables, without units: numpy" in " ".join(succeeds(vanedamp("export", "--help")).split())


def test_results_of_a_study_know_it(vanedamp, tmp_path):
    succeeds(vanedamp("body-masses", "scene.toml", "-o", "masses.h5"))
    study = {"study": "light", "title": "Light bodies", "sources": ["masses.h5"], "claims": []}
    (tmp_path / "light.claims.json").write_text(json.dumps(study))
    succeeds(vanedamp("report", ".", "-o", "report.html"))
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert page.index("together 0.0318 of the structure in light.") < page.index("<h3>Light bodies</h3>")
    assert page.count(">Masses of the bodies</h2>") == 1


def test_outputs_of_the_command_are_checked_like_ours(vanedamp):
    for table, expected in (
        ("scene.toml", "is an input (scene.toml), which would be lost; name another file"),
        ("masses.txt", "expected a file name ending in .csv"),
    ):
        finished = vanedamp("body-masses", "scene.toml", "-o", "masses.h5", "--table", table)
        assert finished.returncode == BAD_INPUT
        assert finished.stderr == f"vanedamp: scene.toml: --table {table}: {expected}\n"


def test_benchmark_is_one_of_bench(vanedamp, tmp_path):
    assert "sum: how long a sum of numbers takes; engine: the exact engine" in " ".join(
        succeeds(vanedamp("bench", "--help")).split()
    )
    assert "the sum is 45" in succeeds(vanedamp("bench", "sum", "-o", "out", "--quick"))
    assert json.loads((tmp_path / "out" / "bench_sum.json").read_text()) == {"total": 45}


def test_law_is_one_of_contact(vanedamp, tmp_path):
    """An impact at a speed v leaves v / (1 + v)."""
    scene = (tmp_path / "scene.toml").read_text() + "velocity = 1.0\n[gravity]\nacceleration = 0.0\n"
    scene += "[time]\nperiods = 1\ntransient = 0\n[contact]\nlaw = 'slower'\n"
    (tmp_path / "scene.toml").write_text(scene + "half = 1.0\n")
    data = json.loads(succeeds(vanedamp("run", "scene.toml", "--json", "-", "--events")))
    first = next(event for event in data["event_list"] if event["kind"] == "impact")
    before, after = (abs(first[f"relative_velocity_{when}"]) for when in ("before", "after"))
    assert after == pytest.approx(before / (1 + before), rel=1e-9)
    (tmp_path / "scene.toml").write_text(scene)
    finished = vanedamp("run", "scene.toml")
    assert (finished.returncode, finished.stderr) == (
        BAD_INPUT, "vanedamp: scene.toml: contact.half: missing; it is required here\n"
    )  # fmt: skip


def test_element_and_shape_are_tables_and_values_of_a_scene(vanedamp, tmp_path):
    scene = (tmp_path / "scene.toml").read_text().split("[[damper]]")[0] + "play = 1e-4\n"
    scene += "[[damper]]\ncavity = 'c1'\nmass = 0.05\nshape = 'diamond'\nedge = 0.01\n"
    scene += "[time]\nperiods = 3\ntransient = 0\n"
    scene += "[[leash]]\nlength = 1e-5\nstiffness = 1e5\n"
    (tmp_path / "scene.toml").write_text(scene)
    data = json.loads(succeeds(vanedamp("run", "scene.toml", "--json", "-", "--events")))
    sides = {(event["side"], event["damper"]) for event in data["event_list"] if event["kind"] == "impact"}
    assert data["status"] == "ok" and ("leash", 0) in sides and sides & {("left", 0), ("right", 0), ("floor", 0)}
    assert data["energy_residual"] < 1e-9
    (tmp_path / "scene.toml").write_text(scene.replace("length = 1e-5", "lengt = 1e-5"))
    assert vanedamp("check", "scene.toml").stderr == (
        "vanedamp: scene.toml: leash[0].lengt: unknown key; did you mean 'length'?\n"
    )
    table = json.loads(succeeds(vanedamp("schema", "scene")))["$defs"]
    assert table["Leash"]["properties"]["length"]["x-unit"] == "m"
    assert "diamond" in table["Damper"]["properties"]["shape"]["enum"]


@pytest.mark.parametrize(
    ("package", "name", "text", "message"),
    [
        (
            "acme_broken",
            "broken",
            "import no_such_package",
            r"cannot be loaded \(ModuleNotFoundError: .*no_such_package",
        ),
        ("acme_lacking", "broken", "SUMMARY = 'no more than that'", r"is no command: lacks add_arguments, run"),
        ("acme_taken", "run", COMMAND, r"there is a command named run already; name it otherwise"),
    ],
)
def test_unusable_command_is_named_and_leaves_ours_alone(package, name, text, message, tmp_path, monkeypatch, capsys):
    entry = f"{name} = {package}.part"
    install(tmp_path / "site", package, f"[vanedamp.commands]\n{entry}\n", part__py=text)
    monkeypatch.syspath_prepend(tmp_path / "site")
    assert main(["--help"]) == BAD_INPUT
    error = capsys.readouterr().err
    assert re.search(re.escape(f"vanedamp: entry point {entry} (vanedamp.commands): ") + message, error)
    assert error.count("\n") == 1
    with pytest.raises(SystemExit) as stopped:
        main(["run", "--help"])
    assert stopped.value.code == 0


def test_sections_of_one_kind_are_refused(tmp_path, monkeypatch, capsys):
    section = SECTION.replace('"body-masses"', '"sweep"')
    install(
        tmp_path / "site", "acme_twin", "[vanedamp.report_sections]\ntwin = acme_twin.section\n", section__py=section
    )
    monkeypatch.syspath_prepend(tmp_path / "site")
    assert main(["report", str(tmp_path), "-o", str(tmp_path / "report.html")]) == BAD_INPUT
    assert "two sections of the report show results of the kind sweep" in capsys.readouterr().err
