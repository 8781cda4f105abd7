"""The engine against closed forms: every row has its source. Energy balances to round-off in each."""

import numpy as np
import pytest

from tests.tools.closed_form_scenes import ball, one_to_one, period_one_start, rubbing, scene, table
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.linear_response import receptance
from vanedamp.files.toml_input import InputError, validate


def cluster(frequency_ratio=0.995, gap_ratio=0.5, mass_ratio=0.02, **changes) -> Scene:
    """One mode at 2414 Hz with a resonance of 30 um, one body: the regime of impact mistuning."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": (2 * np.pi * 2414) ** 2, "damping_ratio": 0.002},
        "excitation": {"frequency": 2414.0 * frequency_ratio, "resonance_amplitude": 30e-6},
        "cavity": [{"name": "c1", "gap": 30e-6 * gap_ratio}],
        "damper": [{"cavity": "c1", "mass": mass_ratio, "friction": 0.4, "restitution": 0.7}],
    }
    return scene(**(data | changes))


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.9])
def test_ball_comes_to_rest(restitution):
    """Chatter ends at 2 v0/(g (1 - e)) after the launch with v0; the ball has then lost all its energy."""
    response = simulate(
        ball(restitution, 1e-20, velocity=1.0, periods=3, time={"periods": 3, "transient": 0}), events=True
    )
    rest = [event for event in response.event_list if event.kind == "rest"]
    assert [event.time for event in rest] == [pytest.approx(2 / (10 * (1 - restitution)), rel=1e-6)]
    assert response.energy["impact"] == pytest.approx(0.5, rel=1e-12)
    impacts = [event for event in response.event_list if event.kind == "impact"]
    for n, event in enumerate(impacts[:10]):
        assert event.relative_velocity_before == pytest.approx(-(restitution**n), rel=1e-10)
        assert event.time == pytest.approx(0.2 * sum(restitution**i for i in range(n + 1)), rel=1e-12)


@pytest.mark.parametrize(("acceleration", "moves"), [(0.999, False), (1.001, True)])
def test_shaking_table_sticks_below_its_friction(acceleration, moves):
    """Code_Aster SDND104: the body sticks for a0 < mu g."""
    response = simulate(table(acceleration))
    assert response.classification == ("no-contact" if moves else "stuck")
    assert (response.energy["friction"] > 0) == moves
    assert response.energy_residual < 1e-10


def test_shaking_table_dissipation():
    """Code_Aster SDND104: mean of N |v_rel| over 4 to 12 s at a0 = 1.01 is 2.26164e-4 W (0.1 %)."""
    response = simulate(table(1.01))
    assert response.energy["friction"] / 0.1 / 8 == pytest.approx(2.26164e-4, rel=1e-3)


@pytest.mark.parametrize(("factor", "stops"), [(0.999, True), (1.001, False)])
def test_shaking_table_slides_without_stop(factor, stops):
    """Code_Aster SDND104: sliding without stop above sqrt(1 + pi^2/4) mu g."""
    limit = np.sqrt(1 + np.pi**2 / 4)
    data = table(factor * limit).replace({"time.periods": 40, "time.transient": 30})
    response = simulate(data, events=True)
    late = [event for event in response.event_list if event.time > 30 and event.kind == "stick"]
    assert bool(late) == stops


@pytest.mark.parametrize("restitution", [0.5, 0.7])
def test_bouncing_ball_period_one(restitution):
    """Period one exists above A w^2/g = pi (1-e)/(1+e); its impacts come once a period with speed pi g/w... (g T/2).

    Holmes (1982): the phase obeys cos = pi (1-e)/(1+e) g/(A w^2), the ball leaves with g T/2 relative to rest.
    """
    threshold = np.pi * (1 - restitution) / (1 + restitution)
    doubling = np.sqrt(threshold**2 + (2 * (1 + restitution**2) / (1 + restitution) ** 2) ** 2)
    for ratio, kind in ((0.5 * (threshold + doubling), "periodic-1"), (doubling * 1.02, "periodic-2")):
        start = period_one_start(restitution, ratio)
        # a little beside the orbit, which an unstable one would leave by round-off only in its own time
        response = simulate(start.replace({"damper.0.velocity": 0.99 * start.damper[0].velocity}), events=True)
        assert response.classification == kind
        assert response.energy_residual < 1e-10
        if kind == "periodic-1":
            speeds = [e.relative_velocity_before for e in response.event_list if e.kind == "impact"][-20:]
            # relative approach speed: fall speed g T/2 and table velocity (1-e)/(1+e) g T/2 together
            assert speeds == pytest.approx([-(5.0 + 5.0 * (1 - restitution) / (1 + restitution))] * 20, rel=1e-6)


@pytest.mark.parametrize("ratio", [0.9, 1.1])
def test_bouncing_ball_needs_its_threshold(ratio):
    """Below pi (1-e)/(1+e) no period-one orbit exists: started where it would be, the ball does not stay on it."""
    restitution = 0.5
    threshold = np.pi / 3
    data = ball(restitution, ratio * threshold) if ratio < 1 else period_one_start(restitution, ratio * threshold)
    assert (simulate(data).classification == "periodic-1") == (ratio > 1)


ONE_TO_ONE = [(xi, r) for xi in (0.3, 0.45, 0.6, 0.66) for r in (0.985, 0.99, 1.0, 1.005)]


@pytest.mark.parametrize(("xi", "r"), ONE_TO_ONE)
def test_one_to_one_impact_regime(xi, r):
    """Two symmetric impacts a period: amplitude and attached mass fraction (Theurich and Krack; code of tobiaswdm/CC).

    Frequencies beside the backbone too; within 0.5 % at a body of 0.5 % of the mass, where the regime is stable.
    """
    case, half_gap, attached = one_to_one(xi, r)
    response = simulate(case)
    assert response.classification == "periodic-1"
    assert response.impacts_per_period == 2
    assert response.amplitude_harmonic / half_gap == pytest.approx(xi, rel=5e-3)
    assert response.attached_mass_fraction == pytest.approx(attached, rel=1e-2)
    assert response.energy_residual < 1e-10


def test_stuck_body_is_attached_mass():
    """A heavy normal load glues the body: the fixed curve, its frequency f_1/sqrt(1 + m_i/m), attached mass 1."""
    data = cluster(frequency_ratio=1 / np.sqrt(1.02), damper=[
        {"cavity": "c1", "mass": 0.02, "friction": 1.0, "normal_load": 1e6, "restitution": 0.7}
    ], time={"periods": 3000, "transient": 2900})  # fmt: skip
    response = simulate(data)
    force = 30e-6 / abs(receptance(data, np.array([2414.0 * np.sqrt(1 - 2 * 0.002**2)]))[0])
    fixed = force * abs(receptance(data, np.array([data.excitation.frequency]), fixed=True)[0])
    assert response.classification == "stuck"
    assert response.amplitude_max == pytest.approx(fixed, rel=1e-9)
    assert response.amplitude_harmonic == pytest.approx(fixed, rel=1e-9)
    assert response.amplitude_rms == pytest.approx(fixed / np.sqrt(2), rel=1e-9)
    assert response.attached_mass_fraction == pytest.approx(1.0, rel=1e-9)
    frequencies = np.linspace(0.98, 1.0, 20001) * 2414.0
    peak = frequencies[np.argmax(np.abs(receptance(data, frequencies, fixed=True)))]
    assert peak == pytest.approx(2414.0 / np.sqrt(1.02), rel=1e-5)


def test_undamped_structure_is_its_receptance():
    """No body at all: the transient decays to the linear response."""
    data = cluster(damper=[], cavity=[], time={"periods": 3000, "transient": 2990})
    response = simulate(data)
    force = 30e-6 / abs(receptance(data, np.array([2414.0 * np.sqrt(1 - 2 * 0.002**2)]))[0])
    linear = force * abs(receptance(data, np.array([data.excitation.frequency]))[0])
    assert response.amplitude_max == pytest.approx(linear, rel=1e-9)
    assert response.attached_mass_fraction is None


def test_a_structure_at_rest_feels_no_mass():
    """What damping has left of the start is less than the smallest number that holds all digits."""
    decay = cluster(excitation={"frequency": 2414.0}, initial={"displacement": 1e-7})
    response = simulate(decay.replace({"structure.damping_ratio": 0.2, "time.transient": 580, "time.periods": 585}))
    assert response.status is Status.OK
    assert response.attached_mass_fraction is None


def held(displacement=5e-5, **changes):
    """A structure that friction holds beside its centre: load, spring and a body that slides on it pull with 0.9 N."""
    return rubbing(
        10.0, 0.3, initial={"displacement": displacement}, gravity={"acceleration": 0.0},
        cavity=[{"name": "c", "gap": 4.0}], time={"periods": 5, "transient": 0},
        damper=[{"cavity": "c", "mass": 0.1, "restitution": 0.5, "friction": 0.5, "normal_load": 0.2, "velocity": 1.0}],
        **changes,
    )  # fmt: skip


@pytest.mark.parametrize("displacement", [5e-5, 1e-14])
def test_a_structure_that_friction_holds_feels_no_mass(displacement):
    """It stays where it is: what order 1 has of that is round-off."""
    response = simulate(held(displacement))
    assert response.status is Status.OK
    assert response.amplitude_max == pytest.approx(displacement, rel=1e-12)
    assert response.amplitude_harmonic < 1e-14 * displacement
    assert response.slip[-1, 0] == pytest.approx(0.375, rel=1e-12)  # 1/2 - 1/8: the body is slowed down by 1 m/s^2
    assert response.attached_mass_fraction is None
    together = sweep(held(displacement, sweep={"excitation.force": [0.1, 0.3]}))
    assert np.isnan(together.attached_mass_fraction).all()


def test_attached_mass_has_no_smallest_amplitude():
    """A stuck body counts in full however small all of the motion is."""
    small = cluster(excitation={"frequency": 2400.0, "resonance_amplitude": 1e-35}, damper=[
        {"cavity": "c1", "mass": 0.02, "friction": 1.0, "normal_load": 1e6, "restitution": 0.7}
    ], time={"periods": 3000, "transient": 2900})  # fmt: skip
    assert simulate(small).attached_mass_fraction == pytest.approx(1.0, rel=1e-9)


def test_free_decay_is_closed_form():
    """Free vibration from an initial displacement, no force: x = x0 exp(-z w t) (cos + z/sqrt(1-z^2) sin)."""
    data = scene(
        structure={"model": "rigid", "mass": 2.0, "stiffness": 50.0, "damping_ratio": 0.05},
        initial={"displacement": 0.3},
        excitation={"frequency": 1.0},
        time={"periods": 5, "transient": 0},
    )
    response = simulate(data, samples_per_period=10)
    zeta, omega = 0.05, 5.0
    damped = omega * np.sqrt(1 - zeta**2)
    t = response.time
    exact = 0.3 * np.exp(-zeta * omega * t) * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
    assert response.displacement == pytest.approx(exact, abs=1e-14)
    assert response.energy["viscous"] == pytest.approx(-response.energy["stored"], rel=1e-12)


def test_free_decay_with_coulomb_friction():
    """Code_Aster SDND100: turning points (-1)^n (U0 - 2 n mu m g / c), then the mass sticks at the fourth."""
    start = {"initial": {"displacement": 0.85e-3}, "time": {"periods": 4, "transient": 0}}
    response = simulate(rubbing(100 / (2 * np.pi), **start), events=True, samples_per_period=2)
    turning = [(-1) ** n * (0.85e-3 - 2e-4 * n) for n in range(5)]
    assert response.displacement[:5] == pytest.approx(turning, rel=1e-12)
    assert response.displacement[5:] == pytest.approx([0.05e-3] * 3, rel=1e-12)
    assert [(event.kind, event.side) for event in response.event_list] == [("stick", "casing")]
    assert response.event_list[0].time == pytest.approx(4 * np.pi / 100, rel=1e-12)
    assert response.energy["friction"] == pytest.approx(0.5e4 * (0.85e-3**2 - 0.05e-3**2), rel=1e-12)
    assert response.energy_residual < 1e-12


def test_den_hartog():
    """Den Hartog (1931): forced vibration with Coulomb friction to ground, motion without stops."""
    r, ratio = 0.6, 0.2
    v, u = 1 / (1 - r**2), np.sin(np.pi / r) / (r * (1 + np.cos(np.pi / r)))
    steady = {"time": {"periods": 3000, "transient": 2900}}
    response = simulate(rubbing(r * 100 / (2 * np.pi), force=1.0, friction=0.1 * ratio, **steady))
    assert np.sqrt(v**2 - (ratio * u) ** 2) == pytest.approx(1.55060285, rel=1e-8)
    assert response.amplitude_max * 1e4 == pytest.approx(np.sqrt(v**2 - (ratio * u) ** 2), rel=1e-6)
    assert response.classification == "no-contact"
    assert response.energy_residual < 1e-10


def test_friction_damper_that_never_slips_locks_the_structure():
    response = simulate(rubbing(10.0, force=1.0, friction=1.0, time={"periods": 5, "transient": 0}))
    assert response.classification == "stuck"
    assert response.amplitude_max == 0.0


def test_base_acceleration_equals_an_inertial_force():
    """A base that shakes a structure without bodies is the force -m a on it; a body feels the base as well."""
    shaken = cluster(excitation={"frequency": 2414.0 * 0.99, "base_acceleration": 3.0})
    pushed = cluster(excitation={"frequency": 2414.0 * 0.99, "force": 3.0})
    bare = {"damper": [], "cavity": [], "time": {"periods": 50, "transient": 40}}
    by_base = simulate(validate(Scene, shaken.to_dict() | bare, "s"))
    by_force = simulate(validate(Scene, pushed.to_dict() | bare, "s"))
    assert by_base.amplitude_harmonic == pytest.approx(by_force.amplitude_harmonic, rel=1e-12)
    assert simulate(shaken).energy_residual < 1e-10


@pytest.mark.parametrize("frequency_ratio", [0.96, 0.985, 0.99, 1.0, 1.01])
@pytest.mark.parametrize("gap_ratio", [1.0, 0.5, 0.1])
def test_energy_balances(frequency_ratio, gap_ratio):
    response = simulate(cluster(frequency_ratio, gap_ratio))
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    assert min(response.energy[name] for name in ("viscous", "friction", "impact")) >= 0


def test_restitution_at_every_impact():
    response = simulate(cluster(), events=True)
    impacts = [event for event in response.event_list if event.kind == "impact"]
    assert len(impacts) == response.counters["impacts"] > 1000
    before = np.array([event.relative_velocity_before for event in impacts])
    after = np.array([event.relative_velocity_after for event in impacts])
    plastic = after == 0  # the last impact of a chatter
    assert np.all(np.abs(after + 0.7 * before)[~plastic] <= 1e-15 * np.abs(before[~plastic]))
    assert np.all(np.abs(before[plastic]) < 1e-6 * np.abs(before).max())
    effective = 1 / (1 / 0.02 + 1 / 1.0)
    impulse = np.array([event.impulse for event in impacts])
    assert impulse[~plastic] == pytest.approx(1.7 * effective * np.abs(before[~plastic]), rel=1e-12)
    side = np.array([event.side == "left" for event in impacts])
    assert np.all((before < 0) == side)


def test_bodies_stay_in_their_cavity():
    response = simulate(cluster(gap_ratio=0.2), samples_per_period=64)
    assert np.abs(response.body_displacement).max() <= 0.1 * 30e-6 * (1 + 1e-12)


def test_time_shift_and_samples_agree_with_the_section():
    response = simulate(cluster(), samples_per_period=4)
    assert response.displacement[::4] == pytest.approx(response.section[:-1, 0], abs=1e-18)
    assert response.peak.max() >= np.abs(response.displacement).max() - 1e-18


def test_event_budget_ends_a_run():
    response = simulate(cluster(solver={"max_events": 100}))
    assert response.status == Status.EVENT_BUDGET
    assert response.counters["changes"] == 100
    assert response.periods < 1500
    assert response.energy_residual < 1e-10


def test_frictionless_and_plastic_limits():
    for restitution in (0.0, 1.0):
        data = cluster(damper=[{"cavity": "c1", "mass": 0.02, "restitution": restitution}])
        response = simulate(data)
        assert response.status == Status.OK
        assert response.energy_residual < 1e-10
        assert (response.energy["impact"] > 1e-12) == (restitution == 0.0)
        assert response.energy["friction"] == 0


def test_mistakes_of_the_model_are_named():
    with pytest.raises(InputError, match="an undamped resonance has no amplitude"):
        simulate(cluster(structure={"model": "rigid", "mass": 1.0, "stiffness": 1e8, "damping_ratio": 0.0}))
    with pytest.raises(InputError, match="critically damped"):
        simulate(cluster(structure={"model": "rigid", "mass": 1.0, "stiffness": 1e8, "damping_ratio": 1.0}))


def test_overdamped_structure_decays_without_oscillation():
    data = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 2.0},
        initial={"displacement": 1.0},
        excitation={"frequency": 1.0},
        time={"periods": 4, "transient": 0},
    )
    response = simulate(data, samples_per_period=8)
    fast, slow = -2 - np.sqrt(3), -2 + np.sqrt(3)
    exact = (slow * np.exp(fast * response.time) - fast * np.exp(slow * response.time)) / (slow - fast)
    assert response.displacement == pytest.approx(exact, abs=1e-13)
    assert response.energy_residual < 1e-12
