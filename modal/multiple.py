"""Modes of one frequency: any orthonormal mixture of their shapes is as good, so that the question chooses it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vanedamp.modal.eigen import shape_signs
from vanedamp.modal.matrices import SystemMatrices
from vanedamp.modal.records.modes import Modes

# below this fraction of its largest possible value, a component along a guide is round-off
_NOISE = 1e-6


def turned(modes: Modes, matrices: SystemMatrices, guides: Sequence[np.ndarray], tolerance: float) -> Modes:
    """Return the modes, turned into the directions of functionals where frequencies (nearly) coincide.

    guides     functionals (N,) in order of precedence. Of the modes of a group, the first takes all that the group has
               of the first guide, and the others none of it; the second takes the rest of the second guide, and so on
    tolerance  modes belong to a group up to this relative distance from its lowest frequency; a mesh splits pairs that
               are exact in the structure by its own error

    Turned shapes stay mass-orthonormal; their frequencies are Rayleigh quotients, within the group's, so that the order
    by frequency holds within the tolerance only. Their residuals show the distance of the group's frequencies. Rigid
    motions, at zero frequency, are left as they are.
    """
    shapes, eigenvalues = modes.shapes.copy(), modes.angular_frequencies**2
    changed: list[int] = []
    for group in _groups(modes.frequencies_hz, tolerance):
        basis = _basis(shapes[group], guides)
        shapes[group] = basis @ shapes[group]
        eigenvalues[group] = basis**2 @ eigenvalues[group]
        changed.extend(range(group.start, group.stop))
    if not changed:
        return modes
    rows, squares = shapes[changed], eigenvalues[changed]
    rows = shape_signs(rows, rows @ matrices.mass @ matrices.movable_translations())[:, None] * rows
    shapes[changed] = rows
    residuals, free = modes.residuals.copy(), matrices.free
    inertia = squares[:, None] * (rows @ matrices.mass)[:, free]
    residuals[changed] = np.linalg.norm((rows @ matrices.stiffness)[:, free] - inertia, axis=1)
    residuals[changed] /= np.linalg.norm(inertia, axis=1)
    return Modes(np.sqrt(eigenvalues) / (2.0 * np.pi), shapes, residuals, modes.provenance)


def rivals(modes: Modes, mode: int, functional: np.ndarray, within: float, share: float) -> np.ndarray:
    """Return the indices of the other modes near a mode in frequency that move a functional (N,), too.

    Modes whose frequency lies within a relative distance of the mode's, and whose modal compliance at the functional,
    (w^T phi)^2, is at least the fraction `share` of the mode's.
    """
    frequency, seen = modes.frequencies_hz[mode], (modes.shapes @ functional) ** 2
    near = np.abs(modes.frequencies_hz - frequency) <= within * frequency
    near[mode] = False
    return np.flatnonzero(near & (seen >= share * seen[mode]))


def _groups(frequencies: np.ndarray, tolerance: float) -> list[slice]:
    """Return runs of at least two frequencies, each run within the tolerance of its first one."""
    groups, start = [], 0
    while start < len(frequencies):
        stop = start + 1
        while stop < len(frequencies) and frequencies[stop] <= (1.0 + tolerance) * frequencies[start]:
            stop += 1
        if stop - start > 1 and frequencies[start] > 0.0:
            groups.append(slice(start, stop))
        start = stop
    return groups


def _basis(shapes: np.ndarray, guides: Sequence[np.ndarray]) -> np.ndarray:
    """Return an orthogonal matrix (k, k): rows along the guides' components in the span of shapes (k, N), then more."""
    size = np.abs(shapes).max()
    components = [shapes @ guide for guide in guides]
    directions = [
        seen / np.linalg.norm(seen)
        for seen, guide in zip(components, guides, strict=True)
        if np.linalg.norm(seen) > _NOISE * size * np.abs(guide).sum()
    ]
    rows: list[np.ndarray] = []
    for vector in (*directions, *np.eye(len(shapes))):
        residual = vector - sum((row @ vector) * row for row in rows)
        # twice: the rest of a vector close to the others' span is then orthogonal to them to round-off
        residual = residual - sum((row @ residual) * row for row in rows)
        if len(rows) < len(shapes) and np.linalg.norm(residual) > _NOISE:
            rows.append(residual / np.linalg.norm(residual))
    return np.array(rows)
