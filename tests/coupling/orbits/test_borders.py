"""Borders over two numbers, and points of codimension two on them, against closed forms: of maps, and of impacts."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from tests.reference.orbit_gap_oscillator import GapOscillator
from tests.reference.orbit_impact_oscillator import ImpactOscillator
from tests.tools import closed_maps as maps
from tests.tools.closed_form_scenes import scene
from tests.tools.tiers import cases
from vanedamp.coupling.orbits.border_path import BorderPath
from vanedamp.coupling.orbits.borders import first_point
from vanedamp.coupling.orbits.branch import Branches
from vanedamp.coupling.orbits.conditions import Clearance, MultiplierPair, Singular
from vanedamp.coupling.orbits.orbits import orbits
from vanedamp.coupling.orbits.problem import OrbitProblem
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.files.toml_input import InputError

#: distance of a border, and of a point of codimension two on it, from its closed form
CLOSE, NAMED = 1e-10, 1e-7
TABLE = Table(**{"from": 0.0, "to": 1.0, "step": 0.01, "max_step": 0.05})


def begun(function, size, start, numbers, kind, low, high):
    """The first point of a border of a map near a state and two numbers, both of which range from low to high."""
    problem = OrbitProblem(maps.smooth(function, size), ("a", "b"), np.full(2, low), np.full(2, high - low))
    y = problem.pack(np.array(start, float), *numbers)
    passage = problem.passage(y)
    pair = np.linalg.eigvals(passage.derivative)
    return first_point(
        MultiplierPair(problem, 0, pair.sum().real) if kind == "pair" else Singular.of(problem, kind, 0, passage), y
    )


def followed(first, way=1.0):
    """The path of a border from a point on in the direction of larger second numbers, or the other."""
    path = BorderPath(TABLE, replace(first, row=way * first.tangent), 500, float(first.y[-1]))
    while not path.end:
        path.advance()
    return path


def named(path):
    """The named points by their kinds: numbers (2,) of each."""
    return {point.kind: np.array([point.parameter, point.second]) for point in path.special}


def points(path):
    """States and numbers along a path."""
    states, *numbers = (np.array([row[name] for row in path.points]) for name in ("state", "parameter", "second"))
    return states, np.transpose(numbers)


def test_a_fold_passes_its_cusp():
    """x + a + b x - x^3 folds at b = 3 x^2, a = -2 x^3."""

    def cusp(x, ab):
        a, b = ab
        return [x[0] + a + b * x[0] - x[0] ** 3, 0.5 * x[1] + 0.1 * x[0]], [[1 + b - 3 * x[0] ** 2, 0], [0.1, 0.5]]

    first = begun(cusp, 2, [-0.5, -0.1], [0.25, 0.75], "fold", -1.0, 1.0)
    # towards larger b the border ends at b = 1; the other way it passes the cusp
    path, back = followed(first), followed(first, -1.0)
    x, numbers = points(back)
    assert numbers[:, 1] == pytest.approx(3 * x[:, 0] ** 2, abs=CLOSE)
    assert numbers[:, 0] == pytest.approx(-2 * x[:, 0] ** 3, abs=CLOSE)
    assert named(back).keys() == {"cusp"}
    assert named(back)["cusp"] == pytest.approx([0.0, 0.0], abs=NAMED)
    assert back.end == path.end == "the end of a number's range"
    assert len(back.visits) == 1  # the other fold at b = 3/4


def test_a_doubling_turns_from_soft_to_hard():
    """-(1 + a) x + b x^3: orbits of two periods at a = b x^2, stable ones for b > 0."""

    def flip(x, ab):
        a, b = ab
        return [-(1 + a) * x[0] + b * x[0] ** 3 + x[0] ** 5], [[-(1 + a) + 3 * b * x[0] ** 2 + 5 * x[0] ** 4]]

    path = followed(begun(flip, 1, [0.0], [0.0, -0.9], "period doubling", -1.0, 1.0))
    assert np.abs(points(path)[1][:, 0]).max() < CLOSE
    assert named(path).keys() == {"generalised doubling"}
    assert named(path)["generalised doubling"] == pytest.approx([0.0, 0.0], abs=NAMED)


def test_a_fold_meets_a_doubling_and_a_double_multiplier():
    """Of x + y and y + a + b y + x^2 beside -(1 + c) z: a fold at a = 0, double at b = 0; a flip at b = 1/2."""

    def map_(x, ab):
        a, b = ab
        derivative = [[1, 1, 0], [2 * x[0], 1 + b, 0], [0, 0, -(0.5 + b)]]
        return [x[0] + x[1], x[1] + a + b * x[1] + x[0] ** 2, -(0.5 + b) * x[2]], derivative

    path = followed(begun(map_, 3, [0.0] * 3, [0.0, -0.7], "fold", -1.0, 1.0))
    found = named(path)
    assert found["1:1 resonance"] == pytest.approx([0.0, 0.0], abs=NAMED)
    assert found["fold-flip"] == pytest.approx([0.0, 0.5], abs=NAMED)
    assert path.end == "the end of a number's range"


def test_a_pair_on_the_unit_circle_passes_strong_resonances():
    """(1 + a) turns by b of a revolution, less a cubic: on the circle at a = 0, up to half a revolution."""

    def turned(x, ab):
        a, b = ab
        angle, r2 = 2 * math.pi * b, x @ x
        turn = (1 + a) * np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        return turn @ x * (1 - r2), turn @ ((1 - r2) * np.eye(2) - 2 * np.outer(x, x))

    path = followed(begun(turned, 2, [0.0, 0.0], [0.0, 0.2], "pair", -0.6, 0.6))
    found = named(path)
    assert found["1:4 resonance"] == pytest.approx([0.0, 0.25], abs=NAMED)
    assert found["1:3 resonance"] == pytest.approx([0.0, 1 / 3], abs=NAMED)


def test_the_sequence_of_events_changes_along_its_closed_form():
    """x/2 + a - b^2 has the orbit 2 (a - b^2), and a body sticks for x > 0: from the side where none does."""

    def step(x, ab):
        ab = np.atleast_1d(ab)
        crossings = () if x[0] < 0 else (maps.Crossing(0.5, "sticks 0", float(x[0]), 0.0),)
        clearance = (float(-x[0]), "sticks 0") if x[0] < 0 else (math.inf, "")
        return 0.5 * x + ab[0] - ab[1] ** 2, np.array([[0.5]]), crossings, clearance

    problem = OrbitProblem(maps.ClosedMap(step, np.ones(1)), ("a", "b"), np.full(2, -1.0), np.full(2, 2.0))
    first = first_point(Clearance(problem, 0), problem.pack(np.array([-0.02]), 0.24, 0.5))
    for way, end in ((1.0, 1.0), (-1.0, -1.0)):
        path = followed(first, way)
        x, numbers = points(path)
        assert np.abs(x).max() < CLOSE and numbers[:, 0] == pytest.approx(numbers[:, 1] ** 2, abs=CLOSE)
        assert numbers[-1] == pytest.approx([1.0, end], abs=1e-6) and path.end == "the end of a number's range"


def test_a_mass_that_rubs_begins_to_stick_at_its_turns_where_den_hartog_has_it():
    """Without stops it turns at X, X^2 = V^2 - (R U)^2 (DryFriction), and goes on as long as r^2 X > R."""

    def limit(r):
        held, turned = r**2 / (1 - r**2), r / (1 + math.cos(math.pi / r)) * math.sin(math.pi / r)
        return held / math.sqrt(1 + turned**2)

    unit, own = 1 / (2 * math.pi), limit(0.6)
    track = {
        "parameter": "excitation.frequency", "from": 0.58 * unit, "to": 0.62 * unit, "kinds": ["sequence"],
        "within": (0.7 * own, 1.3 * own),
    }  # fmt: skip
    data = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.0},
        excitation={"frequency": 0.6 * unit, "force": 1.0},
        friction_damper=[{"normal_force": 1.0, "friction": 0.98 * own}], time={"periods": 200, "transient": 100},
        orbit={
            "parameter": "friction_damper.0.friction", "to": 1.02 * own, "step": 0.5, "max_step": 1.0, "min_step": 1e-3,
            "track": track,
        },
    )  # fmt: skip
    (border,) = orbits(data).borders
    r = border.second / unit
    assert sorted(r[[0, -1]]) == pytest.approx([0.58, 0.62]) and border.kind == "sequence"
    assert border.parameter == pytest.approx([limit(each) for each in r], rel=1e-8)


def stopped(force, frequency=1.2, **orbit):
    """x'' + 0.1 x' + x = force sin(frequency t) below a stop at 1 with restitution 1/2."""
    return scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        excitation={"frequency": frequency / (2 * math.pi), "force": force},
        stop=[{"side": "right", "gap": 1.0, "restitution": 0.5}], time={"periods": 1, "transient": 0},
        orbit={"parameter": "excitation.force", "step": 0.05, "max_step": 0.1, "max_points": 60} | orbit,
    )  # fmt: skip


