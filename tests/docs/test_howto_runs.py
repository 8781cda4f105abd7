"""Programs of docs/howto run as they stand, and the tutorial from its first block to its last."""

import ast
import re
import shutil
import tomllib

import numpy as np
import pytest

from docs._ext.session import Session
from tests.docs.test_examples import examples_of, program, run
from tests.tools.input_files import SCENE
from tests.tools.processes import ROOT
from tests.tools.small_structures import truss
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.modal.matrices import Patch
from vanedamp.modal.matrix_files import write_folder

#: of the repository, whose parts may take those of other packages
PARTS = ("files", "modal", "rom", "coupling", "studies", "benchmarks")
DOCS = ROOT / "docs"
TUTORIAL = DOCS / "tutorial" / "index.md"


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """A folder with the result of a sweep."""
    folder = tmp_path_factory.mktemp("results")
    (folder / "scene.toml").write_text(SCENE)
    sweep(Scene.load(folder / "scene.toml")).save(folder / "sweep.h5")
    return folder


def test_matrices_of_another_code_become_a_reduced_model(tmp_path):
    from dataclasses import replace

    structure = truss(nodes=12)
    groups = {"clamp": structure.fixed[::3] // 3, "shroud": [8], "c1_floor": [10]}
    patches = {name: Patch(np.unique(nodes), np.ones(len(np.unique(nodes)))) for name, nodes in groups.items()}
    write_folder(replace(structure, patches=patches), tmp_path)
    printed = run(program("other_matrices.md", "read_matrices"), tmp_path)
    assert "ReducedModel" in printed and (tmp_path / "rom.h5").is_file()


def test_matrices_in_python_become_a_scene(tmp_path):
    printed = run(program("other_matrices.md", "np.diag"), tmp_path)
    assert "frequencies_hz: " in printed
    assert Scene.load(tmp_path / "scene.toml").structure.file == str(tmp_path / "scene_rom.h5")


def test_results_open_in_xarray(swept):
    pytest.importorskip("h5netcdf", reason="needs h5netcdf")
    printed = run(program("read_results.md", "import xarray"), swept)
    assert f"{Sweep.load(swept / 'sweep.h5').amplitude_mean.max():.4g}"[:4] in printed
    assert printed.split()[-1] == "m"


def test_results_open_in_h5py(swept):
    shape, unit = run(program("read_results.md", "import h5py"), swept).rsplit(maxsplit=1)
    assert (eval(shape), unit) == (Sweep.load(swept / "sweep.h5").shape, "m")


def test_program_of_mpi_is_that_of_the_sweeps():
    """The one that tests/docs/test_examples.py runs."""
    assert program("supercomputer.md", "mpi4py") == program("sweeps.md", "mpi4py")


#: what keeps parts of one kind
PLACES = ("ExtensionPoint", "Registry", "Variants")


def groups_in_the_code():
    """Groups of entry points: words "vanedamp.NAME" in the calls that make the places of parts."""
    for path in (path for part in PARTS for path in (ROOT / part).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in PLACES:
                words = [word.value for word in node.args if isinstance(word, ast.Constant)]
                yield from (word for word in words if re.fullmatch(r"vanedamp\.[a-z_]+", str(word)))


def test_page_of_own_parts_has_every_group():
    groups = list(groups_in_the_code())
    assert len(groups) == 11 == len(set(groups))
    listed = re.findall(r"^\| `(vanedamp\.\w+)` \|", (ROOT / "docs" / "howto" / "own_parts.md").read_text(), re.M)
    assert sorted(listed) == sorted(groups)


@pytest.mark.parametrize("word", ["Falling", "Triangle", "Chamfered", "Tether"])
def test_own_parts_of_scenes(word, tmp_path):
    """Each program prints what the page says: the law's restitution is its formula."""
    page = examples_of(ROOT / "docs" / "howto" / "own_parts.md")
    at = next(i for i, example in enumerate(page) if f"class {word}(" in example.text)
    assert run(page[at].text, tmp_path).split() == page[at + 1].text.split()


# the tutorial


def blocks(text: str):
    """Yield the blocks of a page that is run as it is built: directive, argument, options, text."""
    for kind, argument, body in re.findall(r"^```\{(file|shell|python)\}(.*?)\n(.*?)\n```", text, re.M | re.S):
        lines, options = body.splitlines(), {}
        while lines and (found := re.fullmatch(r":(\w+):\s*(.*)", lines[0])):
            options[found[1]] = found[2]
            lines.pop(0)
        yield kind, argument.strip(), options, "\n".join(lines).strip("\n")


def followed(page, folder):
    """Run a page in a folder. Returns its session and what its commands print."""
    session, printed = Session(folder), []
    for kind, argument, options, text in blocks(page.read_text(encoding="utf-8")):
        for name in options.get("files", "").split():
            shutil.copy(page.parent / name, session.folder)
        if kind == "file":
            session.write(argument, text, "append" in options)
        elif kind == "shell":
            printed.append(session.shell(text))
        else:
            told, pictures = session.python(text)
            printed.append(told)
            assert "alt" not in options or pictures
    return session, printed


@pytest.mark.parametrize(
    ("page", "told"),
    [
        ("frf", ["'Betrag [g/N] and Phase [deg]' as magnitude-degrees in g/N; accelerance", "give conjugate = true"]),
        ("decay", ["'swing [mm pk-pk]' as amplitude in mm pk-pk", "structure.damping_ratio = 0.02"]),
        pytest.param(
            "sweep",
            ["up at 0.00286 Hz/s, 8 points", "structure.damping_ratio = 0.01", "status ok"],
            marks=pytest.mark.slow,
        ),
    ],
)
def test_measured_data_come_in_as_their_pages_say(tmp_path, page, told):
    _, printed = followed(DOCS / "howto" / f"measured_{page}.md", tmp_path / "work")
    assert all(one in "\n".join(printed) for one in told)


@pytest.mark.slow
def test_tutorial_leads_to_a_decision(tmp_path):
    """Word by word; the chosen design halves the resonance from every start."""
    pytest.importorskip("dolfinx", reason="needs dolfinx")
    session, (*_, printed) = followed(TUTORIAL, tmp_path / "work")
    shares = [int(share) for share in re.findall(r"(\d+)% of that without bodies", printed)]
    assert len(shares) == 3 and max(shares) < 50
    with (session.folder / "chosen.toml").open("rb") as file:
        assert 0 < tomllib.load(file)["cavity"][0]["gap"] < 1e-3
