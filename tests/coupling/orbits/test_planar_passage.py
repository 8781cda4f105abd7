"""Period maps of bodies in the plane: derivatives against 40 digits and differences, statuses, symmetry."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.reference.planar_sequence import PlanarSequence, walk
from tests.tools import periodic_scenes
from tests.tools.planar import initial_motion, planar_scene
from tests.tools.planar_laws import scene_of, tables
from vanedamp.coupling.derivatives.event_names import EventNames
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.derivatives.walk import PassageWalk, run_from
from vanedamp.coupling.engine.plane.planar_run import PlanarRun
from vanedamp.coupling.orbits.branch import Branch, Branches
from vanedamp.coupling.orbits.continuation import data_of
from vanedamp.coupling.orbits.multipliers import decided
from vanedamp.coupling.orbits.newton import OrbitStatus, find_orbit
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.response.records import new_records
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.orbit import Orbit
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError
from vanedamp.studies.kinds.orbits.page import branches_figure

EPS = np.finfo(float).eps
LAWS = {
    "newton": {}, "poisson": {"law": "poisson"}, "viscoelastic": {"law": "viscoelastic", "coefficient": 0.2},
    "compliant": {"law": "compliant", "stiffness": 300.0},
}  # fmt: skip
STRUCTURE = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.02},
    "initial": {"displacement": 0.4, "velocity": 0.7},
}
BLOCK = {"shape": "block", "length": 1.0, "height": 0.7, "mass": 0.1}
DISC = {"shape": "disc", "radius": 0.4, "mass": 0.1, "lift": 0.02}
SPRING = {"law": "compliant", "stiffness": 20.0}


def shaken(frequency, force, gravity, law, body):
    """A scene of one body in a rigid structure, angular frequency in units of the structure's."""
    table = STRUCTURE | {
        "excitation": {"frequency": frequency / (2 * math.pi), "force": force},
        "gravity": {"acceleration": gravity}, "contact": law,
    }  # fmt: skip
    return planar_scene(table, body, gap=0.6, play=0.5)


def frame_of(scene):
    """The period map of a scene, its system, and (q, q') at the start."""
    found = period_map(scene)
    motion = initial_motion(scene, found._frame.system)
    return found, found._frame.system, np.r_[motion.q, motion.v]


def start_of(found, z):
    """The state of (q, q')."""
    return found._frame.to_state @ z


