"""The studies on rotating blades: units and speeds of their scenes, closed forms, and physics that must hold."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from paper import blade as study_of_blade
from paper.blade import beam_southwell, southwell
from paper.claims_rotation import campbell, friction_only, load_ratio, values
from paper.claims_self_tuning import resonance_on_track, tuned_order
from paper.figure_scenes import PaperScenes, order_peaks
from paper.plots_rotation import campbell_picture
from paper.runner import study
from paper.scene_files import scene_file
from paper.session import PaperSession
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.modal.records.campbell import Campbell
from vanedamp.studies.case.tables import Case
from vanedamp.studies.demo.curve import curves
from vanedamp.studies.demo.figure_file import Effort, FigureStructure

FREQUENCY, MASS, RATIO, AMPLITUDE = 2412.0, 0.157, 0.002, 70e-6
STIFFNESS = MASS * (2 * math.pi * FREQUENCY) ** 2
STRUCTURE = FigureStructure(MASS, STIFFNESS, RATIO, FREQUENCY, AMPLITUDE, Path("rom.h5"))
BOTH = ("rotating_body", "self_tuning")


def scenes(name):
    return PaperScenes.load(scene_file(name), STRUCTURE).scenes


def along(scene, frequencies, periods=1500, transient=800, sweep_of=None, **changes):
    """The curves of a scene at some frequencies (Hz) along its engine order."""
    speeds = [2 * math.pi * frequency / scene.excitation.engine_order for frequency in frequencies]
    axes = (sweep_of or {}) | {"rotation.speed": speeds}
    run = scene.replace({"sweep": axes, "time.periods": periods, "time.transient": transient, **changes})
    return curves(sweep(run), "curve")


@pytest.mark.parametrize("name", BOTH)
def test_scenes_go_along_an_engine_order(name):
    figure = PaperScenes.load(scene_file(name), STRUCTURE)
    for scene in figure.scenes.values():
        assert scene.excitation.resonance_amplitude == AMPLITUDE
        assert scene.cavity[0].radius == pytest.approx(4320 * AMPLITUDE, rel=1e-12)
        assert list(scene.sweep)[-1] == "rotation.speed"
        order = scene.excitation.engine_order
        for frequency in order_peaks(scene):
            speed = 2 * math.pi * frequency / order
            masses = MASS, MASS + scene.damper[0].mass
            natural = [math.sqrt(scene.structure.stiffness_at(speed) / mass) / (2 * math.pi) for mass in masses]
            assert min(abs(each / frequency - 1) for each in natural) < 1e-12
            swept = values(scene, "rotation.speed")
            assert not swept[0] < speed < swept[-1] or min(abs(swept / speed - 1)) < 1e-12


def test_frequencies_of_a_curve_are_those_of_the_excitation():
    (curve,) = along(scenes("rotating_body")["order_12"], [2300.0, 2412.0])
    np.testing.assert_allclose(curve.frequency, [2300.0, 2412.0], rtol=1e-12)


def test_load_ratios_are_those_of_the_file():
    found = scenes("rotating_body")
    ratios = [load_ratio(found["open"], friction) for friction in values(found["open"], "damper.0.friction")]
    np.testing.assert_allclose(ratios, [0.01, 0.05, 0.1, 0.15, 0.2, 0.3, 0.6, 1.2], rtol=1e-12)


def test_friction_only_against_the_exact_engine():
    """The tops are flat, so that points 0.1 % apart find them; the closed form has the blade's first harmonic only."""
    scene = scenes("rotating_body")["open"]
    (peak, _) = order_peaks(scene)
    for ratio in (0.05, 0.15):
        friction = ratio / load_ratio(scene, 1.0)
        (curve,) = along(scene, peak * np.linspace(0.999, 1.011, 13), **{"damper.0.friction": friction})
        assert curve.mean.max() == pytest.approx(friction_only(scene, ratio), rel=0.02)
        assert not curve.impacts.any()


def test_friction_only_has_its_limits():
    scene = scenes("rotating_body")["open"]
    slope = 4 * 0.02 / (2 * math.pi * RATIO)
    assert friction_only(scene, 1e-6) == pytest.approx(1 - 1e-6 * slope, rel=1e-9)
    assert math.isnan(friction_only(scene, 0.6))  # sticks on the way


def test_a_body_sticks_where_the_amplitude_is_below_friction_times_radius_over_the_squared_order():
    scene = scenes("rotating_body")["open"]
    (peak, _) = order_peaks(scene)
    (curve,) = along(scene, peak * np.array([0.97, 0.99, 1.0, 1.01, 1.03]), **{"damper.0.friction": 0.25})
    below = curve.fixed < load_ratio(scene, 0.25)
    assert below.tolist() == [True, True, False, True, True]
    assert (np.abs(curve.mean / curve.fixed - 1) < 1e-3).tolist() == below.tolist()


def test_a_body_that_leans_on_a_wall_moves_along():
    """Harmonic and mean are those of the fixed body; the static deflection m W^2 r sin(angle)/c is apart."""
    scene = scenes("rotating_body")["inclined"].replace({"cavity.c1.centrifugal_deg": 45.0})
    (curve,) = along(scene, [2350.0, 2400.0])
    np.testing.assert_allclose(curve.harmonic, curve.fixed, rtol=2e-3)
    np.testing.assert_allclose(curve.mean, curve.harmonic, rtol=1e-6)
    speed = 2 * math.pi * 2350.0 / 12
    pull = scene.damper[0].mass * speed**2 * scene.cavity[0].radius * math.sin(math.pi / 4)
    response = simulate(scene.replace({"sweep": {}, "rotation.speed": speed}))
    assert abs(response.static_deflection) == pytest.approx(pull / scene.structure.stiffness_at(speed), rel=5e-3)


