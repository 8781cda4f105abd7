"""Files of the command: links, devices and pipes, outputs that are inputs, full disks; packages that are missing."""

import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import threading
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.tools.input_files import DAMPED_BLOCK, SCENE, rom_scene
from tests.tools.processes import ROOT, environment, vanedamp, without_stages
from tests.tools.tiers import cases
from vanedamp.files.store import StoreError, Variable, load, replacing, save
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.matrix_files import FILES
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import BAD_INPUT, main

# links, devices, pipes


def test_links_stay_and_their_targets_are_replaced(folder):
    (folder / "results").mkdir()
    (folder / "there.h5").symlink_to("results/there.h5")
    (folder / "results/there.h5").write_text("old")
    (folder / "new.h5").symlink_to("over.h5")
    (folder / "over.h5").symlink_to(folder / "results/new.h5")
    for link in ("there.h5", "new.h5"):
        assert main(["run", "scene.toml", "-o", link]) == 0
        assert (folder / link).is_symlink()
        assert "period" in load(folder / "results" / link, "response")[0]
    assert (folder / "over.h5").is_symlink()
    assert sorted(path.name for path in (folder / "results").iterdir()) == ["new.h5", "there.h5"]


def test_pipes_get_the_whole_content(folder):
    os.mkfifo(folder / "pipe.h5")
    taken = []
    reader = threading.Thread(target=lambda: taken.append((folder / "pipe.h5").read_bytes()))
    reader.start()
    assert main(["run", "scene.toml", "-o", "pipe.h5"]) == 0
    reader.join()
    assert (folder / "pipe.h5").is_fifo()
    (folder / "copy.h5").write_bytes(taken[0])
    assert main(["run", "scene.toml", "-o", "file.h5"]) == 0
    assert load("copy.h5", "response")[0]["peak"].tolist() == load("file.h5", "response")[0]["peak"].tolist()


def test_sweep_into_a_device_leaves_nothing_beside_it(folder):
    assert main(["sweep", "scene.toml", "-o", os.devnull, "--json", os.devnull, "--workers", "1"]) == 0
    assert Path(os.devnull).is_char_device()
    assert not Path(f"{os.devnull}.partial").exists()


@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="no device that is full")
def test_full_device():
    with pytest.raises(StoreError, match=r"/dev/full: cannot be written \(No space left on device\)"):
        save("/dev/full", "none", {"a": Variable([1.0], ("n",))})
    assert Path("/dev/full").is_char_device()


def test_links_in_a_circle(folder, capfd):
    (folder / "one.h5").symlink_to("two.h5")
    (folder / "two.h5").symlink_to("one.h5")
    assert main(["run", "scene.toml", "-o", "one.h5"]) == BAD_INPUT
    assert "--output one.h5: cannot be written" in capfd.readouterr().err


def test_standard_output_by_its_name(folder):
    finished = vanedamp("run", "scene.toml", "--json", "/dev/stdout", cwd=folder)
    assert finished.returncode == 0
    assert json.loads(finished.stdout)["amplitude_max"] > 0.0
    finished = vanedamp("run", "scene.toml", "-o", "/dev/stdout", cwd=folder)
    assert finished.returncode == BAD_INPUT
    assert "is standard output, where the summary goes" in finished.stderr


# inputs


def _rom_scene(folder):
    ReducedModel.from_matrices([[1.0]], [[1e4]], {"tip": [1.0]}, damping_ratio=0.01).save(folder / "rom.h5")
    (folder / "rom.toml").write_text(rom_scene("rom.h5"))


def _mesh_case(folder):
    build(TaperedBlock(0.1, 0.02, 0.01, divisions=(2, 1, 1)), folder / "block.msh")
    rest = DAMPED_BLOCK.split("[material.default]")[1]
    (folder / "mesh.toml").write_text('[mesh]\nfile = "block.msh"\n[material.default]' + rest)
    (folder / "shapes.csv").write_text("precious")
    (folder / "shape.toml").write_text(
        (folder / "mesh.toml").read_text().replace("[modes]", '[modes]\nshape = "shapes.csv"')
    )


