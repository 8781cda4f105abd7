"""Friction in the structure against solutions that share no code with the product.

Griffin's damper in 40 digits, Den Hartog's oscillator, a beam with a joint at its tip, sliders in parallel by Masing's
rule, and harmonic balance of a chain of NLvib, which converges to the exact orbit.
"""

import itertools
import math

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq, fsolve, minimize_scalar

import vanedamp as vd
from tests.coupling.scene.elements.test_joint import Matrices, Piecewise
from tests.reference.orbit_dry_friction import DryFriction
from vanedamp.coupling.system.assembly import assemble
from vanedamp.rom.reduced import ReducedModel

# --- Griffin (1980): one mode with a damper of stiffness k_d that slips at a force R
K, C, K_D = 1.0, 0.01, 0.5  # a mass and a force of 1


def in_40_digits(limit, omega):
    """Half of the peak to peak displacement: half a period from a turning point is its own mirror image.

    It sticks until the spring has gone over 2 R, then slips to the other turning point.
    """
    with mp.workdps(40):
        stiffness, damping, spring, omega, R = (mp.mpf(one) for one in (K, C, K_D, omega, limit))
        decay = damping / 2

        def moved(x, v, t, duration, k, pull):
            """x, x' a duration after t of x'' + c x' + k x + pull = sin(omega t)."""
            response = 1 / (k - omega**2 + 1j * omega * damping)
            own = mp.sqrt(k - decay**2)

            def steady(t):
                wave = response * mp.expj(omega * t)
                return wave.imag - pull / k, (1j * omega * wave).imag

            (x0, v0), (x1, v1) = steady(t), steady(t + duration)
            a, b = x - x0, (v - v0 + decay * (x - x0)) / own
            c, s, fade = mp.cos(own * duration), mp.sin(own * duration), mp.exp(-decay * duration)
            return x1 + fade * (a * c + b * s), v1 + fade * (own * (b * c - a * s) - decay * (a * c + b * s))

        def conditions(top, start, held):
            x, v = moved(top, 0, start, held, stiffness + spring, R - spring * top)
            end, speed = moved(x, v, start + held, mp.pi / omega - held, stiffness, -R)
            return x - top + 2 * R / spring, end + top, speed

        size, phase = one_harmonic(float(R), float(omega))
        guess = size, (math.pi / 2 - phase) / omega, math.acos(1 - 2 * R / K_D / size) / omega
        return mp.findroot(conditions, guess)[0]


def one_harmonic(limit, omega):
    """Amplitude and phase by Griffin's equivalent stiffness and damping of order 1."""

    def receptance(size):
        angle = math.acos(1 - 2 * limit / K_D / size)
        stiffness = K_D / math.pi * (angle - 0.5 * math.sin(2 * angle))
        return 1 / (K - omega**2 + stiffness + 1j * (omega * C + 4 * limit / math.pi / size * (1 - limit / K_D / size)))

    size = brentq(lambda size: abs(receptance(size)) - size, (1 + 1e-9) * limit / K_D, 1e3)
    return size, np.angle(receptance(size))


def griffin(limit, omega):
    return vd.find_orbit(
        vd.Scene(
            structure={"model": "rigid", "mass": 1.0, "stiffness": K, "damping": C},
            excitation={"frequency": omega / (2 * math.pi), "force": 1.0},
            friction_damper=[{"normal_force": limit, "friction": 1.0, "stiffness": K_D}],
            time={"periods": 400, "transient": 390},
        )
    ).amplitude_mean


@pytest.mark.parametrize(
    ("limit", "omega", "error"), [(0.3, 1.02, 5e-4), (0.9, 1.02, 0.036), (0.9, 1.1, 4e-4), (1.2, 1.05, 4e-3)]
)
def test_griffins_damper_in_40_digits(limit, omega, error):
    """error: of the formula of one harmonic."""
    exact = float(in_40_digits(limit, omega))
    assert griffin(limit, omega) == pytest.approx(exact, rel=1e-12)
    assert abs(one_harmonic(limit, omega)[0] / exact - 1) == pytest.approx(error, rel=0.11)