CASES = {
    "block that rocks and hits": (
        shaken(1.05, 0.3, 0.05, {"law": "newton"}, BLOCK | {
            "friction": 0.3, "restitution": 0.7, "tilt": 0.2, "position": 0.05, "lift": 0.01, "tilt_rate": 0.2,
        }), ("impact c1.floor.0.0", "impact c1.right.0.1", "impact c1.left.0.3"),
    ),
    "block that slides, comes to lie and sticks": (
        shaken(3.81, 0.72, 0.26, {"law": "newton"}, BLOCK | {
            "friction": 0.35, "restitution": 0.0, "tilt": 0.17, "velocity": 0.35, "tilt_rate": -0.24, "lift": 0.001,
        }), ("turns c1.floor.0.0 right", "rests c1.floor.0.1", "sticks c1.floor.0.0"),
    ),
    "block by Poisson's law": (
        shaken(5.3, 0.65, 0.21, {"law": "poisson"}, BLOCK | {
            "friction": 0.14, "restitution": 0.5, "tilt": 0.29, "velocity": 0.15, "tilt_rate": -0.14, "lift": 0.001,
        }), ("impact c1.floor.0.0", "impact c1.right.0.1", "impact c1.right.0.2"),
    ),
    "disc that rolls, slips and leaves": (
        shaken(2.1, 0.81, 0.78, {"law": "newton"}, DISC | {
            "friction": 0.12, "restitution": 0.0, "velocity": -0.17, "tilt_rate": -0.14,
        }), ("sticks c1.floor.0", "slips c1.floor.0 right", "leaves c1.right.0"),
    ),
    "disc on springs": (
        shaken(2.43, 0.31, 0.84, SPRING, DISC | {
            "friction": 0.33, "restitution": 0.5, "velocity": -0.41, "tilt_rate": -0.04,
        }), ("sticks c1.right.0", "slips c1.right.0 left", "lags c1.right.0"),
    ),
    "disc that a spring pushes again": (
        shaken(6.35, 0.36, 0.68, SPRING, DISC | {
            "friction": 0.41, "restitution": 0.5, "velocity": 0.22, "tilt_rate": 0.25,
        }), ("lags c1.floor.0", "presses c1.floor.0", "impact c1.right.0"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_matches_a_fixed_sequence_in_40_digits(case):
    """An error of a speed by round-off shifts an event by that over its rate."""
    scene, expected = CASES[case]
    found, system, z = frame_of(scene)
    passage = found(start_of(found, z))
    assert passage.status is PassageStatus.OK
    names = {part for name in passage.sequence for part in name.split(", ")}
    assert set(expected) <= names
    end, derivative = PlanarSequence(system, walk(system, z)).passage(z)
    slowest = min(abs(crossing.speed) for crossing in passage.crossings)
    to_state, from_state = found._frame.to_state, found._frame.from_state
    size = np.abs(passage.derivative).max()
    np.testing.assert_allclose(passage.state, to_state @ end, atol=1e3 * EPS * size / slowest)
    np.testing.assert_allclose(
        passage.derivative, to_state @ derivative @ from_state, rtol=0, atol=1e3 * EPS * size / slowest
    )


# --- differences of the engine


class First:
    """Takes the derivative M as a motion begins, without what closed contacts and friction hold."""

    nears, M = False, None

    def begin(self, unheld):
        pass

    def segment(self, begun, duration):
        self.M = begun.M if self.M is None else self.M

    def event(self, before, new, M, shift):
        pass

    def end(self, before):
        pass


def directions(found, x):
    """Directions (k, m), in units of the scale, in which a state may move without breaking closed contacts."""
    first = First()
    PassageWalk(found.dynamics, EventNames(found.scene, found._frame.system), x, watch=first).passage(
        run_from(found._frame, x, 1), 1
    )
    held = found.dynamics.to_state @ first.M / found.scale
    left, sizes, _ = np.linalg.svd(held / found.scale[:, None] * found.scale)
    return left[:, sizes > 1e-9]


def difference(found, x, direction, size):
    """The derivative along a direction by differences of several steps, and how far those are apart.

    size: largest entry of the derivative, by which round-off on the way grows. None where the engine does not reach the
    end from a neighbour.
    """
    best = None
    for h in (1e-3, 1e-4, 1e-5, 1e-6):
        ends = [found(x + way * h * direction * found.scale, derivative=False) for way in (1, -1, 2, -2)]
        if any(end.status is PassageStatus.STOPPED for end in ends):
            continue
        one, two, three, four = (end.state / found.scale for end in ends)
        coarse = (one - two) / (2 * h)
        fine = (4 * coarse - (three - four) / (4 * h)) / 3
        apart = np.abs(fine - coarse).max() + 50 * EPS * size * np.abs(one).max() / h
        if best is None or apart < best[1]:
            best = fine, apart
        if apart < 1e-10 * size:
            break  # smaller steps would show nothing that the comparison resolves
    return best


def compare(found, x):
    """Compare the derivative with differences in all directions; returns in how many that could be done."""
    passage, compared = found(x), 0
    assert passage.status is PassageStatus.OK
    derivative = passage.derivative / found.scale[:, None] * found.scale
    size = max(np.abs(derivative).max(), 1.0)
    slowest = min((abs(crossing.speed) for crossing in passage.crossings), default=1.0)
    for direction in directions(found, x).T:
        differed = difference(found, x, direction, size)
        if differed is None or differed[1] > 1e-4 * size:
            continue  # another sequence of events is nearer than any step
        error = np.abs(derivative @ direction - differed[0]).max()
        assert error <= 100 * differed[1] + size * (1e-9 + 200 * EPS / slowest)
        compared += 1
    return compared


def random_start(seed, law):
    """The map of a random scene and the state at its start; None for one with sliders only, or without a start."""
    table = tables(seed) | {"contact": {"law": "newton"} | LAWS[law]}
    if law == "viscoelastic":
        for damper in table["damper"]:
            damper.pop("restitution", None)
    try:
        scene = scene_of(table)
        if not scene.planar:
            return None
        found, _, z = frame_of(scene)
    except InputError:
        return None
    return found, start_of(found, z)


@pytest.mark.parametrize(
    ("law", "seed", "periods"),
    [
        ("newton", 11, 0), ("newton", 31, 0), ("newton", 64, 1), ("newton", 10, 1), ("poisson", 30, 0),
        ("poisson", 46, 0), ("viscoelastic", 10, 0), ("compliant", 29, 0), ("compliant", 34, 1),
    ],
)  # fmt: skip
def test_matches_differences_of_the_engine(law, seed, periods):
    found, x = random_start(seed, law)
    for _ in range(periods):
        x = found(x).state
    assert compare(found, x) >= 4


@pytest.mark.parametrize("seed", [146, 645])
def test_periodic_blocks_that_stick_to_springs_with_two_corners(seed, tmp_path):
    """How their friction is divided does not matter; closing springs stop the slips of tilted neighbours at once."""
    _, scene = periodic_scenes.scene_of(seed, tmp_path)
    found = period_map(scene)
    assert compare(found, found.state_of(simulate(scene).final)) >= 4


def test_passages_of_periodic_scenes(tmp_path):
    """One scene of each kind; the table counts them."""
    found = [periodic_scenes.passage_of(seed, tmp_path) for seed in (5, 6, 8, 12, 18, 28)]
    assert [each.end for each in found] == ["ok", "ok", "ok", "ok", "grazing", "ok"]
    head, *_, last = periodic_scenes.table(found).splitlines()
    assert head.split() == ["grazing", "ok"]
    assert last.split() == ["all", "1", "5"]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_matches_differences_in_many_scenes(law):
    compared = 0
    for seed in range(60):
        begun = random_start(seed, law)
        if begun is None:
            continue
        found, x = begun
        for _ in range(2):
            passage = found(x)
            if passage.status is PassageStatus.STOPPED:
                break
            if passage.status is PassageStatus.OK and len(passage.crossings) < 40:
                compared += compare(found, x)
            x = passage.state
    assert compared > 20


def beside_elements(law, body, **excitation):
    """A block or a disc in a structure that draws two Jenkins elements and a rigid friction damper."""
    elements = [
        {"normal_force": 0.1, "friction": 0.5, "stiffness": 0.7}, {"normal_force": 0.05, "friction": 0.4},
        {"normal_force": 0.3, "friction": 0.2, "stiffness": 2.0},
    ]  # fmt: skip
    scene = shaken(excitation.get("frequency", 1.05), excitation.get("force", 0.3), 0.05, law, body)
    return scene.replace({"friction_damper": elements})


@pytest.mark.parametrize(
    ("law", "body"),
    [
        ("newton", BLOCK | {"friction": 0.3, "restitution": 0.7, "tilt": 0.2, "lift": 0.01, "tilt_rate": 0.2}),
        ("poisson", DISC | {"friction": 0.2, "restitution": 0.5, "velocity": 0.15}),
    ],
)
def test_jenkins_elements_beside_bodies(law, body):
    """Their elongations are states; one that slides forgets its own, as differences of the engine say."""
    found, _, z = frame_of(beside_elements({"law": law}, body))
    assert found.names[-2:] == ("friction damper 0 elongation", "friction damper 2 elongation")
    x = found(start_of(found, z)).state
    assert np.all(np.abs(x[-2:]) > 1e-3)
    passage = found(x)
    assert passage.status is PassageStatus.OK
    names = {part for name in passage.sequence for part in name.split(", ")}
    assert {"slips casing.0 right", "sticks casing.0", "slips casing.2 left"} <= names
    derivative, h = passage.derivative / found.scale[:, None] * found.scale, 1e-5
    steps = h * found.scale * np.eye(len(x))
    ends = [(found(x + step).state - found(x - step).state) / (2 * h * found.scale) for step in steps]
    np.testing.assert_allclose(derivative, np.array(ends).T, rtol=0, atol=1e-5 * np.abs(derivative).max())


def test_a_jenkins_element_is_the_same_beside_sliders_and_bodies():
    """Two systems and two derivatives of one motion: a body that hardly weighs, as a slider and as a disc."""
    element = [{"normal_force": 0.1, "friction": 0.5, "stiffness": 0.7}]
    lone, parts = {"mass": 1e-9, "friction": 0.0, "restitution": 0.5}, []
    for shape in ({}, {"shape": "disc", "radius": 0.4}):
        scene = shaken(1.05, 0.3, 0.05, {"law": "newton"}, lone | shape)
        found = period_map(scene.replace({"friction_damper": element, "cavity.c1.gap": 100.0}))
        passage = found.over(3)(found.linear_orbit())
        assert passage.status is PassageStatus.OK
        places = [found.names.index(name) for name in ("mode 0", "mode 0 rate", "friction damper 0 elongation")]
        parts.append(np.column_stack([passage.state[places], passage.derivative[np.ix_(places, places)]]))
    np.testing.assert_allclose(parts[1], parts[0], rtol=0, atol=1e-7)


# --- motions that stay aligned


def flat_block(law):
    """A block that flies to and fro aligned with its cavity, without weight, and meets walls with two corners."""
    body = BLOCK | {"friction": 0.0, "restitution": 0.8, "lift": 0.2, "velocity": 0.3}
    return shaken(1.05, 0.3, 0.0, law, body)


def test_tilt_of_an_aligned_block_grows_as_the_derivative_says():
    """Of springs and dashpots the order in which two corners meet a wall is no matter, to first order."""
    scene = flat_block(SPRING)
    found, system, z = frame_of(scene)
    x, periods = start_of(found, z), 4
    passage = found.over(periods)(x)
    assert passage.status is PassageStatus.OK
    assert any("impact c1.right.0.1, impact c1.right.0.2" in name for name in passage.sequence)
    tilt, rate = found.names.index("body 0 tilt"), found.names.index("body 0 tilt rate")
    ends = []
    for way in (1, -1):
        tilted = x.copy()
        tilted[tilt] += way * 1e-8
        run = PlanarRun(system, found._frame.restart_of(tilted), new_records(system, periods, 0), False, 10**6)
        assert run.advance_to(periods) is Status.OK
        ends.append(found._frame.to_state @ np.r_[run.state.q, run.state.v])
    grown = (ends[0] - ends[1]) / 2e-8
    growth = passage.derivative[:, tilt]
    assert np.abs(growth[[tilt, rate]]).max() > 2.0
    # gaps that are zero to 1e-12 of the free travel close together
    np.testing.assert_allclose(grown, growth, rtol=0, atol=5e-5 * np.abs(growth).max())


def test_an_aligned_block_that_hits_rigid_walls_has_no_derivative_of_its_tilt():
    """However small its tilt is, it leaves the wall with a rate of tilt that is not."""
    found, _, z = frame_of(flat_block({"law": "newton"}))
    x = start_of(found, z)
    passage = found(x)
    assert passage.status is PassageStatus.COINCIDENT
    tilt, rate = found.names.index("body 0 tilt"), found.names.index("body 0 tilt rate")
    assert np.abs(passage.state[[tilt, rate]]).max() < 1e-14
    for size in (1e-6, 1e-9):
        tilted = x.copy()
        tilted[tilt] += size
        assert abs(found(tilted).state[rate]) > 1e-2
    along = np.zeros(len(x))
    along[found.names.index("body 0 slip")] = found.scale[found.names.index("body 0 slip")]
    ends = [found(x + way * 1e-5 * along).state for way in (1, -1)]
    np.testing.assert_allclose((ends[0] - ends[1]) / 2e-5, passage.derivative @ along, rtol=1e-6, atol=1e-8)


def test_an_orbit_without_derivative_is_not_called_stable():
    """An aligned block between rigid walls: multipliers below one, and a tilt that leaves the orbit however small."""
    table = STRUCTURE | {
        "excitation": {"frequency": 1.05 / (2 * math.pi), "force": 0.3}, "gravity": {"acceleration": 0.0},
        "contact": {"law": "newton"},
    }  # fmt: skip
    body = BLOCK | {"friction": 0.0, "restitution": 0.6, "lift": 0.2, "velocity": 0.3}
    found, _, z = frame_of(planar_scene(table, body, gap=3.0, play=0.5))
    state = start_of(found, z)
    for _ in range(250):
        state = found(state).state
    orbit = find_orbit(found, state)
    assert orbit.status is OrbitStatus.OK and len(orbit.passage.sequence) == 2
    assert np.abs(decided(orbit.multipliers, orbit.neutral)).max() < 0.9
    tilted = orbit.state.copy()
    tilted[found.names.index("body 0 tilt")] += 1e-9
    assert np.abs(found(tilted).state - orbit.state).max() > 1e-3
    assert orbit.undetermined and not orbit.stable
    branch = Branch.of([data_of(orbit)], periods=1, special=(), end="")
    branches = Branches(replace(found.scene, orbit=Orbit()), found.names, found.scale, (branch,), 0)
    told = branches.to_json()["branches"][0]
    assert (told["stable_points"], told["undetermined_points"]) == (0, 1)
    names = {trace.name for trace in branches_figure(branches, {}).data if trace.name}
    assert names == {"branch 0, stability undetermined"}


# --- the contract


def test_a_block_that_sticks_to_its_floor_is_an_orbit():
    """The linear orbit comes back, and nothing is left of motions that friction and floor stop."""
    scene = shaken(0.3, 0.01, 1.0, {"law": "newton"}, BLOCK | {"friction": 0.5, "restitution": 0.3, "position": 0.1})
    found = period_map(scene)
    x = found.linear_orbit()
    passage = found(x)
    assert passage.status is PassageStatus.OK
    assert passage.sequence == ()
    np.testing.assert_allclose(passage.state, x, rtol=0, atol=1e-11 * np.abs(x).max())
    assert found.names == (
        "mode 0", "mode 0 rate", "body 0 slip", "body 0 slip rate", "body 0 lift", "body 0 lift rate", "body 0 tilt",
        "body 0 tilt rate",
    )  # fmt: skip
    assert len(found.scale) == 8
    assert np.all(found.scale > 0.0)
    assert np.linalg.matrix_rank(passage.derivative, tol=1e-12) == 3  # the structure's two, and where the block sticks
    np.testing.assert_allclose(passage.peaks, np.hypot(x[0], x[1] / 0.3), rtol=1e-9)
    multipliers = np.linalg.eigvals(passage.derivative)
    mass, damping, period = 1.1, 2 * 0.02, 2 * math.pi / 0.3
    expected = np.exp(-damping / (2 * mass) * period)
    np.testing.assert_allclose(np.sort(np.abs(multipliers))[-3:], [expected, expected, 1.0], rtol=1e-10)


def test_state_and_restart_are_inverse():
    found, _, z = frame_of(CASES["disc on springs"][0])
    x = start_of(found, z)
    np.testing.assert_array_equal(found.state_of(found.restart_of(x)), x)


def test_two_periods_are_one_after_the_other():
    """Springs that are compressed as a period ends go on in the next one."""
    found, _, z = frame_of(CASES["disc that a spring pushes again"][0])
    x = start_of(found, z)
    for _ in range(3):
        one = found(x)
        two, both = found(one.state), found.over(2)(x)
        np.testing.assert_allclose(both.state, two.state, rtol=0, atol=1e-11)
        scale = np.abs(both.derivative).max()
        np.testing.assert_allclose(both.derivative, two.derivative @ one.derivative, rtol=0, atol=1e-8 * scale)
        assert both.peaks == pytest.approx(np.r_[one.peaks, two.peaks])
        x = one.state


def test_mirror_image():
    """The image of a motion half a period later is a motion: twice it is a period."""
    found, _, z = frame_of(CASES["block that rocks and hits"][0])
    x = start_of(found, z)
    image = found.mirrored(x)
    passage = found(x)
    assert np.abs(image - passage.state).max() > 1e-2
    np.testing.assert_allclose(found.mirrored(image), passage.state, rtol=0, atol=1e-10)


def test_no_mirror_image_where_gravity_pulls_along():
    scene = CASES["block that rocks and hits"][0].replace({"gravity.orientation_deg": 30.0})
    found, _, z = frame_of(scene)
    assert found.mirrored(start_of(found, z)) is None


def grazed(share: float) -> Scene:
    """A disc at rest in space in a cavity that swings to and fro by its free travel over 2 (1 + share)."""
    table = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1.0},
        "excitation": {"frequency": 1 / (2 * math.pi)}, "gravity": {"acceleration": 1.0},
    }  # fmt: skip
    body = DISC | {"friction": 0.0, "restitution": 0.5, "velocity": -1.0, "lift": 0.0}
    return planar_scene(table, body, gap=2.0 * (1.0 + share), play=1.0)


def test_a_tangential_impact_is_grazing():
    found, _, z = frame_of(grazed(-1e-13))
    passage = found(start_of(found, z))
    assert passage.status is PassageStatus.GRAZING


@pytest.mark.parametrize("share", [1e-2, 1e-6])
def test_clearance_of_an_impact_that_nearly_happens(share):
    found, _, z = frame_of(grazed(share))
    passage = found(start_of(found, z))
    assert passage.status is PassageStatus.OK
    distance, name = passage.clearance
    assert name in ("impact c1.left.0", "impact c1.right.0")
    assert distance == pytest.approx(share / (2 * (1 + share)), rel=1e-6)


def test_a_disc_that_has_come_to_rest_on_its_floor_has_no_derivative_of_its_lift():
    """Its last flight, slow beside the structure, ends in rest: what motions beside this one have of it is lost."""
    body = DISC | {"friction": 0.0, "restitution": 0.003, "lift": 0.1}
    found, _, z = frame_of(shaken(0.9, 0.3, 0.8, {"law": "newton"}, body))
    passage = found(start_of(found, z))
    assert passage.status is PassageStatus.OK and any("rests c1.floor.0" in name for name in passage.sequence)
    rows = [found.names.index(f"body 0 lift{rate}") for rate in ("", " rate")]
    assert np.abs(passage.derivative[rows]).max() < 1e-12 * np.abs(passage.derivative).max()


def test_a_passage_that_begins_as_a_body_begins_to_slip_is_grazing():
    """A neighbour that slips the other way comes to rest first: both sides have derivatives of their own."""
    found, x = random_start(19, "newton")
    assert found(x).status is PassageStatus.GRAZING


def test_a_state_that_is_no_number_stops():
    found, _, z = frame_of(CASES["disc on springs"][0])
    assert found(np.full(len(z), np.nan)).status is PassageStatus.STOPPED


def test_an_impact_that_friction_would_feed_takes_no_energy():
    """All coefficients are smaller by one share that depends on the speeds, and the derivative knows it."""
    found, x = random_start(14, "newton")
    passage = found(x)
    assert passage.status is not PassageStatus.UNDETERMINED
    assert np.all(np.isfinite(passage.derivative))