def striking(force, frequency=1.2, **orbit):
    """The same from the orbit of one impact per period; its closed form has the force A cos t."""
    closed = ImpactOscillator(k=1.0, c=0.1, A=force, w=frequency, d=1.0, e=0.5)
    place, rate = closed.state(1.5 * math.pi if closed.phase < 1.5 * math.pi else -0.5 * math.pi)
    return stopped(force, frequency, **orbit).replace({"initial": {"displacement": place, "velocity": rate}})


def folding(restitution, frequency=1.2):
    """Force at which the two orbits of one impact meet: the quadratic equation for its speed has a double root there.

    See ImpactOscillator: d^2 s0^2 = (s0^2 + s1^2 / w^2) (d^2 - |H|^2), with the receptance |H| of the force.
    """
    orbit = ImpactOscillator(k=1.0, c=0.1, A=1.0, w=frequency, d=1.0, e=restitution)
    s0, s1 = orbit.share
    return abs(s1 / frequency) / math.hypot(s0, s1 / frequency) / abs(orbit.steady)


def test_impact_oscillator_folds_over_its_restitution_where_its_quadratic_equation_does():
    track = {"parameter": "stop.0.restitution", "from": 0.3, "to": 0.9, "kinds": ["fold"], "within": (0.1, 0.3)}
    (border,) = orbits(striking(0.21, to=0.18, step=0.2, max_step=0.5, max_points=8, track=track)).borders
    assert border.second.min() == 0.3 and border.second.max() == pytest.approx(0.9)
    assert border.parameter == pytest.approx([folding(e) for e in border.second], rel=1e-10)
    # two orbits at a larger force, of which the faster one is stable
    assert (border.orbits == [0, 2]).all() and (border.stable_orbits == [0, 1]).all()
    assert border.multipliers[:, 0] == pytest.approx(np.ones(len(border.second)), abs=1e-7)


