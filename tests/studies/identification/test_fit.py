"""Predictions and their derivatives against closed forms of a linear oscillator, and against differences."""

import numpy as np
import pytest

from tests.studies.identification import oscillator
from tests.studies.identification.oscillator import FREQUENCY, RATIO, STIFFNESS, half_swings, response, study
from vanedamp.coupling.orbits.orbits import find_orbit
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError, validate
from vanedamp.studies.identification.data import decay, forced, impacts
from vanedamp.studies.identification.decay import interpolated
from vanedamp.studies.identification.density import LogDensity
from vanedamp.studies.identification.fit import Fit, _gain
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.tables import ForcedTable, ImpactsTable, Prior, Sought

TRUTH = np.array([RATIO, STIFFNESS])
STEP = 1e-6


def closed(values):
    """Logarithms of the amplitudes of both measurements."""
    ratio, stiffness = values
    time, amplitude = half_swings(stiffness, ratio)
    decays = interpolated(half_swings()[0], time, np.log(amplitude))
    return np.log(np.concatenate([response(FREQUENCY, stiffness, ratio)[0], decays]))


def slopes(function, values):
    """Central differences (n, P) by relative steps."""
    columns = []
    for place, value in enumerate(values):
        ends = np.array([values, values])
        ends[:, place] += STEP * value * np.array([-1, 1])
        columns.append((function(ends[1]) - function(ends[0])) / (2 * STEP * value))
    return np.stack(columns, axis=-1)


def test_predictions_and_derivatives_are_those_of_closed_forms():
    sought = study(noise=0.0)
    fit, z = Fit(sought), sought.coordinates(TRUTH)
    found = np.concatenate([np.log(values) for _, _, values, _ in fit.compared(z)])
    # the last half cycles of the closed form are beyond the run's: both are continued
    assert np.abs(found - closed(TRUTH))[:-1].max() < 1e-9
    exact = slopes(closed, TRUTH) * sought.slope(TRUTH) / 0.02
    made = fit.jacobian(z)
    assert made == pytest.approx(exact, abs=1e-6 * np.abs(exact).max())
    assert fit.count["derivatives"] == len(FREQUENCY) + 1


def test_minimum_is_the_truth_without_noise():
    sought = study(noise=0.0)
    found = Fit(sought).minimum(sought.coordinates(TRUTH * [1.8, 1.04]), close=1e-14)
    assert found.converged and found.misfit < 1e-8
    assert sought.values(found.z) == pytest.approx(TRUTH, rel=1e-6)


def test_no_point_of_a_step_is_lower_by_more_than_its_ends_tell():
    rng = np.random.default_rng(3)
    for _ in range(50):
        before, after = rng.normal(size=(2, 6)) * rng.uniform(0.1, 2.0, (2, 1))
        share = np.linspace(0.0, 1.0, 2001)[:, None]
        lowest = np.square((1.0 - share) * before + share * after).sum(axis=1).min()
        most = min(before @ before, after @ after) - lowest
        assert most <= _gain(before, after)
    level = np.array([1.0, 2.0])  # amid ends of one height the bound is what there is
    assert _gain(level, -level) == pytest.approx(level @ level)


def test_phases_and_harmonics():
    amplitude, phase = response(FREQUENCY)
    table = ForcedTable("", noise=0.01, measure="amplitude_harmonic")
    measured = forced("frf", FREQUENCY, amplitude, {}, table, phase)
    sought = IdentificationStudy(oscillator.scene(), oscillator.NUMBERS, [measured])
    fit, z = Fit(sought), sought.coordinates(TRUTH)
    assert np.abs(fit.residual(z)).max() < 1e-4
    of_phase = slopes(lambda values: response(FREQUENCY, values[1], values[0])[1], TRUTH) * sought.slope(TRUTH) / 0.01
    assert fit.jacobian(z)[len(FREQUENCY) :] == pytest.approx(of_phase, abs=1e-6 * np.abs(of_phase).max())


def test_history_of_a_decay():
    time = np.linspace(0.01, 0.4, 20)
    rate = np.sqrt(STIFFNESS) * (-RATIO + 1j * np.sqrt(1 - RATIO**2))
    wave = oscillator.PULL * (1.0 - 1j * rate.real / rate.imag * -1.0)
    exact = np.real(wave * rate**2 * np.exp(rate * time))
    sought = IdentificationStudy(
        oscillator.scene(), oscillator.NUMBERS, [decay("history", time, exact, {}, quantity="acceleration")]
    )
    fit, z = Fit(sought, [0.01]), sought.coordinates(TRUTH)
    ((_, _, found, _),) = fit.compared(z)
    assert found == pytest.approx(exact, abs=1e-6 * np.abs(exact).max())
    values = lambda values: next(iter(Fit(sought, [0.01]).compared(sought.coordinates(values))))[2]  # noqa: E731
    exact = slopes(values, TRUTH) * sought.slope(TRUTH)
    assert fit.sensitivity(z)[0] == pytest.approx(exact, abs=1e-6 * np.abs(exact).max())


BODY = {
    "cavity": [{"name": "c1", "gap": 1e-3}],
    "damper": [{"cavity": "c1", "mass": 0.03, "friction": 0.25, "restitution": 0.6}],
}
OF_BODY = {
    "damper.0.friction": Sought(0.05, 0.9), "damper.0.restitution": Sought(0.2, 0.95),
    "cavity.c1.gap": Sought(5e-4, 2e-3),
}  # fmt: skip


