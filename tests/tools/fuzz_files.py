"""Files of every format that the product reads, with the command that reads each, and ways to damage them."""

from __future__ import annotations

import contextlib
import random
import re
import sys
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import tomli_w
from scipy import io, sparse

from tests.tools import fork_mesh
from tests.tools.archives import ansys_archive, labelled
from tests.tools.fuzz import CASE, OPTIMISE, RING, SCENE
from tests.tools.op2_file import write_op2

#: what takes the place of a number in a text
ODD = ("nan", "inf", "1e400", "1e308", "5e-324", "-1", "0", "", "999999999999", "1" * 5000, "x", "1e5", "3.5", "-0")
#: bytes of the checksum at the end of a record
_SEAL = 19
MASS, STIFFNESS = np.diag([1.0, 2.0, 1.5]), np.array([[4e6, -1e6, 0.0], [-1e6, 3e6, -1e6], [0.0, -1e6, 2e6]])
_MESH = {"file": "", "degree": 1}
_PART = {
    "material": {"default": {"young": 2e11, "poisson": 0.3, "density": 8000.0}},
    "modes": {"count": 2, "direction": [0, 0, 1]},
}


def write_samples(folder: Path, run: Callable[[list[str]], int]) -> None:
    """Write one whole file of every format to a folder; run: the command, in this process."""
    with contextlib.chdir(folder):
        for path in fork_mesh.write(Path(), "tetra", "msh", "inp", "bdf", "unv", "med"):
            path.rename(f"mesh{path.suffix}")
        Path("mesh.cdb").write_text(ansys_archive(labelled(Path("mesh.msh"))))
        _write_matrices()
        _write_tables()
        _write_results(run)