@pytest.mark.parametrize("second", cases(["stop.0.restitution", "stop.0.gap"], fast=["stop.0.gap"]))
def test_impact_oscillator_grazes_where_its_linear_response_reaches_the_stop(second):
    """Whatever the restitution, and in proportion to the gap."""
    own = {"stop.0.restitution": 0.5, "stop.0.gap": 1.0}[second]
    track = {"parameter": second, "to": 0.9 * own, "from": 1.1 * own, "kinds": ["grazing"], "within": (0.3, 0.6)}
    steps = {"min_step": 0.1, "step": 0.5, "max_step": 1.0}
    (border,) = orbits(stopped(0.4, to=0.5, start="linear", track=track, **steps)).borders
    reached = abs(1 - 1.2**2 + 0.12j)
    # the orbit is followed at a clearance of 1e-7, with the round-off of that
    assert border.parameter == pytest.approx(reached * (border.second if "gap" in second else 1.0), rel=1e-8)
    assert sorted(border.second[[0, -1]]) == pytest.approx([0.9 * own, 1.1 * own])
    assert (border.orbits == [1, 0]).all() and (border.stable_orbits == [1, 0]).all()


@pytest.mark.slow
def test_a_body_leaves_its_floor_where_that_falls_as_fast_as_the_body():
    """It rests below gravity g and moves with the mass, whose acceleration reaches g there; then it bounces."""
    g, mass, unit = 1.0, 0.1, 1 / (2 * math.pi)
    data = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        excitation={"frequency": 1.2 * unit, "force": 0.3}, gravity={"acceleration": g, "orientation_deg": 90.0},
        cavity=[{"name": "c", "gap": 20.0}], damper=[
            {"cavity": "c", "mass": mass, "restitution": 0.5, "position": -10.0}
        ],
        time={"periods": 300, "transient": 200},
        orbit={
            "parameter": "excitation.force", "to": 0.6, "step": 0.05, "max_step": 1.0, "min_step": 0.01,
            "max_points": 6,
            "track": {
                "parameter": "excitation.frequency", "from": 1.1 * unit, "to": 1.3 * unit, "within": (0.1, 0.9),
                "kinds": ["grazing"],
            },
        },
    )  # fmt: skip
    (border,) = orbits(data).borders
    w = 2 * math.pi * border.second
    assert sorted(w[[0, -1]]) == pytest.approx([1.1, 1.3])
    assert border.parameter == pytest.approx(np.abs(1 - (1 + mass) * w**2 + 0.1j * w) * g / w**2, rel=1e-9)
    assert (border.orbits == [1, 0]).all() and (border.stable_orbits == [1, 0]).all()


