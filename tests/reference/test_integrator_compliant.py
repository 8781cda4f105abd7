"""The reference integrator with compliant contacts and Jenkins elements, against closed forms and its own ledger."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.reference.compliant_collision import contact_time, damping_ratio
from tests.reference.integrator import agreement, integrate
from tests.reference.ledger import imbalance, ledger
from tests.tools.closed_form_compliant_scenes import collision, jenkins, jenkins_turns, pile, stop
from tests.tools.random_scenes import random_compliant, random_jenkins

KINDS = [
    ("rigid", 1, ""), ("prescribed", 1, ""), ("rigid", 2, ""), ("rigid", 2, "shared"), ("rom", 2, ""),
    ("rom", 2, "separate"), ("rom", 2, "shared separate"),
]  # fmt: skip
RESTITUTIONS = [0.05, 0.1, 0.5, 0.7, 0.9, 1.0]


def test_damping_of_a_restitution():
    known = {0.5: 0.255275638, 0.7: 0.122214748, 0.9: 0.034265204, math.exp(-2): 1.0}
    for restitution, zeta in known.items():
        assert damping_ratio(restitution) == pytest.approx(zeta, rel=1e-7)
    assert contact_time(1 - 1e-6) == pytest.approx(contact_time(1 + 1e-6), rel=1e-5) == pytest.approx(2.0, rel=1e-5)


@pytest.mark.parametrize("partner", ["wall", "structure", "body"])
@pytest.mark.parametrize("restitution", RESTITUTIONS)
def test_collision(partner, restitution):
    case, mass = collision(partner, restitution)
    result = integrate(case, 1)
    begin, end = result.events
    sign = -1.0 if partner == "body" else 1.0
    assert (begin.kind, end.kind) == ("impact", "detach")
    assert begin.time == pytest.approx(0.15, rel=1e-12)
    duration = contact_time(damping_ratio(restitution)) / math.sqrt(1e4 / mass)
    assert end.time - begin.time == pytest.approx(duration, rel=1e-9)
    assert begin.relative_velocity_before == pytest.approx(sign * 2.0, rel=1e-12)
    assert begin.relative_velocity_after == pytest.approx(-sign * 2.0 * restitution, rel=1e-9)
    assert begin.impulse == pytest.approx(2.0 * mass * (1 + restitution), rel=1e-9)
    energies = ledger(result)
    assert energies["contact"] == pytest.approx(mass * 2.0 * (1 - restitution**2), rel=1e-9, abs=1e-9)


def test_stop_of_a_spring_and_mass():
    """Code_Aster SDND101: contact 0.03126 s, peak force 9950.4 N."""
    result = integrate(stop(), 1)
    begin, end = result.events
    omega = math.sqrt(1.01e6 / 100.0)
    assert end.time - begin.time == pytest.approx(math.pi / omega, rel=1e-9) == pytest.approx(0.03126, abs=5e-6)
    time = np.linspace(0.0, end.time, 2001)
    assert 1e6 * result.x(time).max() == pytest.approx(1e6 / omega, rel=1e-9) == pytest.approx(9950.4, abs=0.05)


@pytest.mark.parametrize(("bodies", "periods"), [(1, 2), pytest.param(3, 8, marks=pytest.mark.slow)])
def test_bodies_settle_on_their_springs(bodies, periods):
    case = pile(bodies)
    result = integrate(case, periods)
    masses = np.array([damper.mass for damper in case.damper])
    weights = 10.0 * masses[::-1].cumsum()[::-1]
    assert result.position == pytest.approx(-5.0 - (weights / 1e4).cumsum(), rel=1e-12)
    assert imbalance(ledger(result)) < 1e-12


@pytest.mark.parametrize(
    ("displacement", "limit", "stiffness"), [(2e-3, 2.0, 3e4), (5e-3, 5.0, 3e3), (-1e-3, 1.0, 1e5)]
)
def test_free_decay_with_a_jenkins_element(displacement, limit, stiffness):
    case = jenkins(limit, stiffness, initial={"displacement": displacement})
    turns = jenkins_turns(displacement, limit, stiffness)
    result = integrate(case, 10)
    times, values = np.array(turns).T
    assert len(turns) > 3
    assert result.x(times) == pytest.approx(values, rel=1e-9)
    sticks = [event.time for event in result.events if event.kind == "stick"]
    assert sticks[: len(times) - 1] == pytest.approx(times[1:], rel=1e-9)
    assert imbalance(ledger(result)) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("structure", "bodies", "where"), KINDS)
def test_energy_of_compliant_contacts(structure, bodies, where, seed):
    case, reduced = random_compliant(seed, structure, bodies, where)
    result = integrate(case, 3, reduced)
    assert imbalance(ledger(result)) < 1e-11
    finer = integrate(case, 3, reduced, rtol=1e-13, step=0.05)
    end = agreement(result, finer, 1e-9)
    found, expected = ([e for e in run.events if e.time < end] for run in (result, finer))
    assert [(e.kind, e.damper, e.side) for e in found] == [(e.kind, e.damper, e.side) for e in expected]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("structure", ["rigid", "rom"])
@pytest.mark.parametrize("law", ["newton", "compliant"])
def test_energy_of_jenkins_elements(structure, law, seed):
    case, reduced = random_jenkins(seed, structure, 1, law)
    assert imbalance(ledger(integrate(case, 3, reduced))) < 1e-11
