"""Examples of README.md and docs/: loaders read the files, programs run, commands are understood, links lead on."""

import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from textwrap import dedent
from typing import NamedTuple

import numpy as np
import pytest
import tomli_w

from benchmarks import BENCHMARKS
from docs._ext.pages import language
from tests.tools.input_files import CLUSTER, SCENE, changed
from tests.tools.processes import PATIENCE, RANKS, ROOT, environment
from tests.tools.schemas import faults, kind_of
from vanedamp.coupling.scene.paths import number_at
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.contact_numbers import ContactFile
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.case.external_model import External
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import _parsers, main
from vanedamp.studies.demo.demo import EFFORT
from vanedamp.studies.demo.figure_file import FOLDER, FigureScenes, FigureStructure
from vanedamp.studies.design.tables import DesignFile
from vanedamp.studies.identification.deviations import load_table
from vanedamp.studies.identification.tables import IdentificationFile
from vanedamp.studies.life.study import LifeStudy
from vanedamp.studies.optimisation.study import Study
from vanedamp.studies.pipeline.tables import PipelineFile

DOCS = ROOT / "docs"
FOLDERS = (".", "tutorial", "howto", "reference")
PAGES = [
    ROOT / "README.md", ROOT / "CONTRIBUTING.md",
    *(page for folder in FOLDERS for page in sorted((DOCS / folder).glob("*.md"))),
]  # fmt: skip


class Example(NamedTuple):
    """An indented block of a page, from a line on."""

    page: str
    line: int
    text: str

    @property
    def language(self) -> str:
        return language(self.text)

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def examples_of(page: Path) -> list[Example]:
    """The blocks that are indented by four blanks after an empty line."""
    found, lines = [], page.read_text(encoding="utf-8").splitlines()
    inside = False
    for number, line in enumerate(lines, 1):
        if line.startswith("    ") and (inside or not lines[number - 2].strip()):
            if not inside:
                found.append(Example(page.name, number, ""))
            found[-1] = found[-1]._replace(text=found[-1].text + line[4:] + "\n")
            inside = True
        elif inside and not line.strip():
            found[-1] = found[-1]._replace(text=found[-1].text + "\n")
        else:
            inside = False
    return [example._replace(text=dedent(example.text)) for example in found]


EXAMPLES = [example for page in PAGES for example in examples_of(page)]


def of(language: str):
    return pytest.mark.parametrize("example", [e for e in EXAMPLES if e.language == language], ids=str)


def test_examples_are_found():
    """Blocks that are no example are diagrams, formulas and what commands print."""
    counts = [sum(example.language == language for example in EXAMPLES) for language in ("toml", "python", "shell")]
    assert all(count >= least for count, least in zip(counts, (15, 3, 11), strict=True)), counts
    for page in PAGES:
        assert "```toml" not in page.read_text() and "```python" not in page.read_text()


# files

#: the scene of the examples: an oscillator like the cluster's first bending
OSCILLATOR = changed(SCENE, ("stiffness = 1e4", "stiffness = 2.26e8"), ("frequency = 15.9", "frequency = 2400.0"))


def completed(tables: dict, folder: Path) -> dict:
    """Tables of an example with those that it leaves out."""
    if {"matrices", "numbers", "pair", "deviations"} & tables.keys():
        return tables
    if "envelope" in tables:
        return {"case": "case.toml"} | tables
    scene = {
        "structure",
        "contact",
        "excitation",
        "sweep",
        "continuation",
        "optimise",
        "life",
        "wear",
        "orbit",
        "ramp",
        "ring_down",
    } & tables.keys()
    base = tomllib.loads(OSCILLATOR if scene else CLUSTER)
    contact = tables.get("contact", {})
    if contact.get("law") == "hertz":
        del base["damper"][0]["restitution"]
    if contact.get("stiffness") == "patch":
        tables["structure"] = {"model": "rom", "file": "rom.h5"}
    numbers = tables.get("sweep", {}) | tables.get("optimise", {}).get("variables", {})
    if any(name.startswith("joint.") for name in numbers):
        tables["structure"] = {"model": "rom", "file": "rom.h5"}
        base["joint"] = [
            {"between": ["tip", "casing"], "normal": ["across", "casing"], "friction": 0.3, "preload": 9.0}
        ]
    if "structure" in tables:
        labels = {"tip": [1.0, 0.5], "across": [0.2, 1.0]}
        ReducedModel.from_matrices(np.eye(2), np.diag([2.26e8, 1e10]), labels, damping_ratio=0.01).save(
            folder / "rom.h5"
        )
        base["excitation"]["at"] = base["cavity"][0]["floor"] = "tip"
    if "life" in tables:
        base = {name: table for name, table in base.items() if name != "sweep"} | {"wear": {"rate": 1e-14}}
    for name in ("material", "modes"):
        if name in base and name in tables:
            tables[name] = base[name] | tables[name]
    return base | tables


