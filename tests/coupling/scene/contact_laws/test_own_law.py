"""A contact law from outside the package, whose restitution falls with the speed: closed forms, methods, refusals.

The law is that of viscoelastic spheres to leading order (Kuwabara and Kono 1987), with a coefficient for each body.
"""

import dataclasses
import math
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Literal

import numpy as np
import pytest
from pydantic.dataclasses import dataclass

from tests.tools.processes import environment
from vanedamp.coupling.engine.line.scenes import run
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element
from vanedamp.coupling.scene.contact_laws.newton import Newton
from vanedamp.coupling.scene.registration import LAWS, register
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.extensions import ExtensionError
from vanedamp.files.toml_input import STRICT, InputError, Positive, validate

G, HEIGHT, C = 10.0, 1.0, 0.3
RTOL = 1e-10


@register
@dataclass(frozen=True, config=STRICT)
class FifthRoot(ContactLaw):
    """Restitution 1 - c (1 - e) v^(1/5); e is the restitution of the bodies."""

    c: Positive
    law: Literal["fifth root"] = "fifth root"

    @staticmethod
    def restitution_at(speed, coefficient):
        return max(1.0 - coefficient * speed**0.2, 0.0)

    def element(self, restitution, mass, flexibility=None):
        return Element(self.c * (1.0 - restitution))


@register
@dataclass(frozen=True, config=STRICT)
class Same(ContactLaw):
    """Newton's law, as a law of the speed."""

    law: Literal["same"] = "same"

    @staticmethod
    def restitution_at(speed, coefficient):
        return coefficient


@register
@dataclass(frozen=True, config=STRICT)
class Linear(ContactLaw):
    """Restitution 1 - restitution * v, which is negative at high speeds: no law."""

    law: Literal["linear"] = "linear"

    @staticmethod
    def restitution_at(speed, coefficient):
        return 1.0 - coefficient * speed


def made(**tables):
    return validate(Scene, tables, "scene.toml")


def dropped(law, restitution=0.0, **changes):
    """A ball that falls from rest on a plate at rest, g = 10; the ceiling is out of reach."""
    data = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1e-21}, "excitation": {"frequency": 1.0},
        "gravity": {"acceleration": G, "orientation_deg": 90.0}, "cavity": [{"name": "c", "gap": 4.0}],
        "damper": [{"cavity": "c", "mass": 2.0, "restitution": restitution, "position": HEIGHT - 2.0}],
        "contact": law, "time": {"periods": 7, "transient": 0},
    }  # fmt: skip
    return made(**(data | changes))


def two_bodies(law, first=0.2, second=0.7, **changes):
    """Two bodies that differ in mass and restitution, in one cavity of a structure that vibrates."""
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": (2 * math.pi) ** 2, "damping_ratio": 0.02},
        "excitation": {"frequency": 0.8, "force": 4.0}, "gravity": {"acceleration": 0.0},
        "initial": {"velocity": 3.0}, "cavity": [{"name": "c", "gap": 1.0}],
        "damper": [
            {"cavity": "c", "mass": 0.2, "restitution": first, "position": -0.2, "velocity": 0.3},
            {"cavity": "c", "mass": 0.3, "restitution": second, "position": 0.2},
        ],
        "contact": law, "time": {"periods": 2, "transient": 0},
    }  # fmt: skip
    return made(**(data | changes))


def by(scene, **solver):
    return scene.replace({"solver": solver})


def impacts(response):
    return [event for event in response.event_list if event.kind == "impact"]


def bounces(count, c):
    """Times of the first impacts on the plate, the speeds before them, and the restitutions."""
    times, speeds, factors = [math.sqrt(2 * HEIGHT / G)], [math.sqrt(2 * G * HEIGHT)], []
    for _ in range(count):
        factors.append(1 - c * speeds[-1] ** 0.2)
        speeds.append(speeds[-1] * factors[-1])
        times.append(times[-1] + 2 * speeds[-1] / G)
    return np.array(times[:-1]), np.array(speeds[:-1]), np.array(factors)


@pytest.fixture(scope="module")
def falls():
    return simulate(dropped({"law": "fifth root", "c": C}), events=True)


