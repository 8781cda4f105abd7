"""Quantities of ramps and ring-downs: against closed forms, energy balances, and runs that a ramp does not disturb."""

import json

import numpy as np
import pytest

import vanedamp as vd
from tests.coupling.transients.test_ramp import BODY, FORCE, MASS, OMEGA, ONE_MODE, SLIDER, scene
from tests.coupling.transients.test_ring_down import blow, oscillator
from tests.tools.rings import Chain
from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.quantities.sums import OF_MOTION, OF_PLANE
from vanedamp.coupling.transients.no_meaning import NOT_IN_RAMPS, NOT_IN_RING_DOWNS
from vanedamp.files.toml_input import validate

WEAR = {"rate": 1e-13, "impact_rate": 1e-9, "area": 1e-4}
PAIR = {"young": 2e11, "radius": 0.05, "yield_strength": 6e8}
RATE = 1e-13  # m^3 per N m
HOUR = 3600.0


def test_amplitudes_of_a_slow_ramp_are_those_of_the_linear_oscillator():
    """X = F/|k - m w^2 + i c w|: a harmonic of amplitude X, X/sqrt(2) as root mean square, phase of -1/(...)."""
    table_ = {"from": 60.0, "to": 61.0, "periods": 100, "start": "steady"}
    data = ONE_MODE | {"structure": ONE_MODE["structure"] | {"damping_ratio": 0.05}, "time": {"periods": 200}}
    (run,) = vd.ramp(scene(table_, data)).runs
    omega = 2 * np.pi * run.frequency
    wave = FORCE / (MASS * OMEGA**2 - MASS * omega**2 + 2j * 0.05 * OMEGA * MASS * omega)
    # the ramp leaves the steady motion by some ten-thousandths
    assert run.amplitude_rms == pytest.approx(np.abs(wave) / np.sqrt(2), rel=1e-3)
    assert run.amplitude_harmonic == pytest.approx(np.abs(wave), rel=1e-3)
    assert run.phase == pytest.approx(np.angle(wave), abs=1e-3)
    assert run.amplitude_undamped == pytest.approx(np.abs(wave), rel=1e-12)
    assert run.amplitude_max == pytest.approx(np.abs(wave), rel=1e-3)
    assert np.isfinite(run.energy_share[:, 0]).all() and (run.energy_share[:, 0] == 1.0).all()
    assert "attached_mass_fraction" not in run.quantities and "phase" not in run.mean
    assert run.mean["amplitude_rms"] == pytest.approx(np.average(run.amplitude_rms, weights=1 / run.frequency))


@pytest.mark.parametrize("friction", [0.05, 0.3])
def test_wear_of_a_ramp_is_its_friction_work(friction):
    """Archard: K/H times the integral of normal force times slip speed, of which friction takes the coefficient."""
    data = BODY | {
        "damper": [{**SLIDER, "friction": friction}], "cavity": [{"name": "c", "gap": 1e-2}], "wear": {"rate": RATE},
    }  # fmt: skip
    (run,) = vd.ramp(scene({"from": 96.0, "to": 104.0, "periods": 60}, data)).runs
    seconds = 1 / run.frequency
    lost = run.energy["friction"]
    assert lost > 0.0 and run.impacts.sum() == 0
    assert friction * (run.wear_work_rate @ seconds) == pytest.approx(lost, rel=1e-9)
    volume = run.wear_volume_rate @ seconds / HOUR
    assert volume == pytest.approx(RATE * lost / friction, rel=1e-9)
    assert run.mean["wear_volume_rate"] == pytest.approx(volume / seconds.sum() * HOUR, rel=1e-9)
    assert run.largest["wear_volume_rate"] == run.wear_volume_rate.max() > run.mean["wear_volume_rate"]


def test_force_of_an_impact_in_a_ramp_is_hertz():
    """A body flies to a wall of a structure that hardly moves: F = (5/4 m v^2)^(3/5) (16/9 R E'^2)^(1/5)."""
    mass, speed = 0.02, 0.2
    data = {
        "structure": {"model": "rigid", "mass": 1e9, "stiffness": 1e9 * OMEGA**2, "damping_ratio": 0.01},
        "excitation": {"frequency": 1000.0, "force": 1e-9}, "gravity": {"acceleration": 0.0},
        "cavity": [{"name": "c", "gap": 1e-4}],
        "damper": [{"cavity": "c", "mass": mass, "velocity": speed, "restitution": 0.5}],
        "contact": {"law": "newton", "pair": PAIR},
    }  # fmt: skip
    (run,) = vd.ramp(scene({"from": 1000.0, "to": 1001.0, "periods": 3}, data)).runs
    plane = PAIR["young"] / (1 - 0.3**2) / 2  # both of steel
    stiffness = 4 / 3 * plane * np.sqrt(PAIR["radius"])
    energies = 0.5 * mass * (speed * 0.5 ** np.arange(2)) ** 2
    force = stiffness * (2.5 * energies / stiffness) ** 0.6
    # after 0.25 ms at the first wall, after another 1 ms at the other one
    assert run.impacts.tolist() == [1, 1, 0]
    assert run.contact_force == pytest.approx([*force, 0.0], rel=1e-5)
    assert run.impact_speed_max == pytest.approx([speed, 0.5 * speed, 0.0], rel=1e-6)
    assert run.largest["contact_force"] == run.contact_force[0]


