"""Which body is enough: `shape = "auto"` runs a block as a slider where a check allows it, and says why."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.bodies.measure import AMPLITUDE, MASS, NATURAL, STIFFNESS
from benchmarks.model_order.body_trial import body_trial_text, draw, judge_trial, summary
from benchmarks.model_order.figures import bodies_figure
from tests.tools.planar import initial_motion
from vanedamp.coupling.methods.registry import respond, run_of
from vanedamp.coupling.model_order.body_choice import WORTH, judge, judge_all, with_blocks, with_sliders
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.system import FLOOR
from vanedamp.files.store import frozen, load
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.cli import main

#: gravity in the unit of the peak without bodies's acceleration
PEAK = AMPLITUDE * (2 * np.pi * NATURAL) ** 2


def scene(ratio, *, periods=1200, transient=500, gravity=9.81, gap=0.5, **body):
    """Half the reference gap, at a frequency over the natural one, and a body of shape "auto"."""
    block = {
        "cavity": "c1", "shape": "auto", "length": 6.88e-3, "height": 4.8e-3, "mass": 0.02 * MASS, "friction": 0.4,
        "restitution": 0.7,
    }  # fmt: skip
    data = {
        "structure": {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": 0.002},
        "excitation": {"frequency": ratio * NATURAL, "resonance_amplitude": AMPLITUDE, "resonance_near": NATURAL},
        "gravity": {"acceleration": gravity},
        "cavity": [{"name": "c1", "gap": gap * AMPLITUDE, "play": 2e-4}], "damper": [block | body],
        "time": {"periods": periods, "transient": transient},
    }  # fmt: skip
    return validate(Scene, {key: value for key, value in data.items() if value is not None}, "scene")


def slider_means(made):
    """Mean amplitudes over X of the slider from several places."""
    places = np.array([-0.3, -0.1, 0.1, 0.3]) * made.cavity[0].gap
    runs = [simulate(with_sliders(made.replace({"damper.0.position": place}))) for place in places]
    return np.array([run.amplitude_mean for run in runs]) / AMPLITUDE


def block_runs(made):
    """Responses of the block that begins in the slider's motion with several tilts."""
    return [
        simulate(block, start=start) for block, start in (with_blocks(made, share) for share in (0.3, -0.2, 0.1, -0.05))
    ]


def block_means(runs):
    """Their mean amplitudes over X."""
    return np.array([run.amplitude_mean for run in runs]) / AMPLITUDE


def test_a_block_takes_over_the_motion_of_a_slider():
    """Laid flat into the slider's steady motion, it goes on as the slider does."""
    made = scene(0.98, periods=400, transient=0)
    slider = respond(with_sliders(made))
    more = made.replace({"time.periods": 10})
    flat = more.replace({"damper.0.shape": "block"})
    nothing = frozen([0.0])
    laid = replace(slider.final, lift=nothing, lift_velocity=nothing, tilt=nothing, tilt_rate=nothing)
    on, block = respond(with_sliders(more), start=slider.final), respond(flat, start=laid)
    np.testing.assert_allclose(block.peak, on.peak, rtol=1e-9)
    assert on.peak.min() > 1.5 * simulate(with_sliders(more)).peak.max()  # which begins from rest


def test_lift_is_counted_from_the_floor_that_moves():
    """A cavity that moves across and turns: height and speed at the start are relative to its floor."""
    made = scene(1.0, lift=1e-5).replace({
        "damper.0.shape": "block", "cavity.c1.normal_motion": 0.5, "cavity.c1.rotation": 3.0,
        "initial.displacement": 1e-5, "initial.velocity": 0.2,
    })  # fmt: skip
    system = assemble(made)
    motion = initial_motion(made, system)
    on_floor = np.flatnonzero(system.surface == FLOOR)
    assert system.rest[on_floor] + system.J[on_floor] @ motion.q == pytest.approx(1e-5, rel=1e-9)
    assert (system.J[on_floor] @ motion.v) == pytest.approx(0.0, abs=1e-12)


def test_unstable_at_the_resonance():
    """Figure 9 at f1: 0.078 of the undamped peak with the slider, 0.118 with the block (an independent program)."""
    made = scene(1.0)
    advice = judge(made)
    # as many as are asked for; the motion is chaotic, and a tilt may die down
    assert (advice.shape, advice.persisting) == ("block", 3)
    assert advice.error < -advice.tolerance - advice.confidence
    blocks, sliders = block_means(block_runs(made)).mean(), slider_means(made).mean()
    assert blocks == pytest.approx(0.118, rel=0.06)
    assert sliders / blocks - 1 == pytest.approx(advice.error, abs=2 * advice.confidence)
    given = f"of {advice.tilts} tilts given to them as their motion is steady, 3 persist"
    assert advice.sentence.startswith(f"blocks: {given}; sliders")