def test_a_fold_ends_on_the_grazing_border_where_the_speed_of_its_impact_vanishes():
    """There s0 is zero, and the force of the fold is that of grazing: a point of codimension two."""
    track = {"parameter": "excitation.frequency", "to": 2.05 / (2 * math.pi), "kinds": ["fold"], "within": (2.0, 3.5)}
    (border,) = orbits(striking(2.95, 1.97, to=2.8, step=0.3, max_step=1.0, max_points=6, track=track)).borders
    meets = brentq(lambda w: ImpactOscillator(k=1.0, c=0.1, A=1.0, w=w, d=1.0, e=0.5).share[0], 1.9, 2.05, xtol=1e-14)
    end = int(np.argmax(border.second))
    assert border.parameter == pytest.approx([folding(0.5, 2 * math.pi * f) for f in border.second], rel=1e-9)
    assert 2 * math.pi * border.second[end] == pytest.approx(meets, rel=1e-5)
    assert [point.kind for point in border.special] == ["fold-grazing"]
    assert border.parameter[end] == pytest.approx(abs(1 - meets**2 + 0.1j * meets), rel=1e-5)


GAP = GapOscillator(mass=1.0, damping=0.1, stiffness=1.0, body=0.1, half_gap=8.0, restitution=0.6, force=1.0, omega=1.0)


def gapped(orbit, **table):
    """The scene of a body in a gap, and the branch over the frequency through its symmetric orbit."""
    place, rate, slip, slip_rate = orbit.state
    return scene(
        structure={"model": "rigid", "mass": orbit.mass, "stiffness": orbit.stiffness, "damping": orbit.damping},
        excitation={"frequency": orbit.omega / (2 * math.pi), "force": orbit.force},
        gravity={"acceleration": 0.0}, cavity=[{"name": "c", "gap": 2 * orbit.half_gap}],
        damper=[{"cavity": "c", "mass": orbit.body, "restitution": orbit.restitution, "position": slip,
                 "velocity": slip_rate}],
        initial={"displacement": place, "velocity": rate}, time={"periods": 1, "transient": 0}, orbit=table,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "omega", "to", "gap"),
    cases(
        [("pitchfork", 0.98, 0.92, 18.0), ("neimark-sacker", 1.1, 1.17, 18.0), ("fold", 1.29, 1.36, 15.5)],
        fast=[("pitchfork", 0.98, 0.92, 18.0), ("neimark-sacker", 1.1, 1.17, 18.0)],
    ),
)
def test_symmetric_motion_loses_its_stability_over_the_gap_where_its_closed_form_does(kind, omega, to, gap):
    """A pitchfork, a torus, a fold; over the gap an impact passes the start of the period, too."""
    begin = replace(GAP, omega=omega)
    unit = 1 / (2 * math.pi)
    track = {"parameter": "cavity.c.gap", "to": gap, "kinds": [kind], "within": (0.8 * unit, 1.6 * unit)}
    (border, *_) = orbits(gapped(begin, to=to * unit, track=track, step=0.05, max_step=0.2, max_points=12)).borders
    assert border.second.max() == pytest.approx(max(16.0, gap)) and border.second.min() == pytest.approx(min(16.0, gap))
    for frequency, width in zip(border.parameter, border.second, strict=True):
        orbit, at = replace(GAP, half_gap=width / 2), 2 * math.pi * frequency
        root = {"pitchfork": orbit.pitchfork, "neimark-sacker": orbit.neimark_sacker, "fold": orbit.fold}[kind]
        assert at == pytest.approx(root(at - 1e-4, at + 1e-4), rel=1e-9)


