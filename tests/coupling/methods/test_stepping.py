"""Stepping methods and solve_ivp: orders by theory, convergence to the exact engine, and what they say when they fail.

Orders: Newmark (1959), Hilber, Hughes and Taylor (1977), Jean (1999); held inputs of co-simulation, Kuebler and
Schiehlen (2000).
"""

import math

import numpy as np
import pytest

from benchmarks.methods import scenes as method_scenes
from benchmarks.methods.scenes import double
from benchmarks.stability.macro_step import macro_step
from benchmarks.stability.scenes import DAMPING, contact_stiffness, coupled_pair
from benchmarks.stability.scenes import pressed as pressed_body
from vanedamp.coupling.methods.cosimulation import macro_step_radii
from vanedamp.coupling.model_order.selection import warnings_of
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.toml_input import InputError, validate

METHODS = {
    "moreau": {"method": "moreau"},
    "explicit": {"method": "penalty"},
    "newmark": {"method": "penalty", "scheme": "newmark"},
    "hht": {"method": "penalty", "scheme": "hht"},
    "jacobi": {"method": "cosim", "exchange": "jacobi"},
    "gauss-seidel": {"method": "cosim"},
}
STRUCTURE = {"model": "rigid", "mass": 1.0, "stiffness": (2 * math.pi) ** 2, "damping_ratio": 0.02}


def made(data):
    return validate(Scene, data, "scene")


def by(scene, **solver):
    data = scene.to_dict()
    data["solver"] = solver
    return made(data)


@pytest.fixture(scope="module")
def periodic():
    """Two impacts per period from the first period on."""
    scene = made(
        {"structure": STRUCTURE, "excitation": {"frequency": 1.0, "resonance_amplitude": 1.0},
         "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 1.0}],
         "damper": [{"cavity": "c", "mass": 0.05, "restitution": 0.7}],
         "time": {"periods": 400}}
    )  # fmt: skip
    end = simulate(scene)
    assert end.impacts_per_period == 2
    state = {
        "initial.displacement": end.section[-1, 0], "initial.velocity": end.section[-1, 1],
        "damper.0.position": end.slip[-1, 0], "damper.0.velocity": end.slip_velocity[-1, 0],
        "time.periods": 4, "time.transient": 0,
    }  # fmt: skip
    return scene.replace({key: value if "time" in key else float(value) for key, value in state.items()})


@pytest.fixture(scope="module")
def settled():
    """Two impacts per period, structure of little damping: the scene of the charts of methods, in its steady state."""
    return method_scenes.periodic(3000)


@pytest.fixture(scope="module")
def chatter():
    """A ball on a shaken plate that comes to rest in every period."""
    return made(
        {"structure": {"model": "prescribed", "displacement_amplitude": 1e-3}, "excitation": {"frequency": 17.0},
         "gravity": {"orientation_deg": 90.0}, "cavity": [{"name": "c", "gap": 0.1}],
         "damper": [{"cavity": "c", "mass": 1.0, "restitution": 0.5, "position": -0.0495}],
         "time": {"periods": 8, "transient": 0}}
    )  # fmt: skip


@pytest.fixture(scope="module")
def stick_slip():
    """A body that sticks and slips on its floor, far from the walls."""
    return made(
        {"structure": STRUCTURE, "excitation": {"frequency": 0.8, "force": 1.0}, "cavity": [{"name": "c", "gap": 1.0}],
         "damper": [{"cavity": "c", "mass": 0.3, "friction": 0.02}], "time": {"periods": 5, "transient": 0}}
    )  # fmt: skip


@pytest.fixture(scope="module")
def pressed():
    """A body that stays on its soft wall all the time: a linear system of two coupled units."""
    return made(
        {"structure": STRUCTURE, "excitation": {"frequency": 1.3, "force": 3.0}, "gravity": {"acceleration": 0.0},
         "cavity": [{"name": "c", "gap": 2.0}], "contact": {"law": "compliant", "stiffness": 0.5},
         "damper": [{"cavity": "c", "mass": 0.5, "position": -1.0, "velocity": -1.0}],
         "time": {"periods": 1, "transient": 0}}
    )  # fmt: skip


def states(response):
    return np.column_stack([response.section, response.slip, response.slip_velocity])


def error(scene, exact, **solver):
    response = simulate(by(scene, **solver))
    assert response.status is Status.OK, response.status
    size = np.abs(states(exact)).max(axis=0) + np.finfo(float).tiny
    return float((np.abs(states(response) - states(exact))[-1] / size).max())