def files_named(tables) -> list[str]:
    if isinstance(tables, dict):
        return [name for value in tables.values() for name in files_named(value)]
    return [tables] if isinstance(tables, str) and re.fullmatch(r"\w+\.(csv|inp|op4)", tables) else []


@of("toml")
def test_files_are_read(example, tmp_path):
    tables = tomllib.loads(example.text)
    for name in files_named(tables):
        (tmp_path / name).write_text("")
    path = tmp_path / "example.toml"
    whole = completed(tables, tmp_path)
    assert faults(kind_of(whole), whole) == []
    path.write_text(tomli_w.dumps(whole))
    if "matrices" in tables:
        assert External.read(path).interface.keys() == tables["interface"].keys()
    elif "envelope" in tables:
        assert validate(DesignFile, whole, "design").envelope.bodies == (1, 2)
    elif "numbers" in tables:
        assert len(validate(IdentificationFile, tables, "study").numbers) == 2
    elif "deviations" in tables:
        assert load_table(path).at == "tip"
    elif "pair" in tables:
        assert validate(ContactFile, tables, "pair").pair.contact is not None
    elif "contact" in tables:
        assert Scene.load(path).contact.pair is not None
    elif "optimise" in tables:
        variables = Study.load(path).table.variables
        assert variables.bodies == (1, 4) or len(variables.numbers) in (1, 3)
    elif "life" in tables:
        assert LifeStudy.load(path).table.threshold == 0.5
    elif "wear" in tables:
        assert Scene.load(path).wear is not None
    elif "orbit" in tables:
        assert Scene.load(path).orbit is not None
    elif "ramp" in tables:
        assert Scene.load(path).ramp is not None
    elif "ring_down" in tables:
        assert Scene.load(path).ring_down is not None
    elif {"structure", "excitation", "sweep", "continuation"} & tables.keys():
        scene = Scene.load(path)
        axes, points = scene.sweep_points()
        drive = next(path for path in ("excitation.frequency", "rotation.rpm") if path in axes)
        assert number_at(scene.replace(next(points)).to_dict(), drive) == axes[drive][0]
    else:
        case = Case.load(path)
        assert tables.get("interface", case.interface).keys() <= case.interface.keys()


@pytest.mark.parametrize("path", sorted((ROOT / "docs" / "examples").glob("*.toml")), ids=lambda path: path.name)
def test_example_files_are_read(path, tmp_path):
    if "[report]" in path.read_text():
        for name in ("pipeline", "case", "gaps", "reduced"):
            (tmp_path / f"{name}.toml").write_text(path.read_text())
        assert len(PipelineFile.load(tmp_path / "pipeline.toml").sweep) == 2
        return
    if "[mesh]" in path.read_text():
        case = Case.load(path)
        assert case.campbell is not None or case.ring is not None
        return
    of_study = {"[optimise]": Study, "[life]": LifeStudy}
    load = next((kind.load for table, kind in of_study.items() if table in path.read_text()), None)
    scene = Scene.load(path) if load is None else load(path).scene
    assert scene.damper


# programs


