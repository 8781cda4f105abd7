"""Files of every format that the product reads, with the command that reads each, and ways to damage them."""

from __future__ import annotations

import contextlib
import json
import random
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import tomli_w
from scipy import io, linalg, sparse

from tests.studies.identification import oscillator
from tests.tools import fork_mesh
from tests.tools.archives import ansys_archive, labelled
from tests.tools.fuzz import CASE, OPTIMISE, RING, SCENE, WRONG, places
from tests.tools.op2_file import write_op2
from tests.tools.rings import Chain
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.store import Variable, save, write_csv, write_json
from vanedamp.files.toml_input import validate
from vanedamp.rom.ring.deviations import Deviations

#: what takes the place of a number in a text
ODD = ("nan", "inf", "1e400", "1e308", "5e-324", "-1", "0", "", "999999999999", "1" * 5000, "x", "1e5", "3.5", "-0")
#: deeper than a reader of JSON or TOML can follow
NESTED = "[" * 100_000 + "]" * 100_000
#: what takes the place of a variable's values
_RETYPED = (
    lambda values: np.asarray(values).astype(str).astype(object), lambda values: np.ones(np.shape(values), complex),
    lambda values: np.full(np.shape(values), -3), lambda values: np.full(np.shape(values), np.nan),
    lambda values: np.ravel(values), lambda values: np.zeros((0, *np.shape(values)[1:])),
    lambda values: np.full(np.shape(values), b"\xff\xfe"), lambda values: h5py.Empty("f8"),
    lambda values: np.zeros(np.shape(values), [("a", "f8"), ("b", "S3")]),
)  # fmt: skip
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
        "ranged.toml": plain | {"damper": [plain["damper"][0] | {"friction": [0.2, 0.4]}], "ensemble": {"samples": 4}},
        "life.toml": plain | {"wear": {"rate": 1e-14, "area": 5e-5},
                              "life": {"band": [15.8, 15.9], "hours": 10.0, "steps": 1}},
        "identify.toml": {"scene": "still.toml", "numbers": {"structure.stiffness": {"min": 9e3, "max": 1.1e4}},
                          "decay": [{"file": "decay.csv", "noise": 0.02}], "search": {"candidates": 4, "starts": 1}},
        "still.toml": oscillator.SCENE,
        "deviations.toml": {"deviations": {"ring": "chain.h5", "file": "waves.csv", "at": "tip"}},
    }  # fmt: skip
    _write_measurements()
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
        ["run", "ranged.toml", "-o", "ensemble.h5"], ["life", "life.toml", "--workers", "1", "-o", "life.h5"],
        ["identify", "identify.toml", "--workers", "1", "-o", "found.h5"],
        ["identify", "deviations.toml", "-o", "deviations.h5"],
        ["reduce", "ring.toml", "--basis", "sectors", "-o", "sectors.h5"],
    ):  # fmt: skip
        if run(words):
            raise RuntimeError(Path("../standard_error.txt").read_text())


def _write_measurements() -> None:
    """Write a ring and its modes, a decay, a checkpoint and the claims of a study."""
    chain = Chain(6)
    chain.ring().save("chain.h5")
    squares, shapes = linalg.eigh(*chain.matrices(Deviations(0.03 * np.arange(-2.0, 4.0))))
    rows = [(square**0.5 / (2 * np.pi), sector, value, 0.0)
            for square, shape in zip(squares[:3], shapes.T, strict=False)
            for sector, value in enumerate(shape)]  # fmt: skip
    write_csv("waves.csv", ("frequency_hz", "sector", "real", "imaginary"), rows)
    write_csv("decay.csv", ("time_s", "amplitude_m"), zip(*oscillator.half_swings(), strict=True))
    scene = validate(Scene, SCENE, "scene").to_dict()
    save("part.h5", "sweep-checkpoint", {"point": Variable(np.arange(3), ("point",))}, {"scene": scene, "model": {}})
    claim = {"claim": "it damps", "ours": "it does", "verdict": "shown", "figures": {"reduction": 0.5}}
    study = {"study": "one", "title": "One", "sources": ["sweep.h5"], "claims": [claim]}
    write_json("study.claims.json", study)