def test_an_impact_over_the_end_of_a_period_is_whole():
    """A body compresses a spring without loss for 0.1 ms: F = v (k m)^(1/2); the period ends halfway."""
    mass, speed, lasts = 0.02, 0.2, 1e-4
    stiffness = mass * (np.pi / lasts) ** 2
    data = {
        "structure": {"model": "rigid", "mass": 1e9, "stiffness": 1e9 * OMEGA**2, "damping_ratio": 0.01},
        "excitation": {"frequency": 1000.0, "force": 1e-9}, "gravity": {"acceleration": 0.0},
        "cavity": [{"name": "c", "gap": 1e-4}],
        "damper": [{"cavity": "c", "mass": mass, "velocity": speed, "restitution": 1.0}],
        "contact": {"law": "compliant", "stiffness": stiffness, "pair": PAIR}, "wear": {"impact_rate": 1e-9},
    }  # fmt: skip
    frequency = 1 / (2.5e-4 + lasts / 2)
    (run,) = vd.ramp(scene({"from": frequency, "to": frequency * (1 + 1e-9), "periods": 2}, data)).runs
    assert run.impacts.tolist() == [1, 0]
    assert run.contact_force == pytest.approx([speed * np.sqrt(stiffness * mass), 0.0], rel=1e-6)
    energy = 0.5 * mass * speed**2
    assert run.wear_volume_rate == pytest.approx([1e-9 * energy * frequency * HOUR, 0.0], rel=1e-6)


LAWS = {
    "rigid": {"law": "newton", "pair": PAIR},
    "compliant": {"law": "compliant", "stiffness": 2e6, "pair": PAIR},
}


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("law", LAWS)
def test_a_ramp_that_hardly_changes_has_the_quantities_of_a_run(law, planar):
    """Also where impacts go on over the ends of periods: they are the run's, with the impulse that both parts bring."""
    body = SLIDER | ({"shape": "block", "length": 0.012, "height": 0.01} if planar else {})
    cavity = {"name": "c", "gap": 2e-4} | ({"play": 1e-4} if planar else {})
    data = BODY | {"damper": [body], "cavity": [cavity], "wear": WEAR, "contact": LAWS[law]}
    periods = 24
    given = validate(vd.Scene, data, "x").replace({"excitation.frequency": 100.0})
    (run,) = vd.ramp(scene({"from": 100.0, "to": 100.0 * (1 + 1e-13), "periods": periods}, given.to_dict())).runs
    whole = vd.simulate(given.replace({"time": {"periods": periods, "transient": 0}}))
    assert run.impacts.sum() > 10
    for name in ("wear_volume_rate", "wear_work_rate"):
        assert run.mean[name] == pytest.approx(getattr(whole, name), rel=1e-3), name
    for name in ("contact_force", "contact_pressure", "contact_utilisation", "impact_speed_max"):
        assert run.largest[name] == pytest.approx(getattr(whole, name), rel=1e-3), name
    assert np.sqrt((run.amplitude_rms**2).mean()) == pytest.approx(whole.amplitude_rms, rel=1e-4)
    assert run.mean["impacts_per_period"] == pytest.approx(whole.impacts_per_period, rel=1e-12)
    if planar:
        assert run.largest["tilt_max"] == pytest.approx(whole.tilt_max, rel=1e-3)
        assert run.mean["lift_share"] == pytest.approx(whole.lift_share, rel=1e-3)
        assert run.mean["wall_impacts"] == pytest.approx(whole.wall_impacts, rel=1e-12)


def test_wear_of_a_ring_down_is_the_energy_that_friction_takes():
    """One dry friction damper stops a mass: 1/2 m v^2 = mu N s + k x^2/2, with the rest at x; wear K/H N s."""
    normal, friction, impulse = 3.0, 0.4, 0.05
    damper = {"normal_force": normal, "friction": friction}
    given = oscillator(0.0, friction_damper=[damper], ring_down=blow(impulse, 12), wear={"rate": RATE})
    found = vd.ring_down(given)
    structure = given.structure
    rest = 0.5 * structure.stiffness * found.displacement[-1] ** 2 if found.rest_time is not None else found.energy[-1]
    lost = 0.5 * impulse**2 / structure.mass - rest
    assert found.rest_time is not None and lost > 0.0
    work = lost / friction
    assert found.wear_work_rate * found.duration == pytest.approx(work, rel=1e-9)
    assert found.wear_volume_rate * found.duration / HOUR == pytest.approx(RATE * work, rel=1e-9)
    assert found.energy_share.tolist() == pytest.approx([0.0, 1.0, 0.0, 0.0], abs=1e-12)
    course = found.course["wear_work_rate"]
    assert course.mean() == pytest.approx(found.wear_work_rate, rel=1e-9)
    assert (course[np.arange(len(course)) * found.duration / len(course) > found.rest_time] == 0.0).all()


