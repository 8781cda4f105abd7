"""The derivative of the period map of sliders: against 40 digits, differences of the engine, and what it must obey."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from tests.reference.fixed_sequence import FixedSequence
from tests.tools.closed_form_scenes import ball, period_one_start, rubbing, scene
from tests.tools.random_scenes import random_compliant, random_jenkins, random_reduced, random_scene
from tests.tools.sensitive_scenes import KINDS, numbers_of, scene_of
from tests.tools.tiers import cases, seeds
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.orbits.period_map import PeriodMap, period_map
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError

FREQUENCY = "excitation.frequency"
#: the map and its derivative lose this much to the round-off of a passage: eps times its growth, some events long
EXACT = 1e-10

BODY = {"cavity": "c", "mass": 0.08, "restitution": 0.7}
BASE = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.01},
    "excitation": {"frequency": 1.02 / (2 * math.pi), "force": 0.08},
    "gravity": {"acceleration": 0.3},
    "cavity": [{"name": "c", "gap": 0.9}],
    "damper": [BODY],
    "initial": {"displacement": 1.0, "velocity": 0.2},
}
RUBBING = [BODY | {"friction": 0.2}]
#: scenes with periods before the passage
SCENES = {
    "newton": (BASE, 9),
    "newton, friction": (BASE | {"damper": RUBBING}, 9),
    "stick and slip": (BASE | {"damper": [BODY | {"friction": 0.9}], "cavity": [{"name": "c", "gap": 0.3}]}, 9),
    "base acceleration, gravity along the cavity": (
        BASE | {"gravity": {"acceleration": 0.3, "orientation_deg": 30.0}, "damper": RUBBING,
                "excitation": {"frequency": 1.02 / (2 * math.pi), "base_acceleration": 0.08}}, 7,
    ),
    "two bodies in a cavity": (
        BASE | {"damper": [BODY | {"position": -0.2}, BODY | {"mass": 0.05, "restitution": 0.6, "position": 0.2}]}, 6,
    ),
    "two cavities": (
        BASE | {"cavity": [{"name": "c", "gap": 0.9}, {"name": "d", "gap": 0.6}],
                "damper": [*RUBBING, {"cavity": "d", "mass": 0.03, "restitution": 0.5, "friction": 0.1}]}, 7,
    ),
    "prescribed": (
        {key: BASE[key] for key in ("gravity", "cavity")}
        | {"structure": {"model": "prescribed", "displacement_amplitude": 0.5}, "damper": RUBBING,
           "excitation": {"frequency": 0.2}}, 5,
    ),
    "viscoelastic": (
        BASE | {"contact": {"law": "viscoelastic", "coefficient": 0.3}, "damper": [{"cavity": "c", "mass": 0.08}]}, 9,
    ),
    "compliant": (BASE | {"contact": {"law": "compliant", "stiffness": 30.0}}, 9),
    "compliant, friction, lossless": (
        BASE | {"contact": {"law": "compliant", "stiffness": 8.0}, "damper": [RUBBING[0] | {"restitution": 1.0}]}, 6,
    ),
    "jenkins": (
        BASE | {"friction_damper": [{"normal_force": 0.1, "friction": 0.5, "stiffness": 0.7}], "damper": RUBBING}, 8,
    ),
    "friction damper": (BASE | {"friction_damper": [{"normal_force": 0.1, "friction": 0.4}]}, 8),
    "stops": (
        BASE | {"stop": [{"side": "right", "gap": 0.5, "restitution": 0.8}, {"side": "left", "gap": 0.6}],
                "initial": {"displacement": 0.3}}, 8,
    ),
    "harmonics": (
        BASE | {"damper": RUBBING, "excitation": BASE["excitation"]
                | {"harmonic": [{"order": 2, "amplitude": 0.6, "phase": 40.0}, {"order": 3, "amplitude": 0.4}]}}, 8,
    ),
    "chatter that ends": (
        BASE | {"gravity": {"acceleration": 0.3, "orientation_deg": 90.0}, "cavity": [{"name": "c", "gap": 5.0}],
                "damper": [BODY | {"position": -2.4, "restitution": 0.4}], "initial": {"displacement": 0.05},
                "excitation": {"frequency": 0.1, "force": 0.01}}, 0,
    ),
}  # fmt: skip


def passed(tables, periods) -> tuple[PeriodMap, np.ndarray]:
    """The period map of a scene, and the state after some periods of it."""
    made = scene(**tables)
    mapped = period_map(made, FREQUENCY)
    if not periods:
        start = mapped.state_of(mapped.restart_of(np.zeros(len(mapped.scale))))
        start[0], start[1] = made.initial.displacement, made.initial.velocity
        start[2] = made.positions[0]
        return mapped, start
    run = simulate(made.replace({"time.periods": periods, "time.transient": 0}))
    return mapped, mapped.state_of(run.final)


def begun(mapped, state):
    """States of the rows of friction with which a passage begins, as FixedSequence has them."""
    n, b, states = mapped._frame.system.modes, len(mapped.scene.damper), {}
    for i, damper in enumerate(mapped.scene.damper):
        if damper.friction:
            speed = state[2 * n + b + i]
            states[str(i)] = "rest" if speed == 0.0 else "right" if speed > 0.0 else "left"
    for i, damper in enumerate(mapped.scene.friction_damper):
        way, bound = "right" if state[1] > 0.0 else "left", (1 - 1e-12) * damper.friction * damper.normal_force
        if damper.stiffness:
            slides = abs(state[-1]) * damper.stiffness >= bound
            states[f"casing.{i}"] = ("right" if state[-1] > 0.0 else "left") if slides else "spring"
        else:
            states[f"casing.{i}"] = "rest" if abs(state[1]) <= 1e-12 * mapped.scale[1] else way
    return states


def scaled(mapped, matrix):
    return matrix * mapped.scale / mapped.scale[:, None]


@pytest.mark.parametrize(
    "name", cases(SCENES, fast=SCENES.keys() - {"newton", "two cavities", "compliant, friction, lossless", "harmonics"})
)
def test_the_derivative_is_that_of_40_digits(name):
    mapped, state = passed(*SCENES[name])
    passage = mapped(state)
    assert passage.status is PassageStatus.OK and passage.crossings
    alone = mapped(state, derivative=False)
    assert np.array_equal(alone.state, passage.state) and alone.sequence == passage.sequence
    assert np.isnan(alone.derivative).all()
    made = mapped.scene
    law = (lambda speed: 1 - made.contact.coefficient * speed**0.2) if made.contact.depends_on_speed else None
    system, contact = mapped._frame.system, None
    if not made.contact.rigid:
        names = mapped._event_names.names
        contact = made.contact.stiffness, {names[r]: system.dashpot[r] for r in range(len(names))}
    final, derivative = FixedSequence(made, law).passage(state, passage.crossings, begun(mapped, state), contact)
    assert np.abs((final - passage.state) / mapped.scale).max() < EXACT
    exact, ours = scaled(mapped, derivative), scaled(mapped, passage.derivative)
    # differences of sixth order find the slope of a restitution
    assert np.abs(exact - ours).max() < (1e-9 if law else EXACT) * np.abs(exact).max()


def test_the_scenes_pass_what_they_are_named_for():
    words = {
        "newton": "impact c.", "stick and slip": "sticks 0", "two bodies in a cavity": "impact c.body.0",
        "two cavities": "impact d.", "compliant": "lags", "jenkins": "sticks casing.0", "friction damper": "casing.0",
        "stops": "impact stop.", "chatter that ends": "rests c.left.0",
    }  # fmt: skip
    for name, word in words.items():
        mapped, state = passed(*SCENES[name])
        assert any(word in event for event in mapped(state).sequence), name


def differences(mapped, state, passage):
    """Largest difference of the derivative and central differences of the engine; None where events change.

    The step is the best of some: their error is that of a cubic, or round-off over the step.
    """
    ours, found = scaled(mapped, passage.derivative), []
    for step in (1e-5, 1e-6):
        columns = []
        for j in range(len(state)):
            move = step * mapped.scale[j] * (np.arange(len(state)) == j)
            ends = [mapped(state + way * move, derivative=False) for way in (1, -1)]
            if any(end.sequence != passage.sequence for end in ends):
                break
            columns.append((ends[0].state - ends[1].state) / mapped.scale / (2 * step))
        else:
            found.append(np.abs(np.transpose(columns) - ours).max() / np.abs(ours).max())
    return min(found, default=None)


def drawn(kind, seed, folder):
    """A random scene of a kind, its reduced model saved."""
    reduced = None
    if kind == "rom":
        made, reduced = random_scene(seed, "rom", 2), random_reduced(seed)
    elif kind.startswith("compliant"):
        made, reduced = random_compliant(seed, "rom" if "rom" in kind else "rigid", 2, "separate" if seed % 2 else "")
    elif kind == "jenkins":
        made, reduced = random_jenkins(seed, "rigid", 1, elements=2)
    else:
        made = random_scene(seed, kind, 2)
    if reduced is not None:
        path = folder / f"{seed}.h5"
        reduced.save(path)
        made = made.replace({"structure.file": str(path)})
    return made


@pytest.mark.parametrize(
    "kind",
    cases(["rigid", "prescribed", "rom", "compliant", "compliant rom", "jenkins"], fast=["rom", "compliant rom"]),
)
def test_the_derivative_is_that_of_differences_of_the_engine(kind, tmp_path):
    compared = 0
    for seed in range({"jenkins": 30, "rom": 5, "compliant rom": 5}.get(kind, 8)):
        made = drawn(kind, seed, tmp_path).replace({"time.periods": 15, "time.transient": 0})
        final = simulate(made).final
        mapped = period_map(made, FREQUENCY)
        passage = mapped(mapped.state_of(final))
        if passage.status is not PassageStatus.OK or not 0 < len(passage.crossings) < 50:
            continue
        error = differences(mapped, mapped.state_of(final), passage)
        if error is not None:
            # steps of 1e-6 leave 1e-12 of a cubic, large beside grazing, and round-off of some 1e-15/1e-6
            assert error < 1e-6, (kind, seed)
            compared += 1
    assert compared >= 3


@pytest.mark.parametrize("restitution", [0.5, 0.8])
def test_impacts_of_a_ball_on_a_table_shrink_the_plane_by_the_square_of_their_restitution(restitution):
    ratio = math.pi * (1 - restitution) / (1 + restitution) * 1.05
    made = period_one_start(restitution, ratio)
    mapped = period_map(made, FREQUENCY)
    state = np.array([made.positions[0], made.damper[0].velocity])
    passage = mapped(state)
    assert passage.sequence == ("impact c.left.0",)
    assert np.linalg.det(passage.derivative) == pytest.approx(restitution**2, rel=1e-10)
    assert np.linalg.det(mapped.over(3)(state).derivative) == pytest.approx(restitution**6, rel=1e-9)
    # the one-impact orbit: trace by Holmes (1982), 2 + (1 + e)^2 A omega^2 sin/g at the impact's phase, over 2 e
    assert np.abs(passage.state - state).max() < 1e-10 * np.abs(state).max() + 1e-10


def test_the_phase_space_shrinks_by_impacts_and_damping():
    mapped, state = passed(*SCENES["two bodies in a cavity"])
    passage = mapped(state)
    structure = mapped.scene.structure
    losses = {"c.left.0": 0.7, "c.body.0": math.sqrt(0.7 * 0.6), "c.right.1": 0.6}
    expected = -structure.viscous / structure.mass / mapped.scene.excitation.frequency
    for event in passage.sequence:
        expected += 2 * math.log(losses[event.removeprefix("impact ")])
    assert len(passage.sequence) > 2
    assert math.log(abs(np.linalg.det(passage.derivative))) == pytest.approx(expected, abs=1e-8)


def test_sticking_leaves_a_multiplier_of_zero():
    made = rubbing(20.0, force=14.0, friction=1.0)
    mapped = period_map(made, FREQUENCY)
    passage = mapped(mapped.state_of(simulate(made.replace({"time.periods": 30, "time.transient": 0})).final))
    assert any("sticks casing.0" in event for event in passage.sequence)
    multipliers = np.sort(np.abs(np.linalg.eigvals(scaled(mapped, passage.derivative))))
    assert multipliers[0] < 1e-13 < multipliers[1]


@pytest.mark.parametrize("speed", [0.0, 1e-17, -1e-17])
def test_what_rests_at_the_start_to_round_off_rests(speed):
    mapped = period_map(rubbing(20.0, force=5.0, friction=1.0), FREQUENCY)
    passage = mapped(np.array([1e-4, speed]))
    assert passage.status is PassageStatus.OK and not passage.crossings
    assert passage.derivative == pytest.approx(np.diag([1.0, 0.0]), abs=1e-14)
    # the spring and the force leave friction 10 N - 1 N - 5 N
    assert passage.clearance == (pytest.approx(0.4, rel=1e-9), "slips casing.0")


@pytest.mark.parametrize("excess", [-1e-4, -1e-13, 0.0, 1e-14, 1e-13, 1e-12, 1e-4])
def test_grazing_is_called_by_its_name(excess):
    # x'' + 0.1 x' + x = A sin t reaches the stop at 1 for A = 0.1
    made = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        excitation={"frequency": 1 / (2 * math.pi), "force": 0.1 * (1 + excess)},
        stop=[{"side": "right", "gap": 1.0, "restitution": 0.8}],
    )
    mapped = period_map(made, "excitation.force")
    passage = mapped(mapped.linear_orbit())
    if passage.status is PassageStatus.GRAZING:
        assert abs(excess) <= 1e-12
        return
    assert passage.status is PassageStatus.OK
    if passage.crossings:
        assert excess > 0.0
        assert passage.crossings[0].speed == pytest.approx(-math.sqrt(2 * excess), rel=1e-2)
    else:
        assert passage.clearance == (pytest.approx(max(-excess, 0.0), abs=1e-11), "impact stop.0")


def test_the_distance_to_an_event_is_that_of_the_motion():
    made = scene(**BASE | {"cavity": [{"name": "c", "gap": 100.0}], "damper": [BODY | {"friction": 1e3}]})
    mapped = period_map(made, FREQUENCY)
    state = mapped.linear_orbit()
    passage = mapped(state)
    assert not passage.crossings and np.abs(passage.state - state).max() < 1e-13
    # the body's inertia is the force that friction holds
    omega, mass = 2 * math.pi * made.excitation.frequency, 1.08
    amplitude = 0.08 / abs(1 - mass * omega**2 + 0.02j * omega)
    largest = 0.08 * omega**2 * amplitude / (1e3 * 0.3 * 0.08)
    assert passage.clearance == (pytest.approx(1 - largest, rel=1e-12), "slips 0")
    assert passage.peaks == pytest.approx([amplitude], rel=1e-10)


def test_a_body_pressed_on_its_wall_falls_back_on_it():
    # the derivative at a closed gap is a limit: a body lifted by h is back on its wall after a time of sqrt(h)
    tables = BASE | {
        "gravity": {"acceleration": 1.0, "orientation_deg": 90.0},
        "damper": [BODY | {"position": -0.45}],
        "initial": {"displacement": 0.1},
        "excitation": {"frequency": 0.1, "force": 0.05},
    }
    mapped = period_map(scene(**tables), FREQUENCY)
    state = np.array([0.1, 0.0, -0.45, 0.0])
    passage = mapped(state)
    assert passage.status is PassageStatus.OK
    for j, way in ((0, 1), (1, 1), (2, 1), (3, 1), (3, -1)):
        errors = []
        for step in (1e-2, 1e-5):
            move = way * step * (np.arange(4) == j)
            change = (mapped(state + move).state - passage.state) / (way * step)
            errors.append(np.abs(change - passage.derivative[:, j]).max())
        assert errors[1] < max(0.1 * errors[0], 1e-5), j


def test_a_body_that_would_begin_in_its_wall_begins_beside_it():
    """As far as it is in it does not matter, and the wall's own motion takes it along."""
    mapped = period_map(scene(**BASE), FREQUENCY)
    state = np.array([0.3, 0.1, 0.45 + 0.02, 0.2])
    beside = mapped(np.r_[state[:2], 0.45, state[3]])
    passage = mapped(state)
    assert passage.sequence == beside.sequence and np.abs(passage.state - beside.state).max() < 1e-13
    assert np.abs(passage.derivative[:, 2]).max() == 0.0
    assert differences(mapped, state, passage) < 1e-6


