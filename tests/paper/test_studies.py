"""The paper's figures as studies: units and scenes of their files, their claims, and physics that must hold."""

import json
import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from paper import claims_blocks, runner
from paper.claims_rigid import attached_closed_form, regime
from paper.figure_scenes import Bar, PaperScenes, with_length
from paper.plots import blocks_picture
from paper.runner import STUDIES, run_paper, study
from paper.scene_files import FOLDER, scene_file
from paper.session import PaperSession
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.store import Variable, save
from vanedamp.files.toml_input import InputError
from vanedamp.studies.cli import main
from vanedamp.studies.demo import figure_study
from vanedamp.studies.demo.claims import verdict
from vanedamp.studies.demo.curve import curves
from vanedamp.studies.demo.figure_file import Effort, FigureStructure, linear_peaks
from vanedamp.studies.demo.figure_study import Read
from vanedamp.studies.jobs import sweep as jobs_sweep
from vanedamp.studies.report.results import collect

FREQUENCY, MASS, RATIO, AMPLITUDE = 2412.0, 0.157, 0.002, 70e-6
STIFFNESS = MASS * (2 * math.pi * FREQUENCY) ** 2
STRUCTURE = FigureStructure(MASS, STIFFNESS, RATIO, FREQUENCY, AMPLITUDE, Path("rom.h5"))
RIGID = ("fig9", "fig10", "fig14", "fig19", "mistuning", "systems", "blocks", "fit")


@pytest.mark.parametrize("name", RIGID)
def test_scenes_are_in_units_of_the_structure(name):
    figure = PaperScenes.load(scene_file(name), STRUCTURE)
    assert figure.title
    for curve, scene in figure.scenes.items():
        assert scene.excitation.resonance_amplitude == AMPLITUDE
        assert scene.structure.stiffness == STIFFNESS
        # equal added mass: of loose bodies, or fixed to the structure
        added = sum(damper.mass for damper in scene.damper) + scene.structure.mass - MASS
        if not curve.startswith(("light", "nominal", "heavy")):
            assert added == pytest.approx(0.02 * MASS, rel=1e-12)
        assert list(scene.sweep)[-1] == "excitation.frequency"


def test_gaps_of_fig9_and_its_frequencies():
    (scene,) = PaperScenes.load(scene_file("fig9"), STRUCTURE).scenes.values()
    axes, _ = scene.sweep_points()
    np.testing.assert_allclose(axes["cavity.c1.gap"] / AMPLITUDE, [1.0, 0.5, 0.1])
    peaks = linear_peaks(scene)
    assert peaks == pytest.approx([FREQUENCY / math.sqrt(1.02), FREQUENCY], rel=1e-12)
    assert set(peaks) <= set(axes["excitation.frequency"])


def test_counted_bodies_and_cavities():
    scenes = PaperScenes.load(scene_file("systems"), STRUCTURE).scenes
    many, row = scenes["many_cavities"], scenes["particles"]
    assert [cavity.name for cavity in many.cavity] == [f"c{k}" for k in range(1, 9)]
    assert [damper.cavity for damper in many.damper] == [cavity.name for cavity in many.cavity]
    assert len(row.damper) == 32
    assert len(row.cavity) == 1
    places = list(row.positions)
    assert places == sorted(places)
    assert max(places) == pytest.approx(-min(places))
    assert max(places) < row.cavity[0].gap / 2


def test_mass_of_fig19_moves_the_gap_by_the_length():
    scenes = PaperScenes.load(scene_file("fig19"), STRUCTURE).scenes
    bar = Bar(**tomllib.loads((FOLDER / "fig19.toml").read_text())["bar"])
    nominal = scenes["nominal"]
    mass, gap = nominal.damper[0].mass, nominal.cavity[0].gap
    for name in ("light", "nominal", "heavy"):
        other = scenes[name]
        lengths = bar.length(other.damper[0].mass) + other.cavity[0].gap, bar.length(mass) + gap
        assert lengths[0] == pytest.approx(lengths[1], rel=1e-13)  # one cavity for all
        assert abs(other.damper[0].position) < other.cavity[0].gap / 2
        change = {"light": -0.06, "nominal": 0.0, "heavy": 0.06}[name]
        assert other.damper[0].mass / mass - 1 == pytest.approx(change, abs=1e-12)
        assert scenes[f"{name}_same_gap"].damper[0].mass / mass - 1 == pytest.approx(change, abs=1e-12)
        assert scenes[f"{name}_same_gap"].cavity[0].gap == AMPLITUDE / 2


