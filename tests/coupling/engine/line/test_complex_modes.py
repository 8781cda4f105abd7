"""Modes of subsystems whose masses, stiffnesses and dampings lie far apart: 50 digits, closed forms, limits, units."""

import math
import re

import mpmath as mp
import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from tests.coupling.engine.line.test_subsystem_motion import add_flow
from tests.reference.compliant_collision import damping_ratio
from tests.reference.multiprecision import propagator
from tests.tools.closed_form_compliant_scenes import STILL, scene
from vanedamp.coupling.engine.known import IllConditioned
from vanedamp.coupling.engine.line import complex_modes as module
from vanedamp.coupling.engine.line.complex_modes import complex_modes, real_modes
from vanedamp.coupling.engine.line.subsystem_assembly import empty_flows
from vanedamp.coupling.engine.line.subsystems import _about_centre
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.line_system import line_system
from vanedamp.coupling.system.modal_basis import ModalBasis
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import ReducedModel

EPS = np.finfo(float).eps


def struck(mass, restitution, **changes):
    """A structure of 1 kg, 10 Hz, in whose cavity a body of 1 m/s reaches the left wall after 0.01 s."""
    tables = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": (20 * math.pi) ** 2, "damping_ratio": 0.02},
        "excitation": {"frequency": 8.0},
        "cavity": [{"name": "c", "gap": 1.0}],
        "damper": [{"cavity": "c", "mass": mass, "restitution": restitution, "position": -0.49, "velocity": -1.0}],
        "contact": {"law": "compliant", "stiffness": 1e5},
        "time": {"periods": 1, "transient": 0},
    }
    return scene(**(tables | changes))


def bar(modes, hanger, masses, restitution, damping, stiffness=1e7):
    """Rows of a free bar of 750 Hz on a hanger (Hz), with bodies in a row; damping "modal" or "full"."""
    rng = np.random.default_rng(modes)
    omegas = 2 * np.pi * np.r_[hanger, 750.0 * np.arange(1, modes)]
    shapes = np.sqrt(np.r_[1.0, np.full(modes - 1, 2.0)])
    matrix = np.diag(0.004 * omegas)
    if damping == "full":
        half = rng.normal(size=(modes, modes)) * np.sqrt(0.004 * omegas[:, None] / modes)
        matrix = matrix + half @ half.T
    case = struck(1.0, restitution, excitation={"frequency": 50.0}).replace({"contact.stiffness": stiffness})
    bodies = [{"cavity": "c", "mass": mass, "restitution": restitution} for mass in masses]
    basis = ModalBasis(
        omegas**2, matrix, np.zeros((modes, 3)), {"structure": shapes}, {"structure": np.array([1.0, 0.0, 0.0])}, {}
    )
    return line_system(assemble(case.replace({"damper": bodies, "excitation.force": 1.0}), basis))


def error_of_flow(system, contacts, time):
    """Largest error of the propagator on (p, slip, p', slip') after `time`, and what round-off of its input explains.

    Coordinates count by what the rows feel of them, rates by the excitation's frequency. A relative error of 1e-16 in
    stiffnesses turns the phase of the quickest mode by that share of its turns.
    """
    closed = system.friction_rows + np.array(contacts)
    flows = add_flow(empty_flows(system), system, np.isin(np.arange(len(system.delassus)), closed))
    n, b, m = system.modes, system.bodies, flows.modes[0]
    rate, shape = flows.eigenvalue[0, 1:m], flows.shape[0, 1:m].T
    slips = flows.motion[0, :b, 1:m]
    shape = np.vstack([shape[:n], slips, shape[n:], slips * rate])
    on_structure, on_slips = flows.project[0, 1:m], flows.project_slip[0, 1:m]
    project = np.hstack([on_structure[:, :n], on_slips[:, :b], on_structure[:, n:], on_slips[:, b:]])
    found = ((shape * np.exp(rate * time)) @ project).real
    exact = propagator(system, closed, time)
    size = np.r_[1 / np.abs(system.of_structure.J).max(axis=0), np.ones(b)]
    size = np.r_[size, size * system.omega]
    error = np.array((found - exact).tolist(), float) * size / size[:, None]
    largest = np.abs(np.array(exact.tolist(), float) * size / size[:, None]).max()
    return np.abs(error).max(), EPS * (len(size) + np.abs(rate.imag).max() * time) * largest


