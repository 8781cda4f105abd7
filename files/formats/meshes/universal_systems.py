"""Coordinate systems of universal files: datasets 2420 and 18. Source: SDRC, I-deas universal file datasets."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from vanedamp.files.formats.meshes.frames import CoordinateSystem, through
from vanedamp.files.formats.meshes.labelled_mesh import DeckLine

#: datasets of coordinate systems
SYSTEMS = (2420, 18)
_KINDS = ("rectangular", "cylindrical", "spherical")
#: systems that files name without giving them: the global one
_GLOBAL = (0, 1)


def systems_of(
    number: int, lines: Iterable[DeckLine], known: Mapping[int, CoordinateSystem]
) -> dict[int, CoordinateSystem]:
    """Return the systems of a dataset by label; known: systems of earlier datasets, in which 18 may give its points.

    Raises MeshError with the line, and StopIteration for a dataset that ends within an entry.
    """
    rows, frames = iter(lines), dict[int, CoordinateSystem]()
    if number == 2420:
        next(rows), next(rows)  # number and name of the part
    for head in rows:
        label, kind, *more = head.whole(head.text.split()[: 2 if number == 2420 else 3])
        if not 0 <= kind < len(_KINDS):
            raise head.error(f"coordinate system {label}: the type {kind} is not known")
        next(rows)  # its name
        numbers: list[float] = []
        while len(numbers) < (12 if number == 2420 else 9):
            numbers += next(rows).reals()
        if number == 2420:
            axes, origin = np.reshape(numbers[:9], (3, 3)), np.array(numbers[9:12])
            if not np.allclose(axes @ axes.T, np.eye(3), atol=1e-4):
                raise head.error(f"coordinate system {label}: its axes are not perpendicular unit vectors")
        else:  # points: the origin, one on the axis x, one in the plane of x and z
            points = frame_of(more[0], head.error, frames | dict(known)).to_global(np.reshape(numbers[:9], (3, 3)))
            origin = points[0]
            try:
                x, z, negative_y = through(points[1] - origin, points[2] - origin)
            except ValueError as error:
                raise head.error(f"coordinate system {label}: {error}") from error
            axes = np.array([x, -negative_y, z])
        frames[label] = CoordinateSystem(origin, axes, _KINDS[kind])
    return frames


def frame_of(label: int, error: Callable[[str], Exception], known: Mapping[int, CoordinateSystem]) -> CoordinateSystem:
    """Return the system of a label. Raises `error` of a message for one that the file does not give."""
    if label in known or label in _GLOBAL:
        return known.get(label, CoordinateSystem())
    raise error(f"the coordinate system {label} is not given in the file; write global coordinates")


def systems(path: Path) -> dict[int, CoordinateSystem]:
    """Return the systems of a file that may hold binary datasets. Raises MeshError."""
    frames = dict[int, CoordinateSystem]()
    text = path.read_bytes().decode("latin-1")
    for dataset in re.finditer(r"^ {4}-1\s*\n +(2420|18) *\r?\n(.*?)^ {4}-1\s*$", text, re.MULTILINE | re.DOTALL):
        first = text.count("\n", 0, dataset.start(2)) + 1
        lines = [DeckLine(path, first + index, line) for index, line in enumerate(dataset[2].splitlines())]
        try:
            frames |= systems_of(int(dataset[1]), lines, frames)
        except StopIteration:
            raise lines[-1].error(f"dataset {dataset[1]} ends within an entry; write the file again") from None
    return frames