def test_rms_of_a_linear_ring_down():
    """x = v/w exp(-d t) sin(w t): the integral of its square in closed form."""
    ratio, impulse, periods = 0.01, 0.3, 25
    given = oscillator(ratio, ring_down=blow(impulse, periods))
    found = vd.ring_down(given)
    natural = np.sqrt(given.structure.stiffness / given.structure.mass)
    d, w = ratio * natural, natural * np.sqrt(1 - ratio**2)
    t, p = found.duration, -2 * ratio * natural
    envelope = np.expm1(p * t) / p
    wave = complex(p, 2 * w)
    integral = 0.5 * (envelope - ((np.exp(wave * t) - 1) / wave).real)
    size = impulse / given.structure.mass / w
    assert found.amplitude_rms == pytest.approx(size * np.sqrt(integral / t), rel=1e-9)
    assert found.amplitude_max == pytest.approx(np.abs(found.displacement).max(), rel=1e-12)
    assert d > 0.0 and "amplitude_harmonic" not in found.quantities and "phase" not in found.quantities


def test_what_a_motion_lacks_is_what_has_no_meaning(tmp_path):
    """All quantities that need sums, bodies in the plane, wear and contacts: there, or with a reason."""
    body = SLIDER | {"shape": "block", "length": 0.012, "height": 0.01}
    data = BODY | {
        "damper": [body], "cavity": [{"name": "c", "gap": 2e-4, "play": 1e-4}], "wear": WEAR, "contact": LAWS["rigid"],
    }  # fmt: skip
    found = vd.ramp(scene({"from": 98.0, "to": 102.0, "periods": 6, "both": True}, data))
    rung = vd.ring_down(validate(vd.Scene, data | {"ring_down": blow(2.0, 6)}, "x"))
    sources = {*OF_MOTION, *OF_PLANE, "wear", "contacts"}
    for kind, reasons in ((found, NOT_IN_RAMPS), (rung, NOT_IN_RING_DOWNS)):
        wanted = {name for name, one in table().items() if one.exists(sources) and one.lacking(reasons) is None}
        assert set(kind.quantities) == wanted
        known = {name for one in table().values() for name in (one.name, *one.needs, *one.dims)}
        assert reasons.keys() <= known
        kind.save(tmp_path / "kind.h5")
        again = type(kind).load(tmp_path / "kind.h5")
        assert json.dumps(again.to_json(), sort_keys=True) == json.dumps(kind.to_json(), sort_keys=True)
        for name, values in kind.quantities.items():
            np.testing.assert_array_equal(again.quantities[name], values)
    assert {len(values) for values in found.quantities.values()} == {12}
    assert np.array_equal(found.runs[1].tilt_max, found.tilt_max[6:])


def test_sectors_of_a_ring_in_a_ramp(tmp_path):
    """One body in a ring of six: its sector alone has impacts, and each has its amplitude in the run."""
    chain = Chain(sectors=6, damping_ratio=0.01)
    hertz = float(np.sqrt(chain.squares([2])[0]) / (2 * np.pi))
    data = {
        "structure": {"model": "ring", "file": str(chain.saved(tmp_path))},
        "excitation": {"frequency": hertz, "force": 25.0, "at": "tip", "wave": 2},
        "cavity": [{"name": "c", "gap": 1e-4, "floor": "tip", "sectors": [4]}],
        "damper": [{"cavity": "c", "mass": 0.01, "friction": 0.2, "restitution": 0.6}], "time": {"periods": 30},
    }  # fmt: skip
    given = validate(vd.Scene, data, "x")
    ends = {"from": hertz, "to": hertz * (1 + 1e-13)}
    (run,) = vd.ramp(given.replace({"ramp": ends | {"periods": 12}})).runs
    whole = vd.simulate(given.replace({"time": {"periods": 12, "transient": 0}}))
    assert run.sector_amplitude_max.shape == (12, 6)
    assert run.largest["sector_amplitude_max"] == pytest.approx(whole.sectors.amplitude_max, rel=1e-6)
    assert run.mean["sector_impacts_per_period"] == pytest.approx(whole.sectors.impacts_per_period, rel=1e-12)
    assert np.flatnonzero(run.largest["sector_impacts_per_period"]).tolist() == [4]
    found = vd.ring_down(given.replace({"ring_down": {"start": "steady", "periods": 5}}))
    assert found.sector_amplitude_max.shape == (6,) and found.course["localisation"].shape == (5,)
