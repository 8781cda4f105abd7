"""Published cases of impacts and friction: what they say besides the figures of docs/validation.md."""

import math

import numpy as np
import pytest

from tests.validation.bar import MODES, Bar
from tests.validation.contact import ImpactOscillator
from tests.validation.unilateral_spring import Chain


def test_impact_oscillator_tends_to_its_orbit():
    """On the orbit every impact is the same; from beside it the motion comes back; the stop is never passed."""
    oscillator = ImpactOscillator(k=1.0, c=0.1, A=1.0, w=1.0, d=1.0, e=0.8)
    turn = oscillator.phase + np.linspace(1e-3, 2 * np.pi - 1e-3, 500)
    assert max(oscillator.state(phase)[0] for phase in turn) < 1.0
    for beside, first in ((0.0, 0), (0.05, 60)):
        events = oscillator.run(oscillator.state(1.5 * np.pi) + beside, 100).event_list
        assert len(events) == 100
        # an impact gives the ground 3e-15 of speed, and what it drifts in 100 periods moves the orbit by some 1e-10
        for event in events[first:]:
            phase = math.remainder(event.time - 0.5 * np.pi - oscillator.phase, 2 * np.pi)
            assert phase == pytest.approx(0.0, abs=1e-9)
            assert abs(event.relative_velocity_before) == pytest.approx(oscillator.speed, rel=1e-9)


def test_impact_oscillator_keeps_the_law_of_motion():
    """The closed form by itself: a period from just after an impact to just before the next."""
    oscillator = ImpactOscillator(k=2.0, c=0.3, A=1.5, w=1.7, d=0.4, e=0.6)
    begin, end = oscillator.state(oscillator.phase), oscillator.state(oscillator.phase + 2 * np.pi)
    assert begin == pytest.approx([0.4, -0.6 * oscillator.speed], abs=1e-13)
    assert end == pytest.approx([0.4, oscillator.speed], abs=1e-13)
    step, phase = 1e-4, oscillator.phase + 2.0
    before, at, after = (oscillator.state(phase + shift * step * 1.7) for shift in (-1, 0, 1))
    rate = (after - before) / (2 * step)
    force = 1.5 * math.cos(phase) - 0.3 * at[1] - 2.0 * at[0]
    assert rate == pytest.approx([at[1], force], abs=1e-6)


def test_orbit_of_nlvib_is_left_where_it_is_unstable(tmp_path):
    """Beside the peak's orbit the motion leaves it as its multiplier says; at 0.635 rad/s it comes back.

    A multiplier leaves the unit circle at -1 on the way to the peak, and a pair of them off the axis down to 0.6 rad/s.
    """
    chain = Chain(str(tmp_path))
    stable = chain.orbit(0.635, chain.settled(0.635))
    peak = chain.follow(np.linspace(0.635, 0.754, 15), stable)
    assert chain.multipliers(0.754, peak).imag == pytest.approx(np.zeros(4), abs=1e-6)
    low = chain.multipliers(0.6, chain.follow(np.linspace(0.635, 0.6, 8), stable))
    assert np.abs(low.imag[np.abs(low) > 1.0]) == pytest.approx([1.365, 1.365], abs=0.01)
    for omega, orbit, away in ((0.635, stable, False), (0.754, peak, True)):
        multiplier = np.abs(chain.multipliers(omega, orbit)).max()
        state, distances = orbit + 1e-7, []
        for _ in range(60):
            state = chain.run(omega, state)
            distances.append(np.linalg.norm(state - orbit))
        growth = (distances[-1] / distances[29]) ** (1 / 30)
        assert (growth > 1.0) == away
        # two of the multipliers at 0.635 are nearly as large as the first, in pairs that turn
        assert growth == pytest.approx(multiplier, rel=0.01 if away else 0.05)


def test_bar_converges(tmp_path):
    """Contact and mean force with the number of modes; on a spring of its own the force too, faster than squared."""
    bar = Bar(str(tmp_path))
    wall = np.array([bar.on_a_wall(modes)[:2] for modes in MODES]) - [2.0, 1.0]
    assert np.log2(np.abs(wall[:-1] / wall[1:])) == pytest.approx(1.0, abs=0.15)
    ripple = np.array([bar.on_a_spring(modes).ripple for modes in MODES])
    assert np.all(np.log2(ripple[:-1] / ripple[1:]) > 1.9)