def test_the_smallest_resonance_over_griffins_preload():
    """There the amplitude depends on neither preload nor frequency; one harmonic errs by 1.5e-4."""

    def slopes(limit, omega):
        step = mp.mpf("1e-12")
        for h, g in ((step, 0), (0, step)):
            yield (in_40_digits(limit + h, omega + g) - in_40_digits(limit - h, omega - g)) / (2 * step)

    def peak(amplitude, limit):
        return -minimize_scalar(lambda omega: -amplitude(limit, omega), bounds=(1.08, 1.14), method="bounded").fun

    with mp.workdps(40):
        limit, omega = mp.findroot(lambda *at: list(slopes(*at)), (1.45, 1.118), tol=1e-20)
        lowest = float(in_40_digits(limit, omega))
    limit = float(limit)
    assert griffin(limit, float(omega)) == pytest.approx(lowest, rel=1e-12)
    assert peak(griffin, limit) == pytest.approx(lowest, rel=1e-10)
    assert min(peak(griffin, share * limit) for share in (0.95, 1.05)) > 1.002 * lowest
    assert peak(lambda *at: one_harmonic(*at)[0], limit) == pytest.approx(1.000145 * lowest, rel=1e-5)


@pytest.mark.parametrize("kind", [{"normal_stiffness": 50.0}, {"restitution": 0.5}])
@pytest.mark.parametrize(("ratio", "limit", "stops"), [(0.6, 0.2, False), (1.5, 0.3, False), (0.25, 0.6, True)])
def test_a_joint_under_a_constant_force_is_den_hartogs_friction(ratio, limit, stops, kind):
    """Den Hartog (1931): nothing moves across the joint."""
    exact = DryFriction(ratio, limit, stops)
    model = ReducedModel.from_matrices(np.eye(2), np.eye(2), {"x": 0, "across": 1}, damping=np.diag([0.0, 1.0]))
    joint = {"between": ["x", "casing"], "normal": ["across", "casing"], "preload": 2.0, "friction": limit / 2.0}
    scene = vd.Scene(
        structure=model,
        excitation={"frequency": ratio / (2 * math.pi), "force": 1.0, "at": "x"},
        joint=[joint | kind],
        time={"periods": 60, "transient": 50},
    )
    orbit = vd.find_orbit(scene)
    assert orbit.amplitude_mean == pytest.approx(exact.amplitude, rel=1e-12)
    motion = orbit.state.reshape(2, 2) @ assemble(scene).response  # of modes, whose signs are open
    assert motion == pytest.approx(exact.at(0.0), abs=1e-10)
    found = sorted(orbit.multipliers, key=abs)[-2:]
    assert sorted(np.abs(found)) == pytest.approx(sorted(np.abs(exact.multipliers)), abs=1e-5)


def twisted_beam(elements=3, turned=0.4):
    """A cantilever, stiffer in one of two planes that are turned: displacements and slopes in y, then in z."""
    length, size = 0.2 / elements, 2 * elements
    mass, bending = np.zeros((2, size + 2, size + 2))
    scale = np.array([1.0, length, 1.0, length])
    for at in range(0, size, 2):
        part = np.s_[at : at + 4, at : at + 4]
        bending[part] += np.outer(scale, scale) / length**3 * [
            [12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4],
        ]  # fmt: skip
        mass[part] += np.outer(scale, scale) * length / 420 * [
            [156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4],
        ]  # fmt: skip
    c, s = math.cos(turned), math.sin(turned)
    planes = np.array([[c, -s], [s, c]]) @ np.diag([30.0, 90.0]) @ [[c, s], [-s, c]]
    stiffness = np.kron(planes, bending[2:, 2:])
    return Matrices(np.kron(0.8 * np.eye(2), mass[2:, 2:]), stiffness, 2e-5 * stiffness)