def test_blocks_are_the_bar_cut_across_its_length():
    figure = PaperScenes.load(scene_file("blocks"), STRUCTURE)
    bar = Bar(**tomllib.loads((FOLDER / "blocks.toml").read_text())["bar"])
    for curve, scene in figure.scenes.items():
        for damper in scene.damper:
            if not curve.endswith("same_gap"):  # there only the mass is another one
                assert damper.length == pytest.approx(bar.length(damper.mass), rel=2e-3)
            assert damper.height == 4.8e-3
            assert scene.cavity[0].play == 2e-4
    lengths = [figure.scenes[name].damper[0].length for name in ("light", "nominal", "heavy")]
    np.testing.assert_allclose(np.array(lengths) / lengths[1], [0.94, 1.0, 1.06], rtol=1e-12)


def test_a_bar_that_does_not_fit_is_refused():
    scene = PaperScenes.load(scene_file("fig10"), STRUCTURE).scenes["single"]
    with pytest.raises(InputError, match="more than the gap"):
        with_length(scene, Bar(density=8190.0, section=1e-5), 0.06)


def test_unknown_unit_is_refused():
    with pytest.raises(InputError, match="unknown unit 'furlongs'"):
        STRUCTURE.unit("furlongs")


def test_written_scene_is_the_scene(tmp_path):
    scene = PaperScenes.load(scene_file("fig10"), STRUCTURE).scenes["shared"]
    scene.save(tmp_path / "scene.toml")
    assert Scene.load(tmp_path / "scene.toml") == scene


def damped(name, curve, frequencies, periods=1500, transient=700, **changes):
    """A curve of a figure at some frequencies, relative to that of its undamped resonance."""
    scene = PaperScenes.load(scene_file(name), STRUCTURE).scenes[curve]
    axes = {**scene.to_dict()["sweep"], "excitation.frequency": [share * FREQUENCY for share in frequencies]} | changes
    return curves(sweep(scene.replace({"sweep": axes, "time.periods": periods, "time.transient": transient})), curve)


def test_damped_is_undamped_below_the_onset_and_less_at_the_resonance():
    gaps = {"cavity.c1.gap": [0.5 * AMPLITUDE]}
    (curve,) = damped("fig9", "", [0.955, 0.965, 0.974, 0.988, 1.0], **gaps)
    np.testing.assert_allclose(curve.mean[:3], curve.undamped[:3], rtol=0.01)
    np.testing.assert_allclose(curve.largest[:3], curve.undamped[:3], rtol=0.01)
    assert curve.onset == 0.988 * FREQUENCY
    assert 0.4 < curve.mean[3] < 0.6
    assert curve.mean[4] < 0.12


def test_halves_in_separate_cavities_do_what_the_whole_body_does():
    shares = [0.955, 0.983, 0.985]
    (single,), (separate,) = damped("fig10", "single", shares), damped("fig10", "separate", shares)
    np.testing.assert_allclose(separate.mean, single.mean, rtol=0.02)
    np.testing.assert_allclose(separate.impacts, 2 * single.impacts, rtol=0.02)


def test_two_blocks_in_a_row_damp_better_than_one():
    level = {"gravity.orientation_deg": [0.0]}
    (single,), (double,) = (damped("blocks", name, [0.985, 0.9875], 900, 400, **level) for name in ("single", "double"))
    # sd over starts: 0.004 and 0.003
    np.testing.assert_allclose(single.mean, [0.398, 0.500], atol=0.02)
    np.testing.assert_allclose(double.mean, [0.125, 0.133], atol=0.02)


