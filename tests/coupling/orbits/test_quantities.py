"""Quantities of orbits, branches and borders against closed forms, and against long runs that have settled."""

import math
from dataclasses import replace

import numpy as np
import pytest

import vanedamp as vd
from tests.coupling.orbits.test_scenes import BODY, STOP
from tests.tools.closed_form_scenes import ball, scene
from tests.tools.rings import Chain
from vanedamp.coupling.exponents.lyapunov import lyapunov
from vanedamp.coupling.orbits import newton
from vanedamp.coupling.orbits.border import stacked
from vanedamp.coupling.orbits.branch import Branches, unknown
from vanedamp.coupling.orbits.orbit_quantities import LEAVES, NOT_IN_ORBITS
from vanedamp.coupling.orbits.orbits import find_orbit, orbit_at, orbits
from vanedamp.coupling.orbits.period_map import period_map
from vanedamp.coupling.quantities.quantity import table
from vanedamp.coupling.simulation import simulate
from vanedamp.files.store import load_any, save

FREQUENCY, DAMPING, FORCE = 0.9 / (2 * math.pi), 0.1, 0.3
LINEAR = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": DAMPING},
    "excitation": {"frequency": FREQUENCY, "force": FORCE},
    "time": {"periods": 1, "transient": 0},
    "orbit": {"start": "linear"},
}
PAIR = {"young": 2e11, "radius": 0.05, "yield_strength": 6e8}
BODIES = {
    "cavity": [{"name": "c", "gap": 100.0}],
    "damper": [{"cavity": "c", "mass": 0.2, "friction": 1.0, "normal_load": 100.0}],
}


def receptance(mass, omega=0.9):
    return 1.0 / (1.0 - mass * omega**2 + 1j * DAMPING * omega)


@pytest.mark.parametrize(("tables", "mass"), [({}, 1.0), (BODIES, 1.2)])
def test_a_linear_motion_has_the_quantities_of_its_sine(tables, mass):
    """A body that sticks moves as part of the mass; F sin(w t) leads to |H| F sin(w t + arg H)."""
    orbit = find_orbit(scene(**LINEAR, **tables))
    motion = FORCE * receptance(mass)
    known = {
        "amplitude_mean": abs(motion), "amplitude_max_dynamic": abs(motion), "static_deflection": 0.0,
        "amplitude_rms": abs(motion) / math.sqrt(2), "amplitude_harmonic": abs(motion), "phase": np.angle(motion),
        "impacts_per_period": 0.0,
        "amplitude_undamped": abs(FORCE * receptance(1.0)), "amplitude_fixed": abs(motion),
        "exponent": -DAMPING / (2 * mass),
    }  # fmt: skip
    for name, value in known.items():
        assert getattr(orbit, name) == pytest.approx(value, rel=1e-9, abs=1e-12), name
    assert orbit.energy_share == pytest.approx([1.0, 0.0, 0.0, 0.0])
    if tables:
        assert orbit.attached_mass_fraction == pytest.approx(1.0, rel=1e-9)


def test_a_coulomb_damper_wears_as_den_hartog_has_it():
    """Without stops and other damping the amplitude is known (Den Hartog 1931), and normal force times way is 4 N X."""
    force, friction, normal, ratio = 1.0, 0.4, 0.5, 0.8
    data = scene(
        structure={"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping": 0.0},
        excitation={"frequency": ratio / (2 * math.pi), "force": force},
        friction_damper=[{"normal_force": normal, "friction": friction}],
        wear={"rate": 1e-9}, time={"periods": 400, "transient": 300}, orbit={},
    )  # fmt: skip
    orbit = find_orbit(data)
    inverse, turn = 1 / ratio, math.pi / ratio
    linear, slowed = 1 / (1 - ratio**2), inverse * math.sin(turn) / (1 + math.cos(turn))
    amplitude = math.sqrt((force * linear) ** 2 - (friction * normal * slowed) ** 2)
    assert orbit.amplitude_max == pytest.approx(amplitude, rel=1e-9)
    way = 4 * amplitude * ratio / (2 * math.pi)
    assert orbit.wear_work_rate == pytest.approx(normal * way, rel=1e-9)
    assert orbit.wear_volume_rate == pytest.approx(3600 * 1e-9 * normal * way, rel=1e-9)
    assert orbit.energy_share == pytest.approx([0.0, 1.0, 0.0, 0.0])


