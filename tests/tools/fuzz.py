"""Input files and command lines with something wrong in them: keys of wrong types, without bounds, missing.

    python -m tests.tools.fuzz [FIRST [COUNT [FOLDER]]]

runs cases FIRST to FIRST + COUNT (0 and 2,000), damaged files of every format (fuzz_files) and as many inputs. Prints
how many of each kind ended how, and each fault with its number. Status 1: there are faults. FOLDER, which must not be
there yet, keeps the files of the last case.
"""

from __future__ import annotations

import contextlib
import copy
import datetime
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import tomli_w

#: what takes the place of a value
NUMBERS: tuple[Any, ...] = (
    float("nan"), float("inf"), -float("inf"), -1.0, 0.0, -0.0, 1e-300, 1e-12, 1e12, 1e300, 5e-324, -1, 0, 1, 2, 3,
    10**9, 10**30,
)  # fmt: skip
WRONG: tuple[Any, ...] = (
    *NUMBERS, True, False, "", "1", "nan", "auto", "a.b", "a\0b", "x" * 5000, "\N{GREEK SMALL LETTER MU}m", "/", "..",
    [], [[]], [1.0], [1.0, 2.0], [0.0, 0.0, 0.0], ["x"], [{}], {}, {"": 1.0}, {"a": 1.0}, datetime.date(2020, 1, 1),
    datetime.time(1),
)  # fmt: skip

SCENE = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "initial": {"displacement": 0.0, "velocity": 0.0},
    "excitation": {"frequency": 15.9, "force": 1.0},
    "gravity": {"acceleration": 9.81, "orientation_deg": 0.0},
    "cavity": [{"name": "c1", "gap": 2e-4}],
    "damper": [
        {"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6, "position": -1e-5, "velocity": 0.0},
        {"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6, "position": 1e-5, "normal_load": 1.0},
    ],
    "friction_damper": [{"normal_force": 0.1, "friction": 0.3, "stiffness": 1e3}],
    "contact": {"law": "compliant", "stiffness": 1e6},
    "time": {"periods": 3, "transient": 1},
    "solver": {"method": "exact", "max_events": 2000},
    "continuation": {"direction": "up", "along": "excitation.frequency"},
    "sweep": {"excitation.frequency": {"start": 15.0, "stop": 16.0, "num": 2}, "cavity.c1.gap": [1e-4, 2e-4]},
}
ROM_SCENE = {
    "structure": {"model": "rom", "file": "rom.h5", "modes": 1, "natural": True, "tolerance": 0.01},
    "excitation": {"frequency": 15.9, "force": 1.0, "at": "tip"},
    "cavity": [{"name": "c1", "gap": 2e-4, "left": "tip", "right": "tip", "floor": "top"}],
    "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6}],
    "friction_damper": [{"normal_force": 0.1, "friction": 0.3, "at": "top"}],
    "contact": {"law": "newton"},
    "time": {"periods": 3, "steady": "auto", "tolerance": 0.1},
    "solver": {"method": "moreau", "steps_per_period": 20, "theta": 0.5},
}
PRESCRIBED = {
    "structure": {"model": "prescribed", "displacement_amplitude": 1e-4},
    "excitation": {"frequency": 15.9},
    "cavity": [{"name": "c1", "gap": 2e-4}],
    "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6}],
    "time": {"periods": 3},
    "solver": {"method": "penalty", "scheme": "hht", "alpha": -0.1, "steps_per_period": 50, "contact_steps": 10.0},
}
OPTIMISE = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.05},
    "excitation": {"frequency": 15.9, "force": 1.0},
    "cavity": [{"name": "c1", "gap": 2e-4}],
    "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6}],
    "time": {"periods": 25, "transient": 20},
    "solver": {"max_events": 2000},
    "optimise": {
        "band": {"start": 15.5, "stop": 16.0, "num": 2},
        "measure": "amplitude_mean", "over_band": "worst", "over_tolerances": "mean",
        "samples": 1, "evaluations": 5, "seed": 1,
        "variables": {"mass_ratio": [0.01, 0.05], "gap_ratio": 0.5, "bodies": 1},
        "tolerances": {"mass": 0.1, "gap": 0.1, "excitation": 0.1, "restitution": 0.1, "friction": 0.1,
                       "orientation_deg": 1.0},
        "map": {"mass_ratio": 2, "gap_ratio": 2},
    },
}  # fmt: skip
CASE = {
    "mesh": {"generator": "block", "length": 0.1, "width": 0.02, "thickness": 0.01, "divisions": [2, 1, 1],
             "degree": 1},
    "material": {"default": {"young": 2e11, "poisson": 0.3, "density": 8000.0, "damping_ratio": 0.01,
                             "fatigue_strength": 4e8}},
    "support": {"clamped": ["root"], "elastic": {"top": {"stiffness": [1e9, 1e9, 1e9]}}},
    "modes": {"count": 2, "direction": [0, 0, 1], "at": "tip", "damping_ratio": 0.01},
    "interface": {"tip": {"facets": "tip", "direction": [0, 0, 1], "kind": "average", "motion": "translation"}},
    "calibration": {
        "share": 0.7, "hot_spot": ["block"],
        "damping": {"frf": "frf.csv", "quantity": "receptance", "band": [10.0, 100.0], "modes": 1},
        "tune": {"frequencies": [800.0], "vary": ["material.default"], "modes": [0], "starts": 1},
    },
}  # fmt: skip
EXTERNAL = {
    "name": "other",
    "matrices": {"file": "other.npz", "mass": "m", "stiffness": "k", "damping_ratio": 0.01, "base_load": "b"},
    "interface": {"tip": {"coordinate": 0, "direction": [0.0, 1.0, 0.0]}, "top": {"row": [1.0, 0.0]}},
}
RING = {
    "mesh": {
        "generator": "sector",
        "degree": 1,
        "sectors": 4,
        "inner_radius": 0.05,
        "outer_radius": 0.1,
        "thickness": 0.01,
        "element_size": 0.05,
    },
    "material": {"default": {"young": 2e11, "poisson": 0.3, "density": 8000.0, "damping_ratio": 0.01}},
    "support": {"clamped": ["bore"]},
    "modes": {"count": 2},
    "interface": {"rim": {"facets": "rim", "direction": [0, 0, 1]}},
    "ring": {"sectors": 4, "low": "low", "high": "high"},
    "mistuning": {"frequency": {"std": 0.01}},
}
#: by the command that takes them
FILES: dict[str, tuple[dict[str, Any], ...]] = {
    "run": (SCENE, ROM_SCENE, PRESCRIBED), "sweep": (SCENE,), "optimise": (OPTIMISE,), "modal": (CASE,),
    "calibrate": (CASE,), "reduce": (CASE,), "import": (EXTERNAL,), "ring": (RING,),
}  # fmt: skip


