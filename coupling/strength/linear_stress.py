"""Amplitudes of stress of the linear structure, without bodies and with bodies fixed."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.quantities.stress import LINEAR, MEASURES
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.course import course_stress
from vanedamp.coupling.strength.spots import Spots
from vanedamp.coupling.system.linear_response import linear_responses
from vanedamp.coupling.system.system import System

#: pieces of a period of the highest harmonic: polynomials of degree 7 differ by 1e-11
_PIECES = 20


def linear_stresses(scene: Scene, spots: Spots, system: System | None = None) -> dict[str, np.ndarray] | None:
    """Return amplitudes (s, 8) of MEASURES, Pa, at the scene's frequency, by the names of LINEAR.

    None for an excitation that is no sum of sines; infinite at a resonance without damping. system: of the scene.
    """
    if scene.excitation.signal is not None:
        return None
    curves = linear_responses(scene, system)
    motions = np.array([curve.motions(np.array([scene.frequency])) for curve in curves])
    return dict(zip(LINEAR, stresses_of(curves[0].order, motions, spots)[0], strict=True))


def stresses_of(order: np.ndarray, motions: np.ndarray, spots: Spots) -> np.ndarray:
    """Return the same amplitudes (f, 2, s, 8) of f motions (2, f, e, n) of the harmonics of both curves.

    The same digits for one motion as for many.
    """
    functionals, rows = spots.outputs
    size, count, pieces = len(functionals), 2 * motions.shape[1], _PIECES * int(order.max(initial=1.0))
    finite = np.isfinite(motions).all(axis=(2, 3))
    waves = np.where(finite[..., None, None], motions, 0.0).swapaxes(0, 1).reshape(count, len(order), -1, 1)
    waves = (waves * functionals.T).sum(axis=2)
    turns = np.exp(2j * np.pi * np.multiply.outer(np.arange(pieces + 1) / pieces, order))
    course = np.zeros((count, pieces + 1, 2 + 4 * size))
    course[..., 0], course[:, :-1, 1] = np.arange(count)[:, None], 2.0 * np.pi / pieces
    for d in range(4):
        for h, one in enumerate(order.tolist()):
            course[..., 2 + d * size :][..., :size] += (turns[:, h, None] * (1j * one) ** d * waves[:, None, h]).real
    amplitude = course_stress(course.reshape(-1, course.shape[-1]), rows).amplitude
    amplitude[~finite.T.ravel()] = np.inf
    return amplitude.reshape(-1, 2, len(rows), len(MEASURES))