def test_bounces_of_a_ball(falls):
    """Speeds and times of 100 bounces; the map forgets: an error of a speed shrinks at every bounce."""
    found = impacts(falls)[:100]
    times, speeds, factors = bounces(len(found), C)
    np.testing.assert_allclose([event.time for event in found], times, rtol=1e-10)
    np.testing.assert_allclose([-event.relative_velocity_before for event in found], speeds, rtol=1e-10)
    np.testing.assert_allclose([event.relative_velocity_after for event in found], speeds * factors, rtol=1e-10)
    np.testing.assert_allclose([event.impulse for event in found], 2.0 * speeds * (1 + factors), rtol=1e-10)
    assert len(found) == 100
    assert speeds[-1] < 1e-3 * speeds[0]


def test_the_ball_comes_to_rest(falls):
    """In finite time, as the speeds fall like n^-5, and earlier by what the engine leaves out of the chatter.

    It ends with a flight of less than 3e-8 periods, a fifth of which times v / (v - v') are then to come.
    """
    rest = next(event for event in falls.event_list if event.kind == "rest")
    times, speeds, factors = bounces(200_000, C)
    last = np.count_nonzero(2 * speeds / G > 3e-8) - 1
    left_out = 1.3 * 3e-8 / (1 - factors[last])
    assert times[-1] - left_out < rest.time < times[-1]


def test_energy_of_the_bounces(falls):
    assert falls.status is Status.OK
    assert falls.energy_residual < 1e-12
    lost = sum(
        event.relative_velocity_before**2 - event.relative_velocity_after**2 for event in impacts(falls)
    )  # half of the mass is 1
    assert falls.energy["impact"] == pytest.approx(lost, rel=1e-12)
    assert falls.energy["impact"] == pytest.approx(2.0 * G * HEIGHT, rel=1e-12)


@pytest.mark.parametrize("scheme", [{"method": "exact"}, {"method": "solve_ivp", "rtol": RTOL}])
def test_each_pair_has_its_own_restitution(scheme):
    """Every impact in the list of events obeys the law of its pair; two bodies have the mean of theirs."""
    response = simulate(by(two_bodies({"law": "fifth root", "c": C}), **scheme), events=True)
    coefficients = {(0, "left"): 0.2, (1, "right"): 0.7, (0, "body"): math.sqrt(0.2 * 0.7)}
    seen = set()
    for event in impacts(response):
        pair = event.damper, event.side
        speed = abs(event.relative_velocity_before)
        restitution = 1 - C * (1 - coefficients[pair]) * speed**0.2
        assert abs(event.relative_velocity_after) == pytest.approx(restitution * speed, rel=1e-10)
        seen.add(pair)
    assert seen == set(coefficients)


def states(response):
    return np.column_stack([response.section, response.slip, response.slip_velocity])


def test_solve_ivp_finds_the_same():
    """Errors of the tolerance in each of some 1e3 steps, which the impacts multiply by 30."""
    scene = two_bodies({"law": "fifth root", "c": C})
    exact, ours = (simulate(by(scene, **options), events=True) for options in (
        {"method": "exact"}, {"method": "solve_ivp", "rtol": RTOL}))  # fmt: skip
    assert exact.energy_residual < 1e-12
    assert ours.energy_residual < 1e4 * RTOL
    assert len(impacts(exact)) == len(impacts(ours)) >= 8
    np.testing.assert_allclose(states(ours), states(exact), rtol=0, atol=3e4 * RTOL)
    losses = [run.energy["impact"] for run in (exact, ours)]
    assert losses[1] == pytest.approx(losses[0], rel=3e4 * RTOL)


def test_moreau_converges_in_first_order():
    """The mean over many steps, as an impact falls anywhere in its step."""
    scene = two_bodies({"law": "fifth root", "c": C})
    exact, counts, errors = states(simulate(scene))[-1], (200, 800, 3200), []
    for count in counts:
        steps = [by(scene, method="moreau", steps_per_period=count + 7 * i) for i in range(40)]
        errors.append(np.mean([np.abs(states(simulate(step))[-1] - exact).max() for step in steps]))
    assert -np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize("method", ["exact", "moreau", "solve_ivp"])
def test_a_constant_restitution_is_newtons_law(method):
    options = {"method": method} | ({} if method == "exact" else {"steps_per_period": 400})
    newton, same = (simulate(by(two_bodies({"law": law}), **options), events=True) for law in ("newton", "same"))
    assert len(newton.event_list) == len(same.event_list) > 0
    np.testing.assert_allclose(states(same), states(newton), rtol=0, atol=1e-9)
    for name, value in newton.energy.items():
        assert same.energy[name] == pytest.approx(value, rel=1e-9, abs=1e-9), name