def two_cavities(**structure):
    return scene(
        structure=structure, excitation={"frequency": 0.2} | ({} if "mass" not in structure else {"force": 2.0}),
        cavity=[{"name": "c", "gap": 0.5}, {"name": "d", "gap": 0.5}], gravity={"acceleration": 0.3},
        damper=[{"cavity": name, "mass": 0.1, "friction": 0.3, "restitution": 0.7} for name in ("c", "d")],
    )  # fmt: skip


def test_impacts_at_once_on_a_prescribed_motion_do_not_feel_each_other():
    mapped = period_map(two_cavities(model="prescribed", displacement_amplitude=0.5), FREQUENCY)
    both = mapped(np.array([0.01, 0.01, 0.3, 0.3]))
    alone = mapped(np.array([0.01, 0.013, 0.3, 0.31]))
    assert any(event.count("impact") == 2 for event in both.sequence) and both.status is PassageStatus.OK
    assert np.abs(both.derivative[np.ix_([0, 2], [1, 3])]).max() < 1e-13
    assert both.derivative[np.ix_([0, 2], [0, 2])] == pytest.approx(alone.derivative[np.ix_([0, 2], [0, 2])], rel=1e-9)
    assert both.derivative[np.ix_([1, 3], [1, 3])] == pytest.approx(both.derivative[np.ix_([0, 2], [0, 2])], rel=1e-9)