@pytest.mark.parametrize(
    ("arguments", "input_file"),
    [
        (["run", "scene.toml", "-o", "scene.toml"], "scene.toml"),
        (["run", "scene.toml", "--json", "./scene.toml"], "scene.toml"),
        (["run", "scene.toml", "-o", "hard.h5"], "scene.toml"),
        (["run", "scene.toml", "-o", "soft.h5"], "scene.toml"),
        (["run", "rom.toml", "-o", "rom.h5"], "rom.h5"),
        (["sweep", "rom.toml", "-o", "rom.h5"], "rom.h5"),
        (["sweep", "it.h5.partial", "-o", "it.h5"], "it.h5.partial"),
        (["modal", "mesh.toml", "-o", "block.msh"], "block.msh"),
        (["reduce", "mesh.toml", "--json", "block.msh"], "block.msh"),
        (["modal", "shape.toml", "-o", "shapes.csv"], "shapes.csv"),
        (["matrices", "nodes.csv", "-o", "."], "nodes.csv"),
        (["import", "external.toml", "-o", "mass.mtx"], "mass.mtx"),
        (["report", "response.html", "-o", "response.html"], "response.html"),
    ],
)
def test_inputs_are_kept(arguments, input_file, folder, capfd):
    _rom_scene(folder)
    _mesh_case(folder)
    os.link("scene.toml", "hard.h5")
    os.symlink("scene.toml", "soft.h5")
    (folder / "it.h5.partial").write_text(SCENE)
    (folder / "nodes.csv").write_text(DAMPED_BLOCK)
    (folder / "mass.mtx").write_text("precious")
    (folder / "external.toml").write_text(
        '[matrices]\nmass = "mass.mtx"\nstiffness = "mass.mtx"\ndamping_ratio = 0.0\n[interface.tip]\ncoordinate = 0\n'
    )
    (folder / "response.html").write_text("precious")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert main(arguments) == BAD_INPUT
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    assert input_file in error and ("is an input" in error or "expected a file name ending in .h5" in error)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    "outputs",
    [
        ["-o", "out", "--json", "out"],
        ["-o", "out", "--json", "./out"],
        ["-o", "one", "--json", "two"],
        ["-o", "out", "--json", "out.partial"],
    ],
)
def test_two_outputs_are_two_files(outputs, folder, capfd):
    (folder / "one").symlink_to("there")
    (folder / "two").symlink_to("there")
    assert main(["sweep", "scene.toml", *outputs]) == BAD_INPUT
    assert "name two files" in capfd.readouterr().err
    assert not (folder / "there").exists()


# full disks


