"""Amplitudes of stress of the linear structure, without bodies and with every body fixed to its floor."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.quantities.stress import LINEAR, MEASURES
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.spots import Spots
from vanedamp.coupling.strength.stress import period_stress
from vanedamp.coupling.system.linear_response import LinearResponse, linear_responses

#: samples of a period, and of that of the highest harmonic at least
_SAMPLES, _OF_HARMONIC = 128, 32


def linear_stresses(scene: Scene, spots: Spots) -> dict[str, np.ndarray] | None:
    """Return amplitudes (s, 8) of MEASURES, Pa, at the scene's frequency, by the names of LINEAR.

    None for an excitation that is no sum of sines; infinite at a resonance without damping.
    """
    if scene.excitation.signal is not None:
        return None
    responses = linear_responses(scene)
    return {name: _amplitudes(one, scene.frequency, spots) for name, one in zip(LINEAR, responses, strict=True)}


def _amplitudes(response: LinearResponse, frequency: float, spots: Spots) -> np.ndarray:
    each = max(_SAMPLES, _OF_HARMONIC * int(response.order.max()))
    try:
        motion = response.motion(frequency)
    except np.linalg.LinAlgError:
        return np.full((len(spots.rows), len(MEASURES)), np.inf)
    turns = np.exp(2j * np.pi * np.multiply.outer(np.arange(-1, each + 1) / each, response.order))
    return np.asarray(period_stress(spots.stress((turns @ motion).real), each).amplitude[0])
