"""A design is as good as its worst start, direction and uncertain number, wherever results are told."""

import html
import itertools
import json
from dataclasses import replace

import numpy as np
import pytest
import tomli_w

from tests.studies.report.test_forced_response import made
from tests.tools.changed import changed
from vanedamp.coupling.quantities.quantity import family
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.designs import is_choice
from vanedamp.files.toml_input import validate
from vanedamp.studies import worst_start as module
from vanedamp.studies.cli import main
from vanedamp.studies.explore.sweep_chart import best_design, best_sentence
from vanedamp.studies.report.designs import best_first, designs
from vanedamp.studies.report.forced_response import forced_responses
from vanedamp.studies.worst_start import worst_start, worst_words

X, FREQUENCIES = 7e-5, np.linspace(2370.0, 2425.0, 12)
SCENE = {
    "structure": {"model": "rigid", "mass": 0.157, "stiffness": 3.605e7, "damping_ratio": 0.002},
    "excitation": {"frequency": 2400.0, "resonance_amplitude": X},
    "cavity": [{"name": "c1", "gap": X}],
    "damper": [{"cavity": "c1", "mass": 3.14e-3, "friction": 0.4, "restitution": 0.7}],
    "time": {"periods": 900, "transient": 600},
}
STARTS = ["independent", "up", "down"]


