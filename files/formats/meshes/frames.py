"""Coordinate systems in which other programs' files give their nodes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True, eq=False)
class CoordinateSystem:
    """A rectangular, cylindrical or spherical system.

    origin  (3,)
    axes    (3, 3) rows: its unit vectors x, y, z in global coordinates
    kind    "rectangular"; "cylindrical": r, angle from x, z; "spherical": r, angle from z, angle from x; in degrees
    """

    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    kind: str = "rectangular"

    def to_global(self, points: np.ndarray) -> np.ndarray:
        """Return the rectangular global coordinates (n, 3) of points (n, 3) given in this system."""
        first, second, third = np.asarray(points, dtype=float).T
        angle = np.radians(second)
        if self.kind == "cylindrical":
            local = [first * np.cos(angle), first * np.sin(angle), third]
        elif self.kind == "spherical":
            around, radius = np.radians(third), first * np.sin(angle)
            local = [radius * np.cos(around), radius * np.sin(around), first * np.cos(angle)]
        else:
            local = [first, second, third]
        return np.asarray(self.origin + np.column_stack(local) @ self.axes)

    def directions(self, points: np.ndarray) -> np.ndarray:
        """Return the unit vectors (n, 3, 3) along its three coordinates at global points (n, 3), as rows.

        Raises ValueError for a spherical system.
        """
        if self.kind == "spherical":
            raise ValueError("displacements along the coordinates of a spherical system are not known")
        x, y, z = self.axes
        if self.kind == "rectangular":
            return np.tile(self.axes, (len(points), 1, 1))
        local = (np.asarray(points) - self.origin) @ self.axes.T
        angle = np.arctan2(local[:, 1], local[:, 0])[:, None]
        outward, around = np.cos(angle) * x + np.sin(angle) * y, np.cos(angle) * y - np.sin(angle) * x
        return np.stack([outward, around, np.tile(z, (len(points), 1))], axis=1)

    @property
    def is_global(self) -> bool:
        """Whether coordinates in it are the global ones."""
        return self.kind == "rectangular" and np.allclose(self.axes, np.eye(3)) and not np.any(self.origin)


def through(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return rows a, b, c (3, 3), right-handed: a along `first`, b in the plane of both on the side of `second`.

    Raises ValueError for directions that span no plane.
    """
    along = np.linalg.norm(first)
    third = np.cross(first, second)
    if not np.linalg.norm(third) > 1e-9 * along * np.linalg.norm(second):
        raise ValueError("its points lie on a line")
    a, c = first / along, third / np.linalg.norm(third)
    return np.array([a, np.cross(c, a), c])


def rotation(axis: np.ndarray, degrees: float) -> np.ndarray:
    """Return the matrix (3, 3) that rotates vectors about an axis (Rodrigues). Raises ValueError for a zero axis."""
    length = np.linalg.norm(axis)
    if not length > 0.0:
        raise ValueError("its axis has no length")
    x, y, z = axis / length
    skew, angle = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.radians(degrees)
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew)