@pytest.mark.parametrize("restitution", [0.05, 0.7, 1.0])
@pytest.mark.parametrize("mass", [1e-9, 1e-3, 1.0, 1e6, 1e9, 1e12, 1e13, 1e15])
@pytest.mark.parametrize("stiffness", [10.0, 1e5])
def test_one_mode_and_a_body(mass, restitution, stiffness):
    case = struck(mass, restitution).replace({"contact.stiffness": stiffness})
    error, bound = error_of_flow(line_system(assemble(case)), [0], 0.04)
    assert error < 8 * bound


@pytest.mark.parametrize(
    ("hanger", "masses", "restitution", "damping"),
    [
        (3.0, [400.0], 1.0, "modal"),
        (3.0, [400.0], 0.7, "full"),
        (3.0, [1e9], 0.7, "modal"),
        (3.0, [1e12], 0.05, "full"),
        (0.3, [1e-9], 0.7, "modal"),
        (3.0, [1.0, 1e12, 1e-6], 0.7, "modal"),
    ],
)
def test_a_bar_on_a_soft_hanger(hanger, masses, restitution, damping):
    system = bar(6, hanger, masses, restitution, damping)
    error, bound = error_of_flow(system, np.arange(1, len(masses) + 1), 0.006)
    # a relative error of 1e-16 in a quick mode's strain moves the hanger's mode by the ratio of their frequencies
    assert error < 8 * bound * 3750.0 / hanger


def relative(value, exact):
    return float(abs(mp.mpf(float(value)) / exact - 1))


@pytest.mark.parametrize("seed", range(4))
def test_frequencies_of_graded_chains(seed):
    """Masses and springs over thirty decades: each frequency is right to some last digits, the lowest as well."""
    rng = np.random.default_rng(seed)
    k = 5
    masses, springs = 10 ** rng.uniform(-15, 15, k), 10 ** rng.uniform(-10, 10, k)
    chain = np.eye(k) - np.eye(k, k=-1)
    modes = real_modes(np.diag(np.sqrt(masses)), np.sqrt(springs)[:, None] * chain, np.zeros((k, k)))
    with mp.workdps(100):
        exact = np.vectorize(mp.mpf, otypes=[object])
        root = np.array([mp.sqrt(mass) for mass in exact(masses)])
        matrix = (chain.T.astype(int) * exact(springs)) @ chain.astype(int) / root[:, None] / root
        squares = sorted(mp.eigsy(mp.matrix(matrix.tolist()), eigvals_only=True), reverse=True)
        errors = [relative(w, mp.sqrt(square)) for w, square in zip(modes.frequency, squares, strict=True)]
    assert max(errors) < 16 * k * EPS


def test_masses_about_their_centre():
    """A light mass beside heavy ones: no motion of the centre, and coordinates come back, entry by entry."""
    mass = np.array([1.0, 1e12, 1e-9, 1e12, 3.0])
    spread, gather = _about_centre(mass)
    assert np.abs(mass @ spread).max() <= 4 * EPS * np.abs(mass[:, None] * spread).max()
    assert gather @ spread == pytest.approx(np.eye(4), abs=4 * EPS)
    assert np.abs(gather.sum(axis=1)).max() <= 4 * EPS


def ground(restitution, stiffness=1e5, ratio=0.02):
    """(duration, velocity of the wall at its end) of the contact with a body that nothing slows down: 1 m/s, 1 kg.

    The structure on its own spring and that of the contact, whose other end moves to the left.
    """
    omega = 20 * math.pi
    dashpot = 2 * damping_ratio(restitution) * math.sqrt(stiffness)
    free = np.array([[0, 1, 0, 0], [-(omega**2) - stiffness, -2 * ratio * omega - dashpot, stiffness, -dashpot],
                     [0, 0, 0, -1.0], [0, 0, 0, 0]])  # fmt: skip

    def push(time):
        x, v, end, _ = expm(free * time)[:, 3]
        return -stiffness * (end - x) - dashpot * (-1 - v)

    times = np.linspace(1e-6, 0.03, 300)
    late = next(t for t in times if push(t) < 0)
    duration = brentq(push, late - 2e-4, late, xtol=1e-15, rtol=1e-14)
    return duration, expm(free * duration)[1, 3]


