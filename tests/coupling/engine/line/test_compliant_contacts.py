"""Compliant contacts of the engine: closed forms, limits, and the reference integrator on random scenes."""

import math

import numpy as np
import pytest

from tests.reference.comparison import follow
from tests.reference.compliant_collision import contact_time, damping_ratio
from tests.tools.closed_form_compliant_scenes import STILL, collision, pile, scene, stop
from tests.tools.random_scenes import random_compliant
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import ReducedModel

RESTITUTIONS = [0.05, 0.1, 0.5, 0.7, 0.9, 1.0]


def named(response, kind):
    return [event for event in response.event_list if event.kind == kind]


@pytest.mark.parametrize("partner", ["wall", "structure", "body"])
@pytest.mark.parametrize("restitution", RESTITUTIONS)
def test_collision(partner, restitution):
    """v+ = -k v- after the time in which a mass on a spring and a dashpot pushes, over- and underdamped."""
    case, mass = collision(partner, restitution)
    response = simulate(case, events=True)
    (begin,), (end,) = named(response, "impact"), named(response, "detach")
    assert (begin.damper, begin.side) == (0, "body" if partner == "body" else "right")
    assert begin.time == pytest.approx(0.15, rel=1e-12)
    duration = contact_time(damping_ratio(restitution)) / math.sqrt(1e4 / mass)
    assert end.time - begin.time == pytest.approx(duration, rel=1e-9)
    assert begin.relative_velocity_before == pytest.approx(2.0, rel=1e-12)
    assert begin.relative_velocity_after == pytest.approx(-2.0 * restitution, rel=1e-9)
    assert begin.impulse == pytest.approx(2.0 * mass * (1 + restitution), rel=1e-9)
    assert response.energy["contact"] == pytest.approx(mass * 2.0 * (1 - restitution**2), rel=1e-9, abs=1e-9)
    assert response.energy["impact"] == 0
    assert response.counters["impacts"] == 1
    assert response.energy_residual < 1e-12


def test_restitution_of_two_bodies_is_the_geometric_mean():
    case, _ = collision("body", 0.4)
    response = simulate(case.replace({"damper.1.restitution": 0.9}), events=True)
    (begin,) = named(response, "impact")
    assert begin.relative_velocity_after == pytest.approx(-2.0 * 0.6, rel=1e-9)


def test_stop_of_a_spring_and_mass():
    """Code_Aster SDND101: contact 0.03126 s, peak force 9950.4 N."""
    response = simulate(stop(), events=True)
    (begin,), (end,) = named(response, "impact"), named(response, "detach")
    omega = math.sqrt(1.01e6 / 100.0)
    assert begin.time == 0
    assert end.time == pytest.approx(math.pi / omega, rel=1e-6) == pytest.approx(0.03126, abs=5e-6)
    assert 1e6 * response.amplitude_max == pytest.approx(1e6 / omega, rel=1e-6) == pytest.approx(9950.4, abs=0.05)
    assert begin.impulse == pytest.approx(2e6 / omega**2, rel=1e-6)
    assert response.energy_residual < 1e-10


@pytest.mark.parametrize("bodies", [1, 3])
def test_bodies_settle_on_their_springs(bodies):
    """At rest each contact carries the weight above it, and all that was lost went into the dashpots."""
    case = pile(bodies)
    response = simulate(case, events=True)
    assert response.status == Status.OK
    masses = np.array([damper.mass for damper in case.damper])
    weights = 10.0 * masses[::-1].cumsum()[::-1]
    rest = -5.0 - (weights / 1e4).cumsum()
    assert response.slip[-1] == pytest.approx(rest, rel=1e-13)
    assert response.slip_velocity[-1] == pytest.approx(np.zeros(bodies), abs=1e-12)
    fallen = 10.0 * masses @ (case.positions - rest)
    assert response.energy["contact"] == pytest.approx(fallen - (weights**2).sum() / 2e4, rel=1e-10)
    assert response.energy_residual < 1e-12
    if bodies == 1:
        last = named(response, "impact")[-1]
        assert (last.relative_velocity_after, last.impulse) == (0.0, 0.0)  # never over