def test_stable_on_a_heavy_floor():
    """Pressed to the floor and little elastic, a block that rattles falls flat between its impacts: it is a slider."""
    made = scene(1.0, gravity=0.2 * PEAK, restitution=0.3)
    advice = judge(made)
    assert (advice.shape, advice.persisting, advice.error, advice.confidence) == ("slider", 0, 0.0, 0.0)
    sliders, blocks = with_sliders(made), block_runs(made)
    assert simulate(sliders).impacts_per_period > 0.5
    for run in blocks:
        assert run.lift_share[0] < 1e-3
        assert run.tilt_max[0] < 1e-12
    assert block_means(blocks).mean() == pytest.approx(slider_means(made).mean(), rel=0.05)


def test_stable_out_of_reach_of_the_walls():
    made = scene(1.0, periods=WORTH + 1, gap=40.0, friction=0.1)
    assert simulate(with_sliders(made)).impacts_per_period == 0
    response = simulate(made)
    assert response.advice["shape"] == "slider" and response.tilt_max is None
    assert response.amplitude_mean == simulate(with_sliders(made)).amplitude_mean


def test_a_tolerance_decides():
    """At f1 the slider's mean is a third low: enough for 80 %, not for 2 %."""
    made = scene(1.0)
    for tolerance, shape in ((0.8, "slider"), (0.02, "block")):
        advice = judge(made.replace({"damper.0.tolerance": tolerance}))
        assert advice.shape == shape
        assert advice.persisting > 0 and -0.6 < advice.error < -0.1
        assert advice.tolerance == tolerance


def test_a_prescribed_motion_has_no_error_to_measure():
    made = scene(1.0).replace({
        "structure": {"model": "prescribed", "displacement_amplitude": AMPLITUDE},
        "excitation": {"frequency": NATURAL}, "time.periods": 60, "time.transient": 20,
    })  # fmt: skip
    advice = judge(made)
    assert (advice.shape, advice.error) == ("block", None)
    json.dumps(advice.to_json(), allow_nan=False)


def test_a_run_says_which_body_and_why(tmp_path):
    made = scene(1.0, periods=WORTH + 1, transient=100)
    response = simulate(made)
    advice = json.loads(json.dumps(response.to_json()))["advice"]
    assert advice["shape"] == "block" and advice == judge(made).to_json()
    assert response.tilt_max[0] > 1e-3 and response.status in (Status.OK, Status.NOT_STEADY)
    response.save(tmp_path / "response.h5")
    assert simulate(with_sliders(made)).advice is None


def test_few_periods_run_blocks_without_a_check(tmp_path):
    """Where a check takes longer than the run: the block as it would run otherwise, at once and with the reason."""
    made = scene(1.0, periods=300, transient=100, gravity=0.2 * PEAK, restitution=0.3)
    assert judge(made).shape == "slider"
    response = simulate(made)
    assert (response.advice["shape"], response.advice["error"], response.advice["points"]) == ("block", None, 0)
    assert response.advice["sentence"] == f"blocks: without a check, which pays from {WORTH} periods on; 300 are run"
    block, start = with_blocks(made)
    assert response.amplitude_mean == simulate(block, start=start).amplitude_mean
    json.dumps(response.to_json(), allow_nan=False)


def test_a_start_of_the_scene_is_kept():
    """Blocks begin in the slider's motion unless the scene itself tilts or lifts one."""
    made = scene(1.0, periods=40, transient=10)
    assert with_blocks(made)[1] is not None
    tilted, start = with_blocks(made.replace({"damper.0.tilt": 1e-5}))
    assert start is None and tilted.damper[0].tilt == 1e-5 and tilted.damper[0].shape == "block"


def test_bodies_in_a_row_have_room_for_their_tilts():
    """Bodies of two heights that touch a wall and each other begin tilted, and overlap nothing."""
    made = scene(1.0, periods=20, transient=0)
    body = made.to_dict()["damper"][0]
    for side in (-0.5, 0.5):
        place = {"position": side * made.cavity[0].gap}
        row = made.replace({"damper": [body | place, body | place | {"height": 3e-3}, body | place | {"length": 9e-3}]})
        for share in (0.3, -0.3):
            blocks, start = with_blocks(row, share)
            assert run_of(blocks, start=start).advance_to(3) is Status.OK


