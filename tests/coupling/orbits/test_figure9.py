"""Bifurcations beside the scatter of the paper's figure 9, for its three gaps, and runs beside them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.reference.orbit_gap_oscillator import GapOscillator
from tests.tools.closed_form_scenes import scene
from vanedamp.coupling.orbits.orbits import orbits
from vanedamp.coupling.simulation import simulate

MASS, STIFFNESS, RATIO, AMPLITUDE = 0.15696, 3.6046e7, 0.002, 7e-5
NATURAL = math.sqrt(STIFFNESS / MASS) / (2 * math.pi)


def figure9(gap, frequency, position=0.49, **tables):
    """The scene; gap in amplitudes without bodies, frequency in natural ones, position of the body in gaps."""
    return scene(
        structure={"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": RATIO},
        excitation={
            "frequency": frequency * NATURAL, "resonance_amplitude": AMPLITUDE, "resonance_near": NATURAL,
        },
        cavity=[{"name": "c1", "gap": gap * AMPLITUDE}],
        damper=[{"cavity": "c1", "mass": 0.02 * MASS, "friction": 0.4, "restitution": 0.7,
                 "position": position * gap * AMPLITUDE}],
        **{"time": {"periods": 3000, "transient": 2000}} | tables,
    )  # fmt: skip


def places(kind, gap, start, to, **table):
    """Frequencies of the special points of a kind on the branch from where a run settles, in natural ones."""
    begun = {"from": start * NATURAL, "to": to * NATURAL} | table.pop("orbit", {})
    (branch,) = orbits(figure9(gap, start, orbit=begun, **table)).branches
    return branch, [point.parameter / NATURAL for point in branch.special if point.kind == kind]


def closed_form(gap):
    force = AMPLITUDE * 2 * RATIO * STIFFNESS * math.sqrt(1 - RATIO**2)  # of the undamped resonance's amplitude
    return GapOscillator(
        MASS, 2 * RATIO * math.sqrt(STIFFNESS * MASS), STIFFNESS, 0.02 * MASS, gap * AMPLITUDE / 2, 0.7, force,
        2 * math.pi * NATURAL,
    )  # fmt: skip


@pytest.mark.slow
def test_half_the_gap_loses_its_symmetry_and_later_its_period():
    """Two impacts up to a pitchfork, three up to a Neimark-Sacker point: runs beyond do not repeat.

    The pitchfork is the closed form's but for friction, whose force is 1/1600 of the inertia of the body.
    """
    branch, found = places("pitchfork", 0.5, 0.96, 0.975)
    unit = 2 * math.pi * NATURAL
    assert found[0] == pytest.approx(closed_form(0.5).pitchfork(0.97 * unit, 0.974 * unit) / unit, abs=2e-4)
    assert branch.stable[branch.parameter < found[0] * NATURAL].all()
    (found,) = places("neimark-sacker", 0.5, 0.99, 0.992)[1]
    assert found == pytest.approx(0.99062943, abs=1e-7)
    start = simulate(figure9(0.5, 0.99)).final
    for frequency, kind in ((found - 2e-4, "periodic-1"), (found + 4e-4, "non-periodic")):
        data = figure9(0.5, frequency, time={"periods": 6000, "transient": 5000})
        assert simulate(data, start=start).classification == kind


@pytest.mark.slow
def test_from_rest_in_the_middle_half_the_gap_scatters_by_a_doubling_of_three_impacts():
    branch, found = places("period doubling", 0.5, 0.98, 0.983, position=0.0)
    assert found == pytest.approx([0.981309], abs=2e-5) and set(branch.impacts_per_period) == {3}
    long = {"time": {"periods": 8000, "transient": 7000}, "position": 0.0}
    for frequency, kind in ((0.976, "no-contact"), (0.98125, "periodic-1"), (0.9815, "periodic-2")):
        assert simulate(figure9(0.5, frequency, **long)).classification == kind
    # as a whole: no contact below, and a motion that its transient has brought to the walls above
    for frequency, kind in ((0.9885, "no-contact"), (0.9895, "non-periodic")):
        assert simulate(figure9(1.0, frequency, **long)).classification == kind


@pytest.mark.slow
def test_a_tenth_of_the_gap_doubles_its_period():
    found = places("period doubling", 0.1, 0.95, 0.953)[1]
    assert found == pytest.approx([0.95218538], abs=1e-7)
    for frequency, kind in ((found[0] - 2e-4, "periodic-1"), (found[0] + 4e-4, "periodic-2")):
        data = figure9(0.1, frequency, time={"periods": 6000, "transient": 5000})
        assert simulate(data).classification == kind


@pytest.mark.slow
def test_a_body_in_the_middle_of_the_reference_gap_is_touched_where_its_reach_ends():
    """A body in the middle is out of reach up to half an undamped amplitude; two impacts per period are not stable."""
    branch, found = places("grazing", 1.0, 0.995, 0.9975, position=0.0)
    assert branch.amplitude_mean[-1] / AMPLITUDE == pytest.approx(0.5, abs=1e-4)
    # |1 - r^2 + 2 i D r| is twice that of the resonance
    squares = np.roots([1.0, 4 * RATIO**2 - 2.0, 1.0 - 16 * RATIO**2 * (1 - RATIO**2)])
    assert found[0] == pytest.approx(math.sqrt(squares.min()), abs=1e-5)
    for share in np.linspace(0.93, 1.03, 51):
        orbit = replace(closed_form(1.0), omega=2 * math.pi * NATURAL * share)
        assert not orbit.inside or np.abs(orbit.multipliers).max() > 1


def borders(gap, start, to, low, high, within, kinds, position=0.49):
    """Borders over the gap, between two in amplitudes, by their kinds: frequencies in natural ones and gaps."""
    track = {
        "parameter": "cavity.c1.gap", "from": low * AMPLITUDE, "to": high * AMPLITUDE, "kinds": kinds,
        "within": [share * NATURAL for share in within],
    }  # fmt: skip
    table = {"from": start * NATURAL, "to": to * NATURAL, "track": track}
    found = {border.kind: border for border in orbits(figure9(gap, start, position, orbit=table)).borders}
    assert sorted(found) == sorted(kinds)
    return found


@pytest.mark.slow
def test_the_doublings_of_half_and_a_tenth_of_the_gap_are_one_border():
    """And over wider gaps it turns back: at 0.7 and more the motion of three impacts has none."""
    (border,) = borders(0.5, 0.98, 0.983, 0.1, 0.7, (0.95, 0.987), ["period doubling"], position=0.0).values()
    places = np.column_stack([border.parameter / NATURAL, border.second / AMPLITUDE])
    tenth = places[np.isclose(places[:, 1], 0.1)]
    assert tenth.min(axis=0) == pytest.approx([0.95218538, 0.1], abs=1e-7)
    (turn,) = (point for point in border.special if point.kind == "extremum")
    assert turn.second == pytest.approx(border.second.max(), rel=1e-3) and turn.second / AMPLITUDE < 0.64


@pytest.mark.slow
def test_fold_and_pitchfork_meet_in_points_of_codimension_two():
    """Both borders are followed on their own, and have the same points where both conditions hold."""
    found = borders(0.5, 0.96, 0.995, 0.48, 0.9, (0.965, 0.995), ["fold", "pitchfork"])
    meet = {
        kind: np.array(sorted(
            [point.parameter / NATURAL, point.second / AMPLITUDE]
            for point in border.special if point.kind == "fold-pitchfork"
        ))
        for kind, border in found.items()
    }  # fmt: skip
    assert meet["fold"] == pytest.approx(meet["pitchfork"], abs=1e-8)
    assert meet["fold"] == pytest.approx(np.array([[0.982314, 0.809811], [0.990541, 0.503703]]), abs=1e-6)
    # without friction the pitchfork is the closed form's
    border, unit = found["pitchfork"], 2 * math.pi * NATURAL
    below = border.parameter < 0.975 * NATURAL
    for frequency, gap in zip(border.parameter[below] / NATURAL, border.second[below] / AMPLITUDE, strict=True):
        closed = closed_form(gap).pitchfork((frequency - 2e-3) * unit, (frequency + 2e-3) * unit) / unit
        assert frequency == pytest.approx(closed, abs=2e-4)