@pytest.mark.parametrize("speed", [0.1, 0.17, 0.18, 0.3, 0.5])
def test_friction_can_hold_a_body_in_its_contact(speed):
    """Where the body stops, friction R holds a spring that is shorter by R / k, and swings back about that point."""
    friction, shift = 10.0, 1e-3
    case = scene(
        structure=STILL,
        excitation={"frequency": 5.0},
        cavity=[{"name": "c", "gap": 2.0}],
        damper=[{"cavity": "c", "mass": 1.0, "friction": 1.0, "normal_load": friction, "position": 1.0,
                 "velocity": speed}],
        contact={"law": "compliant", "stiffness": friction / shift},
        time={"periods": 1, "transient": 0},
    )  # fmt: skip
    response = simulate(case, events=True)
    deepest = math.hypot(shift, speed / 100.0) - shift
    back = 2 * max(deepest - shift, 0.0)  # how far it swings back; beyond the wall friction alone stops it
    if back > deepest:
        back = deepest + (speed**2 / 2 - 2 * friction * deepest) / friction
    assert bool(named(response, "detach")) == (back > deepest)
    assert response.slip[-1] == pytest.approx([1.0 + deepest - back], rel=1e-12)
    assert response.energy["friction"] == pytest.approx(friction * (deepest + back), rel=1e-9)
    assert response.energy["contact"] == pytest.approx(0.0, abs=1e-15)
    assert response.energy_residual < 1e-12


def test_a_stiff_contact_is_newtons():
    """In the 1:1 impact regime the amplitude tends to that of Newton's law as fast as the contact time to zero."""
    eps, damping, frequency, xi = 0.005, 0.005, 0.99, 0.6
    rho = 2 / np.pi * 0.3 / 1.7
    theta = (1 + np.sqrt((1 + rho**2) * xi**2 - rho**2)) / (1 + rho**2)
    turn = (theta - 1) / xi - 1j * rho * theta / xi
    loads = (-(1 - eps) * frequency**2 + 2j * damping * frequency + 1) * xi
    half_gap = 1 / abs(loads - 8 * eps * theta * turn * frequency**2 / np.pi**2)
    rigid = scene(
        structure={"model": "rigid", "mass": 1 - eps, "stiffness": 1.0, "damping": 2 * damping},
        excitation={"frequency": frequency / (2 * np.pi), "force": 1.0},
        cavity=[{"name": "c", "gap": 2 * half_gap}],
        damper=[{"cavity": "c", "mass": eps, "restitution": 0.7, "position": -half_gap}],
        time={"periods": 1500, "transient": 1400},
    )
    limit = simulate(rigid)
    # on with the orbit of the limit, so that no transient leads elsewhere
    orbit = {
        "initial": {"displacement": limit.section[-1, 0], "velocity": limit.section[-1, 1]},
        "damper.0.position": limit.slip[-1, 0],
        "damper.0.velocity": limit.slip_velocity[-1, 0],
    }
    ratios = np.array([50.0, 100.0, 200.0, 400.0, 800.0])
    errors = []
    for ratio in ratios:
        law = {"contact": {"law": "compliant", "stiffness": eps * ratio**2}}
        response = simulate(rigid.replace(orbit | law))
        assert response.classification == "periodic-1"
        assert response.impacts_per_period == 2
        assert response.energy_residual < 1e-10
        errors.append(abs(response.amplitude_harmonic / limit.amplitude_harmonic - 1))
    slope = np.polyfit(np.log(ratios), np.log(errors), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.1)
    assert errors[-1] < 5e-3


def bar(modes, stiffness):
    """(reduced model, tables) of a free bar on which the ground falls: Doyen, Ern and Piperno (2011).

    Seen from the falling frame, in which the bar is at rest until the ground, of three hundred times its mass, arrives.
    """
    length, young, density, g = 10.0, 900.0, 1.0, 10.0
    omegas = np.pi * np.arange(modes + 1) * math.sqrt(young / density) / length
    omegas[0] = 4e-3  # a structure has to be held: by a hanger that nothing here notices
    shapes = np.sqrt(np.r_[1.0, np.full(modes, 2.0)] / (density * length))
    model = ReducedModel.from_matrices(
        mass=np.eye(modes + 1),
        stiffness=np.diag(omegas**2),
        damping=np.zeros((modes + 1, modes + 1)),
        interface={"end": shapes},
    )
    return model, {
        "excitation": {"frequency": 1 / 7.2, "at": "end"},
        "gravity": {"acceleration": g, "orientation_deg": 90.0},
        "cavity": [{"name": "c", "gap": 1000.0, "floor": "end"}],
        "damper": [{"cavity": "c", "mass": 3e3, "position": -495.0}],
        "contact": {"law": "compliant", "stiffness": stiffness},
        "time": {"periods": 1, "transient": 0},
    }