@pytest.mark.parametrize(
    ("solver", "order"),
    [
        ({"method": "moreau"}, 2), ({"method": "moreau", "theta": 1.0}, 1),
        (METHODS["explicit"], 2), (METHODS["newmark"], 2), (METHODS["hht"], 2),
        (METHODS["jacobi"] | {"hold": 0}, 1), (METHODS["jacobi"] | {"hold": 1}, 2),
        (METHODS["gauss-seidel"] | {"hold": 0}, 1), (METHODS["gauss-seidel"] | {"hold": 1}, 2),
    ],
)  # fmt: skip
def test_orders_of_the_smooth_motion(pressed, solver, order):
    exact = simulate(pressed)
    assert exact.impacts_per_period == 1
    steps = np.array([200, 400, 800])
    errors = [error(pressed, exact, **solver, steps_per_period=int(count)) for count in steps]
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(order, abs=0.2)


@pytest.mark.parametrize("name", ["moreau", "explicit", "newmark", "gauss-seidel"])
def test_orders_of_the_spring_of_a_friction_damper(name):
    """The slider rests: a linear system of two springs."""
    scene = made(
        {"structure": STRUCTURE, "excitation": {"frequency": 1.1, "force": 0.2},
         "friction_damper": [{"normal_force": 1.0, "friction": 0.5, "stiffness": 20.0}],
         "time": {"periods": 2, "transient": 0}}
    )  # fmt: skip
    exact, steps = simulate(scene), np.array([200, 400, 800])
    assert exact.energy["friction"] == 0.0
    errors = [error(scene, exact, **METHODS[name], steps_per_period=int(count)) for count in steps]
    assert errors[-1] < 1e-3
    assert -np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(2, abs=0.2)


def test_moreau_is_of_first_order_over_impacts(periodic):
    exact = simulate(periodic)
    # averages over many steps, as an impact falls anywhere in its step
    errors = [
        np.mean([error(periodic, exact, method="moreau", steps_per_period=count + 7 * i) for i in range(40)])
        for count in (200, 800, 3200)
    ]
    assert -np.polyfit(np.log([200, 800, 3200]), np.log(errors), 1)[0] == pytest.approx(1, abs=0.2)


def test_penalty_is_of_order_two_thirds(periodic):
    """Time and depth of a contact are of the size of its duration, here 2 steps^(1/3) steps.

    The mean over many steps: where in its step a contact begins, the last bit may decide.
    """
    exact = simulate(periodic)
    errors = [
        np.mean([
            error(periodic, exact, method="penalty", steps_per_period=n, contact_steps=2 * n ** (1 / 3))
            for n in range(count, count + 280, 7)
        ])
        for count in (2000, 8000, 32000)
    ]  # fmt: skip
    assert -np.polyfit(np.log([2000, 8000, 32000]), np.log(errors), 1)[0] == pytest.approx(2 / 3, abs=0.2)


def steady(scene, **solver):
    """The response of a scene that begins in its exact steady state, where a method has reached its own."""
    return simulate(by(scene.replace({"time.periods": 300, "time.transient": 150}), **solver))


@pytest.mark.parametrize("name", METHODS)
def test_steady_amplitudes_are_within_2_percent_by_default(settled, name):
    """A state near the exact one after a few periods says nothing of this: springs of walls widen the cavity."""
    response = steady(settled, **METHODS[name])
    assert response.status is Status.OK
    assert response.amplitude_mean == pytest.approx(steady(settled, method="exact").amplitude_mean, rel=0.02)


@pytest.mark.parametrize("name", ["explicit", "newmark", "gauss-seidel"])
def test_steady_amplitudes_are_wrong_by_ten_times_the_penetration(settled, name):
    exact = steady(settled, method="exact").amplitude_mean
    for steps, contact in ((300, 14.0), (1000, 20.0)):
        response = steady(settled, **METHODS[name], steps_per_period=steps, contact_steps=contact)
        assert 1 - response.amplitude_mean / exact == pytest.approx(10 * response.penetration, rel=0.25)
        [warning] = response.warnings
        assert warning.startswith(f"solver.method: bodies are {response.penetration:.1e} of the free travel deep")