def test_a_block_with_less_restitution_leaves_less():
    """At the peaks of restitution 0.5 and 0.9."""
    soft, elastic = damped("blocks", "single_restitution", [0.986, 0.989], 900, 400)
    assert soft.mean[0] == pytest.approx(0.233, abs=0.02)
    assert elastic.mean[1] == pytest.approx(0.751, abs=0.02)


def test_in_a_tight_cavity_gravity_lays_blocks_flat():
    """Horizontally most of eight starts end as sliders, 0.223 or 0.261; vertically none does."""
    runs = damped("fit", "starts", [0.98], 4000, 3000)  # some drift for a thousand periods
    means = np.reshape([curve.mean[0] for curve in runs], (2, 8))
    assert means[0].mean() > 0.15
    np.testing.assert_allclose(means[1], 0.0975, rtol=0.05)


def test_a_cavity_that_turns_sets_a_flat_block_tilting():
    """By 1 rad/m: once the walls reach it; by 5.25 rad/m, as the shipped cluster's, below the onset as well."""
    turns = {"cavity.c1.normal_motion": [0.0], "cavity.c1.rotation": [1.0, -5.25]}
    little, much = damped("blocks", "flat", [0.96, 0.97, 0.99], 4000, 1000, **turns)
    np.testing.assert_allclose(little.mean[:2], little.undamped[:2], rtol=0.01)
    assert much.mean[1] > 1.2 * much.undamped[1]
    assert min(little.mean[2], much.mean[2]) > 0.29  # a slider: 0.244


def test_high_centrifugal_load_is_the_fixed_curve():
    scene = PaperScenes.load(scene_file("systems"), STRUCTURE).scenes["rotating"]
    loads = scene.sweep["damper.0.normal_load"]
    (stuck,) = damped("systems", "rotating", [0.96, 0.985, 1.0, 1.02], **{"damper.0.normal_load": [loads[-1]]})
    np.testing.assert_allclose(stuck.mean, stuck.fixed, rtol=1e-3)
    assert not stuck.impacts.any()
    np.testing.assert_allclose(stuck.attached, 1.0, rtol=1e-6)


def test_attached_mass_follows_the_closed_form_in_the_1_1_regime():
    (curve,) = damped("mistuning", "", [0.9625, 0.965, 0.9675], 2500, 2000, **{"cavity.c1.gap": [0.5 * AMPLITUDE]})
    chosen, attached = regime(curve, 0.25, 0.7)
    assert chosen.all()
    # to the order of the body's mass over the structure's
    np.testing.assert_allclose(curve.attached, attached, rtol=0.01)


def test_closed_form_of_the_attached_mass():
    # without loss rho = 0, so that Theta = 1 + xi and a = 8 (1 + xi)/(pi^2 xi)
    theta, attached = attached_closed_form(np.array([0.5, 2.0]), 1.0, 1.0)
    np.testing.assert_allclose(theta, [1.5, 3.0])
    np.testing.assert_allclose(attached, 8 / np.pi**2 * np.array([3.0, 1.5]))
    assert np.isnan(attached_closed_form(np.array([0.1]), 1.0, 0.7)[0])  # below rho/sqrt(1 + rho^2)


def test_verdicts():
    assert [verdict(True), verdict(False, True), verdict(False)] == ["shown", "partly", "not shown"]