def test_a_reduced_model_leaves_modes_and_bodies_open(tmp_path):
    """Both are chosen, and the block begins with the reduced model's own motion."""
    matrices = np.diag([1.0, 1.0]), np.array([[2.0, -1.0], [-1.0, 1.0]])
    ReducedModel.from_matrices(*matrices, {"tip": [0.0, 1.0]}, damping_ratio=0.01).save(tmp_path / "rom.h5")
    made = validate(Scene, {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5"), "modes": "auto"},
        "excitation": {"frequency": 0.0984, "resonance_amplitude": 1e-3, "resonance_near": 0.0984, "at": "tip"},
        "gravity": {"acceleration": 1e-7}, "cavity": [{"name": "c", "gap": 5e-4, "play": 1e-3, "floor": "tip"}],
        "damper": [{
            "cavity": "c", "shape": "auto", "length": 0.1, "height": 0.07, "mass": 0.02, "friction": 0.4,
            "restitution": 0.7, "tolerance": 0.001,
        }],
        "time": {"periods": WORTH + 1, "transient": 20},
    }, "scene")  # fmt: skip
    chosen = choose(made)
    assert chosen.estimate["modes"] == chosen.scene.structure.modes
    assert chosen.estimate["sentence"].endswith("planar bodies count as sliders")
    assert chosen.advice["persisting"] > 0 and chosen.advice["shape"] == "block"
    assert len(chosen.start.displacement) == chosen.estimate["modes"]
    assert abs(chosen.start.displacement).max() > 0
    assert simulate(made).advice == chosen.advice


@pytest.mark.parametrize(("gravity", "shape"), [(9.81, "block"), (0.2 * PEAK, "slider")])
def test_the_points_of_a_sweep_share_a_body(gravity, shape, tmp_path):
    made = scene(1.0, periods=WORTH // 2, transient=20, gravity=gravity, restitution=0.3)
    swept = made.replace({"sweep": {"excitation.frequency": [NATURAL, 1.001 * NATURAL, 1.002 * NATURAL]}})
    result = sweep(swept)
    advice = result.to_json()["advice"]
    assert advice["shape"] == shape
    assert advice["points"] == (1 if shape == "block" else 3)
    result.save(tmp_path / "sweep.h5")
    if shape == "slider":
        other = sweep(with_sliders(swept))
        np.testing.assert_array_equal(result.amplitude_mean, other.amplitude_mean)
        assert "advice" not in other.to_json()
    else:
        last = with_blocks(made.replace({"excitation.frequency": 1.002 * NATURAL}))
        assert result.amplitude_mean[-1] == simulate(last[0], start=last[1]).amplitude_mean


def test_points_of_a_sweep_hand_over_the_blocks():
    """The first begins in the sliders' motion, the next with the blocks of the one before: tilted, off the floor."""
    made = scene(1.0, periods=60, transient=20).replace({
        "sweep": {"excitation.frequency": [NATURAL, 1.001 * NATURAL]}, "continuation.direction": "up",
    })  # fmt: skip
    linked, alone = sweep(made), sweep(made.replace({"continuation.direction": "independent"}))
    assert linked.to_json()["advice"]["shape"] == "block"
    assert linked.amplitude_mean[0] == alone.amplitude_mean[0]
    assert linked.amplitude_mean[1] != alone.amplitude_mean[1]
    assert linked.impacts_per_period.min() > 1.0


def test_one_point_that_needs_blocks_is_enough():
    stable = scene(1.0, gravity=0.2 * PEAK, restitution=0.3)
    advice = judge_all([stable, scene(1.0), scene(0.98)])
    assert (advice.shape, advice.points) == ("block", 2)
    assert advice.slider_periods > judge(stable).slider_periods


def test_command_says_which_body(tmp_path, capsys):
    made = scene(1.0, periods=WORTH + 1, transient=20, gravity=0.2 * PEAK, restitution=0.3)
    data = made.to_dict()
    lines = [f"[{name}]\n" + _table(data[name]) for name in ("structure", "excitation", "gravity", "time")]
    lines += [f"[[{name}]]\n" + _table(data[name][0]) for name in ("cavity", "damper")]
    (tmp_path / "scene.toml").write_text("\n".join(lines))
    assert main(["run", str(tmp_path / "scene.toml"), "--json", str(tmp_path / "run.json")]) == 0
    assert "damper.shape: sliders: of 6 tilts" in capsys.readouterr().err
    assert json.loads((tmp_path / "run.json").read_text())["advice"]["shape"] == "slider"


def test_the_peak_of_a_sweep_runs_as_in_the_sweep(tmp_path, capsys):
    """Blocks begin in the sliders' motion there, too, and the report says which body ran."""
    data = scene(1.0, periods=60, transient=0).to_dict()
    lines = [f"[{name}]\n" + _table(data[name]) for name in ("structure", "excitation", "gravity", "time")]
    lines += [f"[[{name}]]\n" + _table(data[name][0]) for name in ("cavity", "damper")]
    lines += [f'[sweep]\n"excitation.frequency" = [{NATURAL}, {1.002 * NATURAL}]\n']
    (tmp_path / "scene.toml").write_text("\n".join(lines))
    files = [str(tmp_path / name) for name in ("scene.toml", "sweep.h5", "peak.h5", "report.html")]
    assert main(["sweep", files[0], "-o", files[1], "--peak", files[2], "--json", "-", "--workers", "1"]) == 0
    result = json.loads(capsys.readouterr().out)
    _, attributes = load(files[2], "response")
    assert attributes["amplitude_mean"] == max(result["amplitude_mean"])
    assert main(["report", *files[1:3], "-o", files[3]]) == 0
    assert (tmp_path / "report.html").read_text().count("Bodies run as blocks: without a check") >= 2


def _table(values):
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in values.items())


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"damper.0.height": None}, 'height: missing of shape = "auto"'),
        ({"damper.0.radius": 1e-3}, "radius: not a measure"),
        ({"damper.0.shape": "block", "damper.0.tolerance": 0.1}, 'tolerance: of shape = "auto"'),
        ({"damper.0.tolerance": 1.5}, "damper[0].tolerance"),
        ({"damper.0.normal_load": 1.0}, "normal_load"),
        ({"damper.0.stiffness": 1e3}, "stiffness, dashpot"),
        ({"cavity.c1.play": None}, "cavity[0].play: missing"),
        ({"solver.method": "moreau"}, "damper.shape"),
        ({"contact": {"law": "compliant", "stiffness": 1e8}}, "contact.law"),
    ],
)
def test_wrong_input_is_answered_in_one_line(wrong, said):
    with pytest.raises(InputError) as caught:
        made = scene(1.0, periods=4, transient=0).replace(wrong)
        simulate(made)
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_other_bodies_beside_it_are_refused():
    made = scene(1.0)
    disc = {"cavity": "c1", "shape": "disc", "radius": 1e-3, "mass": 1e-3}
    with pytest.raises(InputError, match=r"damper\[0\].shape"):
        made.replace({"damper": [made.to_dict()["damper"][0], disc]})