def test_orders_of_tracks():
    found = scenes("self_tuning")
    radius = found["tuned"].cavity[0].radius
    assert tuned_order(radius, found["tuned"].damper[0].track_radius) == pytest.approx(12, rel=1e-12)
    assert tuned_order(radius, found["rolling"].damper[0].track_radius, 2 / 3) == pytest.approx(12, rel=1e-12)


def test_a_tuned_body_keeps_every_blade_at_rest_and_a_sliding_one_does_not():
    """What friction holds also feels that the load grows along the cavity, m W^2: 1.4e-4 of the stiffness, and up to
    3 % of the amplitude beside the resonance."""
    found = scenes("self_tuning")
    for name, factor in (("track_low", 0.9), ("tuned", 1.0), ("track_high", 1.1)):
        (curve,) = along(found[name], FREQUENCY * factor * np.array([0.97, 1.0, 1.006, 1.03]), 6000, 5000)
        assert curve.undamped.max() > 0.5
        assert curve.mean.max() < 0.01
    (curve,) = along(found["tuned"], [2400.0, 2410.0, 2426.0], **{"damper.0.friction": 0.1})
    np.testing.assert_allclose(curve.mean, curve.fixed, rtol=0.03)


@pytest.mark.parametrize("error", [-0.1, 0.1])
def test_resonances_of_tracks_off_their_order(error):
    """Without walls: 1 % beside the resonance, five half-power widths, a fifth of it is left or less."""
    scene = scenes("self_tuning")["tuned"].replace({"cavity.c1.gap": 1000 * AMPLITUDE})
    track = (1 + error) * scene.damper[0].track_radius
    tuned = tuned_order(scene.cavity[0].radius, track)
    expected = FREQUENCY * resonance_on_track(12, tuned, 0.02, 1.725)
    assert (expected < FREQUENCY) == (error < 0)
    (curve,) = along(scene, expected * np.array([0.99, 1.0, 1.01]), 3000, 2000, **{"damper.0.track_radius": track})
    assert curve.mean[1] > 0.6
    assert curve.mean[[0, 2]].max() < 0.35 * curve.mean[1]


def test_there_is_no_resonance_for_a_track_little_below_its_order():
    orders = 12 / np.sqrt(1 + 0.02 * np.array([0.2, 0.9]))
    assert [resonance_on_track(12, tuned, 0.02) for tuned in orders] == [math.inf, math.inf]
    assert resonance_on_track(12, 12.0, 0.02) == math.inf
    assert resonance_on_track(12, 12 / math.sqrt(1.03), 0.02) == pytest.approx(math.sqrt(3), rel=1e-9)


@pytest.mark.parametrize("name", ["rotating_body", pytest.param("self_tuning", marks=pytest.mark.slow)])
def test_claims_of_quick_studies(name, tmp_path, pictures):
    found = study(name, PaperSession(STRUCTURE, tmp_path, effort=Effort(points=3)))
    assert all(panel.x and panel.y for panel in pictures[name]) and any(panel.curves for panel in pictures[name])
    assert json.loads((tmp_path / f"{name}.claims.json").read_text())["study"] == name
    for claim in found.claims:
        assert claim.verdict in ("shown", "partly", "not shown")
        assert claim.verdict == "shown" or claim.why
        assert all(isinstance(value, float) for value in claim.figures.values())


def test_southwell_is_fitted():
    turns = np.linspace(0, 200, 9)
    assert southwell(turns, np.sqrt(150**2 + 2.5 * turns**2)) == pytest.approx((150, 2.5, 0.0), rel=1e-9, abs=1e-12)


def test_beam_coefficients_are_above_the_exact_ones_and_close():
    """Wright et al. (1982): mu^2 = 3.5160, 3.6816 at eta = 0, 1 without a hub; Rayleigh's quotient is above."""
    exact = 3.6816**2 - 3.5160**2
    assert exact - 1e-3 < beam_southwell(1, 0.0) < 1.003 * exact
    for bending in (1, 2, 3):  # linear in the hub's radius
        first, second, third = (beam_southwell(bending, hub) for hub in (0.0, 1.0, 2.0))
        assert third - second == pytest.approx(second - first, rel=1e-12)


def test_study_of_the_blade(tmp_path, monkeypatch, pictures):
    monkeypatch.setattr(study_of_blade, "_SPEEDS", 5)
    found = study_of_blade.blade()
    assert found.names == ("bending 1", "bending 2", "torsion 1", "edge bending 1", "bending 3")
    turns = found.revolutions
    flap, lag = (found.frequencies(diagram, "bending 1") for diagram in (found.flapwise, found.lagwise))
    np.testing.assert_allclose(lag**2, flap**2 - turns**2, rtol=1e-3)
    for index, name in enumerate(("bending 1", "bending 2", "bending 3"), 1):
        _, slope, error = southwell(turns, found.frequencies(found.flapwise, name))
        assert slope == pytest.approx(beam_southwell(index, found.hub), rel=0.02)
        assert error < 0.01
    np.testing.assert_allclose(found.reduced, found.full, rtol=1e-4)
    claims = campbell(found)
    assert [claim.verdict for claim in claims] == ["shown"] * 4
    campbell_picture(found, "Blade", tmp_path / "blade.png")
    left, middle, right = pictures["blade"]
    assert set(found.names[:4]) < set(left.curves) and {"speed, rpm"} == {left.x, right.x}
    assert len(middle.curves) >= 3 and "Southwell" in middle.title
    for name in study_of_blade.save(found, tmp_path):
        assert Campbell.load(tmp_path / name).crossings
    assert Case.load(tmp_path / "blade.toml").rotation.greatest == pytest.approx(12000 * math.pi / 30)