@pytest.mark.parametrize(("preload", "opens"), [(10.0, False), (2.0, True)])
def test_a_beam_with_a_joint_at_its_tip(preload, opens):
    """The force bends it along the joint and across, as its planes are turned: it sticks, slips, reverses and opens."""
    beam, frequency, periods = twisted_beam(), 90.0, 10
    n = len(beam.mass)
    y, z = n // 2 - 2, n - 2
    joint = {"friction": 0.4, "normal_stiffness": 2e4, "preload": preload}
    sections, expected = Piecewise(beam, joint, ((z, 12.0, 0.0),), frequency, np.eye(n)[z], np.eye(n)[y]).run(periods)
    kinds = {kind for _, kind in expected}
    assert kinds == {"slip", "stick", "reverses"} | ({"detach", "impact"} if opens else set())
    made = vd.Scene(
        structure=ReducedModel.from_matrices(beam.mass, beam.stiffness, {"z": z, "y": y}, damping=beam.damping),
        excitation={"frequency": frequency, "force": 12.0, "at": "z"},
        joint=[joint | {"between": ["z", "casing"], "normal": ["y", "casing"]}],
        time={"periods": periods, "transient": 0},
    )
    response = vd.simulate(made, events=True, samples_per_period=1)
    assert abs(response.energy_residual) < 1e-10
    assert response.displacement[1:periods] == pytest.approx(sections[:-1, z], abs=1e-9 * np.abs(sections[:, z]).max())
    expected = [(time, kind) for time, kind in expected if kind != "reverses"]
    assert [event.kind for event in response.event_list] == [kind for _, kind in expected]
    times = [event.time for event in response.event_list]
    assert np.abs(np.subtract(times, [time for time, _ in expected])).max() * frequency < 1e-9


SLIDERS = [(1.0, 2e4), (2.0, 1.5e4), (3.0, 1e4), (2.0, 4e3)]  # limits N, stiffnesses N/m


def test_sliders_in_parallel_between_two_points():
    """Iwan (1966): a motion that nothing can stop, of several amplitudes. A slider slips by what exceeds its springs.

    x = X (sin w t - sin(n w t)/n) turns where cos w t = cos n w t.
    """
    mass, own, order, X = 1e12, 2 * math.pi * 7.0, 3.5, 6e-4
    omega = own / order
    none = np.zeros((2, 2))
    model = ReducedModel.from_matrices(mass * np.eye(2), mass * own**2 * np.eye(2), {"a": 0, "b": 1}, damping=none)
    force = X * mass * (own**2 - omega**2)
    load = [{"at": "a", "force": 0.7 * force}, {"at": "b", "force": 0.3 * force, "phase": 180.0}]
    made = vd.Scene(
        structure=model,
        excitation={"frequency": omega / (2 * math.pi), "at": "a", "load": load},
        friction_damper=[
            {"at": "a", "to": "b", "friction": 1.0, "normal_force": R, "stiffness": k} for R, k in SLIDERS
        ],
        time={"periods": 2, "transient": 0},
    )
    response = vd.simulate(made, events=True)

    def x(t):
        return X * (math.sin(omega * t) - math.sin(own * t) / order)

    end = 4 * math.pi / omega
    zeros = {2 * math.pi * j / (own + s * omega) for s in (1, -1) for j in range(20)}
    turns = [*sorted(t for t in zeros if t < end * (1 - 1e-9)), end]
    work, slips = 0.0, []
    for number, (R, k) in enumerate(SLIDERS):
        spring = 0.0
        for first, last in itertools.pairwise(turns):
            moved = x(last) - x(first)
            way = math.copysign(1.0, moved)
            free = (R - way * spring) / k
            if abs(moved) > free:
                work += R * (abs(moved) - free)
                slips.append((brentq(lambda t, w=way, a=first, f=free: w * (x(t) - x(a)) - f, first, last), number))
                spring = way * R
            else:
                spring += k * moved
    assert response.energy["friction"] == pytest.approx(work, rel=1e-9)
    # not those of no duration where several stop at one instant
    found = [
        event
        for event in response.event_list
        if event.kind == "slip" and min(abs(event.time - turn) for turn in turns) > 1e-7
    ]
    for number in range(len(SLIDERS)):
        expected = [time for time, of in slips if of == number]
        assert [event.time for event in found if event.damper == number] == pytest.approx(expected, rel=1e-9)


