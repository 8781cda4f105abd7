"""Multi-sines: spectrum and crest factor of the signal, and responses to it against sums of harmonics."""

import math

import numpy as np
import pytest

from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.sines import peaks
from vanedamp.coupling.scene.waveforms.multisine import Multisine
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.reduced import ReducedModel

#: 41 sines about a mode of 100 Hz
FREQUENCY, ORDERS, OWN, RATIO, FORCE = 2.5, [20, 60], 2 * math.pi * 100.0, 0.02, 3.0


def scene(waveform=None, level="force", periods=3, transient=0, **tables):
    signal = {"shape": "multisine", "orders": ORDERS} | (waveform or {})
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": OWN**2, "damping_ratio": RATIO},
        "excitation": {"frequency": FREQUENCY, level: FORCE, "waveform": signal},
        "gravity": {"acceleration": 0.0},
        "time": {"periods": periods, "transient": transient},
    } | tables  # fmt: skip
    return validate(Scene, data, "scene")


def sampled(shares, count=1 << 15):
    """The signal at `count` angles, by its definition."""
    spectrum = np.zeros(count // 2 + 1, complex)
    for order, share in shares.items():
        spectrum[order] = -1j * share / 2
    return np.fft.irfft(spectrum, count, norm="forward")


def crest(shares):
    """Largest sample over root mean square, and by how much a value between two samples may exceed it, in shares."""
    signal = sampled(shares)
    # Bernstein: the second derivative of a sum of orders up to n is n^2 times its largest value at most
    missed = (max(shares) * np.pi / len(signal)) ** 2 / 2
    return np.abs(signal).max() / np.sqrt((signal**2).mean()), missed


# -- the signal


@pytest.mark.parametrize("spectrum", ["flat", "pink", [float(k % 7) for k in range(41)]])
@pytest.mark.parametrize("target", [None, 1.9, 2.5, 4.0])
def test_spectrum_and_crest_factor(spectrum, target):
    made = Multisine(tuple(ORDERS), spectrum if isinstance(spectrum, str) else tuple(spectrum), target)
    order = np.arange(ORDERS[0], ORDERS[1] + 1)
    shape = {"flat": np.ones(41), "pink": 1 / np.sqrt(order)}.get(
        spectrum if isinstance(spectrum, str) else "", spectrum
    )
    shape = np.asarray(shape, float)
    expected = {int(k): a for k, a in zip(order, shape * math.sqrt(2) / np.linalg.norm(shape), strict=True) if a}
    assert {k: abs(share) for k, share in made.shares.items()} == pytest.approx(expected, rel=1e-12)
    found, missed = crest(made.shares)
    assert np.sqrt((sampled(made.shares) ** 2).mean()) == pytest.approx(1.0, rel=1e-12)
    if target is not None:
        assert (1 - missed) * target - 1e-9 <= found <= target * (1 + 1e-9)


def test_levels_and_seeds():
    rms, peak = Multisine((20, 60), crest_factor=2.0), Multisine((20, 60), crest_factor=2.0, level="peak")
    for order, share in rms.shares.items():
        assert peak.shares[order] == pytest.approx(share / 2.0, rel=1e-8)
    assert Multisine((20, 60), seed=1).shares == Multisine((20, 60), seed=1).shares
    assert abs(Multisine((20, 60), seed=1).shares[20] - Multisine((20, 60), seed=2).shares[20]) > 1e-3


def test_one_sine_has_the_crest_factor_of_a_sine():
    """Its values between 0 and 1 at level "peak": it is the plain excitation but for its phase."""
    assert abs(Multisine((3, 3), level="peak").shares[3]) == pytest.approx(1.0, rel=1e-12)
    assert abs(Multisine((3, 3)).shares[3]) == pytest.approx(math.sqrt(2), rel=1e-12)


def test_phases_of_least_crest_factor():
    """31 equal sines: Schroeder's phases are far from what norms of growing p find (1.4 to 1.5 in the literature)."""
    found, _ = crest(Multisine((1, 31), crest_factor=1.5).shares)
    assert found == pytest.approx(1.5, rel=2e-3)


@pytest.mark.parametrize("low, high", [(1, 40), (3, 300), (100, 130)])
def test_the_largest_value_of_many_sines(low, high):
    """Against samples so dense that they miss next to nothing, of several sums at once."""
    rng, order = np.random.default_rng(low), np.arange(low, high + 1)
    waves = rng.standard_normal((len(order), 5)) + 1j * rng.standard_normal((len(order), 5))
    dense = np.array([np.abs(sampled(dict(zip(order, 1j * wave, strict=True)), 1 << 17)).max() for wave in waves.T])
    found = peaks(waves, order)
    missed = (high * np.pi / (1 << 17)) ** 2 / 2
    assert np.all(found >= dense * (1 - 1e-12)) and np.all(found <= dense * (1 + 1.1 * missed) + 1e-12)


# -- the response


def receptance(order):
    omega = 2 * math.pi * FREQUENCY * order
    return 1 / (OWN**2 - omega**2 + 2j * RATIO * OWN * omega)


@pytest.mark.parametrize("level, factor", [("force", 1.0), ("base_acceleration", -1.0)])
def test_response_of_one_mode_is_the_sum_over_the_sines(level, factor):
    """After a transient of e^-50; peak, rms, work of the dashpot and the linear curves."""
    case = scene({"crest_factor": 1.8}, level, periods=12, transient=10)
    response = simulate(case)
    shares = case.excitation.waveform.shares
    waves = {order: factor * FORCE * share * receptance(order) for order, share in shares.items()}
    signal = sampled(waves)
    assert response.status is Status.OK and response.energy_residual < 1e-10
    assert response.amplitude_rms == pytest.approx(np.sqrt((signal**2).mean()), rel=1e-9)
    assert response.amplitude_max == pytest.approx(np.abs(signal).max(), rel=(60 * np.pi / len(signal)) ** 2)
    speeds = sum((2 * math.pi * FREQUENCY * order * abs(wave)) ** 2 / 2 for order, wave in waves.items())
    assert response.energy["viscous"] == pytest.approx(2 / FREQUENCY * 2 * RATIO * OWN * speeds, rel=1e-9)
    curve, _ = linear_responses(case)
    assert curve.amplitude(np.array([FREQUENCY]))[0] == pytest.approx(response.amplitude_max, rel=1e-9)


BODY = {
    "cavity": [{"name": "c", "gap": 2e-4}],
    "damper": [{"cavity": "c", "mass": 0.03, "restitution": 0.6, "friction": 0.2}],
    "gravity": {"acceleration": 9.81},
}


def test_a_body_under_noise_against_other_methods():
    """solve_ivp to its tolerance over the first impacts, Moreau-Jean's as its steps decrease."""
    case = scene({"crest_factor": 3.0, "orders": [5, 15]}, periods=1, **BODY).replace({"excitation.frequency": 10.0})
    exact = simulate(case, events=True)
    other = simulate(case.replace({"solver": {"method": "solve_ivp", "rtol": 1e-11}}), events=True)
    times = [[event.time for event in run.event_list if event.kind == "impact"] for run in (exact, other)]
    both = min(map(len, times))
    assert both >= 10 and exact.energy_residual < 1e-10
    # chaos multiplies differences: the first impacts are to agree
    assert np.abs(np.subtract(times[0][:10], times[1][:10])).max() < 1e-7 / case.frequency
    slow = {"structure.damping_ratio": 0.5, "damper.0.friction": 1e3}
    errors = []
    for steps in (2000, 8000):
        stepped = case.replace(slow | {"solver": {"method": "moreau", "steps_per_period": steps}})
        errors.append(np.abs(simulate(stepped).section[:, 0] - simulate(case.replace(slow)).section[:, 0]).max())
    assert 10 < errors[0] / errors[1] < 22


def test_a_table_moves_by_noise():
    """Displacement is the signal, of root mean square 1 mm."""
    table = {"model": "prescribed", "displacement_amplitude": 1e-3}
    excitation = {"frequency": FREQUENCY, "waveform": {"shape": "multisine", "orders": ORDERS}}
    response = simulate(scene(structure=table, excitation=excitation))
    assert response.amplitude_rms == pytest.approx(1e-3, rel=1e-9)


def test_a_sweep_over_the_crest_factor():
    made = scene(
        {"crest_factor": 2.0}, periods=12, transient=10, sweep={"excitation.waveform.crest_factor": [1.8, 4.0]}
    )
    found = sweep(made)
    assert (found.status == "ok").all()
    assert found.amplitude_rms[0] == pytest.approx(found.amplitude_rms[1], rel=1e-9)
    assert found.amplitude_undamped == pytest.approx(found.amplitude_max, rel=1e-9)
    assert found.amplitude_max[1] != pytest.approx(found.amplitude_max[0], rel=1e-4)


@pytest.mark.parametrize(
    ("waveform", "message"),
    [
        ({"crest_factor": 1.2}, r": crest_factor: 1.2 is not reached; the phases found bring it down to 1\.\d+$"),
        ({"crest_factor": 20.0}, r": crest_factor: 20 is out of reach; that of this spectrum is 9.05539 at most"),
        ({"orders": [60, 20]}, r": orders: expected \[lowest, highest\], not \[60, 20\]$"),
        ({"orders": [0, 20]}, r".orders\[0\]: should be greater than 0"),
        ({"spectrum": [1.0, 2.0]}, r": spectrum: expected 41 amplitudes, one for each order from 20 to 60, not 2$"),
        ({"spectrum": [0.0] * 41}, r": spectrum: expected an amplitude above 0$"),
        ({"spectrum": "white"}, r".spectrum: .*'flat' or 'pink'"),
        ({"level": "mean"}, r".level: should be 'rms' or 'peak'"),
    ],
)  # fmt: skip
def test_wrong_tables(waveform, message):
    with pytest.raises(InputError, match=f"^scene: excitation.waveform{message}") as refused:
        scene(waveform)
    assert "\n" not in str(refused.value)


def test_no_attached_mass_without_order_one(tmp_path):
    """It is measured by that order; and the number of modes is chosen by runs with it."""
    assert simulate(scene(periods=1, **BODY)).attached_mass_fraction is None
    assert np.isfinite(simulate(scene({"orders": [1, 60]}, periods=1, **BODY)).attached_mass_fraction)
    model = ReducedModel.from_matrices(np.eye(2), np.diag([1e4, 1e6]), {"tip": [1.0, 0.5]}, damping_ratio=0.01)
    model.save(tmp_path / "rom.h5")
    structure = {"model": "rom", "file": str(tmp_path / "rom.h5"), "modes": "auto"}
    noise = {"shape": "multisine", "orders": ORDERS}
    excitation = {"frequency": FREQUENCY, "force": 1.0, "at": "tip", "waveform": noise}
    with pytest.raises(
        InputError, match=r'^structure.modes: "auto" tries the bodies at resonances that sines of order'
    ):
        simulate(scene(structure=structure, excitation=excitation))