FEW = Effort(points=5, periods=430, transient=390)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Claims of figures with few frequencies and periods."""
    folder = tmp_path_factory.mktemp("paper")
    session = PaperSession(STRUCTURE, folder, effort=FEW)
    for name in ("fig9", "fig10", "fig19"):
        study(name, session)
    return folder


def test_claims_have_their_structure(folder):
    studies = collect([folder]).kinds[".claims.json"]
    assert [Path(file).name for file in studies] == [f"{name}.claims.json" for name in ("fig10", "fig19", "fig9")]
    for file, result in studies.items():
        study = result.record
        assert study.study == Path(file).name.removesuffix(".claims.json")
        assert study.title
        assert study.claims
        for source in study.sources:
            assert isinstance(Sweep.load(folder / source), Sweep)
            assert Scene.load(folder / source.replace(".h5", ".toml")) == Sweep.load(folder / source).scene
        for claim in study.claims:
            assert claim.claim
            assert claim.ours
            assert claim.verdict in ("shown", "partly", "not shown")
            assert claim.verdict == "shown" or claim.why
            assert all(isinstance(value, float) for value in claim.figures.values())
    assert not list(folder.glob("*.partial"))


def test_claims_of_blocks_stand_beside_those_of_sliders(tmp_path, pictures):
    """With one block and one slider in the place of all others, so that nothing is better than anything."""
    shares = [0.96, 0.98, 0.9875, 1.0, 1.01]
    block, gaps = (damped("blocks", name, shares, 600, 390) for name in ("single", "gap"))
    slider = damped("fig9", "", shares, 600, 390)
    scenes = PaperScenes.load(scene_file("blocks"), STRUCTURE).scenes
    mine = dict.fromkeys(scenes, block) | {"gap": gaps}
    others = {figure: dict.fromkeys(of, slider) for figure, of in claims_blocks.SLIDERS["blocks"].items()}
    bar, mass = Bar(**tomllib.loads((FOLDER / "blocks.toml").read_text())["bar"]), scenes["nominal"].damper[0].mass
    claims = claims_blocks.blocks(mine, others, bar, mass)
    assert len(claims) == 13
    assert all(claim.verdict == "shown" or claim.why for claim in claims)
    assert claims[0].figures["peak_mean"] == gaps[1].peak().height
    assert claims[0].figures["slider_peak_mean"] == slider[1].peak().height
    assert [claim.verdict for claim in claims[7:8]] == ["not shown"]  # several bodies are one
    blocks_picture(mine, others, "Blocks", tmp_path / "blocks.png")
    panels = pictures["blocks"]
    assert all("maximum without bodies, %" in panel.y for panel in panels if "frequency" in panel.x and panel.y)
    assert any("slider" in panel.curves for panel in panels)


@pytest.fixture(scope="module")
def curve():
    (curve,) = damped("fig9", "", [0.96, 0.98, 0.9875, 1.0, 1.01], 600, 390, **{"cavity.c1.gap": [0.5 * AMPLITUDE]})
    return curve


@pytest.mark.parametrize("name", ["fig10", "fig14", "fig19", "mistuning", "systems", "blocks", "fit"])
def test_every_study_judges_and_draws_the_curves_of_its_scenes(name, curve, tmp_path, monkeypatch, pictures):
    """With one curve in the place of all others, in the numbers that its sweeps have."""
    of = STUDIES[name].args[0]

    def alike(file):
        figure = PaperScenes.load(file, STRUCTURE)
        axes = {name: list(scene.sweep_points()[0].values())[:-1] for name, scene in figure.scenes.items()}
        return figure, {name: [curve] * math.prod(map(len, values)) for name, values in axes.items()}

    figure, mine = alike(of.file)
    sliders = {other: alike(scene_file(other))[1] for other in claims_blocks.SLIDERS.get(name, {})}
    monkeypatch.setattr(runner, "others", lambda read: sliders)
    read = Read(figure, mine, None)
    claims = of.claims(read)
    assert claims and all(claim.verdict == "shown" or claim.why for claim in claims)
    of.picture(read, tmp_path / "study.png")
    assert pictures.title["study"] or any(panel.title for panel in pictures["study"])
    assert name == "fit" or any(panel.curves for panel in pictures["study"])


def test_map_of_fit_and_friction(tmp_path, pictures):
    found = study("fit", PaperSession(STRUCTURE, tmp_path, effort=replace(FEW, points=3)))
    *panels, bar = pictures["fit"]
    assert {panel.x for panel in panels} == {"coefficient of friction"} and "maximum without bodies, %" in bar.y
    assert Sweep.load(tmp_path / "fit_map.h5").shape == (2, 5, 4, 3)
    least, most = (found.claims[0].figures[name] for name in ("least", "most"))
    assert 0 < least < most < 1


def test_points_that_failed_are_named():
    scene = PaperScenes.load(scene_file("fit"), STRUCTURE).scenes["map"].replace(
        {"solver.linearisation": 1e-6, "time.periods": 20, "time.transient": 5,
         "sweep": {"excitation.frequency": [0.99 * FREQUENCY, FREQUENCY]}}
    )  # fmt: skip
    assert figure_study._trouble("row_of_two", sweep(scene)) == ["row of two 2 of 2 tilt_too_large"]


def test_resumed_session_takes_over_what_is_of_the_same_scene(folder, monkeypatch):
    monkeypatch.setattr(jobs_sweep, "sweep", None)
    study("fig9", PaperSession(STRUCTURE, folder, effort=FEW, resume=True))
    with pytest.raises(TypeError):  # another scene, and so another sweep
        study("fig9", PaperSession(replace(STRUCTURE, amplitude=60e-6), folder, effort=FEW, resume=True))


def test_confidence_goes_with_the_mean():
    (curve,) = damped("fig9", "", [0.99], **{"cavity.c1.gap": [0.5 * AMPLITUDE]})
    scene = PaperScenes.load(scene_file("fig10"), STRUCTURE).scenes["single"]
    single = scene.replace({"sweep": {}, "excitation.frequency": 0.99 * FREQUENCY})
    response = simulate(single.replace({"time.periods": 1500, "time.transient": 700}))
    assert curve.confidence[0] * AMPLITUDE == pytest.approx(response.amplitude_mean_confidence)


def test_modes_without_a_rigid_model_are_refused(tmp_path):
    save(tmp_path / "modes.h5", "modes", {"shape": Variable(np.zeros(2), ("dof",))})
    with pytest.raises(InputError, match="rigid model and a fatigue strength"):
        FigureStructure.load(tmp_path / "modes.h5", tmp_path / "rom.h5")


def test_command_refuses_an_unknown_study(tmp_path, capsys):
    assert main(["paper", "fig99", "-o", str(tmp_path / "out")]) == 2
    assert "no study 'fig99'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_the_whole_paper(tmp_path, capsys):
    made = {found.study: found for found in run_paper(tmp_path, count=2)}
    assert list(made) == list(STUDIES)
    printed = capsys.readouterr().out
    for name, found in made.items():
        assert json.loads((tmp_path / f"{name}.claims.json").read_text())["study"] == name
        assert (tmp_path / f"{name}.png").is_file()
        assert f"\n{name}: " in printed
        if name not in (
            "blocks",
            "fit",
        ):  # rows of three and more have undecided points, single starts may not be steady
            assert all("not ok" not in claim.why for claim in found.claims)
    figures = {name: [claim.figures for claim in found.claims] for name, found in made.items()}
    verdicts = {name: [claim.verdict for claim in found.claims] for name, found in made.items()}
    assert 0.45 < figures["fig9"][0]["reduction"] < 0.55
    assert verdicts["fig9"] == ["shown"] * 3
    assert verdicts["fig10"][0] == "shown"
    assert figures["fig12"][1]["difference"] < 0.01
    assert abs(figures["fig12"][3]["predicted_hz"] / figures["fig12"][3]["peak_hz"] - 1) < 0.002
    assert figures["fig12"][4]["reduced_mean"] < figures["fig12"][4]["rigid_max"]
    assert verdicts["fig13"][0] == "shown"
    assert min(figures["fig14"][1].values()) > 0.5
    assert min(figures["fig14"][2].values()) > 0.45
    assert figures["mistuning"][0]["largest_error"] < 0.05
    assert figures["mistuning"][0]["points"] > 40
    assert figures["systems"][3]["distance_from_fixed"] < 0.01
    assert figures["blocks"][0]["peak_mean"] == pytest.approx(figures["blocks"][0]["slider_peak_mean"], abs=0.03)
    assert 0.5 < figures["blocks"][4]["ratio_median"] < 1
    assert figures["blocks"][6]["double_horizontal"] < 0.16
    assert figures["fit"][1]["horizontal"] > figures["fit"][1]["vertical"] + 0.1
    assert verdicts["campbell"] == ["shown"] * 4
    assert verdicts["rotating_body"][:3] == ["shown"] * 3
    assert figures["rotating_body"][2]["largest_error"] < 0.03
    assert figures["self_tuning"][0]["highest"] < 0.01
    assert figures["self_tuning"][3]["down_1"] < 0.01 < figures["self_tuning"][3]["worst_1"]