def test_impacts_at_once_on_a_structure_are_called_by_their_name():
    mapped = period_map(two_cavities(model="rigid", mass=1.0, stiffness=1.0, damping_ratio=0.01), FREQUENCY)
    assert mapped(np.array([0.5, 0.1, 0.01, 0.01, 0.3, 0.3])).status is PassageStatus.COINCIDENT


@pytest.mark.parametrize(
    "name", ["newton, friction", "two bodies in a cavity", "jenkins", "two cavities", "prescribed"]
)
def test_the_mirror_image_of_the_mirror_image_is_a_period_later(name):
    tables, periods = SCENES[name]
    if name == "two bodies in a cavity":
        tables = tables | {"damper": [BODY | {"position": -0.2}, BODY | {"position": 0.2}]}
    mapped, state = passed(tables, periods)
    twice = mapped.mirrored(mapped.mirrored(state))
    assert np.abs((twice - mapped(state).state) / mapped.scale).max() < 1e-11


@pytest.mark.parametrize("name", ["harmonics", "stops", "base acceleration, gravity along the cavity"])
def test_scenes_without_symmetry_have_no_mirror_image(name):
    mapped, state = passed(*SCENES[name])
    assert mapped.mirrored(state) is None


def test_unlike_bodies_in_a_cavity_have_no_mirror_image():
    mapped, state = passed(*SCENES["two bodies in a cavity"])
    assert mapped.mirrored(state) is None


