"""The comparison of methods: edges of failure against analytic limits, results complete. No test asserts a time."""

import csv
import json
import math
from importlib.util import find_spec

import numpy as np
import pytest

from benchmarks.methods import scenes as method_scenes
from benchmarks.methods.charts import status_after
from benchmarks.methods.measure import WorkPrecision
from benchmarks.methods.peers import PEERS
from benchmarks.stability import limits as stability
from benchmarks.stability.macro_step import macro_step
from benchmarks.stability.maps import CO_SIMULATIONS, MAPS, MapEffort
from benchmarks.stability.scenes import DAMPING
from vanedamp.coupling.simulation import simulate
from vanedamp.studies.cli import main

SMALL = stability.Stability(points=2, runs=3, modes=(0, 1, 2, 5, 10, 20))


@pytest.mark.parametrize(
    "part", [stability.explicit_limit, stability.contact_limit, stability.friction_limit, stability.cosimulation_limit]
)
def test_methods_fail_where_theory_says(part):
    """2/omega (central differences), 2 v_reg m*/(mu N), and the spectral radius of a macro-step."""
    curves = part(SMALL)["curves"]
    np.testing.assert_allclose(curves["measured"], curves["limit"], rtol=0.05)


def test_contact_mass_of_the_rod():
    """The tip of a clamped unit rod with 0, 1, 2, 5 and 10 modes, by the Schur complement of its mass."""
    curves = stability.restitution_and_modes(SMALL)["curves"]
    np.testing.assert_allclose(curves["measured"][:5], [0.333, 0.131, 0.080, 0.0367, 0.0193], rtol=5e-3)
    newton, compliant = curves["Newton's law"], curves["compliant"]
    assert newton[-1] < 0.5 * newton[0]
    assert compliant[-1] == pytest.approx(compliant[-2], rel=0.05)


def test_chatter_ends_where_the_geometric_series_does():
    part = stability.chatter_end(SMALL)
    np.testing.assert_allclose(
        part["curves"]["measured"], part["curves"]["limit"], rtol=2e-5
    )  # the last hops take 3e-7 periods
    # without completion it goes on until the clock resolves no more: beyond the budget where little is lost
    assert part["without_completion"][-1] == "event_budget"


def test_newmark_makes_energy_in_contacts():
    curves = stability.contact_energy(SMALL)["curves"]
    assert curves["Newmark"][0] > 1.01 and abs(curves["Newmark"][-1] - 1) < 0.01


def test_touches_shorter_than_a_step_are_missed_by_signs_alone():
    part = stability.missed_impacts(SMALL)
    assert part["curves"]["sign at step ends (DOP853)"][0] > 0.5
    assert part["curves"]["sign at step ends (DOP853)"][-1] == 0
    assert not any(part["curves"]["exact engine"])


SMALL_MAP = MapEffort(across=2, up=2, phases=40, modes=(0, 2, 5))


DEAR = {"missed impacts", *CO_SIMULATIONS}


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in DEAR else n for n in MAPS])
def test_edges_of_the_maps_lie_on_the_analytic_limits(name):
    """2/omega, 2 v_reg m*/(mu N), spectral radii of macro-steps, durations of touches, the contact mass of a rod."""
    made = MAPS[name](SMALL_MAP)
    edge, limit = (np.array(made[key], float) for key in ("edge", "limit"))
    known = np.isfinite(limit)
    assert known.any() and (np.isfinite(edge) == known).all()
    np.testing.assert_allclose(edge[known], limit[known], rtol=0.05)
    assert np.shape(made["value"]) == (len(made["y"]), len(made["x"]))
    assert not made.get("missed_by_exact")


def test_macro_step_of_a_far_too_light_body_is_the_structure_alone():
    """Without a contact the structure's unit is exact: its multipliers are exp(lambda h), the body's 1."""
    h = 0.1
    matrix = macro_step(h, 1.0, 0.0, 0.0, "jacobi", 0)
    decay = DAMPING / 2
    size = np.sort(np.abs(np.linalg.eigvals(matrix)))[-4:]
    np.testing.assert_allclose(size, [math.exp(-decay * h)] * 2 + [1, 1], rtol=1e-7)


def test_work_precision_leaves_its_results(tmp_path, capsys, pictures):
    bench = WorkPrecision(1, (100, 1000), (1e-6,), 2, 60, 200, 2, 1e5, 2000, None, ())
    result = bench.run(tmp_path)
    assert json.loads((tmp_path / "work_precision.json").read_text()) == json.loads(json.dumps(result))
    assert {"Moreau-Jean", "exact engine"} <= {label for panel in pictures["work_precision"] for label in panel.curves}
    with (tmp_path / "work_precision.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["scene"] for row in rows} == set(result["charts"])
    chart = result["charts"]["periodic 1:1 impact"]
    assert chart["classification"] == "periodic-1"
    coarse, fine = (point["error"] for point in chart["points"] if point["method"] == "Moreau-Jean")
    assert fine < 0.3 * coarse
    # a mean of the last 15 of 30 periods, from the exact steady state, in which the method drifts from it
    scene = method_scenes.periodic(3000).replace({"time.periods": 30, "time.transient": 15})
    stepped = simulate(method_scenes.by(scene, method="penalty", steps_per_period=1000)).amplitude_mean
    label, drift = "penalty, central differences", abs(stepped / simulate(scene).amplitude_mean - 1)
    points = {(row["method"], float(row["setting"])): row for row in rows if row["scene"] == "periodic 1:1 impact"}
    assert float(points[label, 1000]["steady"]) == pytest.approx(drift, rel=1e-6) and drift > 0.01
    assert float(points["exact engine", 0]["steady"]) < 1e-12
    # of the peers only those with a tolerance have a setting in this effort
    for name in ("SUNDIALS CVODE", "heyoka"):
        errors = [point["error"] for point in chart["points"] if point["method"] == name]
        installed = find_spec(PEERS[name].needs) is not None
        assert (name in chart["absent"]) == (not installed)
        assert errors == ([pytest.approx(0.0, abs=1e-3)] if installed else [])
    bench.print_summary(result)
    out = capsys.readouterr().out
    assert "exact engine is" in out and "| Moreau-Jean, 1000 " in out
    assert "| penalty, central differences, 100 " in out  # the table of steady errors has every setting


def test_timed_runs_are_not_judged_by_what_so_few_periods_have_settled():
    scene = method_scenes.by(method_scenes.single(), method="solve_ivp", rtol=1e-4)
    assert simulate(scene.replace({"time.periods": 3, "time.transient": 1})).status == "not_steady"
    assert status_after(scene, 3) == "ok"


def test_command_writes_the_maps(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(stability, "QUICK", stability.Stability(2, 1, (0, 1)))
    assert main(["bench", "stability", "-o", str(tmp_path / "maps"), "--quick"]) == 0
    assert "measured / analytic limit" in capsys.readouterr().out
    assert {file.name for file in (tmp_path / "maps").iterdir()} == {"stability.json", "stability.csv", "stability.png"}