def test_a_ball_that_flies_for_two_periods_has_half_an_impact_a_period():
    """It leaves with V = g T, the table has the speed v: V - v = e (V + v), as Holmes 1982 has it for one period."""
    e, ratio, g, omega = 0.5, 2.2, 10.0, 2 * math.pi
    phase = math.acos(2 * math.pi * (1 - e) / (1 + e) / ratio)
    later, size = 1.0 - phase / omega, ratio * g / omega**2
    height = g * later - g * later**2 / 2 + size * math.sin(phase)
    table = {"cavity": [{"name": "c", "gap": 20.0}], "contact": {"law": "newton", "pair": PAIR}}
    data = ball(e, ratio, damper=[{"cavity": "c", "mass": 1.0, "restitution": e, "position": -10.0}], **table)
    state = np.array([height - 10.0, g - g * later - size * omega])
    orbit = newton.find_orbit(period_map(data, periods=2), state)
    assert orbit.periods == 2 and orbit.state == pytest.approx(state, rel=1e-9)
    assert orbit.impacts_per_period == 0.5 and orbit.energy_share == pytest.approx([0.0, 0.0, 1.0, 0.0])
    assert orbit.impact_speed_max == pytest.approx(2 * g / (1 + e), rel=1e-9)
    assert orbit.amplitude_mean == pytest.approx(size) and orbit.amplitude_rms == pytest.approx(size / math.sqrt(2))


@pytest.fixture(scope="module")
def data():
    """A body that hits both walls once a period, with all that a rigid model can have: wear, forces of contacts."""
    orbit = {"from": 102.0, "to": 101.9, "step": 0.04, "max_points": 3}
    wear = {"rate": 1e-12, "length": 0.01, "height": 0.01, "width": 0.01}
    return scene(**BODY | {"orbit": orbit}, wear=wear, contact={"law": "newton", "pair": PAIR})


@pytest.fixture(scope="module")
def followed(data):
    """The branch of three of its orbits."""
    return orbits(data)


def test_an_orbit_has_the_quantities_of_the_run_that_settles_on_it(data):
    """All of the table: there is none that the run has and the orbit has not, without a reason."""
    orbit, run = find_orbit(data), simulate(data.replace({"orbit": None, "time": {"periods": 6000, "transient": 5900}}))
    assert orbit.stable and {run.wear_depth_rate, run.contact_utilisation}.isdisjoint([None, 0.0])
    for name, one in table().items():
        if (value := getattr(run, name)) is None:
            continue
        if not NOT_IN_ORBITS.keys().isdisjoint(one.needs):
            assert name not in orbit.quantities
        elif name != "energy_residual":
            assert getattr(orbit, name) == pytest.approx(value, rel=1e-9, abs=1e-15, nan_ok=True), name


def test_orbits_print_their_quantities():
    orbit = find_orbit(scene(**LINEAR))
    shown = repr(orbit)
    assert "phase: -" in shown and "rad" in shown and "amplitude_rms" in dir(orbit)
    with pytest.raises(AttributeError, match="no amplitude_men"):
        orbit.amplitude_men  # noqa: B018


def test_exponents_are_those_of_the_motion(data):
    orbit = find_orbit(data)
    found = lyapunov(orbit.map.scene, 64, orbit.map.restart_of(orbit.state))
    assert orbit.exponent == pytest.approx(found.largest, rel=1e-6)
    assert orbit.exponent_second == pytest.approx(found.exponents[1], rel=1e-6)


def test_a_branch_keeps_the_quantities_of_its_orbits_and_files_keep_them(data, followed, tmp_path):
    found = followed
    (branch,) = found.branches
    assert len(branch.parameter) == 3 and branch.wear_work_rate.shape == (3,) and branch.energy_share.shape == (3, 4)
    assert branch.wear.keys() == {name for name, one in table().items() if one.family == "wear"}
    (last,) = branch.rows[2:]
    single = find_orbit(
        data.replace({"excitation.frequency": float(last["parameter"]), "orbit.from": float(last["parameter"])})
    )
    for name, value in single.quantities.items():
        if name != "energy_residual" and not table()[name].text:
            assert last["quantities"][name] == pytest.approx(value, rel=1e-6, nan_ok=True), name
    found.save(tmp_path / "orbits.h5")
    read = Branches.load(tmp_path / "orbits.h5")
    for name, values in found.quantities.items():
        np.testing.assert_array_equal(read.quantities[name], values)
    assert read.to_json() == found.to_json()
    ends = found.to_json()["quantities"]["wear_work_rate"]
    assert ends["unit"] == "W" and ends["branches"][0]["min"] == branch.wear_work_rate.min() and ends["borders"] == []
    _, variables, _ = load_any(tmp_path / "orbits.h5")
    assert variables["energy_share"].dims == ("point", "loss") and variables["phase"].units == "rad"