@pytest.mark.parametrize("name", ["explicit", "newmark", "hht", "gauss-seidel"])
def test_restitution_does_not_depend_on_where_in_its_step_a_contact_begins(name):
    """A body in free flight rebounds with 0.7 of its speed from a wall that it meets at 20 places in a step.

    With a dashpot that acts in whole steps only, rebounds scatter by 0.05.
    """
    scene = made(
        {"structure": {"model": "prescribed", "displacement_amplitude": 1e-9}, "excitation": {"frequency": 1.0},
         "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 1.0}],
         "damper": [{"cavity": "c", "mass": 1.0, "velocity": 1.0, "restitution": 0.7}],
         "time": {"periods": 1, "transient": 0}}
    )  # fmt: skip
    solver = METHODS[name] | {"steps_per_period": 200, "contact_steps": 10.0}
    solver |= {"substeps": 1} if solver["method"] == "cosim" else {}
    places = (0.25 + place / 4000 for place in range(20))
    rebounds = [-simulate(by(scene.replace({"damper.0.position": x}), **solver)).slip_velocity[-1, 0] for x in places]
    assert np.ptp(rebounds) < 0.02
    assert np.mean(rebounds) == pytest.approx(0.7, abs=0.02)


def test_walls_that_are_hard_enough_have_no_warning(settled, pressed):
    assert steady(settled, method="moreau", steps_per_period=300).warnings == ()
    assert steady(settled, method="penalty", contact_steps=5.0).warnings == ()  # penetration 5e-4
    assert simulate(by(pressed, method="penalty", steps_per_period=300)).warnings == ()  # the wall's own spring


def test_sweeps_warn_of_deep_walls_by_the_methods_that_have_them(settled):
    data = settled.to_dict() | {"time": {"periods": 20, "transient": 0}}
    gaps = [settled.cavity[0].gap * factor for factor in (0.98, 1.0, 1.02)]

    def swept(*methods):
        axes = {"solver.method": list(methods), "cavity.c.gap": gaps}
        return sweep(made(data | {"sweep": axes, "solver": {"steps_per_period": 300, "method": "penalty"}}))

    found = swept("moreau", "penalty")
    of_method = found.penetration.max(axis=1)
    assert (of_method > 1e-3).all() and found.penetration.shape == (2, 3)
    assert [f"{of_method[1]:.1e} of the free travel" in warning for warning in found.to_json()["warnings"]] == [True]
    assert swept("moreau").to_json()["warnings"] == []


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize(("scene", "tolerance"), [("periodic", 0.06), ("stick_slip", 1e-3)])
def test_converges_to_the_exact_engine(scene, tolerance, name, request):
    scene = request.getfixturevalue(scene)
    exact = simulate(scene)
    # averages as above
    coarse, fine = (
        np.mean([error(scene, exact, **METHODS[name], steps_per_period=count + 7 * i) for i in range(8)])
        for count in (2000, 32000)
    )
    assert fine < min(tolerance, 0.4 * coarse)


@pytest.mark.parametrize("name", METHODS)
def test_chatter_comes_to_rest_like_the_exact_engine(chatter, name):
    exact = simulate(chatter)
    response = simulate(by(chatter, **METHODS[name], steps_per_period=20000))
    assert response.status is Status.OK
    assert response.energy["impact"] + response.energy["contact"] == pytest.approx(exact.energy["impact"], rel=2e-2)
    assert np.abs(response.slip - exact.slip).max() < 2e-3 * exact.amplitude_max


