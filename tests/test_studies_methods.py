"""The comparison of methods: edges of failure against analytic limits, results complete. No test asserts a time."""

import csv
import json

import numpy as np
import pytest

from studies import stability, work_precision
from studies.cli import main

SMALL = stability.Effort(points=2, runs=3, modes=(0, 1, 2, 5, 10, 20))


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
    assert "ok" not in part["without_completion"]


def test_newmark_makes_energy_in_contacts():
    curves = stability.contact_energy(SMALL)["curves"]
    assert curves["Newmark"][0] > 1.01 and abs(curves["Newmark"][-1] - 1) < 0.01


def test_touches_shorter_than_a_step_are_missed_by_signs_alone():
    part = stability.missed_impacts(SMALL)
    assert part["curves"]["sign at step ends (DOP853)"][0] > 0.5
    assert part["curves"]["sign at step ends (DOP853)"][-1] == 0
    assert not any(part["curves"]["exact engine"])


def test_work_precision_leaves_its_results(tmp_path, capsys):
    effort = work_precision.Effort(1, (100, 1000), (1e-6,), 2, 60, 200, 2, 1e5, 2000, None, ())
    result = work_precision.run_work_precision(tmp_path, effort)
    assert json.loads((tmp_path / "work_precision.json").read_text()) == json.loads(json.dumps(result))
    assert (tmp_path / "work_precision.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "work_precision.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["scene"] for row in rows} == set(result["charts"])
    chart = result["charts"]["periodic 1:1 impact"]
    assert chart["classification"] == "periodic-1"
    coarse, fine = (point["error"] for point in chart["points"] if point["method"] == "Moreau-Jean")
    assert fine < 0.3 * coarse
    work_precision.tell(result)
    assert "exact engine is" in capsys.readouterr().out


def test_command_writes_the_maps(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(stability, "QUICK", stability.Effort(2, 1, (0, 1)))
    assert main(["bench", "stability", "-o", str(tmp_path / "maps"), "--quick"]) == 0
    assert "measured / analytic limit" in capsys.readouterr().out
    assert {file.name for file in (tmp_path / "maps").iterdir()} == {"stability.json", "stability.csv", "stability.png"}