def chain(gap, direction):
    """Means and maxima of single runs, each from the last state of the one before."""
    scene, state, found = validate(Scene, SCENE, "scene").replace({"cavity.c1.gap": gap}), None, []
    for frequency in FREQUENCIES[:: -1 if direction == "down" else 1]:
        run = simulate(scene.replace({"excitation.frequency": frequency}), start=state)
        state = None if direction == "independent" else run.final
        found.append((run.amplitude_mean_dynamic, run.amplitude_max_dynamic))
    return np.array(found)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Folder of a sweep of two gaps from three starts, with what the command printed, and its JSON."""
    folder = tmp_path_factory.mktemp("starts")
    axes = {
        "continuation.direction": STARTS,
        "cavity.c1.gap": [X / 10, X],
        "excitation.frequency": FREQUENCIES.tolist(),
    }
    (folder / "scene.toml").write_text(tomli_w.dumps(SCENE | {"sweep": axes}))
    files = ["-o", str(folder / "s.h5"), "--json", str(folder / "s.json"), "--workers", "1"]
    assert main(["sweep", str(folder / "scene.toml"), *files]) == 0
    return folder


def test_every_place_tells_the_worst_start(swept, capsys):
    """The gap X leaves little from rest and more going up, by single runs of the engine."""
    means = {start: chain(X, start)[:, 0].max() / X for start in STARTS}
    largest = max(chain(X, start)[:, 1].max() for start in STARTS) / X
    worst = max(means, key=means.get)
    assert worst != "independent" and means[worst] > 1.2 * means["independent"]
    told = json.loads((swept / "s.json").read_text())["designs"]
    assert len(told) == 2 and told[0]["peak_ratio"] == pytest.approx(means[worst], rel=1e-3)
    assert f"direction = {worst}" in told[0]["name"] and told[0]["starts"] == 3
    said = f"damped peak (mean) {told[0]['peak_ratio']:.3f}"
    assert said in told[0]["sentence"] and f"{largest:.3f}" in told[0]["sentence"]
    assert "one start only" not in told[0]["sentence"]
    assert main(["info", str(swept / "s.h5")]) == 0
    printed = capsys.readouterr().out
    assert f"direction = {worst}" in printed and said in printed
    assert main(["report", str(swept / "s.h5"), "-o", str(swept / "page.html")]) == 0
    page = html.unescape((swept / "page.html").read_text())
    assert f"{told[0]['peak_ratio']:.1%} is left" in page and f"{means['independent']:.1%} is left" not in page
    assert f"direction = {worst}" in page


def test_a_chosen_damper_is_told_by_its_worst_start(swept, monkeypatch):
    told = worst_start(validate(Scene, SCENE, "scene"), FREQUENCIES)
    (first, _) = json.loads((swept / "s.json").read_text())["designs"]
    assert told["starts"] == 3 and told["not_ok"] == 0
    assert told["peak_ratio"] == pytest.approx(first["peak_ratio"], rel=1e-12)
    assert told["frequency"] == first["damped_peak_at"] and told["maximum_ratio"] >= told["peak_ratio"]
    words = {"up": "going up", "down": "going down"}[told["direction"]]
    assert f"from the worst of 3 starts, {words}, {told['peak_ratio']:.1%} of the maximum" in worst_words(told)
    monkeypatch.setattr(module, "why_no_restart", lambda scene: "is for another method")
    alone = worst_start(validate(Scene, SCENE, "scene"), FREQUENCIES[:2])
    assert alone["starts"] == 1 and worst_words(alone).startswith("one start only")


def test_choices():
    chosen = (
        "cavity.c.gap",
        "cavity.0.play",
        "damper.mass",
        "structure.mass",
        "friction_damper.0.normal_force",
        "stop.0.gap",
    )
    given = (
        "continuation.direction", "initial.displacement", "damper.0.position", "damper.friction", "stop.restitution",
        "structure.mistuning.seed", "cavity.0.scatter.gap", "excitation.force", "gravity.orientation_deg",
        "contact.stiffness", "structure.modes", "structure.damping_ratio", "solver.method", "time.periods",
    )  # fmt: skip
    assert [path for path in (*chosen, *given) if is_choice(path)] == list(chosen)


AXES = {
    "damper.friction": [0.1, 0.4], "cavity.c1.gap": [1e-5, 2e-5, 3e-5], "continuation.direction": STARTS,
    "excitation.frequency": [1.0, 2.0, 3.0, 4.0], "damper.mass": [0.1, 0.2],
}  # fmt: skip


@pytest.mark.parametrize("seed", range(5))
def test_order_by_plain_loops(seed):
    """Random amplitudes: the worst of friction, starts and frequencies; designs by rising worst. Explore agrees."""
    mean = np.random.default_rng(seed).uniform(0.1, 1.0, [len(values) for values in AXES.values()])
    sweep = made(
        AXES, amplitude_mean_dynamic=mean, amplitude_max_dynamic=1.1 * mean, amplitude_undamped=np.ones(mean.shape)
    )
    heights = {
        (gap, mass): max(mean[f, gap, s, at, mass] for f, s, at in itertools.product(range(2), range(3), range(4)))
        for gap, mass in itertools.product(range(3), range(2))
    }
    judged = designs(forced_responses(sweep))
    assert [design.worst.headline.peak_ratio for design in judged] == sorted(heights.values())
    assert all(design.starts == 3 and len(design.curves) == 6 for design in judged)
    gap, mass = min(heights, key=heights.get)
    assert judged[0].worst.settings["cavity.c1.gap"] == AXES["cavity.c1.gap"][gap]
    assert "worst of 6 curves of the design (damper.friction, continuation.direction)" in judged[0].sentence
    best = best_design(sweep)
    assert (best.amplitude, best.designs) == (heights[gap, mass], 6)
    assert (best.places["cavity.c1.gap"], best.places["damper.mass"]) == (gap, mass)
    place = tuple(best.places[path] for path in AXES)
    assert mean[place] == heights[gap, mass]
    assert f"direction = {STARTS[best.places['continuation.direction']]}" in best_sentence(sweep, best)
    assert [curve.name for curve in best_first(forced_responses(sweep))][:6] == [c.name for c in judged[0].curves]


def test_one_start_is_said():
    axes = {"cavity.c1.gap": [1e-5, 2e-5], "excitation.frequency": [1.0, 2.0, 3.0]}
    sweep = made(axes, **{one.name: np.ones((2, 3)) for one in family("amplitude")})
    assert all(design.sentence.endswith("; one start only") for design in designs(forced_responses(sweep)))


def test_files_that_differ_in_their_start_have_one_design():
    axes = {"excitation.frequency": [1.0, 2.0, 3.0]}
    low = made(axes, amplitude_mean_dynamic=np.array([0.1, 0.2, 0.1]), amplitude_undamped=np.ones(3))
    up = replace(low.scene, continuation=replace(low.scene.continuation, direction="up"))
    high = changed(low, scene=up, amplitude_mean_dynamic=np.array([0.1, 0.6, 0.1]))
    (design,) = designs([*forced_responses(low), *forced_responses(high)])
    assert (design.starts, design.worst.headline.peak_ratio) == (2, 0.6)
    heavy = replace(high, scene=low.scene.replace({"damper.mass": 0.07}))
    assert len(designs([*forced_responses(low), *forced_responses(heavy)])) == 2


def test_only_a_point_that_may_be_the_peak_spoils_a_design():
    """A run that ended below the peak may still change, but is known; one that broke off is not."""
    axes = {"cavity.c1.gap": [1e-5, 2e-5], "excitation.frequency": [1.0, 2.0, 3.0]}
    mean = np.array([[0.1, 0.3, 0.2], [0.2, 0.5, 0.4]])
    for state, value, first in (("not_steady", 0.2, 0.3), ("not_steady", 0.9, 0.5), ("event_budget", 0.2, 0.5)):
        status = np.full((2, 3), "ok", object)
        status[0, 2], mean[0, 2] = state, value
        sweep = made(axes, status=status, amplitude_mean_dynamic=mean.copy(), amplitude_undamped=np.ones((2, 3)))
        assert designs(forced_responses(sweep))[0].worst.headline.peak_ratio == first
        assert best_design(sweep).amplitude == first