# --- the chain of NLvib's example 07 with its two sliders: masses and springs 1, dampers 0.02, a force on mass 2
CHAIN, BETWEEN = np.diag([2.0, 2, 2]) - np.eye(3, k=1) - np.eye(3, k=-1), np.array([[1.0, 0, 0], [-1, 1, 0]])


def balanced(omega, force, orders, samples=2**12):
    """Amplitude of the first mass by harmonic balance with those orders: alternating frequency and time."""
    waves = np.exp(2j * np.pi / samples * np.outer(np.arange(samples), orders))
    receptance = [np.linalg.inv((1 + 0.02j * h * omega) * CHAIN - (h * omega) ** 2 * np.eye(3)) for h in orders]

    def drawn(x):
        """Force of a slider in the second of two periods, from turning point to turning point."""
        x = np.tile(x, 2)
        ends = np.flatnonzero(np.diff(np.sign(np.diff(x)))) + 1
        pull = np.zeros(2 * samples)
        for first, last in itertools.pairwise([0, *ends, 2 * samples - 1]):
            pull[first : last + 1] = np.clip(pull[first] + 20.0 * (x[first : last + 1] - x[first]), -1.0, 1.0)
        return pull[samples:]

    def moved(slipped):
        """Orders of the masses (orders, 3) by those of the sliders (orders, 2)."""
        x = (waves @ slipped).real
        pulls = 2 / samples * waves.conj().T @ np.array([drawn(one) for one in x.T]).T
        loads = -pulls @ BETWEEN
        loads[0, 1] += force
        return np.array([one @ load for one, load in zip(receptance, loads, strict=True)])

    def residual(parts):
        slipped = parts.view(complex).reshape(-1, 2)
        return (moved(slipped) @ BETWEEN.T - slipped).ravel().view(float)

    stuck = np.linalg.inv((1 + 0.02j * omega) * CHAIN - omega**2 * np.eye(3) + 20 * BETWEEN.T @ BETWEEN)
    start = np.zeros((len(orders), 2), complex)
    start[0] = BETWEEN @ stuck[:, 1] * force
    parts = fsolve(residual, start.ravel().view(float), xtol=1e-12)
    assert np.abs(residual(parts)).max() < 1e-9
    return abs(moved(parts.view(complex).reshape(-1, 2))[0, 0])


@pytest.mark.parametrize(
    ("omega", "errors"),
    [(1.2, {1: 0.46, 5: 0.016, 9: 1.5e-3, 17: -4e-5}), (0.9, {1: 0.10, 5: 0.016, 9: -2.4e-3, 17: -3.4e-4})],
)
def test_harmonic_balance_of_a_chain_tends_to_its_orbit(omega, errors):
    """errors: of the harmonic balance, by its highest order."""
    slider = {"at": "1", "friction": 1.0, "normal_force": 1.0, "stiffness": 20.0}
    orbit = vd.find_orbit(
        vd.Scene(
            structure=ReducedModel.from_matrices(np.eye(3), CHAIN, {"1": 0, "2": 1, "3": 2}, damping=0.02 * CHAIN),
            excitation={"frequency": omega / (2 * math.pi), "at": "1", "load": [{"at": "2", "force": 4.0}]},
            friction_damper=[slider, slider | {"at": "2", "to": "1"}],
            time={"periods": 300, "transient": 290},
        )
    )
    for highest, error in errors.items():
        by_balance = balanced(omega, 4.0, np.arange(1, highest + 1, 2))
        assert by_balance / orbit.amplitude_harmonic - 1 == pytest.approx(error, rel=0.1)