def test_states_of_runs_are_those_of_maps():
    mapped, state = passed(*SCENES["jenkins"])
    assert mapped.names == (
        "mode 0", "mode 0 rate", "body 0 slip", "body 0 slip rate", "friction damper 0 elongation"
    )  # fmt: skip
    assert np.array_equal(mapped.state_of(mapped.restart_of(state)), state)
    run = simulate(mapped.scene.replace({"time.periods": 3, "time.transient": 0}), start=mapped.restart_of(state))
    passage = mapped.over(3)(state)
    assert np.abs((mapped.state_of(run.final) - passage.state) / mapped.scale).max() < 1e-13
    assert passage.peaks == pytest.approx(run.peak)
    assert len(passage.crossings) > len(mapped(state).crossings)


@pytest.mark.parametrize(
    ("parameter", "value"),
    [(FREQUENCY, 0.17), ("cavity.c.gap", 0.8), ("damper.0.friction", 0.3), ("damper.0.restitution", 0.5),
     ("damper.0.mass", 0.1), ("excitation.force", 0.1)],
)  # fmt: skip
def test_any_number_of_the_scene_is_a_parameter(parameter, value):
    tables, periods = SCENES["newton, friction"]
    mapped, state = passed(tables, periods)
    mapped = period_map(mapped.scene, parameter)
    other = mapped.at(value)
    assert np.array_equal(other.scale, mapped.scale)
    expected = period_map(mapped.scene.replace({parameter: value}), parameter)(state)
    assert np.array_equal(other(state).state, expected.state)
    with pytest.raises(InputError):
        mapped.at(-1.0)