def test_bar_on_a_wall(tmp_path):
    """Doyen, Ern and Piperno (2011): contacts of 2/3 s at 1, 11/3 and 19/3 s, the third of which repeats the first.

    d'Alembert's solution: the end gives way with 30 N s/m until the wave comes back from the top, so that the first
    force is 300 (1 + t) N for 2/3 s and the second, on the bar that still rings, 500 - 300 t. The error is that of the
    truncation: the contact has to be soft beside the modes that are missing.
    """
    exact = [1.0, 5 / 3, 11 / 3, 13 / 3, 19 / 3, 7.0]
    errors = []
    for modes in (10, 20, 40):
        model, tables = bar(modes, 250.0 * modes)
        model.save(tmp_path / "bar.h5")
        response = simulate(scene(structure={"model": "rom", "file": str(tmp_path / "bar.h5")}, **tables), events=True)
        assert response.status == Status.OK
        # in contact the pair hangs so softly that its equilibrium is 1e6 m away, and digits go into that
        assert response.energy_residual < 1e-6
        assert [event.kind for event in response.event_list] == ["impact", "detach"] * 3
        times = [event.time for event in response.event_list]
        assert times[0] == pytest.approx(1.0, rel=1e-10)
        errors.append(np.abs(np.array(times) - exact).max())
        impulses = [event.impulse for event in named(response, "impact")]
        assert impulses == pytest.approx([800 / 3] * 3, rel=0.1 / modes)
    assert errors[-1] < 1e-2
    assert max(errors[1] / errors[0], errors[2] / errors[1]) < 0.7


def test_mistakes_are_named():
    case, _ = collision("wall", 0.5)
    with pytest.raises(InputError, match="restitution"):
        simulate(case.replace({"damper.0.restitution": 0.0}))
    with pytest.raises(InputError, match="stiffness"):
        case.replace({"contact": {"law": "compliant"}})


FEW = [("rigid", 1, "", 1), ("prescribed", 1, "", 4), ("rigid", 2, "shared", 3), ("rom", 1, "separate", 2)]
MANY = (
    [("rigid", 1, "", seed) for seed in range(10, 20)]
    + [("prescribed", 1, "", seed) for seed in range(10, 18)]
    + [("rigid", 2, "", seed) for seed in range(10, 16)]
    + [("rigid", 2, "shared", seed) for seed in range(10, 18)]
    + [("prescribed", 2, "shared", seed) for seed in range(10, 14)]
    + [("rom", 2, "", seed) for seed in range(10, 15)]
    + [("rom", 2, "separate", seed) for seed in range(10, 18)]
    + [("rom", 2, "shared separate", seed) for seed in range(10, 16)]
)


@pytest.mark.parametrize(("structure", "bodies", "where", "seed"), FEW)
def test_motion_equals_dop853(structure, bodies, where, seed, tmp_path):
    case, reduced = random_compliant(seed, structure, bodies, where)
    follow(case, 3, reduced, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(("structure", "bodies", "where", "seed"), MANY)
def test_motion_equals_dop853_at_length(structure, bodies, where, seed, tmp_path):
    case, reduced = random_compliant(seed, structure, bodies, where)
    follow(case, 6, reduced, tmp_path)


@pytest.mark.parametrize("seed", [2, 5])
def test_long_runs_between_walls_that_move_apart(seed, tmp_path):
    """Slips and gaps are states of their own there: round-off must not add up (1e-10 in 800 periods if it does)."""
    case, reduced = random_compliant(seed, "rom", 1, "separate")
    reduced.save(tmp_path / "rom.h5")
    file = {"structure.file": str(tmp_path / "rom.h5")}
    response = simulate(case.replace(file | {"time.periods": 800, "time.transient": 400}))
    assert response.impacts_per_period >= 1
    assert response.energy_residual < 1e-12
