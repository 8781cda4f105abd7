"""Which contact laws converge with the number of modes: a bar on a wall with an exact solution; the command."""

import json

import numpy as np
import pytest

from benchmarks.model_order.bar_on_wall import GAP, GRAVITY, LENGTH, MODULUS, PERIOD, bar, bounce
from vanedamp.studies.cli import main


def test_one_mode_is_a_mass_on_a_spring():
    """Fall, a half period of the spring with the weight's part, rise: closed form (the bar's flexibility L / 3 EA)."""
    spring = bar(1, "massless").spring
    assert spring == pytest.approx(3 * MODULUS / LENGTH)
    rate, speed = np.sqrt(spring / 10.0), np.sqrt(2 * GRAVITY * GAP)
    sag = GRAVITY / rate**2
    contact = 2 * (np.pi - np.arctan2(speed / rate, sag)) / rate
    result = bounce(1, "massless")
    assert result.time == pytest.approx(abs(2 * (2 * speed / GRAVITY + contact) / PERIOD - 1), abs=1e-8)
    assert result.energy < 1e-12
    assert bounce(1, "newton").time == pytest.approx(abs(4 * speed / GRAVITY / PERIOD - 1), abs=1e-8)


def test_massless_boundary_converges():
    errors = np.array([[run.time, run.height] for run in (bounce(modes, "massless") for modes in (20, 40))])
    assert errors[-1, 0] < 1e-3
    assert np.all(np.diff(np.log2(errors), axis=0) < -0.4)


def test_compliant_contact_has_a_limit_and_newton_has_none():
    """The limit belongs to the spring; Newton's second apex wanders by a quarter of the period however many modes."""
    compliant = [bounce(modes, "compliant").time for modes in (12, 24)]
    assert np.ptp(compliant) < 1e-3
    assert max(compliant) < 5e-3
    newton = [bounce(modes, "newton").time for modes in (5, 8, 20)]
    assert min(newton) > 0.2
    assert bounce(20, "newton").energy < 1e-12


@pytest.mark.slow
def test_command(tmp_path, capsys):
    assert main(["bench", "ladder", "--quick", "-o", str(tmp_path)]) == 0
    assert "cluster, error of the mean amplitude" in capsys.readouterr().out
    result = json.loads((tmp_path / "ladder.json").read_text())
    assert result["bar"]["energy"] < 1e-11
    laws = result["cluster"]["laws"]
    assert laws[result["cluster"]["reference"]["law"]]["error"][-1] == 0.0
    assert laws["newton"]["error"][-1] > 0.0
    for entry in laws.values():
        assert set(np.ravel(entry["status"])) == {"ok"}
    assert result["auto"]["number"] == 6
    assert result["auto"]["kept"] >= 5
    assert all(row["cheapest_cost"] > 0.0 for row in result["auto"]["verdicts"])
    assert (tmp_path / "auto.csv").read_text().startswith("scene,tolerance,modes,estimate,error")
    assert [row["number"] for row in result["bodies"]["tolerances"]] == [3, 3]
    assert (tmp_path / "bodies.csv").read_text().startswith("scene,tolerance,shape,tilts,persisting")
    figures = {"ladder_bar.png", "ladder_cluster.png", "ladder_auto.png", "ladder_bodies.png"}
    assert {path.name for path in tmp_path.glob("*.png")} == figures