def test_an_open_shape_does_not_run():
    with pytest.raises(InputError, match="still open"):
        respond(scene(1.0, periods=4, transient=0))


def test_trial_of_the_choice(tmp_path, capsys):
    """Two scenes of the trial's generator, of a seed of its own: estimates are near the true errors."""
    verdicts = [verdict for made in draw(7, 2) for verdict in judge_trial(made, "s", 600)]
    assert len(verdicts) == 4
    for verdict in verdicts:
        assert verdict.kept and not verdict.missed
        if verdict.estimate is not None:
            assert verdict.estimate == pytest.approx(verdict.error, abs=0.1 + verdict.confidence)
    result = summary(verdicts) | {"periods": 600}
    assert [row["number"] for row in result["tolerances"]] == [2, 2]
    bodies_figure(result, tmp_path / "bodies.png")
    print(*body_trial_text(json.loads(json.dumps(result))), sep="\n")
    assert "2 of 2 within" in capsys.readouterr().out


@pytest.mark.parametrize("number", [44, 63])
def test_a_slider_in_a_cavity_that_turns_is_as_good_as_its_block(number):
    """Scenes of the trial whose tilts die: without its arm the slider was 6 and 7 % off, and said to have no error."""
    made = replace(draw(2032, number + 1, turning=True)[number], time=Time(1200, 400))
    advice = judge(made.replace({"damper.0.tolerance": 0.02}))
    assert (advice.shape, advice.persisting) == ("slider", 0)
    runs = block_runs(made)
    assert max(run.tilt_max[0] for run in runs) < 1e-9
    block, slider = block_means(runs).mean(), slider_means(made).mean()
    assert slider == pytest.approx(block, rel=0.01)
    sliders = with_sliders(made).replace({"damper.0.height": None})
    assert abs(simulate(sliders).amplitude_mean / AMPLITUDE / block - 1.0) > 0.05


def test_blocks_that_tilt_too_far_are_no_measure():
    """Their mean is 2 % off the slider's, but their runs end as tilt_too_large: it is blocks, and said why."""
    loose = draw(2032, 8, turning=True)[7]
    made = loose.replace({"solver.linearisation": 5e-3})
    advice = judge(made)
    assert (advice.shape, advice.error) == ("block", None)
    assert advice.sentence.endswith("a run ended as tilt_too_large")
    block, start = with_blocks(replace(made, time=Time(600, 300)))
    assert simulate(block, start=start).status is Status.TILTED
    looser = judge(loose.replace({"solver.linearisation": 0.1}))
    assert looser.shape == "slider" and abs(looser.error) < 0.05