def test_stress_of_earlier_files_is_read(followed, tmp_path):
    """They have one array of all amplitudes: six components, von Mises, principal."""
    followed.save(tmp_path / "orbits.h5")
    kind, variables, attributes = load_any(tmp_path / "orbits.h5")
    stress = np.arange(3 * 2 * 8.0).reshape(3, 2, 8)
    more = {"stress": type(variables["phase"])(stress, ("point", "hot_spot", "stress_measure"), "Pa")}
    save(tmp_path / "earlier.h5", kind, variables | more, attributes)
    (branch,) = Branches.load(tmp_path / "earlier.h5").branches
    np.testing.assert_array_equal(branch.stress_amplitude, stress[..., :6])
    np.testing.assert_array_equal(branch.stress_von_mises, stress[..., 6])
    np.testing.assert_array_equal(branch.stress_principal, stress[..., 7])


def test_quantities_of_an_orbit_that_no_run_stays_on_are_unknown():
    """Over n of its periods round-off grows as the multiplier to the n: what is given is right to 1e-6."""
    found = vd.orbits(scene(**STOP | {"orbit": STOP["orbit"] | {"max_points": 8}}))
    (branch,) = found.branches
    number = int(np.abs(branch.multipliers[:, 0]).argmax())
    orbit = orbit_at(found, 0, number)
    growth, given = abs(orbit.multipliers[0]), [1]
    assert growth > 2.0 and not orbit.stable
    while True:
        longer = orbit.map.over(given[-1] + 3).quantities(orbit.state)
        if np.isnan(longer["amplitude_rms"]):
            break
        given.append(given[-1] + 3)
        assert longer["amplitude_rms"] == pytest.approx(orbit.amplitude_rms, rel=1e-6)
    assert 1e6 < growth ** given[-1] < 1e12
    assert all(np.isnan(value).all() for name, value in longer.items() if not table()[name].text)
    lost = stacked([*(row["quantities"] for row in branch.rows[:-1]), longer])
    assert unknown(branch) == ""
    assert unknown(replace(branch, quantities=lost)) == f"1 of 8 orbits have no quantities: {LEAVES}"


def test_one_number_of_a_ring_is_that_of_all_its_sectors(tmp_path):
    """Along branches and by derivatives, as in scenes that are written with it."""
    model = Chain(sectors=4, damping_ratio=0.02).saved(tmp_path)

    def ring(mass, **orbit):
        return vd.Scene.of({
            "structure": {"model": "ring", "file": str(model)},
            "excitation": {"frequency": 300.0, "at": "tip", "force": 10.0},
            "cavity": [{"name": "c", "gap": 1.0, "floor": "tip", "sectors": [0, 1]}],
            "damper": [{"cavity": "c", "mass": mass, "friction": 1.0, "normal_load": 2.0}],
            "time": {"periods": 40}, "orbit": {"start": "linear"} | orbit,
        }, "ring")  # fmt: skip

    below, orbit, above = (find_orbit(ring(mass)) for mass in (0.0499, 0.05, 0.0501))
    slope = (above.sector_amplitude_mean - below.sector_amplitude_mean) / 2e-4
    found = vd.sensitivity(orbit, ["damper.0.mass"])
    turned = [found.derivatives[f"sector_amplitude_mean.{sector}"][0] for sector in range(4)]
    assert found.status == "ok" and turned == pytest.approx(slope, rel=1e-4)
    (branch,) = orbits(ring(0.05, **{"parameter": "damper.0.mass", "from": 0.05, "to": 0.06})).branches
    end = find_orbit(ring(float(branch.parameter[-1])))
    assert branch.parameter[-1] == 0.06
    assert branch.sector_amplitude_mean[-1] == pytest.approx(end.sector_amplitude_mean, rel=1e-9)
