"""`resonance_amplitude` is that of one resonance: which, and that it is told. Two modes, the upper responds most."""

import json
import math

import numpy as np
import pytest
import tomli_w

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.resonance import chosen_resonance, excitation_force
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import main

ZETA, TOP = 0.005, 1e-4
FREQUENCIES, SHAPE = np.array([100.0, 150.0]), np.array([1.0, 3.0])


@pytest.fixture
def data(tmp_path):
    squares = (2 * np.pi * FREQUENCIES) ** 2
    model = ReducedModel.from_matrices(np.eye(2), np.diag(squares), {"tip": SHAPE}, damping_ratio=ZETA)
    model.save(tmp_path / "rom.h5")
    return {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")},
        "excitation": {"frequency": 100.0, "resonance_amplitude": TOP, "at": "tip"},
        "time": {"periods": 2, "transient": 0},
    }


def scene(data, frequency=100.0, **excitation):
    return validate(Scene, data | {"excitation": data["excitation"] | {"frequency": frequency} | excitation}, "x")


def receptance(frequency):
    omega, own = 2 * np.pi * frequency, 2 * np.pi * FREQUENCIES
    return abs(np.sum(SHAPE**2 / (own**2 - omega**2 + 2j * ZETA * own * omega)))


@pytest.mark.parametrize(
    ("low", "high", "mode"), [(90.0, 110.0, 0), (140.0, 160.0, 1), (90.0, 160.0, 1), (60.0, 80.0, 1)]
)
def test_resonance_of_the_swept_range(data, low, high, mode):
    """The one that responds most within the range; beside both, the one that makes up most of the response there."""
    swept = scene(data).replace({"sweep": {"excitation.frequency": [low, 0.5 * (low + high), high]}})
    result = sweep(swept)
    own = FREQUENCIES[mode] * (1 + np.linspace(-0.01, 0.01, 20001))
    top = max(map(receptance, own))
    expected = [TOP * receptance(frequency) / top for frequency in (low, 0.5 * (low + high), high)]
    # the grid of the closed form is finer than the resonance by 1e-6 / 0.01: its top is off by the square
    assert result.amplitude_undamped == pytest.approx(np.array(expected), rel=1e-6)
    if low < FREQUENCIES[mode] < high:
        assert result.peaks["undamped_peak"] == pytest.approx(TOP, rel=1e-9)


def test_resonance_by_name(data):
    first, second = (chosen_resonance(scene(data, resonance_near=near)) for near in (FREQUENCIES[0], [120.0, 200.0]))
    assert (first.mode, second.mode) == (0, 1)
    assert first.frequency == pytest.approx(100.0, rel=1e-3)
    assert second.mass == pytest.approx(1 / 9)
    named = scene(data, frequency=100.0, resonance_near=150.0)
    assert excitation_force(named) == pytest.approx(TOP / second.flexibility)
    assert excitation_force(scene(data, frequency=99.0)) == pytest.approx(TOP / first.flexibility)
    with pytest.raises(InputError, match=r"resonance_near: expected \[lowest, highest\]"):
        scene(data, resonance_near=[200.0, 100.0])


def test_command_tells_the_resonance(data, tmp_path, capsys):
    path = tmp_path / "scene.toml"
    path.write_text(tomli_w.dumps(data))
    assert main(["run", str(path), "--json", "-"]) == 0
    captured = capsys.readouterr()
    told = json.loads(captured.out)["resonance"]
    assert told["mode"] == 0 and told["frequency"] == pytest.approx(100.0 * math.sqrt(1 - 2 * ZETA**2), rel=1e-3)
    assert "resonance_amplitude: of the resonance at " in captured.err and "(mode 1)" in captured.err
