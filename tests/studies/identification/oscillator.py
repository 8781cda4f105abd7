"""A linear oscillator, whose responses and decays are closed forms, as the truth of measurements."""

from __future__ import annotations

import math

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate
from vanedamp.studies.identification.data import decay, forced
from vanedamp.studies.identification.study import IdentificationStudy
from vanedamp.studies.identification.tables import SearchTable, Sought

MASS, STIFFNESS, RATIO, FORCE, PULL = 1.0, 1e4, 0.01, 0.5, 1e-3
OMEGA = math.sqrt(STIFFNESS / MASS)
SCENE = {
    "structure": {"model": "rigid", "mass": MASS, "stiffness": STIFFNESS, "damping_ratio": RATIO},
    "excitation": {"frequency": 15.9, "force": FORCE},
    "cavity": [{"name": "c1", "gap": 1e-3}],
    "ring_down": {"start": "displacement", "displacement": PULL, "periods": 8},
    "time": {"periods": 300, "transient": 250},
}
NUMBERS = {
    "structure.damping_ratio": Sought(0.002, 0.05, 0.02, scale="log"),
    "structure.stiffness": Sought(0.9e4, 1.1e4, 1.02e4),
}
FREQUENCY = np.array([15.3, 15.6, 15.8, 15.9, 16.0, 16.2, 16.6])


def scene(**changes) -> Scene:
    return validate(Scene, SCENE | changes, "scene")


def response(frequency, stiffness=STIFFNESS, ratio=RATIO):
    """Amplitude (m) and phase (rad) of x'' m + 2 zeta sqrt(k m) x' + k x = F sin(W t)."""
    w = 2 * np.pi * np.asarray(frequency)
    transfer = FORCE / (stiffness - MASS * w**2 + 2j * ratio * math.sqrt(stiffness * MASS) * w)
    return np.abs(transfer), np.angle(transfer)


def half_swings(stiffness=STIFFNESS, ratio=RATIO, count=12):
    """Times (s) of the middles of half cycles after a static pull, and amplitudes (m), half of each swing."""
    damped = math.sqrt(stiffness / MASS) * math.sqrt(1 - ratio**2)
    swing = PULL * np.exp(-math.pi * ratio / math.sqrt(1 - ratio**2) * np.arange(count + 1))
    return (np.arange(count) + 0.5) * math.pi / damped, (swing[:-1] + swing[1:]) / 2


def study(noise=0.02, seed=1, numbers=None, **options) -> IdentificationStudy:
    rng = np.random.default_rng(seed)
    noisy = lambda values: values * np.exp(noise * rng.standard_normal(len(values)))  # noqa: E731
    time, amplitude = half_swings()
    measured = [
        forced("sweep", FREQUENCY, noisy(response(FREQUENCY)[0]), {}, noise=noise or 0.02),
        decay("decay", time, noisy(amplitude), {}, noise=noise or 0.02),
    ]
    search = options.pop("search", SearchTable(candidates=8, starts=1))
    return IdentificationStudy(scene(), numbers or NUMBERS, measured, search, **options)
