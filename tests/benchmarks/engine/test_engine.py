"""The benchmark of the engine: its rivals are right, its results are complete. No test asserts a time."""

import csv
import json

import numpy as np
import pytest

from benchmarks.engine import inside
from benchmarks.engine import scenes as bench_scenes
from benchmarks.engine.hand_written_loop import (
    ACCOUNT,
    ImpactOscillator,
    complete_loop,
    lean_loop,
    plain_loop,
)
from benchmarks.engine.measure import Engine
from benchmarks.engine.reference_solutions import solve_with_events, truth
from vanedamp.coupling.simulation import simulate
from vanedamp.studies.cli import BAD_INPUT, main

PERIODS = 20
TINY = Engine(
    rounds=2, settle=2000, checked=PERIODS, engine=(50, 150), loop=100, solver=3, modes=(1, 6), calm=(20, 60),
    hard=(20, 60),
)  # fmt: skip


@pytest.fixture(scope="module")
def scene():
    """Two impacts per period from the first period on."""
    settled = bench_scenes.settled(bench_scenes.one_mode(), TINY.settle)
    return settled.replace({"time.periods": PERIODS, "time.transient": 0})


@pytest.fixture(scope="module")
def case(scene):
    return ImpactOscillator.of(scene)


@pytest.fixture(scope="module")
def exact(case):
    return truth(case, PERIODS)


def worst(states, exact):
    return (np.abs(states - exact) / np.abs(exact).max(axis=0)).max()


@pytest.mark.parametrize("loop", [plain_loop, lean_loop, complete_loop])
def test_loops_follow_the_exact_states(loop, case, exact):
    assert worst(loop(case, PERIODS)[0], exact) < 1e-11


def test_engine_follows_the_exact_states(scene, exact):
    response = simulate(scene)
    assert response.impacts_per_period == 2
    assert worst(np.column_stack([response.section, response.slip, response.slip_velocity]), exact) < 1e-11


@pytest.mark.parametrize("rtol", [1e-5, 1e-9])
def test_solve_ivp_follows_the_exact_states_to_its_tolerance(rtol, case, exact):
    # errors of a step add up over the impacts that the damping has not yet forgotten
    assert worst(solve_with_events(case, PERIODS, rtol), exact) < 300 * rtol


def test_truth_is_converged(case, exact):
    np.testing.assert_array_equal(truth(case, 5, digits=60), exact[:6])


def test_complete_loop_accounts_for_what_the_engine_does(scene, case):
    response = simulate(scene)
    _, peak, account = complete_loop(case, PERIODS)
    total = dict(zip(ACCOUNT, account.sum(axis=0), strict=True))
    span = PERIODS / scene.excitation.frequency
    for name in ("excitation", "viscous", "impact"):
        assert total[name] == pytest.approx(response.energy[name], rel=1e-9)
    assert np.sqrt(total["square"] / span) == pytest.approx(response.amplitude_rms, rel=1e-9)
    assert 2 / span * abs(complex(total["harmonic"], total["harmonic_i"])) == pytest.approx(
        response.amplitude_harmonic, rel=1e-9
    )
    np.testing.assert_allclose(peak, response.peak, rtol=1e-9)


def test_ledger_of_the_complete_loop_closes(case, exact):
    account = complete_loop(case, PERIODS)[2].sum(axis=0)
    x, v, _, slip_velocity = exact.T
    stored = 0.5 * (case.mass * v**2 + case.stiffness * x**2 + case.body * (v + slip_velocity) ** 2)
    assert account[0] == pytest.approx(account[1] + account[2] + stored[-1] - stored[0], rel=1e-11)


def test_more_modes_keep_the_first(tmp_path):
    """The reduced model of one mode is the rigid model."""
    rom, rigid = bench_scenes.reduced(tmp_path, 1, "two impacts per period"), bench_scenes.one_mode()
    ours, theirs = (simulate(scene.replace({"time.periods": 30})) for scene in (rom, rigid))
    np.testing.assert_allclose(ours.section, theirs.section, rtol=0, atol=1e-9 * bench_scenes.AMPLITUDE)


def test_benchmark_leaves_its_results(tmp_path, capsys, monkeypatch, pictures):
    monkeypatch.setattr(inside, "_REPEATS", 100)
    result = TINY.run(tmp_path / "bench")
    written = json.loads((tmp_path / "bench" / "bench_engine.json").read_text())
    assert written == json.loads(json.dumps(result))
    assert set(result) == {"machine", "seed", "effort", "one_mode", "modes", "bodies", "costs", "wall_time_s"}
    one = result["one_mode"]
    assert one["impacts_per_period"] == 2
    assert set(one["time"]) == set(one["error"])
    assert max(one["error"][name] for name in ("engine", "plain loop", "lean loop", "complete loop")) < 1e-11
    assert one["error"]["engine"] < one["error"]["solve_ivp 1e-11"] < one["error"]["solve_ivp 1e-05"]
    for entry in result["modes"]["uses"].values():
        assert set(entry["status"]) <= {"ok", "not_steady"}  # windows of 40 periods
        assert all(0 <= awake <= count for awake, count in zip(entry["awake"], (1, 6), strict=True))
    assert result["bodies"]["counts"] == [1, 2, 4, 8]
    assert set(result["costs"]["timed"]) == {"search", "account", "rest"}
    with (tmp_path / "bench" / "bench_engine.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["part"] for row in rows} >= {"one mode", "bodies", "costs", "modes, free"}
    assert any(panel.curves for panel in pictures["bench_scaling"]) and pictures["bench_one_mode"]
    TINY.print_summary(result)
    assert "engine / lean loop" in capsys.readouterr().out


def test_output_must_be_a_folder(tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("kept")
    assert main(["bench", "engine", "-o", str(file)]) == BAD_INPUT
    assert "expected a folder" in capsys.readouterr().err
    assert file.read_text() == "kept"


def test_unknown_study_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["bench", "engines", "-o", str(tmp_path)])
    assert stopped.value.code == BAD_INPUT
    assert len(capsys.readouterr().err.splitlines()) == 1