#: results in files, of every kind
_RESULTS = (
    "run", "sweep", "ramp", "down", "modes", "calibration", "campbell", "orbits", "optimum", "ring", "mistuning",
    "ensemble", "life", "found", "deviations", "chain", "sectors", "part", "rom",
)  # fmt: skip
_SHOWN = (["info", "@"], ["report", "@", "-o", "out.html"])
#: by the name of a sample: the words of commands that read the damaged file "damaged.*", or a call of Python
READS: dict[str, tuple[list[str], ...]] = {
    **{f"{name}.h5": (*_SHOWN, *(["export", "@", "-o", f"out.{ending}"] for ending in (
        "csv", "mat", "uff", "vtkhdf", "op4", "dmig", "inp"))) for name in _RESULTS},
    "study.claims.json": _SHOWN,
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


def damaged(number: int, samples: Path) -> tuple[str, list[list[str]]]:
    """Write the damaged file of a case, and what names it, to the working directory.

    Returns the name of the whole one and the words of commands, or the name of a function of modal.measurements.
    """
    draw = random.Random(f"file {number}")
    name = draw.choice(list(READS))
    target = Path(f"damaged{''.join(Path(name).suffixes)}")
    data = bytearray((samples / name).read_bytes())
    if name.endswith(".h5") and draw.random() < 0.8:
        data = data[:-_SEAL]  # as one of an earlier version, which has no checksum
        if draw.random() < 0.4:
            target.write_bytes(data)
            with contextlib.suppress(Exception):
                _change_record(target, draw)
            data = bytearray(target.read_bytes())
    if draw.random() < 0.02:
        target.unlink(missing_ok=True)
        target.mkdir()
        return name, _words(name, target, draw)
    text = target.suffix in (".toml", ".json", ".csv", ".inp", ".bdf", ".unv", ".cdb", ".mtx", ".msh", ".op4", ".uff")
    for _ in range(draw.choice((0, 1, 1, 2, 5)) if name.endswith(".h5") else draw.choice((1, 1, 2, 5))):
        data = _damage_text(data, draw) if text and draw.random() < 0.7 else _damage(data, draw)
    target.write_bytes(data)
    target.chmod(0 if draw.random() < 0.02 else 0o644)  # the superuser reads it none the less
    return name, _words(name, target, draw)


def _words(name: str, target: Path, draw: random.Random) -> list[list[str]]:
    """Return the words of all commands that show a result, or of one that reads a file of another kind."""
    _write_users(target.name)
    reads = READS[name]
    of = reads if reads[:2] == _SHOWN else [draw.choice(reads)]
    return [[target.name if word == "@" else word for word in words] for words in of]


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
    """Change a number, a word, a line or the encoding."""
    lines = data.decode("latin-1").split("\n")
    place = draw.randrange(len(lines))
    match draw.randrange(8):
        case 6:
            return bytearray(data.decode("latin-1").encode(draw.choice(("utf-16", "utf-32", "utf-8-sig", "cp037"))))
        case 7:
            lines[place] = lines[place].replace("=", "= " + NESTED).replace(":", ": " + NESTED, 1)
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
        match draw.randrange(13):
            case 0:
                del file[name]
            case 1:
                del file[name]
                file[name] = draw.choice((np.zeros(0), np.zeros((2, 2, 2)), 1.0, "text", np.zeros(3, complex)))
            case 9 | 10:
                del file[name]
                file[name] = draw.choice(_RETYPED)(values)
            case 11:
                file.attrs["schema_version"] = draw.choice((0, 2, -1, 2**40, np.nan, "1", "", [1, 1]))
            case 12:  # keeps the scale of a dimension
                _change_value(file.attrs, attribute, draw)
            case 2:
                del file[name]
                file[name] = np.asarray(values)[..., :-1]
            case 3:
                with np.errstate(over="ignore"):
                    file[name][...] = draw.choice((np.nan, np.inf, -1, 1e308, 10**9))
            case 4:
                del file.attrs[attribute]
            case 5:
                file.attrs[attribute] = draw.choice((
                    1, -1.0, "", "{", "[]", "{}", "null", "[1, 2]", np.zeros(3), NESTED, "[" + NESTED[::-1],
                ))  # fmt: skip
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


def _change_value(attributes: Any, name: str, draw: random.Random) -> None:
    """Change, remove or retype a value within an attribute that is JSON text."""
    data = json.loads(attributes[name])
    holder, key = draw.choice(list(places(data)))
    if draw.random() < 0.3:
        del holder[key]
    else:
        holder[key] = draw.choice(WRONG[:-2])  # no dates in JSON
    attributes[name] = json.dumps(data)


if __name__ == "__main__":  # the samples, to a folder
    from vanedamp.studies.cli import main

    write_samples(Path(sys.argv[1]), main)