@pytest.mark.parametrize("restitution", [0.3, 0.7, 1.0])
@pytest.mark.parametrize("mass", [1e6, 1e9, 1e12, 1e13, 1e15])
def test_a_heavy_body_is_the_ground(mass, restitution):
    """A body of infinite mass cannot be slowed down; a finite one differs by the ratio of the masses."""
    response = simulate(struck(mass, restitution), events=True)
    duration, velocity = ground(restitution)
    begin, end = response.event_list[:2]
    assert response.status == Status.OK
    # a contact ends when its spring is pulled by 1e-13 of the gap, at some 1e-3 of the gap a contact
    limit = 2 / mass + 2e-10
    assert end.time - begin.time == pytest.approx(duration, rel=limit)
    assert begin.relative_velocity_after == pytest.approx(-1 - velocity, rel=limit)
    # round-off of the body's own energy, of which a thousandth counts as flow
    assert response.energy_residual < 1e-11


def test_mean_square_beside_a_heavy_body():
    """The response is as it is beside the ground, whatever the mass: differences go with its reciprocal."""
    ground, heavy = (simulate(struck(mass, 0.7)).amplitude_rms for mass in (1e10, 1e14))
    assert heavy == pytest.approx(ground, rel=1e-9)


def test_a_body_too_heavy_for_doubles_ends_the_run():
    response = simulate(struck(1e21, 0.7), events=True)
    assert response.status == Status.ILL_CONDITIONED
    assert [event.kind for event in response.event_list] == ["impact"]


def in_units(case, mass, length, time):
    """The same scene in other units: numbers times these factors. Its damping is a ratio, its gravity zero."""
    values = {
        "structure.mass": mass, "structure.stiffness": mass / time**2, "excitation.frequency": 1 / time,
        "cavity.0.gap": length, "damper.0.mass": mass, "damper.0.position": length, "damper.0.velocity": length / time,
        "contact.stiffness": mass / time**2,
    }  # fmt: skip

    def value(path):
        node = case.to_dict()
        for step in path.split("."):
            node = node[int(step)] if step.isdigit() else node[step]
        return node

    return case.replace({path: value(path) * factor for path, factor in values.items()})


@pytest.mark.parametrize(
    ("restitution", "ratio", "gravity"), [(1.0, 0.0, 0.0), (0.7, 0.002, 9.81)], ids=["elastic", "upright"]
)
def test_energies_beside_a_soft_hanger(restitution, ratio, gravity, tmp_path):
    """Sixty modes up to 3e5 Hz on a hanger of 3 Hz, and a body of 400 times the mass: each impact keeps its digits.

    Round-off of each of some hundred impacts is 1e-16 of the energies, at the condition of the states.
    """
    omegas = 2 * np.pi * np.r_[3.0, 4900.0 * np.arange(1, 60)]
    model = ReducedModel.from_matrices(
        mass=np.eye(60),
        stiffness=np.diag(omegas**2),
        damping=np.diag(2 * ratio * omegas),
        interface={"end": np.sqrt(np.r_[1.0, np.full(59, 2.0)])},
    )
    model.save(tmp_path / "bar.h5")
    body = {"cavity": "c", "mass": 400.0, "restitution": restitution, "velocity": 0.05}
    response = simulate(
        scene(
            structure={"model": "rom", "file": str(tmp_path / "bar.h5")},
            excitation={"frequency": 2000.0, "at": "end", "force": 1e4},
            gravity={"acceleration": gravity, "orientation_deg": 90.0},
            cavity=[{"name": "c", "gap": 1e-6, "floor": "end"}],
            damper=[body],
            contact={"law": "compliant", "stiffness": 1e10},
            time={"periods": 50, "transient": 0},
        )
    )
    assert response.status == Status.OK
    assert response.counters["impacts"] > 50
    # upright, the slow pair swings about an equilibrium far away: round-off there is 1e-14 of the body's energy, which
    # is a million times what flows
    assert response.energy_residual < (1e-8 if gravity else 1e-11)


UNITS = [(2.0**-10, 2.0**10, 2.0**10), (2.0**40, 2.0**-20, 2.0**-30), (1e-3, 1e3, 1e3), (1e3, 1e6, 1e-9)]


@pytest.mark.parametrize("units", UNITS)
@pytest.mark.parametrize("mass", [1e-9, 0.01, 1e6, 1e15])
def test_units_do_not_matter(mass, units):
    case = struck(mass, 0.7).replace({"time.periods": 3})
    here, there = (simulate(one, events=True) for one in (case, in_units(case, *units)))
    assert here.status == there.status == Status.OK
    assert [(event.kind, event.side) for event in here.event_list] == [
        (event.kind, event.side) for event in there.event_list
    ]
    for one, other in zip(here.event_list, there.event_list, strict=True):
        assert other.time / units[2] == pytest.approx(one.time, rel=1e-9)


