"""Files of every kind with something wrong in them: keys of wrong types, without bounds, missing, of other tables."""

from __future__ import annotations

import copy
import datetime
import random
from collections.abc import Iterator
from typing import Any

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
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": 15.9, "force": 1.0},
    "cavity": [{"name": "c1", "gap": 2e-4}],
    "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6}],
    "time": {"periods": 3, "transient": 1},
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
#: by the command that takes them
FILES: dict[str, tuple[dict[str, Any], ...]] = {
    "run": (SCENE, ROM_SCENE, PRESCRIBED), "sweep": (SCENE,), "optimise": (OPTIMISE,), "modal": (CASE,),
    "calibrate": (CASE,), "reduce": (CASE,), "import": (EXTERNAL,),
}  # fmt: skip


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
    holder, key = draw.choice(list(_places(data)))
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


def _places(node: Any) -> Iterator[tuple[Any, Any]]:
    """(table or list, key or index) of everything in a file."""
    for key, value in list(node.items()) if isinstance(node, dict) else list(enumerate(node)):
        yield node, key
        if isinstance(value, dict | list):
            yield from _places(value)
