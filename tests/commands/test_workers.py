"""Commands that hand their runs to other processes, as they do unless they are told: the same by one and by two."""

import json

import numpy as np
import pytest
import tomli_w

from tests.studies.identification import oscillator
from vanedamp.studies.cli import main
from vanedamp.studies.commands.declarations import COMMANDS
from vanedamp.studies.commands.support.arguments import workers

SCENE = {
    "structure": {"model": "rigid", "mass": 0.148, "stiffness": 3.4e7, "damping_ratio": 0.002},
    "excitation": {"frequency": 2412.0, "resonance_amplitude": 3e-5},
    "cavity": [{"name": "c1", "gap": 2e-5}],
    "damper": [{"cavity": "c1", "mass": 0.003, "friction": 0.4, "restitution": 0.7}],
    "time": {"periods": 440, "transient": 400},
}
BAND = [2400.0, 2420.0]
BLOCK = {"shape": "block", "length": 5e-3, "height": 4e-3}
#: what clocks tell
CLOCK = {"wall_time_s", "points_per_second"}
#: input of each command
INPUTS = {
    "sweep": SCENE | {"sweep": {"excitation.frequency": BAND}},
    "sweep of blocks": SCENE | {
        "sweep": {"excitation.frequency": BAND}, "damper": [SCENE["damper"][0] | BLOCK],
        "cavity": [SCENE["cavity"][0] | {"play": 1e-4}],
    },
    "sweep of ranges": SCENE | {"structure": SCENE["structure"] | {"mass": [0.14, 0.15]}, "ensemble": {"samples": 4}},
    "optimise": SCENE | {
        "optimise": {
            "band": BAND, "samples": 2, "evaluations": 5, "gradient_steps": 1, "seed": 1,
            "variables": {"mass_ratio": [0.01, 0.03], "gap_ratio": [0.3, 1.0], "bodies": 1},
            "tolerances": {"gap": 0.1}, "map": {"mass_ratio": 2, "gap_ratio": 2},
        }
    },
    "life": SCENE | {
        "wear": {"rate": 1e-14, "impact_rate": 1e-15, "area": 5e-5},
        "life": {"band": BAND, "hours": 10.0, "threshold": 0.01, "tolerance": 0.1},
    },
    "identify": {
        "scene": "scene.toml", "numbers": {"structure.damping_ratio": {"min": 0.005, "max": 0.02}},
        "forced": [{"file": "forced.csv", "noise": 0.02}], "search": {"candidates": 2, "starts": 1},
    },
}  # fmt: skip


@pytest.mark.parametrize("name", INPUTS)
def test_two_workers_find_what_one_finds(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "input.toml").write_text(tomli_w.dumps(INPUTS[name]))
    (tmp_path / "scene.toml").write_text(tomli_w.dumps(oscillator.SCENE))
    pairs = zip(oscillator.FREQUENCY, oscillator.response(oscillator.FREQUENCY)[0], strict=True)
    (tmp_path / "forced.csv").write_text("\n".join(["frequency_hz,amplitude_m", *(f"{f},{a:.6g}" for f, a in pairs)]))
    found = []
    for count in "12":
        outputs = ["-o", f"{count}.h5", "--json", f"{count}.json", "--workers", count]
        assert main([name.split()[0], "input.toml", *outputs]) == 0
        told = json.loads((tmp_path / f"{count}.json").read_text())
        found.append({key: value for key, value in told.items() if key not in CLOCK})
    np.testing.assert_equal(*found)


def test_every_command_with_workers_is_tried():
    having = {command.NAME for command in COMMANDS if workers in getattr(command, "arguments", ())}
    # their stages are these commands'; the explorer's and the demo's have tests with two
    assert having - {"pipeline", "design", "explore", "demo"} == {name.split()[0] for name in INPUTS}