def test_hops_without_end_stop_the_passage():
    made = ball(1.0, 0.01)
    mapped = period_map(made, FREQUENCY)
    hop = 10.0 / 2 / 4000  # 4000 a second
    passage = mapped(np.array([-1e3, hop]))
    assert passage.status is PassageStatus.STOPPED and np.isnan(passage.derivative).all()


def test_a_resonance_without_damping_has_sizes_but_no_linear_orbit():
    made = scene(**BASE | {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.0}, "damper": [],
        "excitation": {"frequency": 1 / (2 * math.pi), "force": 0.1},
        "stop": [{"side": "right", "gap": 0.7, "restitution": 0.8}], "initial": {},
    })  # fmt: skip
    mapped = period_map(made, FREQUENCY)
    assert np.all(np.isfinite(mapped.scale)) and np.all(mapped.scale > 0.0)
    passage = mapped(np.array([0.4, 0.9]))
    assert passage.status is PassageStatus.OK and passage.crossings
    assert differences(mapped, np.array([0.4, 0.9]), passage) < 1e-6
    with pytest.raises(InputError, match="resonance without damping"):
        mapped.linear_orbit()


def test_states_that_are_no_numbers_stop_the_passage():
    mapped, state = passed(*SCENES["newton"])
    for place, wrong in itertools.product(range(len(state)), (np.nan, np.inf)):
        passage = mapped(np.where(np.arange(len(state)) == place, wrong, state))
        assert passage.status is PassageStatus.STOPPED and np.isnan(passage.derivative).all()