CLOSE = [sign * 10.0**-k for k in range(1, 17) for sign in (1, -1)]


@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), *UNITS[2:]])
def test_a_critically_damped_structure(units):
    """Refused within some 1e-14 of critical damping, in all units; otherwise the closed form."""
    for excess in CLOSE:
        mass, length, time = units
        case = scene(
            structure={"model": "rigid", "mass": mass, "stiffness": mass / time**2, "damping_ratio": 1.0 + excess},
            excitation={"frequency": 1 / time},
            initial={"displacement": length},
            time={"periods": 1, "transient": 0},
        )
        if abs(excess) < 3e-15:
            name = f"the mode of {1 / (2 * math.pi * time):.6g} Hz is critically damped"
            with pytest.raises(InputError, match=re.escape(name)):
                simulate(case)
        elif abs(excess) > 1e-13:
            response = simulate(case)
            with mp.workdps(50):
                half, root = mp.mpf(1.0 + excess), mp.sqrt(mp.mpc(mp.mpf(1.0 + excess) ** 2 - 1))
                exact = (mp.exp(-half) * (mp.cosh(root) + half * mp.sinh(root) / root)).real
            # two large exponentials cancel: round-off grows by the condition 1/sqrt(2 excess)
            limit = 16 * EPS / math.sqrt(2 * abs(excess))
            assert response.section[-1, 0] / length == pytest.approx(float(exact), abs=limit)
            # the energies lose no more, but for forms of modes with a condition up to 100
            limit, rate = 4 * limit + 1e-11, (mp.exp(-half) * mp.sinh(root) / root).real
            lost = (1 - exact**2 - rate**2) / 2
            unit = mass * (length / time) ** 2
            assert response.status is Status.OK and response.energy_residual < limit
            assert response.energy["viscous"] / unit == pytest.approx(float(lost), abs=limit)


@pytest.mark.parametrize("units", [(1.0, 1.0, 1.0), *UNITS[2:]])
def test_a_critically_damped_contact_ends_the_run_with_a_status(units):
    """A collision of restitution exp(-2) is critically damped: within round-off of that the run ends, in all units."""
    mass, length, time = units
    for excess in CLOSE:
        restitution = math.exp(-2) * (1 + excess)
        case = scene(
            structure=STILL,
            excitation={"frequency": 4.0 / time},
            cavity=[{"name": "c", "gap": length}],
            damper=[{"cavity": "c", "mass": 0.5 * mass, "restitution": restitution, "position": 0.2 * length,
                     "velocity": 2.0 * length / time}],
            contact={"law": "compliant", "stiffness": 1e4 * mass / time**2},
            time={"periods": 1, "transient": 0},
        )  # fmt: skip
        response = simulate(case, events=True)
        ended = abs(excess) <= 1e-13
        allowed = {Status.ILL_CONDITIONED} if ended else {Status.OK}
        # here round-off decides whether doubles resolve the subsystem
        near = 1e-15 < abs(excess) < 3e-13
        assert response.status in ({Status.OK, Status.ILL_CONDITIONED} if near else allowed)
        if response.status != Status.ILL_CONDITIONED:
            limit = 1e-9 + 64 * EPS / math.sqrt(abs(excess))
            assert response.event_list[0].relative_velocity_after * time / length == pytest.approx(
                -2 * restitution, rel=limit
            )


def test_equal_oscillators_that_damping_couples():
    """Of equal modes any combination is a mode: the propagator is still that of the matrix exponential."""
    rng = np.random.default_rng(3)
    frequency = np.array([2.0, 2.0, 2.0, 5.0])
    for rank in (1, 2, 3, 4):
        half = rng.normal(size=(4, rank))
        damping = 0.1 * half @ half.T
        values, vectors, inverse = complex_modes(frequency, damping)
        whole = np.block([[np.zeros((4, 4)), np.eye(4)], [-np.diag(frequency**2), -damping]])
        assert ((vectors * np.exp(values)) @ inverse).real == pytest.approx(expm(whole), abs=1e-13)


def waves(sectors, bodies, detuned):
    """A ring of chains of two with bodies held to some tips: inertia, elastic and loss factors of its modes."""
    n = 2 * sectors
    K = np.zeros((n, n))
    for s in range(sectors):
        for a, b, k in ((2 * s, 2 * s + 1, 6.0), (2 * s, (2 * s + 2) % n, 0.02)):
            K[[a, b], [a, b]] += k
            K[[a, b], [b, a]] -= k
        K[2 * s, 2 * s] += 1.0 + detuned * math.cos(s * s)
    squares, shapes = np.linalg.eigh(K)
    frequency = np.sqrt(squares)
    inertia = np.vstack([np.eye(n), 0.15 * shapes[2 * np.array(bodies, int) + 1]])
    return inertia, np.diag(frequency), np.diag(0.01 / frequency)


