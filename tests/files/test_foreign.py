"""Files that a user hands over: devices, libraries that crash, records that were damaged or changed."""

import itertools
import os
import signal
import subprocess
import sys

import h5py
import numpy as np
import pytest

from tests.tools.processes import environment
from vanedamp.files import foreign, store
from vanedamp.files.csv_input import read_csv
from vanedamp.files.errors import shortened
from vanedamp.files.foreign import apart, existing, reading
from vanedamp.files.formats.matrices import MatrixFileError
from vanedamp.files.formats.matrices.registry import read_matrices
from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.files.store import StoreError, Variable, decoding
from vanedamp.files.toml_input import InputError, read_toml
from vanedamp.modal.msh import merge
from vanedamp.rom.reduced import ReducedModel


def _stumble():
    raise ZeroDivisionError("division by zero")


@pytest.fixture
def model(tmp_path):
    """The file of a reduced model."""
    ReducedModel.from_matrices(np.eye(2), np.diag([4e6, 9e6]), {"x": [1.0, 0.0]}, damping_ratio=0.1).save(
        tmp_path / "rom.h5"
    )
    return tmp_path / "rom.h5"


def test_devices_pipes_and_folders_are_no_input(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="pipe: is a device or a pipe"):
        read_toml(tmp_path / "pipe")
    with pytest.raises(InputError, match="/dev/zero: is a device or a pipe"):
        read_csv("/dev/zero", ("x",))
    (tmp_path / "zero.mtx").symlink_to("/dev/zero")
    with pytest.raises(MatrixFileError, match=r"zero\.mtx: is a device or a pipe"):
        read_matrices(tmp_path / "zero.mtx")
    with pytest.raises(MeshError, match="is a folder"):
        merge(tmp_path)
    with pytest.raises(StoreError, match="no such file"):
        ReducedModel.load(tmp_path / "none.h5")
    with pytest.raises(InputError, match="cannot be read"):
        existing("a\0b", InputError)


def test_a_library_that_crashes_or_hangs_is_one_line(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")

    def tried(read):
        with pytest.raises(StoreError) as told:
            apart(tmp_path / "file", StoreError, read)
        return str(told.value)

    assert "file: damaged: its library ends in the middle of it (SIGSEGV)" in tried(
        lambda: os.kill(os.getpid(), signal.SIGSEGV)
    )
    assert "SIGABRT" in tried(os.abort)
    monkeypatch.setattr(foreign, "_PATIENCE", 1)
    assert "takes more than 1 s" in tried(lambda: max(itertools.count()))
    monkeypatch.setattr(foreign, "_WAITS", 2)
    assert "takes more than 2 s" in tried(signal.pause)
    with pytest.raises(ValueError, match=r"^division by zero$"):
        apart(tmp_path / "file", StoreError, _stumble)
    assert apart(tmp_path / "file", StoreError, lambda: {"a": 1}) == {"a": 1}


def test_what_a_reader_meets_names_the_file():
    told = r"a\.x: no such format: damaged, or of another format \(division"
    with pytest.raises(StoreError, match=told), reading("a.x", StoreError, "no such format"):
        _stumble()
    for own in (MemoryError(), ImportError(), InputError("own"), OSError(28, "full")):
        with pytest.raises(type(own)), reading("a.x", StoreError, "none"):
            raise own


def test_damage_anywhere_is_seen(model):
    """Its last bytes hold the checksum of the others, which HDF5 itself does not look at."""
    whole = model.read_bytes()
    draw = np.random.default_rng(1)
    for place in draw.integers(0, len(whole) - 20, 60).tolist():
        damaged = bytearray(whole)
        damaged[place] ^= 1 << int(draw.integers(8))
        model.write_bytes(damaged)
        with pytest.raises(StoreError, match=r"rom\.h5: damaged: its bytes are not those that were written"):
            ReducedModel.load(model)
    model.write_bytes(whole)
    assert ReducedModel.load(model).size == 2


def test_records_without_the_checksum_are_tried_apart(model):
    """Those of earlier versions, and those that h5py has changed: a damaged byte is one line, or changes nothing."""
    whole = model.read_bytes()[:-20]
    draw = np.random.default_rng(2)
    refused = 0
    for place in draw.integers(0, len(whole), 30).tolist():
        damaged = bytearray(whole)
        damaged[place] = int(draw.integers(256))
        model.write_bytes(damaged)
        try:
            ReducedModel.load(model)
        except ValueError as error:
            assert "\n" not in str(error)
            refused += 1
    assert refused > 0


def test_h5py_may_change_a_record(model):
    for change in (lambda file: file["mass"].__setitem__((0, 0), 3.0), lambda file: file.attrs.__setitem__("own", 1)):
        with h5py.File(model, "r+") as file:
            change(file)
    assert ReducedModel.load(model).mass[0, 0] == 3.0


def test_a_fault_of_ours_is_not_called_damage(model):
    with pytest.raises(ZeroDivisionError), decoding(model):
        _stumble()
    with h5py.File(model, "r+") as file:
        file.attrs["own"] = 1
    with pytest.raises(StoreError, match=r"rom\.h5: not a readable record: damaged"), decoding(model):
        _stumble()


def test_equal_records_are_equal_files(tmp_path):
    for name in ("a.h5", "b.h5"):
        store.save(tmp_path / name, "kind", {"x": Variable(np.arange(3.0), ("n",))})
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("a = " + "1" * 5000, "not valid TOML: Exceeds the limit"),
        (".".join(["a"] * 5000) + " = 1", "nested too deeply; at most 30 levels"),
        ("a = " + "[" * 5000, "nested too deeply"),
        ("k" * 200_000 + " = ", "not valid TOML"),
    ],
)
def test_texts_that_are_no_input(tmp_path, text, told):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(InputError, match=told) as error:
        read_toml(tmp_path / "a.toml")
    assert len(str(error.value)) < 5000


def test_long_words_are_cut_in_messages():
    assert shortened("a short message") == "a short message"
    assert len(shortened("k" * 200_000 + ": unknown key")) < 600
    assert len(str(InputError("many words " * 10_000))) < 5000


def test_a_closed_standard_output_is_one_line(tmp_path):
    """Otherwise a result's file would take its place, and what libraries print."""
    command = ["sh", "-c", 'exec "$@" >&-', "sh", sys.executable, "-m", "vanedamp", "run", "none.toml"]
    ended = subprocess.run(command, cwd=tmp_path, env=environment(), stderr=subprocess.PIPE, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (
        2, "vanedamp: standard output is closed; send it to a file, or to /dev/null\n"
    )  # fmt: skip