@pytest.mark.parametrize("scene", ["periodic", "chatter", "stick_slip", "pressed"])
def test_solve_ivp_follows_the_exact_engine(scene, request):
    scene = request.getfixturevalue(scene)
    exact, response = simulate(scene), simulate(by(scene, method="solve_ivp", rtol=1e-10))
    assert response.status is Status.OK
    size = np.abs(states(exact)).max(axis=0)
    assert (np.abs(states(response) - states(exact)) <= 1e-5 * size + 1e-12).all()
    for name in ("excitation", "friction", "impact", "contact"):
        assert response.energy[name] == pytest.approx(exact.energy[name], rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("name", ["moreau", "newmark"])
def test_ledgers_of_energy_keeping_schemes_close(periodic, name):
    assert simulate(by(periodic, **METHODS[name], steps_per_period=500)).energy_residual < 1e-12


@pytest.mark.parametrize("theta", [0.5, 0.6, 1.0])
def test_moreau_impacts_lose_what_newtons_law_does(theta):
    """One collision of two free masses: (1 - e^2) m* v^2 / 2, to the round-off of a hardly moved spring."""
    scene = made(
        {"structure": STRUCTURE | {"stiffness": 1e-12, "damping_ratio": 0.0}, "excitation": {"frequency": 1.0},
         "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 1.0}],
         "damper": [{"cavity": "c", "mass": 0.25, "restitution": 0.6, "velocity": 0.7}],
         "solver": {"method": "moreau", "theta": theta}, "time": {"periods": 1, "transient": 0}}
    )  # fmt: skip
    response = simulate(scene, events=True)
    assert response.status is Status.OK and len(response.event_list) == 1
    assert response.energy["impact"] == pytest.approx(0.5 * (1 - 0.6**2) * 0.2 * 0.7**2, rel=1e-9)


def test_moreau_ledgers_close_with_the_step(periodic):
    """For theta above 1/2 the energy missing is of the size of a step, over impacts too."""
    exact, steps = simulate(periodic), np.array([500, 2000, 8000])
    for theta in (0.6, 1.0):
        found = [simulate(by(periodic, method="moreau", theta=theta, steps_per_period=int(n))) for n in steps]
        order = np.polyfit(np.log(steps), np.log([response.energy_residual for response in found]), 1)[0]
        assert order == pytest.approx(-1, abs=0.1)
        assert found[-1].energy["impact"] == pytest.approx(exact.energy["impact"], rel=0.02)


@pytest.mark.parametrize("exchange", ["jacobi", "gauss_seidel"])
@pytest.mark.parametrize("hold", [0, 1])
def test_the_radius_of_a_macro_step(exchange, hold):
    """That of the matrix with an exact body, up to the error of the substeps."""
    for steps in (20, 60, 200):
        tables, stiffness, dashpot = coupled_pair(1.0)
        solver = {"method": "cosim", "exchange": exchange, "hold": hold, "substeps": 400, "steps_per_period": steps}
        pressed = made(tables | {"solver": solver})
        expected = np.abs(np.linalg.eigvals(macro_step(1 / steps, 1.0, stiffness, dashpot, exchange, hold))).max()
        (_, left), (_, right) = macro_step_radii(pressed)
        assert left == pytest.approx(expected, rel=2e-3) and right == pytest.approx(left, rel=1e-9)
        assert bool(warnings_of(pressed)) == (left > 1.0 + 1e-9)


@pytest.mark.parametrize(("exchange", "hold"), [("jacobi", 0), ("gauss_seidel", 0), ("gauss_seidel", 1)])
def test_a_contact_that_makes_energy_is_not_ok(exchange, hold):
    """Whatever the residual: an elastic contact by a co-simulation beyond its limit, of which its warning tells."""
    data = pressed_body(0.4, contact_stiffness(0.4) / 4, restitution=1.0)
    solver = {"method": "cosim", "exchange": exchange, "hold": hold, "steps_per_period": 250}
    structure, span = data["structure"] | {"damping": DAMPING}, {"periods": 2, "transient": 0}
    response = simulate(made(data | {"structure": structure, "solver": solver, "time": span}))
    assert response.energy["contact"] < 0.0 and response.energy_residual < 0.1
    assert response.status is Status.ENERGY
    assert any("the macro-step is unstable" in warning for warning in response.warnings)


@pytest.mark.parametrize("method", ["penalty", "cosim", "solve_ivp"])
def test_a_law_of_two_phases_is_named(periodic, method):
    with pytest.raises(InputError, match=f'contact.law: .* "poisson", are for .* exact or moreau, not {method}'):
        simulate(periodic.replace({"contact.law": "poisson", "solver": {"method": method}}))


@pytest.mark.parametrize("name", ["moreau", "newmark", "explicit"])
def test_bodies_in_one_cavity_share_their_losses(periodic, name):
    """Two bodies in a row, whose motion is soon chaotic: mean amplitude and attached mass within their spread."""
    data = periodic.to_dict() | {"time": {"periods": 400, "transient": 100}}
    body = data["damper"][0] | {"velocity": 0.0}
    data["damper"] = [body | {"position": -0.2, "mass": 0.02}, body | {"position": 0.1, "mass": 0.03}]
    scene = made(data)
    exact = simulate(scene)
    response = simulate(by(scene, **METHODS[name], steps_per_period=2000))
    assert response.status is Status.OK and response.energy_residual < 1e-3
    assert response.amplitude_mean == pytest.approx(exact.amplitude_mean, rel=0.08)


def test_bodies_in_a_row_part_after_impacts_within_one_step():
    """Wall, body and neighbour collide within a step: with one impact law for all three, the two would fly as one.

    Such a pair keeps to 1.39 times the mean amplitude, in the exact engine too if it starts as one, but 1e-9 of the gap
    between the bodies parts it there.
    """
    scene = double().replace({"time.periods": 900, "time.transient": 300})
    exact = simulate(scene)
    response = simulate(by(scene, method="moreau", steps_per_period=300))
    assert response.status is Status.OK
    assert response.amplitude_mean == pytest.approx(exact.amplitude_mean, rel=0.04)
    assert response.impacts_per_period == pytest.approx(exact.impacts_per_period, rel=0.06)
    left, right = (0.9 * scene.damper[0].position,) * 2
    pair = simulate(scene.replace({"damper.0.position": left, "damper.1.position": right}))
    assert pair.amplitude_mean == pytest.approx(1.39 * exact.amplitude_mean, rel=0.02)


def test_a_slip_that_turns_twice_in_a_step_does_not_stand_still():
    """The second turn, in the step in which the first slip has begun from rest, is not taken for the first again."""
    scene = double().replace({"time.periods": 30, "time.transient": 0})
    assert simulate(by(scene, method="solve_ivp", rtol=1e-4, steps_per_period=10)).status is Status.OK


def test_impacts_are_logged(periodic):
    exact = simulate(periodic, events=True)
    impacts = [event for event in exact.event_list if event.kind == "impact"]
    assert impacts
    for solver in (METHODS["moreau"], METHODS["newmark"], {"method": "solve_ivp"}):
        steps = {} if solver["method"] == "solve_ivp" else {"steps_per_period": 20000}
        ours = simulate(by(periodic, **solver, **steps), events=True).event_list
        assert len(ours) == len(impacts)
        for one, other in zip(ours, impacts, strict=True):
            assert one.side == other.side
            assert one.time == pytest.approx(other.time, abs=1e-2)
            assert one.relative_velocity_before == pytest.approx(other.relative_velocity_before, rel=0.05)
            assert one.impulse == pytest.approx(other.impulse, rel=0.05)


def test_samples_are_those_of_the_exact_engine(stick_slip):
    exact = simulate(stick_slip, samples_per_period=20)
    for solver in ({"method": "moreau", "steps_per_period": 4000}, {"method": "solve_ivp", "steps_per_period": 40}):
        response = simulate(by(stick_slip, **solver), samples_per_period=20)
        np.testing.assert_allclose(response.displacement, exact.displacement, atol=1e-3 * exact.amplitude_max)
    with pytest.raises(InputError, match="no multiple"):
        simulate(by(stick_slip, method="moreau", steps_per_period=50), samples_per_period=20)


def test_beyond_its_limit_the_explicit_method_says_so():
    """omega_max h = 2 at pi steps a period of the structure, 31.4 of the excitation."""
    stiff = made(
        {"structure": STRUCTURE | {"stiffness": (2 * math.pi * 10) ** 2},
         "excitation": {"frequency": 1.0, "force": 1.0}, "time": {"periods": 200}}
    )  # fmt: skip
    assert simulate(by(stiff, method="penalty", steps_per_period=34)).status is Status.OK
    response = simulate(by(stiff, method="penalty", steps_per_period=30))
    assert response.status is Status.DIVERGED
    assert all(np.isnan(value) for value in (response.amplitude_max, response.phase, *response.energy.values()))
    assert np.isnan(response.attached_mass_fraction)


def test_a_missed_impact_is_flagged():
    """A body that the wall meets and leaves within one step: the solver sees no sign change, and the check sees it."""
    scene = made(
        {"structure": {"model": "prescribed", "displacement_amplitude": 1.0}, "excitation": {"frequency": 1.0},
         "gravity": {"acceleration": 0.0}, "cavity": [{"name": "c", "gap": 0.2}],
         "damper": [{"cavity": "c", "mass": 1.0, "velocity": 20.0, "restitution": 0.5}],
         "time": {"periods": 1, "transient": 0}}
    )  # fmt: skip
    assert simulate(scene).status is Status.OK
    response = simulate(by(scene, method="moreau", steps_per_period=10))
    assert response.status is Status.PENETRATION


def test_without_completion_chatter_spends_the_budget(chatter):
    """Some 20 impacts per period with completion, twice as many without: the budget lies between."""
    completed, followed = (
        simulate(by(chatter, method="solve_ivp", complete_chatter=complete, max_events=240, rtol=1e-7))
        for complete in (True, False)
    )
    assert completed.status is Status.OK
    assert followed.status is Status.EVENT_BUDGET


@pytest.mark.parametrize(
    ("solver", "words"),
    [
        ({"method": "penalty", "theta": 0.5}, "is for method moreau"),
        ({"method": "exact", "steps_per_period": 100}, "is for method moreau or penalty"),
        ({"method": "penalty", "alpha": -0.1}, 'scheme = "hht"'),
        ({"method": "cosim", "contact_steps": 10.0, "contact_stiffness": 1.0}, "one of"),
        ({"method": "verlet"}, "solver.method"),
    ],
)
def test_options_of_another_method_are_refused(stick_slip, solver, words):
    with pytest.raises(InputError, match=words):
        by(stick_slip, **solver)
