"""Structures with little or no damping, driven at their own frequency: a mode grows as t exp(i omega t).

The first impact against the closed form in 40 digits, motion and energies against DOP853, what holds at every event,
and the same run with and without the treatment that near resonance needs.
"""

import math
from collections import OrderedDict

import numpy as np
import pytest

from tests.reference.comparison import follow
from tests.tools.laws_by_event import check_events
from tests.tools.tiers import cases
from vanedamp.coupling.engine import known
from vanedamp.coupling.engine.line import subsystems
from vanedamp.coupling.engine.line.event_driven import EngineRun
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.line_system import line_system
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel

MASS, STIFFNESS, FORCE = 2.0, 8e3, 20.0
OMEGA = math.sqrt(STIFFNESS / MASS)
BODY = {"cavity": "c", "mass": 0.1, "restitution": 0.6}
NATURAL = {
    "apart": [60.0, 97.0, 143.0, 260.0],
    "double": [97.0, 97.0, 143.0],
    "close": [97.0, 97.1, 143.0],
}


def scene(omega=OMEGA, damping_ratio=0.0, gap=0.03, body=None, force=FORCE, periods=8, **changes):
    data = {
        "structure": {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": damping_ratio},
        "excitation": {"frequency": omega / (2 * math.pi), "force": force},
        "cavity": [{"name": "c", "gap": gap}],
        "damper": [BODY | (body or {})],
        "time": {"periods": periods, "transient": 0},
    }
    return validate(Scene, data | changes, "scene")


def reduced(spectrum, damping_ratio=0.0):
    """A model with these natural frequencies (rad/s) and two patches, coordinates coupled."""
    omegas, rng = np.array(NATURAL[spectrum]), np.random.default_rng(3)
    n = len(omegas)
    basis = np.linalg.inv(np.eye(n) + 0.2 * rng.standard_normal((n, n)))
    rows = rng.uniform(0.4, 1.0, (2, n)) @ basis
    return ReducedModel.from_matrices(
        mass=basis.T @ basis, stiffness=basis.T @ np.diag(omegas**2) @ basis,
        interface={"a": rows[0], "b": rows[1]}, damping_ratio=damping_ratio,
    )  # fmt: skip


def on_model(folder, model, omega=97.0, **changes):
    """Two bodies, one of them with friction, on the two patches of a reduced model."""
    model.save(folder / "rom.h5")
    cavities = [{"name": "c", "gap": 0.02, "floor": "a"}, {"name": "d", "gap": 0.015, "floor": "b"}]
    return scene(
        structure={"model": "rom", "file": str(folder / "rom.h5")},
        excitation={"frequency": omega / (2 * math.pi), "force": FORCE, "at": "a"},
        cavity=cavities, damper=[BODY | {"friction": 0.1}, BODY | {"cavity": "d"}], **changes,
    )  # fmt: skip


HELD = math.sqrt(STIFFNESS / (MASS + BODY["mass"]))
JENKINS = {"normal_force": 20.0, "friction": 0.3, "stiffness": 2e3}
SCENES = {
    "impacts": scene(),
    "plastic": scene(body={"restitution": 0.0}),
    "hardly damped": scene(damping_ratio=1e-6),
    "damped": scene(damping_ratio=1e-3, omega=1.001 * OMEGA),
    "row": scene(damper=[BODY, BODY | {"position": 4e-3, "mass": 0.2}]),
    "slope": scene(body={"friction": 0.1}, gravity={"orientation_deg": 30.0}),
    "stuck": scene(omega=HELD, body={"friction": 0.4}, force=2.0),
    "resting": scene(omega=HELD, body={"friction": 0.4}, force=2.0, gravity={"orientation_deg": 90.0}),
    "base": scene(excitation={"frequency": OMEGA / (2 * math.pi), "base_acceleration": 10.0}),
    "compliant": scene(contact={"law": "compliant", "stiffness": 2e3}, body={"friction": 0.2}),
    "spring": scene(
        omega=math.sqrt((STIFFNESS + JENKINS["stiffness"]) / MASS), force=5.0, friction_damper=[JENKINS]
    ),
    "sliding": scene(friction_damper=[JENKINS], force=30.0),
    # a body pressed on a compliant wall of a shaken table: the contact resonates
    "table": scene(
        structure={"model": "prescribed", "displacement_amplitude": 2e-4}, gravity={"orientation_deg": 90.0},
        excitation={"frequency": math.sqrt(2e4) / (2 * math.pi)}, cavity=[{"name": "c", "gap": 5e-3}],
        contact={"law": "compliant", "stiffness": 2e3}, damper=[BODY | {"restitution": 1.0, "position": -2.5e-3}],
    ),
}  # fmt: skip


@pytest.fixture
def driven(monkeypatch):
    """Numbers of driven modes in the subsystems that runs have met."""
    found, advance = [], EngineRun._advance

    def watched(run, periods, max_events):
        code = advance(run, periods, max_events)
        found.extend(int(np.ptp(run.flows.driven[s])) for s in np.flatnonzero(run.flows.modes))
        return code

    monkeypatch.setattr(EngineRun, "_advance", watched)
    return found


def test_growth_without_bodies():
    """x = -F/(2 m w) (t cos(w t) - sin(w t)/w), and no steady state."""
    alone = scene(cavity=[], damper=[], periods=100)
    response = simulate(alone, samples_per_period=8)
    t = response.time
    exact = -FORCE / (2 * MASS * OMEGA) * (t * np.cos(OMEGA * t) - np.sin(OMEGA * t) / OMEGA)
    # the phase omega t of 100 periods has a round-off of 628 * 2^-53
    assert np.abs(response.displacement - exact).max() < 1e-12 * np.abs(exact).max()
    assert response.status == "ok"
    assert response.energy_residual < 1e-13
    # grows by the same every period, and is largest at its end
    assert response.peak[:100] == pytest.approx(
        FORCE / (2 * MASS * OMEGA) * np.arange(1, 101) / alone.excitation.frequency
    )
    assert simulate(alone.replace({"time": {"periods": 300, "steady": "auto"}})).status == "not_steady"


@pytest.mark.parametrize("damping_ratio", [0.0, 1e-16, 1e-14, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 2e-3, 4e-3])
def test_first_impact(damping_ratio):
    """Where the structure from rest reaches half the gap, to 1e-14 periods near resonance and 1e-12 further off.

    A root is the time's round-off away from the truth, some 1e-16 periods a period; where the mode is not driven, the
    response in step with the excitation and the free one cancel by up to 2 pi/DRIVEN.
    """
    mpmath = pytest.importorskip("mpmath")
    for detuning in (0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-4, 2.5e-3, 1e-2):
        case = scene(OMEGA * (1 + detuning), damping_ratio, body={"friction": 0.0}, periods=12)
        found = next(event.time for event in simulate(case, events=True).event_list if event.kind == "impact")
        near = math.hypot(detuning, damping_ratio) < 3e-3
        with mpmath.workdps(40):
            error = abs(found - _first_impact(mpmath, case, found)) * case.excitation.frequency
            assert error < (1e-14 if near else 1e-12), (detuning, float(error))


def _first_impact(mpmath, case, near):
    """Root near a time of |x| = half the gap: p'' + c p' + k p = F sin(w t) from rest, in the model's doubles."""
    structure = line_system(assemble(case))
    k, c, omega, force, row = (
        mpmath.mpf(float(value))
        for value in (
            structure.stiffness[0], structure.damping[0, 0], structure.omega, -structure.load[0, 0].imag,
            structure.floor[0, 0],
        )
    )  # fmt: skip
    excitation, root = mpmath.mpc(0, omega), mpmath.sqrt(mpmath.mpc(c * c / 4 - k))

    def growth(rate, t):
        if rate == excitation:
            return t * mpmath.exp(rate * t)
        return (mpmath.exp(excitation * t) - mpmath.exp(rate * t)) / (excitation - rate)

    def x(t):
        return row * mpmath.im(force * (growth(-c / 2 + root, t) - growth(-c / 2 - root, t)) / (2 * root))

    half = mpmath.mpf(case.cavity[0].gap) / 2
    return mpmath.findroot(lambda t: abs(x(t)) - half, mpmath.mpf(near))


@pytest.mark.parametrize("name", cases(SCENES, fast=["row", "slope", "stuck", "compliant", "sliding", "table"]))
def test_motion_and_laws(name, driven):
    """Events, motion and energies as by DOP853; forces, walls and Newton's law at every event; a closed ledger."""
    follow(SCENES[name], 8)
    check_events(SCENES[name].replace({"time.periods": 20}))
    long = simulate(SCENES[name].replace({"time.periods": 400}))
    assert long.status == "ok"
    assert long.energy_residual < 1e-11
    assert any(driven)


@pytest.mark.parametrize(("spectrum", "count"), cases([("apart", 1), ("double", 2), ("close", 2)], fast=[("close", 2)]))
def test_reduced_model(spectrum, count, driven, tmp_path):
    """One resonant mode of several, two of the same frequency, and two so close that both are driven."""
    case = on_model(tmp_path, reduced(spectrum))
    follow(case, 6, reduced(spectrum), tmp_path)
    check_events(case.replace({"time.periods": 20}))
    assert simulate(case.replace({"time.periods": 300})).energy_residual < 1e-11
    assert max(driven) == count


@pytest.mark.parametrize("name", ["impacts", "slope", "compliant", "sliding", "base", "reduced"])
def test_driven_or_not_is_the_same(name, monkeypatch, driven, tmp_path):
    """At a damping ratio of 0.1 % both ways hold: every result of a short run is the same, whatever it is a sum of."""
    model = reduced("apart", 1e-3)
    case = on_model(tmp_path, model) if name == "reduced" else SCENES[name].replace({"structure.damping_ratio": 1e-3})
    case = case.replace({"time.periods": 6})
    one = simulate(case, events=True, samples_per_period=16)
    assert any(driven)
    driven.clear()
    monkeypatch.setattr(subsystems, "DRIVEN", 0.0)
    monkeypatch.setattr(known._STRUCTURES, "known", OrderedDict())  # kept with the other bound
    two = simulate(case, events=True, samples_per_period=16)
    assert not any(driven)
    assert len(one.event_list) == len(two.event_list) > 10
    for found, expected in (
        (one.peak, two.peak), (one.section, two.section), (one.displacement, two.displacement),
        (one.body_displacement, two.body_displacement), (one.slip_velocity, two.slip_velocity),
        ([one.amplitude_rms, one.amplitude_harmonic], [two.amplitude_rms, two.amplitude_harmonic]),
        (list(one.energy.values()), list(two.energy.values())),
        ([event.time for event in one.event_list], [event.time for event in two.event_list]),
        ([event.impulse for event in one.event_list], [event.impulse for event in two.event_list]),
    ):  # fmt: skip
        # 1e-13 of what cancels a hundredfold, and impacts multiply it
        assert np.asarray(found) == pytest.approx(np.asarray(expected), abs=1e-9 * np.abs(expected).max())
    assert one.attached_mass_fraction == pytest.approx(two.attached_mass_fraction, rel=1e-9)


def test_runs_go_on_where_others_end():
    """A driven mode's amplitude is the state's own: a run in two parts is the whole run."""
    whole = simulate(SCENES["slope"])
    first = simulate(SCENES["slope"].replace({"time.periods": 3}))
    second = simulate(SCENES["slope"].replace({"time.periods": 5}), start=first.final)
    assert second.section == pytest.approx(whole.section[3:], abs=1e-9 * np.abs(whole.section).max())
