"""A collision with a wall that has modes: closed forms, an independent integration, its worth as an estimate."""

import numpy as np
import pytest
from scipy import integrate

from vanedamp.coupling.scene.contact_laws.compliant import damping_ratio
from vanedamp.rom import error_estimate as ladder
from vanedamp.rom.contact_pulse import WallContact, pulse, pulse_spectrum, share_above
from vanedamp.rom.reduced import ReducedModel


def test_pulse_spectrum():
    for ratio in (0.3, 1.0, 2.5):
        # half sine of duration pi and unit impulse: sin(t) / 2
        parts = [
            integrate.quad(lambda t, f=f, r=ratio: 0.5 * np.sin(t) * f(r * t), 0, np.pi)[0] for f in (np.cos, np.sin)
        ]
        assert pulse_spectrum(ratio) == pytest.approx(np.hypot(*parts), rel=1e-9)


@pytest.mark.parametrize("restitution", [1.0, 0.7, 0.3])
def test_pulse_of_a_free_wall(restitution):
    """Two all but free masses: impulse (1 + restitution) m, and elastic contact lasts half a period of the pair."""
    mass, wall, spring = 0.5, 2.0, 3.0
    reduced = mass * wall / (mass + wall)
    dashpot = 2 * damping_ratio(restitution) * np.sqrt(spring * reduced)
    found = pulse(np.full(1, 1e-8), np.array([1 / np.sqrt(wall)]), WallContact("wall", mass, spring, dashpot), 1e-9)
    assert found.transform == pytest.approx((1 + restitution) * reduced, rel=1e-6)
    if restitution == 1.0:
        assert found.duration == pytest.approx(np.pi * np.sqrt(reduced / spring), rel=1e-7)


def test_pulse_with_modes_against_integration():
    squares, row = np.array([1.0, 30.0, 200.0]), np.array([1.0, 0.8, -1.2])
    mass, spring, dashpot, frequency = 0.3, 80.0, 0.9, 0.7

    def rate(_time, state):
        eta, speed, (x, v), _ = np.split(state, [3, 6, 8])
        force = spring * (row @ eta - x) + dashpot * (row @ speed - v)
        return np.concatenate([speed, -squares * eta - row * force, [v, force / mass], [force, force]])

    def ended(_time, state):
        return spring * (row @ state[:3] - state[6]) + dashpot * (row @ state[3:6] - state[7])

    ended.terminal, ended.direction = True, -1
    start = np.array([0.0] * 6 + [0.0, -1.0, 0.0, 0.0])
    run = integrate.solve_ivp(
        rate, (0, 10), start, rtol=1e-11, atol=1e-13, events=ended, dense_output=True, method="DOP853"
    )
    end = run.t_events[0][0]
    found = pulse(squares, row, WallContact("wall", mass, spring, dashpot), frequency)
    assert found.duration == pytest.approx(end, rel=1e-8)
    parts = [
        integrate.quad(lambda t, f=f: ended(t, run.sol(t)) * f(2 * np.pi * frequency * t), 0, end, limit=200)[0]
        for f in (np.cos, np.sin)
    ]
    assert found.transform == pytest.approx(parts[0] - 1j * parts[1], rel=1e-7)


def test_share_above_of_two_modes():
    # the second mode is far below the contact's frequency and takes its part of a blow at once
    squares, row, collision = np.array([1.0, 25.0]), np.array([1.0, 0.5]), WallContact("wall", 0.5, 1e8)
    # reduced mass 1/(1 + 2), impulse 2/3: energy (0.5 * 2/3)^2 / 2 besides an approach with 1/6
    assert share_above(squares, row, 1, collision) == pytest.approx((1 / 18) / (1 / 6 + 1 / 18), rel=1e-4)
    assert share_above(squares, row, 2, collision) == 0.0
    # and one far above hardly moves
    assert share_above(np.array([1.0, 1e12]), row, 1, WallContact("wall", 0.5, 1e4)) < 1e-12


def test_ladder_knows_what_pulses_lack():
    """Modes above the contact's frequency yield statically: a spring in their place leaves all but no error."""
    rows = {"wall": [1.0, 0.6, 0.5]}
    model = ReducedModel.from_matrices(np.eye(3), np.diag([1.0, 9.0, 4e6]), rows, damping_ratio=0.01)

    def collisions(smaller, yields):
        lost = smaller.residual_flexibility[0, 0] if yields else 0.0
        return [WallContact("wall", 0.2, 1 / (1e-3 + lost))]

    hard = [ladder.natural_ladder(model, np.array([0.1]), collisions=lambda m, y=y: collisions(m, y)) for y in (0, 1)]
    assert [rung.modes for rung in hard[0]] == [1, 2, 3]
    # the whole model against itself: round-off of sums of terms of order one
    assert max(hard[0][-1].collision, hard[1][-1].collision) < 1e-14
    assert hard[0][0].collision > 0.02
    assert hard[1][1].collision < 0.1 * hard[0][1].collision < 1e-4
    # a contact that is not on the whole model leaves it out
    none = ladder.natural_ladder(
        model, np.array([0.1]), collisions=lambda m: [] if m.size == 3 else collisions(m, True)
    )
    assert [rung.modes for rung in none] == [1, 2]