#: command lines, and what takes the place of a word
LINES = (
    "run scene.toml --samples 10 -o out.h5 --json -", "sweep swept.toml --workers 1 -o out.h5 --resume",
    "ramp ramp.toml -o out.h5 --json -", "ringdown down.toml -o out.h5", "orbits scene.toml -o out.h5",
    "export rom.h5 -o out.uff --frequencies 1 100 10", "export run.h5 -o out.csv --table time",
    "export modes.h5 -o out.vtkhdf --mode 1 --frames 4", "report run.h5 sweep.h5 -o out.html",
    "reduce case.toml --modes 2 -o out.h5", "import external.toml -o out.h5 --json out.json",
    "check scene.toml --json -", "matrices case.toml -o out", "calibrate case.toml -o out.h5", "new scene -o new.toml",
    "schema scene -o out.json",
)  # fmt: skip
WORDS = (
    "", "-", "--", "-1", "0", "nan", "inf", "1e9", "999999999", "100000", "1" * 5000, "x" * 5000, "/", ".", "..",
    "/dev/zero", "/dev/null", "none.toml", "out.txt", "out.h5", "scene.toml", "rom.h5", "--help", "--json",
    "--resume", "--workers", "-o", "--version", "\udcff.toml", "\udcff.h5", "\N{SNOWMAN}", "run", "auto",
)  # fmt: skip


def drawn_line(seed: int) -> list[str]:
    """The words of a command line with one to three faults: the same for a seed."""
    draw = random.Random(f"line {seed}")
    words = draw.choice(LINES).split()
    for _ in range(draw.choice((1, 1, 2, 3))):
        place = draw.randrange(len(words) + 1)
        words[place : place + draw.choice((0, 1, 1, 2))] = draw.choices(WORDS, k=draw.choice((0, 1, 1, 1, 2)))
    return words


