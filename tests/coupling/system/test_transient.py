"""The structure's transient: how long it is, the default that suits it, and runs that were too short for it."""

import math

import numpy as np
import pytest

from vanedamp.coupling.model_order.selection import select_model_order
from vanedamp.coupling.response.records import IMPACT_LOSS, new_records
from vanedamp.coupling.response.steadiness import judge
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.transient import LIMIT, Transient, left_over, settled_after
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

FIRST, TOP = 100.0, 1e-3
OUT_OF_REACH, BETWEEN = 1.0, 1e-3


def scene(zeta, frequency=FIRST, gap=OUT_OF_REACH, **changes):
    """A mode at resonance with a body without friction."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": (2 * np.pi * FIRST) ** 2, "damping_ratio": zeta},
        "excitation": {"frequency": frequency, "force": 2 * zeta * (2 * np.pi * FIRST) ** 2 * TOP},
        "cavity": [{"name": "c", "gap": gap}],
        "damper": [{"cavity": "c", "mass": 0.02, "restitution": 0.6}],
    }
    return validate(Scene, data | changes, "scene")


@pytest.mark.parametrize("zeta", [1e-4, 1e-3, 0.02])
@pytest.mark.parametrize("periods", [0, 10, 1000])
def test_one_mode_at_resonance(zeta, periods):
    assert left_over(scene(zeta), periods) == pytest.approx(math.exp(-2 * math.pi * zeta * periods), rel=zeta**2)


def test_overdamped_mode_goes_by_its_slower_part():
    structure = scene(2.0)
    slower = 2 * math.pi * (2.0 - math.sqrt(3.0))
    assert left_over(structure, 3) / left_over(structure, 2) == pytest.approx(math.exp(-slower), rel=1e-9)


def test_a_resonance_without_damping_never_ends():
    assert left_over(scene(0.0, excitation={"frequency": FIRST, "force": 1.0}), LIMIT) == math.inf


@pytest.mark.parametrize("seed", range(3))
def test_steady_amplitude_of_coupled_modes(tmp_path, seed):
    """Modes near each other, coupled by their damping, against a solution of numpy's."""
    draw = np.random.default_rng(seed)
    root, row = draw.normal(size=(4, 4)), draw.normal(size=4)
    squares, damping = (2 * np.pi * FIRST * draw.uniform(0.99, 1.01, 4)) ** 2, root @ root.T
    model = ReducedModel.from_matrices(np.eye(4), np.diag(squares), {"tip": row}, damping=damping)
    model.save(tmp_path / "rom.h5")
    structure = {"model": "rom", "file": str(tmp_path / "rom.h5")}
    excitation = {"frequency": FIRST, "force": 3.0, "at": "tip"}
    made = validate(Scene, {"structure": structure, "excitation": excitation}, "coupled")
    omega = 2 * np.pi * FIRST
    x = np.linalg.solve(np.diag(squares - omega**2) + 1j * omega * damping, 3.0 * row) @ row
    assert Transient(made).numbers[1].steady[0] == pytest.approx(abs(x), rel=1e-9)


def test_modes_count_as_they_are_excited(tmp_path):
    """A mode that the force does not drive has no transient, however little it is damped."""
    squares = (2 * np.pi * np.array([50.0, FIRST])) ** 2
    model = ReducedModel.from_matrices(
        np.eye(2), np.diag(squares), {"tip": [0.0, 1.0]}, damping=np.diag([1e-6, 1.0]),
    )  # fmt: skip
    model.save(tmp_path / "rom.h5")
    data = scene(0.1).to_dict() | {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")},
        "excitation": {"frequency": FIRST, "force": 1.0, "at": "tip"},
        "cavity": [], "damper": [],
    }  # fmt: skip
    structure = validate(Scene, data, "x")
    assert left_over(structure, 100) == pytest.approx(math.exp(-0.5 * 100 / FIRST), rel=1e-6)


def test_nothing_excited_has_no_transient():
    assert left_over(scene(0.0, excitation={"frequency": FIRST}), 1) == 0.0


@pytest.mark.parametrize(
    ("zeta", "transient"), [(0.02, 1000), (0.002, 1000), (2e-4, math.ceil(math.log(100) / 4e-4 / math.pi))]
)
def test_default_suits_the_damping(zeta, transient):
    response = simulate(scene(zeta))
    assert (response.transient, response.periods) == (transient, transient + 500)
    assert response.status == "ok"
    # what is left at the window's start, and less in its mean
    assert response.amplitude_mean == pytest.approx(TOP, rel=0.01)


def test_default_where_no_length_would_do():
    """With next to no damping the default stays; the run tells that it was too short."""
    assert select_model_order(scene(1e-6)).scene.time == scene(1e-6).time
    assert left_over(scene(1e-6), LIMIT) > 0.01
    response = simulate(scene(1e-6))
    assert (response.periods, response.transient, response.status) == (1500, 1000, "not_steady")


@pytest.mark.parametrize(
    "time",
    [
        {"periods": 1500},
        {"periods": 1500, "transient": 1400},
        {"periods": 1010, "transient": 1000},
        {"periods": 9, "transient": 8},
    ],
)
def test_too_short_a_transient_of_the_user(time):
    response = simulate(scene(2e-4, time=time))
    assert response.status == "not_steady"
    assert response.periods == time["periods"]
    assert response.amplitude_mean < 0.9 * TOP


