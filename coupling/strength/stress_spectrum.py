"""Spectral moments of von Mises stress at hot spots: of linear responses in closed form, of runs by Welch's method."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.quantities.stress import LINEAR
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.spectral import Moments, line_moments, moments, spectral_density, von_mises_components
from vanedamp.coupling.strength.spots import Spots, known_spots
from vanedamp.coupling.strength.stress_history import stress_history
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.files.toml_input import InputError


def linear_moments(scene: Scene, spots: Spots | None = None) -> dict[str, list[Moments]]:
    """Return the moments of the structure without bodies and with bodies fixed, by the names of LINEAR, per spot.

    The excitation is a sum of sines of open phases, such as a multi-sine; constant loads are left out, and so is a
    curve with a sine at a resonance without damping. spots: the scene's. Raises InputError for a scene without hot
    spots, or another excitation.
    """
    spots = spots or known_spots(scene)
    if scene.excitation.signal is not None:
        raise InputError(f'excitation.waveform: no spectrum of "{scene.excitation.signal.shape}"; take a multi-sine')
    by_curve = {}
    for name, response in zip(LINEAR, linear_responses(scene), strict=True):
        try:
            motion = response.motion(scene.frequency)
        except np.linalg.LinAlgError:
            continue
        lines = von_mises_components(np.moveaxis(spots.stress(motion), 1, 0))
        hertz = scene.frequency * response.order
        by_curve[name] = [line_moments(hertz, lines[:, spot].T) for spot in range(len(spots.rows))]
    return by_curve


def run_moments(scene: Scene, samples_per_period: int, highest_hz: float | None = None) -> list[Moments]:
    """Return the moments of a run over its evaluated periods, per hot spot.

    highest_hz: up to which the spectrum counts (default: half the sampling frequency). Impacts leave jumps of velocity,
    whose l4 grows with that frequency. Raises InputError for a scene without hot spots, or a method that keeps no modal
    coordinates.
    """
    history = stress_history(scene, samples_per_period)
    stress = von_mises_components(np.moveaxis(history.stress, 1, 0))
    rate = 1.0 / float(history.time[1] - history.time[0])
    of_spots = []
    for spot in range(len(history.spots)):
        hertz, density = spectral_density(stress[:, spot], rate)
        below = hertz <= (highest_hz or np.inf)
        of_spots.append(moments(hertz[below], density[below]))
    return of_spots