@pytest.fixture
def small_files():
    """A function after which no file grows beyond so many bytes: to a writer, that is a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda most: resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    ("arguments", "output", "most"),
    [
        (["run", "scene.toml", "-o", "response.h5"], "response.h5", 3000),
        (["run", "scene.toml", "--json", "response.json"], "response.json", 100),
        (["mesh", "case.toml", "-o", "block.msh"], "block.msh", 3000),
        (["modal", "case.toml", "--json", "modes.json"], "modes.json", 100),
        (["export", "modes.h5", "-o", "modes.vtkhdf"], "modes.vtkhdf", 3000),
        (["matrices", "case.toml", "-o", "matrices"], "matrices/stiffness.mtx", 60000),
        (["report", "response.h5", "-o", "report.html"], "report.html", 2_000),
    ],
)
def test_full_disk(arguments, output, most, folder, small_files, capfd, monkeypatch):
    if arguments[0] == "report":
        assert main(["run", "scene.toml", "-o", "response.h5"]) == 0
    if arguments[0] == "export":
        assert main(["modal", "case.toml", "-o", "modes.h5"]) == 0
    if arguments[0] in ("modal", "matrices"):
        # what dolfinx compiles and the mesh on its way fit
        from vanedamp.studies.case.stages import assemble
        from vanedamp.studies.case.tables import Case

        structure = assemble(Case.load("case.toml"))
        command = importlib.import_module(f"vanedamp.studies.commands.{arguments[0]}")
        monkeypatch.setattr(command, "assemble", lambda case: structure)
    assert main(arguments) == 0
    before = (folder / output).read_bytes()
    capfd.readouterr()
    small_files(most)
    assert main(arguments) == BAD_INPUT
    error = capfd.readouterr().err
    assert error.count("\n") == 1
    assert f"{output}: cannot be written" in error
    assert (folder / output).read_bytes() == before
    assert not [path for path in folder.rglob(".*")]
    assert set(os.listdir("matrices")) == set(FILES) if output.startswith("matrices") else True


@pytest.mark.parametrize("words", [["run", "scene.toml", "--json", "-"], ["--help"], ["info", "none.h5"]])
def test_full_output(folder, words):
    """The interpreter would write the rest as it ends, and change the status."""
    errors = words[0] == "info"
    with open("/dev/full", "w") as full:
        finished = subprocess.run(
            [sys.executable, "-m", "vanedamp", *words], cwd=folder, stdout=full, stderr=full if errors else -1,
            text=True, check=False, env=environment(),
        )  # fmt: skip
    assert finished.returncode == BAD_INPUT
    if not errors:
        told = "vanedamp: standard output, or another file: No space left on device\n"
        assert without_stages(finished.stderr) == told


POSIX = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


@pytest.mark.parametrize("variables", cases([{"PYTHONIOENCODING": "ascii"}, POSIX], fast=[POSIX]))
def test_output_that_holds_ascii_only(tmp_path, variables):
    answer = "5 \N{MICRO SIGN}m"
    save(tmp_path / "own.h5", "own", {}, {"answer": answer})
    shown = vanedamp("info", "own.h5", cwd=tmp_path, **variables)
    assert (shown.returncode, r"answer                5 \xb5m" in shown.stdout) == (0, True)
    data = vanedamp("info", "own.h5", "--json", "-", cwd=tmp_path, **variables)
    assert json.loads(data.stdout)["answer"] == answer
    name = "\N{MICRO SIGN}.h5"  # whose bytes are no text in the C locale
    ReducedModel.from_matrices(np.eye(2), np.diag([1e4, 1e6]), {"x": [1.0, 0.0]}, damping_ratio=0.1).save(
        tmp_path / name
    )
    page = vanedamp("report", name, "-o", "r.html", cwd=tmp_path, **variables)
    assert page.returncode == (BAD_INPUT if "LC_ALL" in variables else 0)
    assert ("set LC_ALL=C.UTF-8\n" in page.stderr) == ("LC_ALL" in variables)


def test_nobody_reads_on(folder):
    command = f"{sys.executable} -m vanedamp run scene.toml --events --json - | head -c 1"
    finished = subprocess.run(command, shell=True, cwd=folder, capture_output=True, text=True, env=environment())
    assert (finished.stdout, without_stages(finished.stderr)) == ("{", "")


def test_leftovers_beside_the_target_of_a_link(tmp_path):
    from vanedamp.files.store import clear_leftovers

    (tmp_path / "far").mkdir()
    (tmp_path / "link.h5").symlink_to("far/it.h5")
    with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "link.h5") as temporary:
        temporary.write_text("half")
        raise KeyboardInterrupt
    (tmp_path / "far" / ".it-12345678.h5").write_text("half")
    clear_leftovers(tmp_path / "link.h5")
    assert not list((tmp_path / "far").iterdir())


# inputs that cannot be read, packages and folders that are missing


@pytest.mark.parametrize("command", ["modal", "run", "sweep", "optimise", "import", "report"])
def test_folders_are_no_files(command, folder, capfd):
    (folder / "it.h5").mkdir()
    assert main([command, "it.h5", *(["-o", "report.html"] if command == "report" else [])]) == BAD_INPUT
    error = capfd.readouterr().err
    assert error.count("\n") == 1 and "it.h5" in error


def test_files_without_permission(folder):
    (folder / "scene.toml").chmod(0)
    # root reads every file until it gives up that right
    mortal = ["setpriv", "--bounding-set", "-dac_override,-dac_read_search"] if os.geteuid() == 0 else []
    finished = subprocess.run(
        [*mortal, sys.executable, "-m", "vanedamp", "run", "scene.toml"],
        cwd=folder, env=environment(), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert finished.returncode == BAD_INPUT
    assert finished.stderr.startswith("vanedamp: scene.toml: cannot be read") and finished.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("package", "arguments", "remedy"),
    cases(
        MISSING := [
            ("dolfinx", ["modal", "case.toml"], "apt install python3-dolfinx"),
            ("gmsh", ["mesh", "case.toml", "-o", "block.msh"], "pip install gmsh"),
            ("matplotlib", ["report", "response.h5", "-o", "report.html"], "pip install matplotlib"),
            ("plotly", ["report", "response.h5", "-o", "report.html"], "pip install plotly"),
            ("h5py", ["run", "scene.toml", "-o", "response.h5"], "pip install h5py"),
        ],
        fast=MISSING[::4],
    ),
)
def test_missing_packages(package, arguments, remedy, folder):
    (folder / "empty" / package).mkdir(parents=True)
    absent = f"raise ModuleNotFoundError('No module named {package}', name='{package}')"
    (folder / "empty" / package / "__init__.py").write_text(absent)
    if arguments[0] == "report":
        assert main(["run", "scene.toml", "-o", "response.h5"]) == 0
    finished = vanedamp(*arguments, cwd=folder, PYTHONPATH=f"{folder / 'empty'}{os.pathsep}{ROOT}")
    assert finished.returncode == BAD_INPUT
    assert finished.stderr.count("\n") == 1
    assert finished.stderr.startswith(f"vanedamp: needs {package}, which cannot be loaded")
    assert remedy in finished.stderr


@pytest.mark.parametrize(
    ("package", "raised", "arguments", "line"),
    cases(LACKING := [
        ("ufl", "ImportError('libX.so: cannot open')", ["modal", "case.toml"],
         "a library is installed, but cannot be loaded (libX.so: cannot open)"),
        ("mpi4py", "ImportError('libX.so: failed to map segment from shared object')", ["modal", "case.toml"],
         "not enough memory (libX.so: failed to map segment from shared object): free some, "),
        ("gmsh", "OSError('libX.so: cannot open')", ["mesh", "case.toml", "-o", "block.msh"],
         "case.toml: gmsh, which reads and makes meshes, cannot be loaded (libX.so: cannot open): apt install "),
        ("gmsh", "OSError('libX.so: failed to map segment')", ["mesh", "case.toml", "-o", "block.msh"],
         "not enough memory (libX.so: failed to map segment): free some, "),
        ("h5py", "MemoryError()", ["run", "scene.toml", "-o", "response.h5"], "not enough memory (none left): free "),
        ("h5py", "RuntimeError(\"can't start new thread\")", ["run", "scene.toml", "-o", "response.h5"],
         "not enough memory (can't start new thread): free some, "),
    ], fast=LACKING[2:4]),
)  # fmt: skip
def test_libraries_that_do_not_load(package, raised, arguments, line, folder):
    (folder / "broken" / package).mkdir(parents=True)
    # what runs at the end of a process, as in OpenBLAS, may wait for memory for ever
    (folder / "broken" / package / "__init__.py").write_text(
        f"import atexit\natexit.register(print, 'the end', flush=True)\nraise {raised}"
    )
    finished = vanedamp(*arguments, cwd=folder, PYTHONPATH=f"{folder / 'broken'}{os.pathsep}{ROOT}")
    assert finished.returncode == BAD_INPUT
    assert finished.stderr.count("\n") == 1 and finished.stderr.startswith(f"vanedamp: {line}")
    assert ("the end" in finished.stdout) == ("memory" not in line)


@pytest.mark.parametrize("arguments", [["info", "it.h5"], ["modal", "case.toml", "--json", "-"]])
def test_a_reader_that_closes_the_pipe(arguments, folder):
    save("it.h5", "own", {}, {"answer": 42})
    words = [sys.executable, "-m", "vanedamp", *arguments]
    with subprocess.Popen(words, cwd=folder, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as ran:
        ran.stdout.close()
        error = without_stages(ran.stderr.read().decode())
    assert (ran.returncode, error) == (1, "")


def test_solvers_leave_the_handlers_of_signals():
    """They print pages at a fault, and Python's own handler has nothing to say."""
    code = "import ctypes, faulthandler\nfaulthandler.enable()\nimport vanedamp.modal.elasticity\nctypes.string_at(0)"
    crashed = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=False
    )
    assert crashed.returncode == -signal.SIGSEGV
    assert crashed.stderr.startswith("Fatal Python error: Segmentation fault") and "PETSC" not in crashed.stderr


def test_no_folder_for_compiled_functions(folder):
    nowhere = {"NUMBA_CACHE_DIR": f"{os.devnull}/cache", "NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator"}
    finished = vanedamp("run", "scene.toml", cwd=folder, **nowhere)
    assert finished.returncode == BAD_INPUT
    assert finished.stderr.count("\n") == 1
    assert "set NUMBA_CACHE_DIR" in finished.stderr


def test_equal_records_are_equal_files_whatever_other_packages_set(tmp_path, monkeypatch):
    """h5py has settings of the process, which writers of meshes change and leave so."""
    variables = {"mode": Variable(np.arange(3.0), ("mode",), "1"), "name": Variable(["a", "b", "c"], ("mode",), "1")}
    save(tmp_path / "one.h5", "something", variables | {"plain": Variable(np.zeros(2), ("other",), "m")}, {"a": 1})
    monkeypatch.setattr(h5py.get_config(), "track_order", True)
    save(tmp_path / "two.h5", "something", variables | {"plain": Variable(np.zeros(2), ("other",), "m")}, {"a": 1})
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "two.h5").read_bytes()