def _write_matrices() -> None:
    from pyyeti.nastran import op4

    named = {"m": MASS, "k": STIFFNESS}
    np.savez("matrices.npz", **named)
    sparse.save_npz("sparse.npz", sparse.csr_matrix(STIFFNESS))
    io.mmwrite("matrix.mtx", sparse.coo_matrix(STIFFNESS))
    np.savetxt("matrix.csv", STIFFNESS, delimiter=",")
    io.savemat("five.mat", {"m": sparse.csc_matrix(MASS), "k": STIFFNESS})
    op4.write("matrices.op4", named)
    write_op2(Path("matrices.op2"), {name.upper(): matrix for name, matrix in named.items()})
    with h5py.File("seven.mat", "w", userblock_size=512) as file:
        for name, matrix in named.items():
            columns = sparse.csc_matrix(matrix)
            group = file.create_group(name)
            group.attrs["MATLAB_sparse"] = np.uint64(3)
            group["data"], group["ir"], group["jc"] = columns.data, columns.indices, columns.indptr
    with open("seven.mat", "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + bytes([0x00, 0x02]) + b"IM")


def _write_tables() -> None:
    from vanedamp.modal.correlation import MeasuredShapes
    from vanedamp.modal.frf import Frf
    from vanedamp.modal.measurements import write_frf, write_shapes

    frequencies = np.linspace(3800.0, 4500.0, 60)
    response = 1.0 / ((2 * np.pi * 4151.0) ** 2 * (1 + 0.02j) - (2 * np.pi * frequencies) ** 2)
    frf = Frf(frequencies, response[None, :], "receptance")
    points = np.repeat([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], 3, axis=0)
    shapes = MeasuredShapes(points, np.tile(np.eye(3), (2, 1)), np.arange(12.0).reshape(2, 6) + 1.0, [50.0, 80.0])
    for ending in ("csv", "uff"):
        write_frf(frf, f"frf.{ending}")
        write_shapes(shapes, f"shapes.{ending}")
    Path("history.csv").write_text("time,value\n0,0\n0.01,1\n0.03,-1\n0.06,0\n")
    Path("pattern.csv").write_text("at,order,force,phase_deg\ntip,1,1.0,0\ntop,2,0.5,90\n")
    Path("heat.csv").write_text("x,y,z,temperature\n0,0,0,20\n0.1,0,0,100\n0,0.1,0,50\n0,0,0.1,30\n")


def _write_results(run: Callable[[list[str]], int]) -> None:
    ramp = {"ramp": {"rate": [5.0], "from": 15.0, "to": 16.0}}
    plain = {key: SCENE[key] for key in ("structure", "excitation", "cavity", "time")}
    plain["damper"] = [{"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6}]
    down = {"ring_down": {"start": "steady", "periods": 5, "bins": 2}}
    damping = {"frf": "frf.csv", "quantity": "receptance", "band": [3800.0, 4500.0], "modes": 1}
    calibration = {"share": 0.7, "hot_spot": ["block"], "damping": damping}
    matrices = {"file": "matrices.npz", "mass": "m", "stiffness": "k", "damping_ratio": 0.01}
    campbell = {
        "rotation": {"axis": [0.0, 1.0, 0.0], "point": [-0.1, 0.0, 0.0]},
        "campbell": {"rpm": {"start": 0, "stop": 3000, "num": 2}, "engine_orders": [1]},
    }
    files = {
        "scene.toml": plain, "swept.toml": plain | {"sweep": SCENE["sweep"]}, "ramp.toml": plain | ramp,
        "down.toml": plain | down, "case.toml": CASE | {"calibration": calibration},
        "orbit.toml": plain | {"orbit": {"to": 15.95, "max_points": 4}}, "optimise.toml": OPTIMISE,
        "campbell.toml": CASE | campbell, "ring.toml": RING,
        "external.toml": {"matrices": matrices, "interface": {"tip": {"coordinate": 0}, "top": {"coordinate": 2}}},
    }  # fmt: skip
    for name, tables in files.items():
        Path(name).write_text(tomli_w.dumps(tables))
    for words in (
        ["run", "scene.toml", "--samples", "20", "-o", "run.h5"],
        ["sweep", "swept.toml", "--workers", "1", "-o", "sweep.h5"],
        ["ramp", "ramp.toml", "-o", "ramp.h5"], ["ringdown", "down.toml", "-o", "down.h5"],
        ["import", "external.toml", "-o", "rom.h5"], ["modal", "case.toml", "-o", "modes.h5"],
        ["calibrate", "case.toml", "-o", "calibration.h5"], ["campbell", "campbell.toml", "-o", "campbell.h5"],
        ["orbits", "orbit.toml", "-o", "orbits.h5"],
        ["ring", "ring.toml", "--orders", "1", "--draws", "2", "-o", "ring.h5", "--mistuning", "mistuning.h5"],
        ["optimise", "optimise.toml", "--workers", "1", "-o", "optimum.h5"],
    ):  # fmt: skip
        if run(words):
            raise RuntimeError(Path("../standard_error.txt").read_text())


#: by the name of a sample: the words of commands that read the damaged file "damaged.*", or a call of Python
READS: dict[str, tuple[list[str], ...]] = {
    **{f"{name}.h5": (["report", "@", "-o", "out.html"], *(["export", "@", "-o", f"out.{e}"] for e in ("csv", "mat")))
       for name in ("run", "sweep", "ramp", "down", "modes", "calibration", "campbell", "orbits", "optimum", "ring",
                    "mistuning")},
    "rom.h5": (["report", "@", "-o", "out.html"], ["run", "on_rom.toml"], ["export", "@", "-o", "out.uff"],
               ["export", "@", "-o", "out.mat"]),
    **{f"mesh.{ending}": (["check", "on_mesh.toml"], ["check", "on_mesh.toml"], ["modal", "on_mesh.toml"])
       for ending in ("msh", "inp", "bdf", "unv", "med", "cdb")},
    **{name: (["import", "on_matrices.toml", "-o", "out.h5"],)
       for name in ("matrices.npz", "five.mat", "seven.mat", "matrices.op4", "matrices.op2")},
    **{name: (["import", "on_matrix.toml", "-o", "out.h5"],) for name in ("sparse.npz", "matrix.mtx", "matrix.csv")},
    **{name: (["read_frf"],) for name in ("frf.csv", "frf.uff")},
    **{name: (["read_shapes"],) for name in ("shapes.csv", "shapes.uff")},
    "heat.csv": (["read_temperature"],),
    "history.csv": (["run", "on_history.toml"],), "pattern.csv": (["run", "on_pattern.toml"],),
    "scene.toml": (["run", "@"], ["check", "@"]), "swept.toml": (["check", "@"],), "case.toml": (["check", "@"],),
    "external.toml": (["import", "@", "-o", "out.h5"], ["check", "@"]), "down.toml": (["ringdown", "@"],),
}  # fmt: skip


def damaged(number: int, samples: Path) -> tuple[str, list[str]]:
    """Write the damaged file of a case, and what names it, to the working directory.

    Returns the name of the whole one and the words of the command, or the name of a function of modal.measurements.
    """
    draw = random.Random(f"file {number}")
    name = draw.choice(list(READS))
    target = Path(f"damaged{Path(name).suffix}")
    data = bytearray((samples / name).read_bytes())
    if name.endswith(".h5") and draw.random() < 0.8:
        data = data[:-_SEAL]  # as one of an earlier version, which has no checksum
        if draw.random() < 0.4:
            target.write_bytes(data)
            with contextlib.suppress(Exception):
                _change_record(target, draw)
            data = bytearray(target.read_bytes())
    text = target.suffix in (".toml", ".csv", ".inp", ".bdf", ".unv", ".cdb", ".mtx", ".msh", ".op4", ".uff")
    for _ in range(draw.choice((0, 1, 1, 2, 5)) if name.endswith(".h5") else draw.choice((1, 1, 2, 5))):
        data = _damage_text(data, draw) if text and draw.random() < 0.7 else _damage(data, draw)
    target.write_bytes(data)
    _write_users(target.name)
    words = draw.choice(READS[name])
    return name, [target.name if word == "@" else word for word in words]


def _write_users(file: str) -> None:
    """Write the input files that name a damaged one."""
    bdf = file.endswith(".bdf")
    clamp, tip = ("1", "5") if bdf else ("clamp", "tip")
    mesh = _PART | {
        "mesh": _MESH | {"file": file}, "support": {"clamped": [clamp]},
        "interface": {"tip": {"facets": tip, "direction": [0, 0, 1]}},
    }  # fmt: skip
    one = {"interface": {"tip": {"coordinate": 0}}}
    named = {"file": file, "mass": "m", "stiffness": "k", "damping_ratio": 0.01}
    single = {"mass": file, "stiffness": file, "damping_ratio": 0.01}
    rom = {
        "structure": {"model": "rom", "file": file}, "excitation": {"frequency": 150.0, "force": 1.0, "at": "tip"},
        "cavity": [{"name": "c1", "gap": 2e-4, "left": "tip", "right": "tip", "floor": "tip"}],
        "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6}], "time": {"periods": 3},
    }  # fmt: skip
    history = {
        "structure": SCENE["structure"], "cavity": SCENE["cavity"], "damper": rom["damper"], "time": {"periods": 3},
        "excitation": {"force": 1.0, "waveform": {"shape": "history", "file": file}},
        "solver": {"method": "moreau", "steps_per_period": 20},
    }  # fmt: skip
    pattern = rom | {
        "structure": {"model": "rom", "file": "rom.h5"},
        "excitation": {"frequency": 150.0, "at": "tip", "pattern": file},
    }  # fmt: skip
    for name, tables in {
        "on_mesh.toml": mesh, "on_rom.toml": rom, "on_history.toml": history,
        "on_pattern.toml": pattern, "on_matrices.toml": one | {"matrices": named},
        "on_matrix.toml": one | {"matrices": single},
    }.items():  # fmt: skip
        Path(name).write_text(tomli_w.dumps(tables))


def _damage(data: bytearray, draw: random.Random) -> bytearray:
    """Change bytes anywhere."""
    size = len(data)
    place, length = draw.randrange(max(size, 1)), draw.choice((1, 2, 4, 8, 64, 1000))
    match draw.randrange(8):
        case 0 | 1 if size:
            data[place] ^= 1 << draw.randrange(8)
        case 2 if size:
            data[place] = draw.choice((0, 1, 127, 128, 255))
        case 3:
            data[place : place + length] = draw.randbytes(length)
        case 4:
            data[place : place + length] = bytes(length)
        case 5:
            del data[place : place + length]
        case 6:
            data[place:place] = data[draw.randrange(max(size, 1)) :][:length]
        case _:
            del data[place:]
    return data


def _damage_text(data: bytearray, draw: random.Random) -> bytearray:
    """Change a number, a word or a line."""
    lines = data.decode("latin-1").split("\n")
    place = draw.randrange(len(lines))
    match draw.randrange(6):
        case 0:
            del lines[place]
        case 1:
            lines.insert(place, draw.choice(lines))
        case 2:
            other = draw.randrange(len(lines))
            lines[place], lines[other] = lines[other], lines[place]
        case _:
            words = list(re.finditer(r"[-+.\w]+", lines[place]))
            if words:
                word = draw.choice(words)
                lines[place] = lines[place][: word.start()] + draw.choice(ODD) + lines[place][word.end() :]
    return bytearray("\n".join(lines).encode("latin-1"))


def _change_record(path: Path, draw: random.Random) -> None:
    """Change a variable or an attribute of a record, as HDF5 sees it."""
    with h5py.File(path, "r+") as file:
        name = draw.choice([name for name, item in file.items() if isinstance(item, h5py.Dataset)])
        attribute = draw.choice(list(file.attrs))
        values = file[name][()]
        match draw.randrange(9):
            case 0:
                del file[name]
            case 1:
                del file[name]
                file[name] = draw.choice((np.zeros(0), np.zeros((2, 2, 2)), 1.0, "text", np.zeros(3, complex)))
            case 2:
                del file[name]
                file[name] = np.asarray(values)[..., :-1]
            case 3:
                with np.errstate(over="ignore"):
                    file[name][...] = draw.choice((np.nan, np.inf, -1, 1e308, 10**9))
            case 4:
                del file.attrs[attribute]
            case 5:
                file.attrs[attribute] = draw.choice((1, -1.0, "", "{", "[]", "{}", "null", "[1, 2]", np.zeros(3)))
            case 6:
                text = str(file.attrs[attribute])
                cut = draw.randrange(max(len(text), 1))
                file.attrs[attribute] = (
                    text[:cut] + draw.choice(("", "\\", '"', "1", "}", "\N{SNOWMAN}")) + text[cut + 1 :]
                )
            case 7:
                file.attrs[attribute] = np.bytes_(b"\xff\xfe" + str(file.attrs[attribute]).encode())
            case _:
                file[name].attrs["DIMENSION_LIST"] = 1


if __name__ == "__main__":  # the samples, to a folder
    from vanedamp.studies.cli import main

    write_samples(Path(sys.argv[1]), main)
