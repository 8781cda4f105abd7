"""Files that a user hands over: devices, libraries that crash, records that were damaged or changed."""

import itertools
import os
import signal
import subprocess
import sys
import zlib

import h5py
import numpy as np
import pytest

from tests.tools.processes import environment
from tests.tools.tiers import cases
from vanedamp.files import foreign, store
from vanedamp.files.csv_input import read_csv
from vanedamp.files.errors import VanedampError, shortened
from vanedamp.files.foreign import apart, existing, reading
from vanedamp.files.formats.matrices import MatrixFileError
from vanedamp.files.formats.matrices.registry import read_matrices
from vanedamp.files.formats.meshes.labelled_mesh import MeshError
from vanedamp.files.store import StoreError, Variable, decoding
from vanedamp.files.toml_input import InputError, read_toml
from vanedamp.modal.msh import merge
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import BAD_INPUT, main


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


@pytest.mark.parametrize("draws", cases([10, 30], fast=[10]))
def test_records_without_the_checksum_are_tried_apart(model, draws):
    """Those of earlier versions, and those that h5py has changed: a damaged byte is one line, or changes nothing."""
    whole = model.read_bytes()[:-20]
    draw = np.random.default_rng(2)
    refused = 0
    for place in draw.integers(0, len(whole), draws).tolist():
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


def _external(file, folder):
    file.create_dataset("x", (3,), "u1", external=[(str(folder / "secret"), 0, 3)])


def _virtual(file, folder):
    layout = h5py.VirtualLayout((3,), "f8")
    layout[:] = h5py.VirtualSource(folder / "other.h5", "x", (3,))
    file.create_virtual_dataset("x", layout)


def _linked(link):
    return lambda file, folder: file.__setitem__("x", link(folder))


@pytest.mark.parametrize("sealed", [False, True])
@pytest.mark.parametrize(
    ("change", "told"),
    [
        (_external, "the data of x are in other files"),
        (_virtual, "the data of x are in other files"),
        (_linked(lambda folder: h5py.ExternalLink(folder / "other.h5", "x")), "x is a link to data elsewhere"),
        (_linked(lambda folder: h5py.ExternalLink(folder / "none.h5", "x")), "x is a link to data elsewhere"),
        (_linked(lambda _: h5py.SoftLink("/mass")), "x is a link to data elsewhere"),
        (lambda file, _: file.create_group("g").__setitem__("x", h5py.SoftLink("/")), "g/x is a link"),
        (lambda file, _: file.create_dataset("x", (10**12,)), "x has the shape (1000000000000,), more than its bytes"),
        (lambda file, _: file.create_dataset("x", (10**6, 10**6), chunks=(99, 99), compression=9), "x has the shape"),
    ],
)
def test_hdf5_that_leads_elsewhere_or_to_nothing(model, tmp_path, capfd, sealed, change, told):
    """No data of other files become ours, and no shape without data fills the memory."""
    (tmp_path / "secret").write_bytes(b"key")
    with h5py.File(matlab := tmp_path / "seven.mat", "w", userblock_size=512) as file:
        file["m"] = np.eye(2)
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = np.zeros(3)
    for name in (model, matlab):
        with h5py.File(name, "r+") as file:
            change(file, tmp_path)
    with open(matlab, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(124) + bytes([0x00, 0x02]) + b"IM")
    if sealed:  # whoever writes a file may write a checksum
        image = model.read_bytes()
        model.write_bytes(image + store._SEAL.format(zlib.crc32(image)).encode())
    for read, file in ((ReducedModel.load, model), (store.load_any, model), (read_matrices, matlab)):
        with pytest.raises(VanedampError) as error:
            read(file)
        assert str(error.value).startswith(f"{file}: {told}")
        assert str(error.value).endswith("; expected a file that holds its data itself")
    assert main(["info", str(model)]) == BAD_INPUT
    assert capfd.readouterr().err.count("\n") == 1


def test_a_text_that_is_there_many_times_ends_in_a_line(model):
    """Texts of one place in a file are read to as many places in memory; in a process without memory left to use."""
    with h5py.File(model, "r+") as file:
        file.create_dataset("x", (1000,), h5py.string_dtype(), ["y" * 10**6] + [""] * 999)
        place = file["x"].id.get_offset()
    image = bytearray(model.read_bytes())
    image[place : place + 16_000] = image[place : place + 16] * 1000
    model.write_bytes(image)
    program = (
        "import sys; from vanedamp.files import foreign, store; foreign._MEMORY, foreign._PER_BYTE = 2 * 10**8, 1\n"
        "try: store.load_any(sys.argv[1])\n"
        "except store.StoreError as error: print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(model)], env=environment(), text=True, capture_output=True, check=False
    )
    assert done.returncode == 0 and "rom.h5: " in done.stdout, done


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
        ('[a]\nb = [{"c\\u0000" = "d"}]', r"'a.b\[0\].c\\x00': holds a zero character; leave \\u0000 out"),
        ('a = "x\\U00000000"', "'a': holds a zero character"),
    ],
)
def test_texts_that_are_no_input(tmp_path, text, told):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises(InputError, match=told) as error:
        read_toml(tmp_path / "a.toml")
    assert len(str(error.value)) < 5000


def test_a_zero_character_is_no_text_of_a_table(tmp_path):
    (tmp_path / "a.csv").write_text("x\n\0\n")
    with pytest.raises(InputError, match=r"a\.csv: line 2: holds a zero character"):
        read_csv(tmp_path / "a.csv", ("x",))
    with pytest.raises(StoreError, match="'a/b': is no name of a variable in HDF5"):
        store.save(tmp_path / "a.h5", "kind", {"a/b": Variable(np.zeros(1), ("n",))})
    wide = "cavity_\N{MICRO SIGN} 1_" + "x" * 200
    store.save(tmp_path / "a.h5", "kind", {wide: Variable(np.ones(1), (wide,)), "y": Variable(np.ones(1), (wide,))})
    assert store.load_any(tmp_path / "a.h5")[1]["y"].dims == (wide,)


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
