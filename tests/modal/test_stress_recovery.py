"""The stress at a hot spot and its estimated error against closed forms, over meshes."""

import numpy as np
import pytest

from tests.tools.plate_with_hole import PEAK, solved, write_plate
from vanedamp.modal.rigid_model import fatigue_amplitude
from vanedamp.modal.stress import peak_stresses
from vanedamp.modal.stress_recovery import interior_angles

SIZES = (8e-3, 5e-3, 2.5e-3, 1.5e-3)


@pytest.fixture(scope="module")
def peaks(tmp_path_factory):
    """The largest stress of the plate on four meshes."""
    folder = tmp_path_factory.mktemp("plates")
    return [peak_stresses(*solved(write_plate(folder / f"{place}.msh", size)))[0] for place, size in enumerate(SIZES)]


def test_the_closed_form_lies_within_the_error_on_every_mesh(peaks):
    """Of the amplitude at 70 % of the strength, which is in inverse proportion to the stress, too."""
    for peak in peaks:
        assert abs(PEAK - peak.stress) <= peak.error * peak.stress
        true, told = (fatigue_amplitude(stress, 4e8, 0.7) for stress in (PEAK, peak.stress))
        assert told / (1.0 + peak.error) <= true <= told / (1.0 - peak.error)
        assert peak.coordinates[:2] == pytest.approx([0.0, 0.01], abs=2e-3)


def test_the_error_tells_fine_meshes_from_coarse_ones(peaks):
    assert peaks[0].error > 0.2 and peaks[-1].error < 0.06
    assert peaks[-1].stress == pytest.approx(PEAK, rel=0.015)


def test_the_angles_of_corners():
    """Of a brick, and of three of them in an L."""
    reference = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], dtype=float)
    shifts = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    every = np.concatenate([reference + shift for shift in shifts])
    vertices, cells = np.unique(every, axis=0, return_inverse=True)
    cells = cells.reshape(3, 8)
    assert interior_angles(cells[:1], vertices)[cells[0]] == pytest.approx(np.full(8, 90.0))
    angles = interior_angles(cells, vertices)
    inner = (vertices[:, :2] == 1.0).all(axis=1)
    assert angles[inner] == pytest.approx(np.full(2, 270.0))
    flat = np.isin(vertices[:, 0] + 10 * vertices[:, 1], (1, 10))
    assert angles[flat] == pytest.approx(np.full(4, 180.0))
    assert angles[~inner & ~flat] == pytest.approx(np.full(10, 90.0))


def test_the_angles_of_tetrahedra():
    """A regular one has arccos(1/3) at every edge; two that share a face have twice that there."""
    corners = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], dtype=float)
    angle = np.degrees(np.arccos(1.0 / 3.0))
    assert interior_angles(np.arange(4)[None], corners) == pytest.approx(np.full(4, angle))
    mirrored = corners[:3].sum(axis=0) * 2.0 / 3.0 - corners[3]
    both = interior_angles(np.array([[0, 1, 2, 3], [0, 1, 2, 4]]), np.vstack([corners, mirrored]))
    assert both == pytest.approx([2 * angle] * 3 + [angle] * 2)
