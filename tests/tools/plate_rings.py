"""Rings of a mesh that is written by hand, with waves in closed form as their modes."""

import numpy as np

from vanedamp.files.store import Variable
from vanedamp.modal.records.ring_modes import RingModes

#: nodes of a sector along the radius, the circumference and the height
SHAPE = (3, 4, 2)


def sector_mesh(sectors: int, radii=(0.1, 0.2), thickness: float = 0.01) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n, 3) and hexahedra (c, 8) of a sector of an annular plate about z, from angle 0 to 2 pi / N."""
    radius, angle, height = np.meshgrid(
        np.linspace(*radii, SHAPE[0]), np.linspace(0.0, 2 * np.pi / sectors, SHAPE[1]), [0.0, thickness], indexing="ij"
    )
    points = np.column_stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel(), height.ravel()])
    number = np.arange(len(points)).reshape(SHAPE)
    i, j = (each.ravel() for each in np.meshgrid(range(SHAPE[0] - 1), range(SHAPE[1] - 1), indexing="ij"))
    square = ((0, 0), (1, 0), (1, 1), (0, 1))
    cells = np.column_stack([number[i + di, j + dj, k] for k in (0, 1) for di, dj in square])
    return points, cells


def plate_waves(sectors: int = 8, families: int = 2, point=(0.0, 0.0, 0.0)) -> RingModes:
    """Bending-like waves w = r^(f+1) exp(i h angle) along z of every diameter, at 100 (f + 1) + 10 h^2 Hz."""
    points, _ = sector_mesh(sectors)
    radius, angle = np.hypot(points[:, 0], points[:, 1]), np.arctan2(points[:, 1], points[:, 0])
    pairs = [(h, f) for f in range(families) for h in range(sectors // 2 + 1)]
    shapes = np.zeros((len(pairs), len(points), 3), dtype=complex)
    for row, (h, f) in enumerate(pairs):
        wave = radius ** (f + 1) * np.exp(1j * h * angle)
        shapes[row, :, 2] = wave.real if 2 * h in (0, sectors) else wave
    diameters, order = np.transpose(pairs)
    frequencies = 100.0 * (order + 1) + 10.0 * diameters**2
    return RingModes(
        sectors, np.array([0.0, 0.0, 1.0]), np.array(point), diameters, order, frequencies, np.zeros(len(pairs)),
        shapes.reshape(len(pairs), -1), {},
    )  # fmt: skip


def mesh_variables(sectors: int) -> tuple[dict, dict]:
    """The mesh of a sector as it rides along in a file of modes."""
    points, cells = sector_mesh(sectors)
    return {
        "coordinates": Variable(points, ("node", "axis"), "m"), "cell": Variable(cells, ("cells", "corner"))
    }, {"vtk_cell_type": 12}  # fmt: skip