def body() -> Scene:
    return validate(Scene, oscillator.SCENE | BODY, "scene")


def test_impacts_of_a_steady_motion():
    base = body()
    orbit = find_orbit(
        base.replace({"excitation.frequency": 15.2}), simulate(base.replace({"excitation.frequency": 15.2})).final
    )
    struck = [(each.time, abs(each.speed)) for each in orbit.passage.crossings if "impact" in each.name]
    assert len(struck) == 2
    time, speed = np.array(struck).T
    measured = impacts(
        "walls", time, speed, {"excitation.frequency": 15.2}, ImpactsTable("", noise=0.01, time_deviation=1e-4)
    )
    sought = IdentificationStudy(base, OF_BODY, [measured])
    fit, z = Fit(sought), sought.coordinates(sought.start)
    assert np.abs(fit.residual(z)).max() < 1e-4

    def all_values(values):
        return np.concatenate([found for _, _, found, _ in Fit(sought).compared(sought.coordinates(values))])

    exact = slopes(all_values, sought.start) * sought.slope(sought.start)
    made = np.concatenate(fit.sensitivity(z))
    for own, other in ((made[:2], exact[:2]), (made[2:], exact[2:])):
        assert own == pytest.approx(other, abs=1e-4 * np.abs(other).max())


def test_directions_are_followed_from_their_neighbours():
    base, at = body(), [15.2, 15.3, 15.4]
    measured = forced("down", at, [7e-4, 9e-4, 1.1e-3], {}, noise=0.02, direction=["down"] * 3)
    fit = Fit(
        IdentificationStudy(base, OF_BODY | {"structure.damping_ratio": Sought(0.005, 0.02)}, [measured, measured])
    )
    found = fit.models[0].quick(np.array([0.25, 0.6, 1e-3, 0.01])).values["amplitude"]
    before, chained = None, []
    for frequency in at[::-1]:
        made = simulate(base.replace({"excitation.frequency": frequency}), start=before)
        before = made.final
        chained.append(made.amplitude_mean)
    assert found.tolist() == chained[::-1]


def test_density_and_its_gradient():
    numbers = oscillator.NUMBERS | {
        "structure.damping_ratio": Sought(0.002, 0.05, 0.02, Prior(0.012, 0.002), scale="log")
    }
    density = LogDensity(study(numbers=numbers))
    near = TRUTH * [1.05, 1.001]
    exact = slopes(lambda values: np.array([density(values)]), near)[0]
    assert density.gradient(near) == pytest.approx(exact, rel=1e-5)
    # of the closed forms: residuals of ratios and the prior
    rest = (near[0] - 0.012) / 0.002
    data = np.concatenate([np.log(channel.values) for channel in density._fit.channels])
    off = (closed(near) - data) / 0.02
    assert density(near) == pytest.approx(-0.5 * (off @ off + rest**2), rel=1e-4)
    assert density([0.1, 1e4]) == -np.inf and np.isnan(density.gradient([0.1, 1e4])).all()
    open_study = IdentificationStudy(
        oscillator.scene(), oscillator.NUMBERS, [forced("open", FREQUENCY, response(FREQUENCY)[0], {})]
    )
    with pytest.raises(InputError, match="give noise there"):
        LogDensity(open_study)
    assert LogDensity(open_study, np.array([0.02]))(TRUTH) == pytest.approx(0.0, abs=1e-6)


FREE = {
    "cavity": [{"name": "c1", "gap": 1.6e-3}],
    "damper": [{"cavity": "c1", "mass": 0.03, "friction": 0.0, "restitution": 0.7}],
}


def of_gap(frequency, amplitude, **changes):
    """The density of a gap by amplitudes (n,) at frequencies (n,), Hz."""
    measured = forced("sweep", frequency, amplitude, {}, noise=0.02)
    return LogDensity(
        IdentificationStudy(oscillator.scene(**FREE | changes), {"cavity.c1.gap": Sought(1e-3, 2e-3)}, [measured])
    )


def test_a_density_depends_on_no_call_before():
    """In the wide gap the body, at rest at the start, never meets a wall; motions of a narrow gap lead to impacts."""
    frequency = np.array([15.2, 15.1])
    density = of_gap(frequency, response(frequency)[0])
    wide, narrow = [3.0 * response(15.2)[0]], [2.6 * response(15.2)[0]]
    assert density(wide) == pytest.approx(0.0, abs=1e-4)
    assert density(narrow) < -100.0
    density.gradient(narrow)
    assert density(wide) == pytest.approx(0.0, abs=1e-4)
    assert density.gradient(wide) == pytest.approx([0.0], abs=1e-9)


def test_a_density_of_motions_that_do_not_repeat_is_as_wide_as_their_means():
    frequency, gap = np.array([15.5, 15.45]), 1.6 * response(15.5)[0]
    base = oscillator.scene(**FREE).replace({"cavity.c1.gap": gap})
    runs = [simulate(base.replace({"excitation.frequency": each})) for each in frequency.tolist()]
    assert runs[0].classification == "non-periodic"
    measured = 1.01 * np.array([run.amplitude_mean for run in runs])
    errors = [(run.amplitude_mean_confidence or 0.0) / 1.96 / run.amplitude_mean for run in runs]
    deviation = np.hypot(0.02, errors)
    exact = np.sum(-0.5 * (np.log(1.01) / deviation) ** 2 - np.log(deviation / 0.02))
    assert of_gap(frequency, measured)([gap]) == pytest.approx(exact, rel=1e-3)
    assert deviation[0] > 1.001 * 0.02