def test_beats_beside_the_resonance():
    """Peaks swell and fade without a trend."""
    short = scene(2e-4, frequency=0.97 * FIRST, time={"periods": 600, "transient": 300})
    assert simulate(short).status == "not_steady"
    assert simulate(short.replace({"time": {"periods": 4300, "transient": 4000}})).status == "ok"


def test_from_the_start_is_what_was_asked_for():
    assert simulate(scene(2e-4, time={"periods": 50, "transient": 0})).status == "ok"


def test_bodies_may_end_the_transient_sooner():
    """Impacts take more than the damping: after 2000 periods the mean is that of a long run, not after 400."""
    long = simulate(scene(2e-4, gap=BETWEEN, time={"periods": 9000, "transient": 6000}))
    assert long.status == "ok" and long.impacts_per_period > 0.5
    short = simulate(scene(2e-4, gap=BETWEEN, time={"periods": 3500, "transient": 2000}))
    assert left_over(scene(2e-4), 2000) > 0.05
    assert short.status == "ok"
    # confidence intervals are 2 % wide each
    assert short.amplitude_mean == pytest.approx(long.amplitude_mean, rel=0.05)
    shorter = simulate(scene(2e-4, gap=BETWEEN, time={"periods": 1500, "transient": 400}))
    assert shorter.status == "not_steady"
    assert shorter.amplitude_mean > 1.2 * long.amplitude_mean


def judged(given, peaks, rate=0.0):
    """Return the judgement of periods among impacts, whose losses would damp amplitudes at some rate a period."""
    transient, dropped, n = Transient(given), given.time.dropped, len(peaks)
    records = new_records(transient.system, dropped + n, 0)
    records.peak[dropped : dropped + n], records.impacts[dropped:] = peaks, 1
    records.parts[:, 0] = 1.0
    records.ledger[:, IMPACT_LOSS] = 2 * rate * np.arange(dropped + n + 1)
    return judge(transient, records, dropped, dropped + n)


def test_a_mean_that_drifts_among_impacts():
    """Peaks with noise: a drift of 20 % over the window is seen, noise alone is not taken for one."""
    noise = np.random.default_rng(1).uniform(-0.03, 0.03, 500)
    given = scene(2e-4, time={"periods": 600, "transient": 100})
    assert judged(given, 1.0 + noise, 0.01).steady
    assert not judged(given, 1.0 + noise + np.linspace(0.0, 0.2, 500), 0.01).steady
    # what loses so little energy remembers more than the window
    assert not judged(given, 1.0 + noise, 1e-3).steady


@pytest.mark.parametrize(
    ("gap", "dropped", "evaluated"),
    [(BETWEEN / 5, 50, 50), (BETWEEN / 2, 200, 100), (BETWEEN, 400, 200), (BETWEEN, 400, 400)],
)
def test_a_short_window_among_impacts(gap, dropped, evaluated):
    """Of too few periods to know their scatter, those of a transient are told from the steady ones of a long run."""
    long = simulate(scene(2e-4, gap=gap, time={"periods": 9000, "transient": 6000}))
    short = simulate(scene(2e-4, gap=gap, time={"periods": dropped + evaluated, "transient": dropped}))
    assert short.impacts_per_period > 0 and short.status == "not_steady"
    assert abs(short.amplitude_mean / long.amplitude_mean - 1) > 0.2


def test_what_repeats_is_steady_in_a_short_window():
    """Halves that agree within the tolerance are not enough: a slow decay goes on for long."""
    given = scene(2e-4, time={"periods": 200, "transient": 100})
    decay, rate = np.linspace(0, 0.005, 100), 1e-3
    assert judged(given, np.ones(100), rate).steady
    assert judged(given, np.tile([1.0, 1.2], 50), rate).steady  # of two periods
    assert not judged(given, 1.0 + decay, rate).steady
    noise = np.random.default_rng(1).uniform(-0.03, 0.03, 100)
    assert not judged(given, 1.0 + noise, rate).steady


def test_confidence_holds_what_remains():
    """Peaks that decay towards 1 at the rate of the losses: the mean of the window is known as well as that."""
    given = scene(0.002, time={"periods": 1500, "transient": 1000})
    peaks = 1.0 + 0.004 * np.exp(-0.002 * np.arange(500))
    found = judged(given, peaks, 0.002)
    assert found.steady
    assert peaks.mean() - 1.0 <= found.confidence <= 3 * (peaks.mean() - 1.0)


def test_settled_after():
    lengths = range(100, 1000, 7)
    assert settled_after(scene(0.002), lengths) == 373  # ln(100) / (2 pi 0.002) = 366.5, rounded up to one of them
    assert settled_after(scene(1e-5), lengths) == 1003 == lengths[-1] + 7
    assert settled_after(scene(0.1), lengths) == 100


def test_every_point_of_a_sweep_has_its_own():
    swept = scene(0.002).replace({"sweep": {"structure.damping_ratio": [0.002, 2e-4, 1e-6]}})
    assert sweep(swept).status.tolist() == ["ok", "ok", "not_steady"]