def run(text: str, folder: Path) -> str:
    """Run a program in a folder. Returns its output."""
    (folder / "program.py").write_text(text)
    done = subprocess.run(
        [sys.executable, "program.py"], cwd=folder, env=environment(**RANKS), capture_output=True, text=True,
        check=False, timeout=PATIENCE,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def program(page: str, word: str) -> str:
    """The Python example of a page that has a word."""
    (found,) = [e.text for e in EXAMPLES if e.language == "python" and e.page == page and word in e.text]
    return found


def test_program_of_the_readme(tmp_path):
    """On the scene that `make demo` leaves, with its effort."""
    structure = FigureStructure(0.157, 0.157 * (2 * np.pi * 2412.0) ** 2, 0.002, 2412.0, 70e-6, Path("rom.h5"))
    scene = FigureScenes.load(FOLDER / "fig10.toml", structure, EFFORT).scenes["single"]
    (tmp_path / "out").mkdir()
    scene.save(tmp_path / "out" / "fig10_single.toml")
    status, *printed = run(program("README.md", "simulate"), tmp_path).replace("[", "").replace("]", "").split()
    amplitude, attached, *reductions = map(float, printed)
    scene.replace({"excitation.frequency": 2382.0, "cavity.c1.gap": 2e-5}).save(tmp_path / "same.toml")
    # in a process like the program's: the motion is chaotic, and BLAS's threads decide its last bits
    asked = (
        "import vanedamp as vd\nr = vd.simulate('same.toml')\n"
        "print(r.status, r.amplitude_mean, r.attached_mass_fraction)"
    )
    expected, *figures = run(asked, tmp_path).split()
    assert status == expected
    assert (amplitude, attached) == pytest.approx(tuple(map(float, figures)))
    assert len(reductions) == 3 and max(reductions) < 1.0


def test_program_of_noise(tmp_path):
    """It prints the figures of the text and draws the picture of the page."""
    (tmp_path / "noise.toml").write_text((ROOT / "docs" / "examples" / "noise.toml").read_text())
    text = "import matplotlib\n\nmatplotlib.use('Agg')\n" + program("service_loads.md", "multisine.png")
    rigid, loose = re.findall(r": ([\d.]+) µm rms", run(text, tmp_path))
    assert (float(rigid), float(loose)) == pytest.approx((17.2, 5.5), abs=0.3)
    assert (tmp_path / "multisine.png").is_file()


def test_program_of_mpi_ranks(tmp_path):
    pytest.importorskip("mpi4py", reason="needs mpi4py")
    (tmp_path / "scene.toml").write_text(SCENE)
    run(program("sweeps.md", "mpi4py"), tmp_path)
    assert Sweep.load(tmp_path / "sweep.h5").shape == (4,)


@pytest.mark.slow
def test_program_of_dask_workers(tmp_path):
    """With a LocalCluster, as its comment says, in place of the scheduler's address."""
    pytest.importorskip("distributed", reason="needs dask.distributed")
    (tmp_path / "scene.toml").write_text(SCENE)
    text = program("sweeps.md", "distributed")
    local = changed(text, ('Client("scheduler:8786")', "Client(LocalCluster(n_workers=2, dashboard_address=None))"))
    imports = "from distributed import LocalCluster\nfrom vanedamp import Scene, sweep\n"
    body = "".join(f"    {line}\n" for line in local.splitlines())
    run(f'{imports}if __name__ == "__main__":\n{body}', tmp_path)
    assert Sweep.load(tmp_path / "sweep.h5").shape == (4,)


# commands


@of("shell")
def test_commands_are_understood(example):
    for line in example.text.splitlines():
        words = shlex.split(line, comments=True) if "<(" not in line else []
        if "vanedamp" in words:
            arguments = words[words.index("vanedamp") + 1 :]
            assert _parsers(arguments[0])[0].parse_args(arguments).command == arguments[0]
        elif words[:1] == ["make"]:
            assert re.search(rf"^{words[1]}:", (ROOT / "Makefile").read_text(), re.MULTILINE)


def test_command_lines_in_pages_are_found():
    lines = [line for e in EXAMPLES if e.language == "shell" for line in e.text.splitlines()]
    assert sum("vanedamp" in line.split("#")[0] for line in lines) >= 12


def test_modules_in_pages_run():
    """`python -m NAME`: in examples and in the text."""
    names = {name for page in PAGES for name in re.findall(r"python -m ([\w.]+)", page.read_text())}
    assert names >= {"tests.validation", "tests.tools.laws_of_runs"}
    for name in names:
        path = ROOT / name.replace(".", "/")
        assert path.with_suffix(".py").exists() or (path / "__main__.py").exists(), name


def test_page_of_commands_describes_every_one(capsys):
    text = (DOCS / "reference" / "commands.md").read_text()
    described = {line.split("`")[1].split()[1] for line in text.splitlines() if line.startswith("| `vanedamp ")}
    with pytest.raises(SystemExit):
        main(["--help"])
    usage = capsys.readouterr().out
    assert described == {line.split()[0] for line in usage.splitlines() if line.startswith("    ") and line[4] != " "}


def test_page_of_benchmarks_describes_every_one():
    text = (DOCS / "benchmarks.md").read_text()
    assert set(re.findall(r"^\| `vanedamp bench ([\w-]+)` \|", text, re.MULTILINE)) == set(BENCHMARKS.all())


# links


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_pages_have_links_and_names_of_files():
    """What the next tests look for is there."""
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert len(re.findall(r"\]\(([^)\s]+)\)", text)) > 50 and len(re.findall(r"\btests/[\w/]+\.py\b", text)) > 20


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_to_files_and_headings(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = page.parent / name if name else page
        assert target.exists(), link
        assert not anchor or anchor in anchors(target), link


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_the_text_names_exist(page):
    """From the root of the repository."""
    parts = "docs|tests|scripts|files|meshes|modal|rom|coupling|studies"
    for name in re.findall(rf"(?<![\w/.])(?:{parts})/[\w/]+\.(?:md|py|sh|toml)\b", page.read_text(encoding="utf-8")):
        assert (ROOT / name).exists(), name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_tests_that_the_text_names_exist(page):
    """`FILE.py::FUNCTION` in tests/."""
    for file, function in re.findall(r"`tests/((?:\w+/)*test_\w+\.py)::(\w+)`", page.read_text(encoding="utf-8")):
        assert f"def {function}(" in (ROOT / "tests" / file).read_text()
