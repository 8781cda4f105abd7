"""Sweeps up and down: runs begin with their neighbour's last state, and so find each of two steady states."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.tools.sweep_processes import DATA, scene
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.grid import grid
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError, validate

EPS, DAMPING, RESTITUTION, HALF_GAP = 0.005, 0.005, 0.7, 70.0
RHO = 2 / np.pi * (1 - RESTITUTION) / (1 + RESTITUTION)
RATIOS = np.linspace(0.974, 1.03, 15)
BISTABLE = {
    "structure": {"model": "rigid", "mass": 1 - EPS, "stiffness": 1.0, "damping": 2 * DAMPING},
    "excitation": {"frequency": 0.16, "force": 1.0},
    "gravity": {"acceleration": 0.0},
    "cavity": [{"name": "c", "gap": 2 * HALF_GAP}],
    "damper": [{"cavity": "c", "mass": EPS, "restitution": RESTITUTION}],
    "time": {"periods": 600, "transient": 500},
    "sweep": {
        "continuation.direction": ["up", "down", "independent"],
        "excitation.frequency": (RATIOS / (2 * np.pi)).tolist(),
    },
}


def one_to_one(ratio):
    """Amplitude of the regime with two symmetric impacts per period (Theurich and Krack; code of tobiaswdm/CC)."""

    def force(xi):
        theta = (1 + np.sqrt((1 + RHO**2) * xi**2 - RHO**2)) / (1 + RHO**2)
        turn = (theta - 1) / xi - 1j * RHO * theta / xi
        linear = -(1 - EPS) * ratio**2 + 2j * DAMPING * ratio + 1
        return abs(linear * xi - 8 * EPS * theta * turn * ratio**2 / np.pi**2) - 1 / HALF_GAP

    return HALF_GAP * brentq(force, RHO, 3.0)


@pytest.fixture(scope="module")
def both():
    return sweep(validate(Scene, BISTABLE, "scene"))


def test_hysteresis(both):
    """Beside the resonance the body either hits both walls once a period, or floats without a contact.

    A body that begins at rest in the middle floats wherever the structure's amplitude stays below half the gap; one
    that comes from the resonance goes on to hit. Both states are known in closed form.
    """
    alone = 1 / np.abs(1 - (1 - EPS) * RATIOS**2 + 2j * DAMPING * RATIOS)
    above, below = RATIOS >= 1.0099, RATIOS <= 0.9901
    hitting, floating = np.array([one_to_one(ratio) for ratio in RATIOS]), alone
    up, down, independent = both.amplitude_harmonic
    assert up[above] == pytest.approx(hitting[above], rel=5e-3)
    assert down[above] == pytest.approx(floating[above], rel=1e-6)
    assert down[below] == pytest.approx(hitting[below], rel=5e-3)
    assert up[below] == pytest.approx(floating[below], rel=1e-3)
    assert independent[above | below] == pytest.approx(floating[above | below], rel=1e-2)
    assert np.all(np.abs(up - down)[above | below] > 0.2 * floating[above | below])
    assert np.all(both.impacts_per_period[0, above] == 2) and np.all(both.impacts_per_period[1, above] == 0)


def test_links_are_single_runs(both):
    """Every point is the run that its neighbour's last state begins."""
    scenes = validate(Scene, BISTABLE | {"sweep": {}}, "scene")
    for row, order in ((0, range(4)), (1, range(14, 10, -1))):
        state = None
        for place in order:
            single = simulate(scenes.replace({"excitation.frequency": RATIOS[place] / (2 * np.pi)}), start=state)
            assert both.amplitude_mean[row, place] == single.amplitude_mean
            state = single.final


@pytest.mark.slow
def test_workers_and_files_change_nothing(both, tmp_path):
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        sweep(validate(Scene, BISTABLE, "scene"), pool).save(tmp_path / "two.h5")
    both.save(tmp_path / "one.h5")
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "two.h5").read_bytes()
    assert Sweep.load(tmp_path / "one.h5").scene == both.scene


def test_a_run_that_breaks_off_passes_its_start_on(monkeypatch):
    """The chain goes on with the last state there is."""
    from vanedamp.coupling.sweep import worker as points

    states = []

    def brittle(point, start):
        states.append(start)
        if len(states) == 3:
            raise ZeroDivisionError
        return simulate(point, start=start)

    monkeypatch.setattr(points, "kind_of", lambda *_: None)  # points run one by one
    monkeypatch.setattr(points, "simulate", brittle)
    one = scene(continuation={"direction": "up"}, sweep={"excitation.frequency": DATA["sweep"]["excitation.frequency"]})
    found = sweep(one)
    assert [status.startswith("error") for status in found.status] == [False, False, True, False, False, False]
    assert states[0] is None and None not in states[1:]
    assert states[3] is states[2]


def test_chains_run_along_any_axis():
    """Up is by value, whatever the order in the file."""
    made = grid(scene(continuation={"direction": "down", "along": "cavity.c1.gap"}))
    chains = list(made.chains())
    assert len(chains) == 6 and all(chain.linked for chain in chains)
    assert [made.values(point)["cavity.c1.gap"] for point in chains[0].points] == [5e-4, 2e-4]
    mixed = scene(sweep={"continuation.direction": ["up", "independent"], "damper.mass": [0.05, 0.01, 0.02]})
    made = grid(mixed)
    assert [[made.values(point)["damper.mass"] for point in chain.points] for chain in made.chains()] == [
        [0.01, 0.02, 0.05], [0.01, 0.02, 0.05]
    ]  # fmt: skip
    assert [chain.linked for chain in made.chains()] == [True, False]
    assert [chain.linked for chain in grid(scene()).chains()] == [False]


GAPS = {"cavity.c1.gap": [1e-4, 2e-4]}


@pytest.mark.parametrize(
    ("continuation", "axes", "message"),
    [
        ({"direction": "upp"}, GAPS, r"continuation.direction: .*'independent', 'up' or 'down'"),
        ({"direction": "up", "along": "cavity.c1.gapp"}, GAPS, r"no axis 'cavity.c1.gapp'; did you mean"),
        ({"direction": "up"}, GAPS | {"damper.mass": [0.1]}, r"continuation.along: name the axis .* one of cavity"),
        ({"direction": "up"}, {"damper.cavity": ["c1"]}, r"name the axis of the sweep, one of none"),
        ({"direction": "up", "along": "damper.cavity"}, GAPS | {"damper.cavity": ["c1"]}, r"are no numbers"),
        ({"direction": "up"}, {"continuation.along": ["a"]} | GAPS, r"another continuation.along; take another"),
        ({"direction": "up"}, {"solver.method": ["exact", "moreau"]} | GAPS, r"is for solver.method exact, not moreau"),
    ],
)  # fmt: skip
def test_bad_continuations(continuation, axes, message):
    with pytest.raises(InputError, match=message):
        grid(scene(continuation=continuation, sweep=axes))
