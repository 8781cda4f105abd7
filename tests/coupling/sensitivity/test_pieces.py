"""Segments whose quick modes need many panels are taken piece by piece: the pieces add up to the whole."""

import itertools

import numpy as np
import pytest

from tests.tools.sensitive_scenes import KINDS, numbers_of, scene_of
from vanedamp.coupling.derivatives import series
from vanedamp.coupling.derivatives.series import Series
from vanedamp.coupling.sensitivity.sensitivity import sensitivity
from vanedamp.coupling.simulation import simulate


def test_pieces_are_the_course():
    rng = np.random.default_rng(3)
    X, D = 40.0 * rng.normal(size=(5, 5)), rng.normal(size=(2, 5, 5))
    z, Z, moved = rng.normal(size=5), rng.normal(size=(5, 2)), Series(X - 60.0 * np.eye(5)).by(D)
    whole, duration = moved.course(z, Z, 0.7, True), 0.7
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(series, "_MOST", 3)
        pieces = list(moved.pieces(z, Z, duration))
    assert len(pieces) >= 3
    assert pieces[0][0] == 0.0 and pieces[-1][1] == duration
    assert all(one[1] == other[0] for one, other in itertools.pairwise(pieces))
    np.testing.assert_allclose(pieces[-1][2].last, whole.last, rtol=1e-10)
    np.testing.assert_allclose(pieces[-1][2].end, whole.end, rtol=1e-10)
    for power in (1, 2):  # integrals
        parts = sum(piece.weight @ piece.z**power for _, _, piece in pieces)
        np.testing.assert_allclose(parts, whole.weight @ whole.z**power, rtol=1e-12)


@pytest.mark.parametrize("seed", range(0, len(KINDS), 4))
def test_derivatives_by_pieces_are_those_of_whole_segments(seed, tmp_path, monkeypatch):
    """Largest values, sums, time off the floor: of runs of several kinds of scenes."""
    _, scene = scene_of(seed, tmp_path)
    short = scene.replace({"time": {"periods": 2, "transient": 1}})
    if simulate(short).final is None:
        return
    paths = list(numbers_of(short, False))[:4]
    whole = sensitivity(short, paths)
    monkeypatch.setattr(series, "_MOST", 2)
    cut = sensitivity(short, paths)
    assert (cut.status, cut.note) == (whole.status, whole.note)
    for name, derivative in whole.derivatives.items():
        size = np.abs(derivative) + 1e-6 * np.abs(whole.values[name]) + 1e-12
        np.testing.assert_array_less(np.abs(cut.derivatives[name] - derivative), 1e-7 * size + 1e-300, err_msg=name)