@pytest.mark.parametrize("detuned", [0.0, 0.03])
@pytest.mark.parametrize("bodies", [(0,), (0, 1), (0, 3), (0, 4, 8), (1, 2, 5, 9), range(12)])
def test_many_modes_that_damping_hardly_couples(bodies, detuned, monkeypatch):
    """A tuned ring has equal modes, also with bodies in a pattern that repeats: found quickly, and without QR."""
    inertia, elastic, loss = waves(12, bodies, detuned)
    for name in ("_coupled", "_far_apart"):
        monkeypatch.setattr(module, name, None)
    real = real_modes(inertia, elastic, loss)
    q = len(real.frequency)
    assert real.shape.T @ inertia.T @ inertia @ real.shape == pytest.approx(np.eye(q), abs=1e-13)
    assert real.shape.T @ elastic.T @ elastic @ real.shape == pytest.approx(np.diag(real.frequency**2), abs=1e-12)
    assert real.shape @ real.project == pytest.approx(np.eye(q), abs=1e-13)
    values, vectors, inverse = complex_modes(real.frequency, real.damping)
    whole = np.block([[np.zeros((q, q)), np.eye(q)], [-np.diag(real.frequency**2), -real.damping]])
    assert whole @ vectors == pytest.approx(vectors * values, abs=1e-13)
    assert ((vectors * np.exp(values)) @ inverse).real == pytest.approx(expm(whole), abs=1e-12)
    assert inverse @ vectors == pytest.approx(np.eye(2 * q), abs=1e-12)


def test_many_modes_far_apart_or_strongly_coupled():
    """What is not found the quick way is found the other way, to the same equation."""
    rng = np.random.default_rng(5)
    for frequency, damping in (
        (np.linspace(1.0, 1.01, 24), 0.2), (np.geomspace(1.0, 1e5, 24), 1e-3), (np.ones(24), 1e-3),
    ):  # fmt: skip
        half = rng.normal(size=(24, 24)) / 24
        loss = damping * half @ half.T
        real = real_modes(np.vstack([np.eye(24), half]), np.diag(frequency), loss)
        values, vectors, inverse = complex_modes(real.frequency, real.damping)
        whole = np.block([[np.zeros((24, 24)), np.eye(24)], [-np.diag(real.frequency**2), -real.damping]])
        size = np.abs(whole) @ np.abs(vectors)
        assert (np.abs(whole @ vectors - vectors * values) <= 1e-12 * size).all()
        assert inverse @ vectors == pytest.approx(np.eye(48), abs=1e-9)


@pytest.mark.parametrize("sign", [1, -1])
def test_modes_that_nearly_coalesce(sign):
    """Two oscillators that a damper couples, in phase critically damped but for an excess: right to its condition."""
    for k in range(1, 14):
        excess = 10.0**-k
        turn = np.array([[0.6, -0.8], [0.8, 0.6]])
        frequency, damping = np.array([1.5, 1.5]), turn @ np.diag([3.0 * (1 + sign * excess), 0.3]) @ turn.T
        values, vectors, inverse = complex_modes(frequency, (damping + damping.T) / 2)
        whole = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag(frequency**2), -damping]])
        error = ((vectors * np.exp(values)) @ inverse).real - expm(whole)
        assert np.abs(error).max() < 64 * EPS / math.sqrt(excess)
        # the engine takes one of each pair, twice
        upper = np.flatnonzero(values.imag >= 0)
        twice = np.where(values[upper].imag > 0, 2.0, 1.0)
        error = ((vectors[:, upper] * twice * np.exp(values[upper])) @ inverse[upper]).real - expm(whole)
        assert np.abs(error).max() < 64 * EPS / math.sqrt(excess)


def test_modes_that_coalesce_are_refused():
    with pytest.raises(IllConditioned, match="critically damped"):
        complex_modes(np.array([3.0, 1.0]), np.diag([0.1, 2.0]))
    with pytest.raises(IllConditioned, match="critically damped"):
        complex_modes(np.array([1.5, 1.5]), np.array([[2.0, 1.0], [1.0, 2.0]]))