def test_the_peak_of_a_linear_response_follows_its_damping():
    """It lies at w^2 = 1 - c^2 / 2."""
    data = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        excitation={"frequency": 0.98 / (2 * math.pi), "force": 1.0}, time={"periods": 1, "transient": 0},
        orbit={
            "to": 1.02 / (2 * math.pi), "start": "linear", "step": 0.3, "max_step": 1.0,
            "track": {"parameter": "structure.damping", "to": 0.12},
        },
    )  # fmt: skip
    (border,) = orbits(data).borders
    assert border.kind == "peak" and border.second[[0, -1]] == pytest.approx([0.1, 0.12])
    assert 2 * math.pi * border.parameter == pytest.approx(np.sqrt(1 - border.second**2 / 2), rel=1e-9)
    assert (border.orbits == 1).all() and (border.stable_orbits == 1).all()
    peak = 1.0 / (border.second * np.sqrt(1 - border.second**2 / 4))
    assert border.amplitude_mean == pytest.approx(peak, rel=1e-12) and border.amplitude_harmonic == pytest.approx(peak)
    assert border.amplitude_rms == pytest.approx(peak / math.sqrt(2), rel=1e-12)


@pytest.fixture(scope="module")
def grazing():
    track = {"parameter": "stop.0.gap", "to": 1.02, "kinds": ["grazing"], "within": (0.45, 0.5)}
    return stopped(0.4555, to=0.4565, start="linear", step=0.5, max_step=1.0, min_step=0.1, track=track)


def test_borders_are_read_as_they_were_written_and_continue_after_a_stop(grazing, tmp_path):
    whole = orbits(grazing)
    whole.save(tmp_path / "whole.h5")
    read = Branches.load(tmp_path / "whole.h5")
    assert read.to_json() == whole.to_json() and read.second == "stop.0.gap"
    (border,), (kept,) = whole.borders, read.borders
    for name in ("parameter", "second", "state", "multipliers", "orbits", "stable_orbits", *border.quantities):
        np.testing.assert_array_equal(getattr(border, name), getattr(kept, name))
    assert kept.amplitude_rms == pytest.approx(kept.second / math.sqrt(2), rel=1e-6)  # grazes where it fills the gap
    points = sum(len(branch.parameter) for branch in whole.branches)

    def stop(done, total):
        if done > points:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        orbits(grazing, stop, tmp_path / "kept.h5")
    resumed = orbits(grazing, None, tmp_path / "kept.h5")
    assert resumed.to_json() | {"iterations": 0} == whole.to_json() | {"iterations": 0}


@pytest.mark.parametrize(
    ("track", "message"),
    [
        ({"parameter": "stop.0.gap", "from": 2.0, "to": 3.0}, r"orbit.track: stop.0.gap = 1 .* from `from` \(2\)"),
        ({"parameter": "stop.0.height", "to": 3.0}, r"orbit.track.parameter: "),
        ({"parameter": "time.periods", "to": 3.0}, r"orbit.track.parameter: time.periods is no number of"),
        ({"parameter": "stop.0.gap", "to": -1.0}, r"orbit: at excitation.force = 0.45 and stop.0.gap = -1: "),
        ({"parameter": "excitation.force", "to": 1.0}, r"track.parameter: excitation.force is the branch's own"),
        ({"parameter": "stop.0.gap", "to": 2.0, "within": (2.0, 1.0)}, r"track.within: 2 must be smaller than 1"),
    ],
)
def test_bad_second_numbers_are_rejected_in_one_line(track, message):
    with pytest.raises(InputError, match=message):
        orbits(stopped(0.45, to=0.46, start="linear", track=track))


def test_a_branch_without_special_points_says_so():
    track = {"parameter": "stop.0.gap", "to": 1.1}
    found = orbits(stopped(0.1, to=0.2, start="linear", step=0.5, max_step=1.0, track=track))
    assert found.borders == () and found.warnings[0].startswith("orbit.track: the branches have none of fold, ")


def test_a_friction_damper_begins_to_slip_at_the_force_of_the_stuck_motion():
    """From a slider that rests amid: its spring reaches the limit on both sides at once."""
    track = {"parameter": "friction_damper.0.friction", "to": 0.12, "kinds": ["sequence"]}
    data = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        excitation={"frequency": 1.0 / (2 * math.pi), "force": 0.1},
        friction_damper=[{"normal_force": 1.0, "friction": 0.1, "stiffness": 0.5}],
        time={"periods": 1, "transient": 0},
        orbit={
            "parameter": "excitation.force", "to": 0.12, "start": "linear", "min_step": 0.01, "step": 0.1,
            "max_step": 1.0, "max_points": 4, "track": track,
        },
    )  # fmt: skip
    borders = orbits(data).borders
    assert borders
    for border in borders:
        assert border.parameter / border.second == pytest.approx(abs(0.5 + 0.1j) / 0.5, rel=1e-6)