@pytest.mark.parametrize("solver", [{"method": "penalty"}, {"method": "penalty", "scheme": "hht"}, {"method": "cosim"}])
def test_a_dashpot_has_one_restitution(solver):
    scene = by(dropped({"law": "fifth root", "c": C}), **solver)
    with pytest.raises(InputError, match=f'^contact.law: .* depends on the speed, .* not "{solver["method"]}"$'):
        simulate(scene)


def test_sweep_over_the_laws_parameter():
    """In this process and in others, which import the law with the scene."""
    values = [0.1, 0.2, 0.4]
    scene = dropped(
        {"law": "fifth root", "c": C}, sweep={"contact.c": values}, time={"periods": 1, "transient": 0}
    )  # fmt: skip
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = [sweep(scene), sweep(scene, executor=pool)]
    for result in found:
        assert list(result.status) == ["ok"] * 3
        for c, count in zip(values, result.impacts_per_period, strict=True):
            times, _, _ = bounces(1000, c)
            assert count == np.count_nonzero(times < 1.0)


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ({"law": "sixth root"}, "contact.law: must be one of 'newton', 'poisson', 'compliant', 'massless', "
         "'viscoelastic'.*, 'fifth root'.*"),
        ({"law": "fifth root"}, "contact.c: missing; it is required here"),
        ({"law": "fifth root", "c": 0.0}, r"contact.c: should be greater than 0 \(got 0.0\)"),
        ({"law": "newton", "c": 0.1}, 'contact.c: belongs to law = "fifth root", not to law = "newton"'),
        ({"law": "fifth root", "c": 0.1, "k": 1.0}, "contact.k: unknown key; known: c, law, pair"),
    ],
)  # fmt: skip
def test_refusals_know_the_law(law, message):
    with pytest.raises(InputError, match=f"^scene.toml: {message}$"):
        dropped(law)


def test_a_restitution_outside_its_range_is_refused():
    """1 - v / 2 is negative above 2 m/s."""
    with pytest.raises(
        InputError, match=r'^contact: law "linear" gives a restitution of -.* must lie between 0 and 1$'
    ):
        simulate(dropped({"law": "linear"}, restitution=0.5))


def test_what_is_no_law_is_not_registered():
    with pytest.raises(ExtensionError, match="is no contact law: derive a dataclass from ContactLaw"):
        LAWS.register(dict)
    taken = dataclasses.make_dataclass("Other", [("law", str, "newton")], bases=(ContactLaw,), frozen=True)
    with pytest.raises(ExtensionError, match="there is a contact law named newton already"):
        register(taken)
    assert isinstance(dropped({"law": "newton"}).contact, Newton)


#: runs a scene of a law with the factor `sys.argv[1]` in a process of its own, and says what it has compiled
_PROCESS = """
import sys
from tests.coupling.scene.contact_laws.test_own_law import *

@register
@dataclass(frozen=True, config=STRICT)
class Other(ContactLaw):
    law: Literal["other"] = "other"

    @staticmethod
    def restitution_at(speed, coefficient):
        return {factor} * coefficient

response = simulate(dropped({{"law": "other"}}, 1.0), events=True)
first = impacts(response)[0]
print(first.relative_velocity_after / -first.relative_velocity_before, len(run._compiled.stats.cache_misses))
"""


def test_laws_share_the_compiled_engine():
    """In one process and in others: nothing of the engine is compiled for a law, and no law is taken for another."""
    simulate(dropped({"law": "newton"}, 0.5))
    compiled = len(run._compiled.signatures)
    simulate(dropped({"law": "fifth root", "c": C}))
    assert len(run._compiled.signatures) == compiled > 0
    for factor in (0.25, 0.75):
        text = _PROCESS.format(factor=factor)
        said = subprocess.run(
            [sys.executable, "-c", text], env=environment(), capture_output=True, text=True, check=True
        ).stdout.split()
        assert float(said[0]) == pytest.approx(factor, rel=1e-12)
        assert said[1] == "0"


def test_viscoelastic_spheres(falls):
    """The law of the package, whose bodies have no restitution, is that of this file with e = 0."""
    response = simulate(dropped({"law": "viscoelastic", "coefficient": C}, 1.0), events=True)
    assert [event.time for event in response.event_list] == [event.time for event in falls.event_list]
    with pytest.raises(InputError, match=r"damper\[0\].restitution: that of a viscoelastic contact .* \(got 0.5\)"):
        dropped({"law": "viscoelastic", "coefficient": C}, 0.5)