def test_other_methods_have_no_period_map():
    made = scene(**BASE | {"solver": {"method": "moreau"}})
    with pytest.raises(InputError, match=r"solver.method: orbits are those of the exact engine"):
        period_map(made, FREQUENCY)


def test_crossings_come_in_order_with_their_losses():
    mapped, state = passed(*SCENES["newton"])
    crossings = mapped(state).crossings
    assert len(crossings) > 1 and all(one.time < other.time for one, other in itertools.pairwise(crossings))
    run = simulate(mapped.scene.replace({"time.periods": 1, "time.transient": 0}), start=mapped.restart_of(state))
    assert sum(crossing.energy for crossing in crossings) == pytest.approx(run.energy["impact"], rel=1e-12)


# 51 and 90 are of the kinds of 13 and 14, with tens of events in a period in place of thousands
@pytest.mark.parametrize("seed", [*seeds(len(KINDS), fast=set(range(len(KINDS))) - {13, 14}), 51, 90])
def test_passages_do_not_depend_on_those_before(seed, tmp_path):
    """Of other states, lengths and numbers: a map keeps its run, its flows and room for derivatives."""
    try:
        _, scene = scene_of(seed, tmp_path)
        found = period_map(scene)
    except InputError:
        pytest.skip("no scene")
    one = found.linear_orbit()
    other = one + 0.3 * found.scale * np.random.default_rng(seed).normal(size=len(one))
    longer, by_numbers = found.over(2), found.by(tuple(list(numbers_of(scene, False))[:2]))
    for made, state in ((found, one), (by_numbers, other), (longer, one), (by_numbers, one), (found, other)):
        fresh = replace(made, earlier=[])(state)
        again = made(state)
        assert again.status is fresh.status and again.crossings == fresh.crossings
        for name in ("state", "derivative", "by_number", "peaks"):
            assert np.array_equal(getattr(again, name), getattr(fresh, name), equal_nan=True)


@pytest.mark.parametrize(("seed", "periods"), [(0, 12), (2, 12), (4, 12), (5, 12), (9, 12), (17, 150)])
def test_periods_of_one_run_are_passages(seed, periods, tmp_path):
    """Derivatives that begin anew at the end of every period are those of runs that begin there."""
    scene = choose(scene_of(seed, tmp_path)[1]).scene
    along = period_map(scene)
    state, compared, sizes = along.state_of(simulate(scene).final), 0, along.scale / along.scale[:, None]
    for after, derivative, status in along.each_period(state, periods):
        passage = along(state)
        # where a run that begins there has a kink, the motion may have none
        assert status is PassageStatus.OK or passage.status is not PassageStatus.OK
        if status is PassageStatus.OK and passage.status is PassageStatus.OK:
            size = max(1.0, np.abs(passage.derivative * sizes).max())
            assert np.abs((passage.derivative - derivative) * sizes).max() < 1e-7 * size
            assert np.abs((passage.state - after) / along.scale).max() < 1e-9 * size
            compared += 1
        state = after
    assert compared >= 0.9 * periods
