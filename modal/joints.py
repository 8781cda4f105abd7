"""Faults of a mesh's joints, found by where its nodes lie and by modes without strain."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.records.modes import Modes

# fraction of the largest extent: nodes closer than this coincide
_SAME = 1e-6
# fraction by which a mode may differ from a rigid motion
_STRAINED = 1e-3


def coincident_nodes(matrices: SystemMatrices) -> np.ndarray:
    """Return the nodes (k,), ascending, that lie where another one does: there the parts of the mesh are not joined."""
    points = matrices.coordinates
    pairs = cKDTree(points).query_pairs(_SAME * float(np.ptp(points, axis=0).max()), output_type="ndarray")
    return np.unique(pairs)


def free_motions(modes: Modes, matrices: SystemMatrices) -> tuple[int, int]:
    """Return how many modes without strain move the structure as a whole, and how many its parts against each other."""
    arms = matrices.coordinates - matrices.coordinates.mean(axis=0)
    turned = [np.cross(axis, arms).ravel() for axis in np.eye(3)]
    rigid = np.linalg.qr(np.column_stack([matrices.rigid_translations(), *turned]))[0]
    shapes = modes.shapes[modes.frequencies_hz == 0.0]
    internal = shapes - (shapes @ rigid) @ rigid.T
    apart = np.linalg.norm(internal, axis=1) > _STRAINED * np.linalg.norm(shapes, axis=1)
    return int(np.sum(~apart)), int(np.sum(apart))
