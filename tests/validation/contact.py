"""Impacts and friction of the exact engine against published cases."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from tests.reference import orbit_impact_oscillator
from tests.tools.closed_form_compliant_scenes import stop
from tests.tools.closed_form_scenes import ball, one_to_one, period_one_start, rubbing, scene, table
from tests.validation.bar import bar_on_a_spring, bar_on_a_wall, falling_bar
from tests.validation.page import Case, Figure, case
from tests.validation.unilateral_spring import unilateral_spring
from vanedamp.coupling.response.response import Response
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.simulation import simulate

# a body so heavy that it is the ground: what an impact gives it in speed is below round-off of the structure's
GROUND = 1e15


class ImpactOscillator(orbit_impact_oscillator.ImpactOscillator):
    """The oscillator below a stop, with runs of the engine in which a heavy body is the stop."""

    def run(self, start: np.ndarray, periods: int) -> Response:
        """The engine's motion from a state at phase -pi/2, where its force A sin(w t) begins."""
        half_gap = 10.0
        return simulate(
            scene(
                structure={"model": "rigid", "mass": 1.0, "stiffness": self.k, "damping": self.c},
                initial={"displacement": start[0], "velocity": start[1]},
                excitation={"frequency": self.w / (2 * np.pi), "force": self.A},
                gravity={"acceleration": 0.0},
                cavity=[{"name": "c", "gap": 2 * half_gap}],
                damper=[
                    {"cavity": "c", "mass": GROUND, "restitution": self.e, "position": self.d - half_gap - start[0],
                     "velocity": -start[1]}
                ],
                time={"periods": periods, "transient": 0},
            ),
            events=True,
        )  # fmt: skip


@case(
    "impact oscillator",
    "COCO, demo `impact` of its toolbox `hspo` (Dankowicz and Schilder 2013, Example 15.2); closed form",
    "tests/validation/test_published_contact.py::test_impact_oscillator_tends_to_its_orbit",
)
def impact_oscillator() -> list[Figure]:
    """The parameters of the demo; it starts its continuation from rounded states, which belong to the orbit."""
    oscillator = ImpactOscillator(k=1.0, c=0.1, A=1.0, w=1.0, d=1.0, e=0.8)
    start = oscillator.state(1.5 * np.pi)
    assert np.allclose(oscillator.state(np.pi), [-0.98, -0.29], atol=0.005)
    response = oscillator.run(start + 0.05, 100)
    last = response.event_list[-1]
    phase = math.remainder(last.time - 0.5 * np.pi, 2 * np.pi)
    return [
        Figure("phase of the impact, rad, after 100 periods", oscillator.phase, phase, 1e-9),
        Figure("speed before it", oscillator.speed, abs(last.relative_velocity_before), 1e-10),
        Figure("phase, as the demo starts from", "0.076", phase, 0.0005 / 0.076),
        Figure("speed after it, as the demo starts from", "1.36", abs(last.relative_velocity_after), 0.005 / 1.36),
    ]


@case(
    "two impacts per period",
    "Theurich and Krack; code of tobiaswdm/CC",
    "tests/coupling/engine/line/test_closed_forms.py::test_one_to_one_impact_regime",
)
def one_to_one_regime() -> list[Figure]:
    """The theory neglects terms of the order of the body's share of the mass, 0.005."""
    figures = []
    for xi, ratio in ((0.3, 0.99), (0.45, 0.985), (0.6, 1.0), (0.66, 1.005)):
        data, half_gap, attached = one_to_one(xi, ratio)
        response = simulate(data)
        figures += [
            Figure(f"amplitude over half gap, frequency {ratio}", xi, response.amplitude_harmonic / half_gap, 5e-3),
            Figure(f"attached mass fraction, {ratio}", attached, float(response.attached_mass_fraction or 0.0), 1e-2),
        ]
    return figures


@case(
    "ball on a shaking table",
    "Holmes (1982), J. Sound Vib. 84",
    "tests/coupling/engine/line/test_closed_forms.py::test_bouncing_ball_period_one",
)
def bouncing_ball() -> list[Figure]:
    """The orbit with one impact a period doubles where a multiplier of the engine's period map is -1."""
    figures = []
    for restitution, published in ((0.5, "1.52682"), (0.7, "1.17073")):
        fall = 5.0 + 5.0 * (1 - restitution) / (1 + restitution)
        response = simulate(period_one_start(restitution, 0.97 * float(published)), events=True)
        impacts = [event for event in response.event_list if event.kind == "impact"]
        speed = abs(impacts[-1].relative_velocity_before)
        doubling = brentq(
            lambda ratio, e=restitution: _doubling(e, ratio), 0.98 * float(published), 1.02 * float(published)
        )
        figures += [
            Figure(f"approach speed, restitution {restitution}, m/s", fall, speed, 1e-9),
            Figure(f"A w^2/g where the period doubles, {restitution}", published, float(doubling), 5e-6),
        ]
    return figures