def drawn(seed: int, count: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Commands with files that have one or two faults each: the same for a seed."""
    draw = random.Random(seed)
    for _ in range(count):
        command = draw.choice(list(FILES))
        data = copy.deepcopy(draw.choice(FILES[command]))
        for _ in range(draw.choice((1, 1, 2))):
            _spoil(data, draw)
        yield command, data


def _spoil(data: dict[str, Any], draw: random.Random) -> None:
    holder, key = draw.choice(list(places(data)))
    value = holder[key]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    match draw.randrange(10):
        case 0:
            del holder[key]
        case 1 if isinstance(holder, dict):  # misspelt, or of another table
            holder[draw.choice((str(key) + "x", "mass", "file", "frequency", "", "a.b", "generator"))] = holder.pop(key)
        case 2:
            holder[key] = [value]
        case 3 if isinstance(value, list) and value:
            holder[key] = value[0]
        case 4 | 5 | 6 if number:
            holder[key] = draw.choice(NUMBERS)
        case 7 | 8 if number:
            holder[key] = value * draw.choice((-1, 0.5, 2, 3, 1e-9, 1e-3, 1e3, 1e9, 1000, 1000000))
        case _:
            holder[key] = draw.choice(WRONG)


def places(node: Any) -> Iterator[tuple[Any, Any]]:
    """(table or list, key or index) of everything in a file."""
    for key, value in list(node.items()) if isinstance(node, dict) else list(enumerate(node)):
        yield node, key
        if isinstance(value, dict | list):
            yield from places(value)


def write_input(command: str, data: dict[str, Any]) -> list[str] | None:
    """Write a drawn file; return the words of the command, None for what cannot be written as TOML."""
    try:
        text = tomli_w.dumps(data)
    except (TypeError, ValueError):
        return None
    Path("file.toml").write_text(text, encoding="utf-8")
    extra = ["--workers", "1"] if command in ("sweep", "optimise") else ["--modes", "2"] if command == "reduce" else []
    return [command, "file.toml", *extra]


def run_all(first: int, count: int, folder: Path) -> int:
    """Run the cases of a range of numbers, print the table and the faults; return the number of these."""
    from tests.tools import fuzz_runs
    from tests.tools.fuzz_files import damaged, write_samples
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.coupling.simulation import simulate
    from vanedamp.files.toml_input import validate
    from vanedamp.modal import measurements
    from vanedamp.studies.cli import main
    from vanedamp.studies.jobs import job

    explicit = PRESCRIBED | {"solver": {"method": "penalty"}}
    for scene in (SCENE, PRESCRIBED, explicit):  # compiled functions are loaded once
        simulate(validate(Scene, scene, "warm-up"))
    readers: dict[str, Callable[[], object]] = {
        "read_frf": lambda: measurements.read_frf(_damaged_file()),
        "read_shapes": lambda: measurements.read_shapes(_damaged_file()),
        "read_temperature": lambda: measurements.read_temperature(_damaged_file(), 20.0),
    }
    samples, work = folder / "samples", folder / "work"
    samples.mkdir(parents=True)
    work.mkdir()

    def prepare(_: int, told: Callable[[], str]) -> tuple[str, str, str | None]:
        write_samples(samples, main)
        return "samples", "written", None

    def file_case(number: int, told: Callable[[], str]) -> tuple[str, str, str | None]:
        for left in Path().glob("damaged.*"):
            left.rmdir() if left.is_dir() else left.unlink()
        name, commands = damaged(number, samples)
        ends = [fuzz_runs.call(readers[words[0]]) if words[0] in readers else fuzz_runs.answer(words, told)
                for words in commands]  # fmt: skip
        wrong = [f"{words[0]} {words[-1]}: {what}" for words, (_, what) in zip(commands, ends, strict=True) if what]
        ends_as = "fault" if wrong else "one line" if ("one line", None) in ends else "result"
        return name, ends_as, "; ".join(wrong) or None

    def input_case(number: int, told: Callable[[], str]) -> tuple[str, str, str | None]:
        line = number % 4 == 0
        words = drawn_line(number) if line else write_input(*next(drawn(number, 1)))
        if words is None:
            return "inputs", "no TOML", None
        return "command lines" if line else f"inputs of {words[0]}", *fuzz_runs.answer(words, told)

    with contextlib.chdir(folder):
        _, wrong = fuzz_runs.run_cases(range(1), prepare)
    if wrong:
        raise RuntimeError(f"the samples cannot be written: {wrong}")
    job.progress = fuzz_runs.patient  # type: ignore[assignment]  # samples are written to their end
    numbers = range(first, first + count)
    faults = 0
    for title, case in (("damaged files", file_case), ("inputs", input_case)):
        for sample in samples.iterdir():
            Path(work, sample.name).write_bytes(sample.read_bytes())
        with contextlib.chdir(work):
            counts, wrong = fuzz_runs.run_cases(numbers, case)
        _print_table(title, counts, wrong)
        faults += len(wrong)
    return faults


def _damaged_file() -> Path:
    return next(Path().glob("damaged.*"))


def _print_table(title: str, counts: Counter[tuple[str, str]], faults: list[tuple[int, str, str]]) -> None:
    ends = ("result", "one line", "no TOML", "fault")
    print(f"{title:24}" + "".join(f"{end:>10}" for end in ends))
    for kind in sorted({kind for kind, _ in counts}):
        print(f"{kind:24}" + "".join(f"{counts[kind, end]:10}" for end in ends))
    print(f"{'all':24}" + "".join(f"{sum(n for (_, e), n in counts.items() if e == end):10}" for end in ends))
    for number, kind, what in faults:
        print(f"  case {number}, {kind}: {what}")


if __name__ == "__main__":
    first, count = [int(word) for word in sys.argv[1:3]] + [0, 2000][len(sys.argv) - 1 :]
    with tempfile.TemporaryDirectory() as place:
        sys.exit(bool(run_all(first, count, Path(*sys.argv[3:4] or [place, "fuzz"]).resolve())))
