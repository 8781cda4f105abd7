"""Compiled functions are compiled anew when the code that they hold has changed, and only then."""

import pickle
import runpy
import subprocess
import sys
from importlib.metadata import version
from multiprocessing import Pipe, get_context

import numba
import pytest

from tests.tools.processes import environment
from vanedamp.coupling.numerics.compiler import jit
from vanedamp.coupling.numerics.compiler.jit import _read, _sources


@pytest.fixture
def digest(tmp_path, monkeypatch):
    """Digest of a file of compiled functions in a chain caller -> callee -> records -> scenes."""
    texts = {
        "caller": "from vanedamp.callee import rise\n@entry\ndef climb(x): return rise(x)\n",
        "callee": "from vanedamp.records import STEP\n@kernel\ndef rise(x): return x + STEP\n",
        "records": "from vanedamp.scenes import Scene\nSTEP = 1.0\n",
        "scenes": "class Scene: pass\n",
    }
    for name, text in texts.items():
        (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.setattr(jit, "_PACKAGE", tmp_path)

    def after(edited=None, file="caller"):
        for name, text in texts.items():
            (tmp_path / f"{name}.py").write_text(text + ("\n# edited\n" if name == edited else ""))
        _sources.cache_clear()
        _read.cache_clear()
        return _sources(tmp_path / f"{file}.py")

    yield after
    _sources.cache_clear()


@pytest.mark.parametrize("name", ["caller", "callee", "records"])
def test_code_that_a_function_holds_dates_it(digest, name):
    assert digest(name) != digest()


def test_data_behind_records_does_not_date_it(digest):
    assert digest("scenes") == digest()


def test_a_caller_does_not_date_its_callee(digest):
    assert digest("caller", "callee") == digest(None, "callee")


_KEPT = """
import numpy as np
from vanedamp.coupling.numerics.compiler.jit import entry

def add(values, one):
    for place in range(len(values)):
        values[place] += one

values, compiled = np.zeros(3), entry(add)
compiled(values, FACTOR)
found = float(values.sum()), sum(compiled._compiled.stats.cache_hits.values()) == 1
"""


def _forked(program, cache):
    """What a program finds in a process of its own that has numba already, and keeps code elsewhere; or its OSError."""
    parent, child = Pipe()

    def work():
        numba.config.CACHE_DIR = str(cache)
        try:
            child.send(runpy.run_path(str(program))["found"])
        except OSError as error:
            child.send(error)

    process = get_context("fork").Process(target=work)
    process.start()
    process.join()
    assert process.exitcode == 0
    found = parent.recv()
    if isinstance(found, OSError):
        raise found
    return found


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """Runs a compiled function in a process of its own, kept in a folder. Returns its sum, and whether it was there."""
    folder = tmp_path_factory.mktemp("kept")

    def run(factor="2.0"):
        (folder / "program.py").write_text(_KEPT.replace("FACTOR", factor))
        return _forked(folder / "program.py", folder / "cache")

    assert run() == (6.0, False)
    (index,) = folder.rglob("*.nbi")
    (code,) = folder.rglob("*.nbc")
    assert run() == (6.0, True)
    return run, {"index": index, "code": code}


_DAMAGE = {
    "empty": lambda content: b"",
    "cut": lambda content: content[: len(content) // 2],
    "noise": lambda content: bytes(range(256)) * 8,
    "zeros within": lambda content: (
        content[: len(content) // 2] + bytes(len(content) // 4) + content[3 * len(content) // 4 :]
    ),
    "another version's": lambda content: (
        pickle.dumps(version("numba")) + b"cvanedamp.coupling.numerics.compiler.jit\nNo\n."
    ),
    "another object": lambda content: pickle.dumps(version("numba")) + pickle.dumps((None, 7)),
}


@pytest.mark.parametrize("damage", _DAMAGE)
@pytest.mark.parametrize("which", ["index", "code"])
def test_damaged_code_is_compiled_again_and_replaced(which, damage, kept):
    """After a loss of power; zeros within machine code would crash, or compute anything."""
    run, files = kept
    content = files[which].read_bytes()
    assert len(content) > 512  # a generic processor's name is short
    files[which].write_bytes(_DAMAGE[damage](content))
    assert run() == (6.0, False)
    assert run() == (6.0, True)


def test_code_that_cannot_be_read_is_compiled_again(kept):
    run, files = kept
    files["code"].unlink()
    files["code"].mkdir()
    # its place cannot be taken, as on a disk that is full: that is told
    with pytest.raises(IsADirectoryError):
        run()
    files["code"].rmdir()
    assert run() == (6.0, False)


def test_code_of_other_arguments_is_not_taken(kept):
    """An index is written before the code: after a crash between both it names what was there before."""
    run, files = kept
    before = files["code"].read_bytes()
    files["index"].unlink()
    files["code"].unlink()
    assert run("2") == (6.0, False)
    files["code"].write_bytes(before)
    assert run("2") == (6.0, False)


_LIBRARIES = """
import sys

import numpy as np
from numba import njit
from vanedamp.coupling.engine.root_search import expand, new_expansion, step_or_stop
from vanedamp.coupling.numerics.codes import POSITION
from vanedamp.coupling.numerics.compiler.jit import entry, kernel


@kernel
def step(k0, g, eigenvalue, end, work):
    noise, second, calm, fast = expand(POSITION, 0.1, 0.0, g, eigenvalue, 0, len(g), 0.0, work)
    return step_or_stop(work, 1.0, k0, np.inf, noise, second, calm, fast, end, 1e-15 * end)[0]


def twice(g, eigenvalue, work):
    return step(1.0, g, eigenvalue, 6.0, work) + step(2.0, g, eigenvalue, 0.1, work)


arguments = np.ones(3) + 0j, 1j * np.arange(1, 4.0), new_expansion(3)
others = [njit(twice), njit(lambda a, b, c: step(1.0, a, b, 6.0, c))] if "others" in sys.argv else []
print(*(function(*arguments) for function in [entry(twice), *others]))
"""


def test_kernels_serve_entries_and_functions_of_others(tmp_path):
    """Called from several places, optimised in an entry first, then linked into functions that numba compiles."""
    (tmp_path / "libraries.py").write_text(_LIBRARIES)
    said = [
        subprocess.run(
            [sys.executable, tmp_path / "libraries.py", *words], check=True, capture_output=True, text=True,
            env=environment(NUMBA_CACHE_DIR=str(tmp_path / "cache")),
        ).stdout.split()
        for words in (["others"], [])  # compiled, and from the disk
    ]  # fmt: skip
    assert said[1] == said[0][:1]
    both, same, one = map(float, said[0])
    assert both == same and 0 < one < both < one + 0.1 + 1e-12