def _doubling(restitution: float, ratio: float) -> float:
    """det(J + 1) of the period map's Jacobian J at the periodic orbit, by central differences."""
    data = period_one_start(restitution, ratio).replace({"time": {"periods": 1, "transient": 0}})
    body = data.damper[0]
    nothing, start = np.zeros(0), np.array([body.position, body.velocity])

    def moved(change: np.ndarray) -> np.ndarray:
        slip, speed = start + change
        given = RestartState(nothing, nothing, np.array([slip]), np.array([speed]), nothing, np.full(2, 2e3))
        final = simulate(data, start=given).final
        assert final is not None
        return np.array([final.slip[0], final.slip_velocity[0]])

    step = 1e-5
    jacobian = np.array([(moved(step * axis) - moved(-step * axis)) / (2 * step) for axis in np.eye(2)]).T
    return float(np.linalg.det(jacobian + np.eye(2)))


@case(
    "ball that comes to rest", "closed form", "tests/coupling/engine/line/test_closed_forms.py::test_ball_comes_to_rest"
)
def ball_at_rest() -> list[Figure]:
    figures = []
    for restitution in (0.5, 0.9):
        data = ball(restitution, 1e-20, velocity=1.0, periods=3, time={"periods": 3, "transient": 0})
        (rest,) = [event for event in simulate(data, events=True).event_list if event.kind == "rest"]
        exact = 2 / (10 * (1 - restitution))
        figures.append(Figure(f"end of the chatter, restitution {restitution}, s", exact, rest.time, 1e-6))
    return figures


@case(
    "mass on an elastic stop",
    "Code_Aster SDND101",
    "tests/coupling/engine/line/test_compliant_contacts.py::test_stop_of_a_spring_and_mass",
)
def elastic_stop() -> list[Figure]:
    response = simulate(stop(), events=True)
    begin, end = response.event_list
    return [
        Figure("contact, s", "0.03126", end.time - begin.time, 5e-6 / 0.03126),
        Figure("peak force, N", "9950.4", 1e6 * response.amplitude_max, 1e-5),
    ]


@case(
    "free decay with Coulomb friction",
    "Code_Aster SDND100",
    "tests/coupling/engine/line/test_closed_forms.py::test_free_decay_with_coulomb_friction",
)
def free_decay() -> list[Figure]:
    start = {"initial": {"displacement": 0.85e-3}, "time": {"periods": 4, "transient": 0}}
    response = simulate(rubbing(100 / (2 * np.pi), **start), samples_per_period=2)
    turns = [(-1) ** n * (0.85e-3 - 2e-4 * n) for n in range(5)]
    pairs = zip(turns, response.displacement, strict=False)
    return [Figure(f"turning point {n}, m", turn, float(x), 1e-11) for n, (turn, x) in enumerate(pairs) if n]


@case(
    "mass on a shaking table",
    "Code_Aster SDND104",
    "tests/coupling/engine/line/test_closed_forms.py::test_shaking_table_dissipation",
)
def shaking_table() -> list[Figure]:
    def rests(acceleration: float) -> bool:
        data = table(acceleration).replace({"time.periods": 200, "time.transient": 100})
        return any(event.kind == "stick" and event.time > 100 for event in simulate(data, events=True).event_list)

    low, high = 1.8, 1.9
    while high - low > 1e-10:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rests(middle) else (low, middle)
    power = simulate(table(1.01)).energy["friction"] / 0.1 / 8
    return [
        Figure("mean power of friction, W, 1.01 m/s^2", "2.26164e-4", power, 1e-3),
        Figure("m/s^2 above which it slides without a stop", math.sqrt(1 + math.pi**2 / 4), low, 1e-9),
    ]


@case(
    "oscillator with dry friction",
    "Den Hartog (1931)",
    "tests/coupling/engine/line/test_closed_forms.py::test_den_hartog",
)
def den_hartog() -> list[Figure]:
    r, ratio = 0.6, 0.2
    v, u = 1 / (1 - r**2), math.sin(math.pi / r) / (r * (1 + math.cos(math.pi / r)))
    steady = {"time": {"periods": 3000, "transient": 2900}}
    response = simulate(rubbing(r * 100 / (2 * np.pi), force=1.0, friction=0.1 * ratio, **steady))
    exact = math.sqrt(v**2 - (ratio * u) ** 2)
    return [Figure("amplitude, forces 0.2, frequencies 0.6", exact, 1e4 * response.amplitude_max, 1e-6)]


CASES: tuple[Case, ...] = (
    impact_oscillator, unilateral_spring, one_to_one_regime, bouncing_ball, ball_at_rest, bar_on_a_wall,
    bar_on_a_spring, falling_bar, elastic_stop, free_decay, shaking_table, den_hartog,
)  # fmt: skip
