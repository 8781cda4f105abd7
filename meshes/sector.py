"""A sector of a bladed disk or an annular plate: hexahedra whose two faces match, about the z axis.

The sector is centred on the x axis, where x is radial, y tangential and z axial. A blade stands on the rim, a straight
prism along x; a hollow one has a cavity for a damper body, which rotation presses on the wall at the larger radius.
"""

from __future__ import annotations

import math
import os
from dataclasses import MISSING, dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from vanedamp.files.toml_input import Real, Whole
from vanedamp.meshes.parameters import MeshParameters, ParameterError, check_elements
from vanedamp.modal import gmsh_on_demand as gmsh
from vanedamp.modal import msh

_OUTSIDE, _DISK, _BLADE, _CAVITY = range(4)
# largest angle of an element, rad
_WIDEST = math.radians(30.0)


@dataclass(frozen=True)
class Sector(MeshParameters):
    """A sector of a disk with a blade, or of an annular plate without, symmetric about y = 0 and z = 0.

    Facet groups: `low` and `high` (the faces at negative and positive y, of which a turn about z brings the first to
    the second), `bore` and `rim` (inner and outer surface of the disk), `tip` (end of the blade), and in a hollow blade
    `cavity_left` and `cavity_right` (walls at negative and positive y), `cavity_floor` and `cavity_roof` (at the larger
    and the smaller radius). Volume groups: `disk`, `blade`.
    """

    generator: Literal["sector"] = field(default="sector", kw_only=True)
    """"sector": for [ring], a sector of a bladed disk or an annular plate"""
    sectors: Whole
    """number of sectors around the ring"""
    inner_radius: Real
    """inner radius of the disk [m]"""
    outer_radius: Real
    """outer radius of the disk, where the blade begins [m]"""
    thickness: Real
    """axial thickness of the disk [m]"""
    element_size: Real
    """largest size of the elements [m]"""
    blade_length: Real = 0.0
    """radial length of the blade; 0: none [m]"""
    blade_thickness: Real = 0.0
    """tangential thickness of the blade [m]"""
    blade_width: Real = 0.0
    """axial width of the blade, at most that of the disk (default: that) [m]"""
    cavity_length: Real = 0.0
    """radial length of the cavity in the blade; 0: solid [m]"""
    cavity_thickness: Real = 0.0
    """tangential thickness of the cavity [m]"""
    cavity_width: Real = 0.0
    """axial width of the cavity [m]"""
    cavity_wall: Real = 0.0
    """wall between the cavity and the tip (default: the cavity is in the middle) [m]"""
    order: Whole = 1
    """order of the elements' geometry: 1 straight, 2 curved"""

    def __post_init__(self) -> None:
        for item in self.own:
            value = getattr(self, item.name)
            if not math.isfinite(value) or value < 0.0 or (item.default is MISSING and value == 0.0):
                raise ParameterError(f"{item.name}: expected a positive number, not {value}")
        if self.sectors < 2:
            raise ParameterError(f"sectors: expected at least 2, not {self.sectors}")
        if self.order not in (1, 2):
            raise ParameterError(f"order: expected 1 (straight) or 2 (curved elements), not {self.order}")
        if self.outer_radius <= self.inner_radius:
            raise ParameterError(f"outer_radius: expected more than the inner {self.inner_radius} m")
        pitch = 2.0 * self.outer_radius * math.sin(math.pi / self.sectors)
        if self.blade_length:
            _check_within("blade_thickness", self.blade_thickness, pitch)
            _check_within("blade_width", self.axial_width, self.thickness * (1.0 + 1e-12))
        if self.cavity_length:
            if not self.blade_length:
                raise ParameterError("cavity_length: needs a blade; give blade_length")
            _check_within("cavity_length", self.cavity_length, self.blade_length - self.cavity_wall)
            _check_within("cavity_thickness", self.cavity_thickness, self.blade_thickness)
            _check_within("cavity_width", self.cavity_width, self.axial_width)
        sizes = (self.tip_radius - self.inner_radius, pitch, self.thickness)
        check_elements(math.prod(max(length / self.element_size, 1.0) for length in sizes), "element_size")

    @property
    def tip_radius(self) -> float:
        """Radius of the tip of the blade, m."""
        return self.outer_radius + self.blade_length

    @property
    def axial_width(self) -> float:
        """Axial width of the blade, m."""
        return self.blade_width or self.thickness

    @property
    def tip_wall(self) -> float:
        """Wall between the cavity and the tip, m."""
        return self.cavity_wall or 0.5 * (self.blade_length - self.cavity_length)


def _check_within(name: str, value: float, most: float) -> None:
    if not 0.0 < value < most:
        raise ParameterError(f"{name}: expected more than 0 and less than {most:.6g} m, not {value:.6g}")


def build(sector: Sector, path: str | os.PathLike[str]) -> Path:
    """Mesh the sector and write it as gmsh 4.1 text. Returns the path."""
    lines = _lines(sector)
    kinds = _kinds(sector, lines)
    with msh.session("sector"):
        cells = [(name, np.argwhere(kinds == kind), (0, 1, 2)) for name, kind in (("disk", _DISK), ("blade", _BLADE))]
        blocks = [
            (name, len(across), *_elements(first, sector.order, kinds.shape, across))
            for name, first, across in [*cells, *_faces(sector, lines, kinds)]
            if len(first)
        ]
        used = np.unique(np.concatenate([nodes.ravel() for _, dimension, _, nodes in blocks if dimension == 3]))
        for tag, (name, dimension, kind, nodes) in enumerate(blocks, 1):
            gmsh.model.addDiscreteEntity(dimension, tag)
            gmsh.model.addPhysicalGroup(dimension, [tag], name=name)
            if tag == 1:  # all nodes belong to the disk
                gmsh.model.mesh.addNodes(3, 1, used, _points(sector, lines)[used - 1].ravel())
            gmsh.model.mesh.addElementsByType(tag, kind, [], nodes.ravel())
        gmsh.model.mesh.renumberNodes()
        return msh.write(path)


def _lines(sector: Sector) -> list[np.ndarray]:
    """Return the grid: radii (m), angles (rad) and heights (m) of its planes."""
    half, tip = math.pi / sector.sectors, sector.tip_radius
    radii, angles, heights = [sector.inner_radius, sector.outer_radius], [half], [0.5 * sector.thickness]
    if sector.blade_length:
        radii.append(tip)
        angles.append(_angle(sector, sector.blade_thickness))
        heights.append(0.5 * sector.axial_width)
    if sector.cavity_length:
        radii += [tip - sector.tip_wall - sector.cavity_length, tip - sector.tip_wall]
        angles.append(_angle(sector, sector.cavity_thickness))
        heights.append(0.5 * sector.cavity_width)
    size = sector.element_size
    return [
        _divided(radii, size),
        _divided([sign * angle for angle in angles for sign in (-1, 1)], min(size / sector.outer_radius, _WIDEST)),
        _divided([sign * height for height in heights for sign in (-1, 1)], size),
    ]


def _angle(sector: Sector, thickness: float) -> float:
    return math.asin(0.5 * thickness / sector.outer_radius)


def _divided(breaks: list[float], size: float) -> np.ndarray:
    """Return the breaks, ascending, and between them as many even divisions as a size needs."""
    ends = np.unique(breaks)
    counts = np.maximum(np.ceil(np.diff(ends) / size - 1e-9), 1).astype(int)
    pieces = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(ends[:-1], ends[1:], counts, strict=True)]
    return np.concatenate([*pieces, ends[-1:]])


def _kinds(sector: Sector, lines: list[np.ndarray]) -> np.ndarray:
    """Return the kind of every cell of the grid."""
    radii, angles, heights = np.meshgrid(*(0.5 * (line[:-1] + line[1:]) for line in lines), indexing="ij")
    angles, heights = np.abs(angles), np.abs(heights)
    blade = (angles < _angle(sector, sector.blade_thickness)) & (heights < 0.5 * sector.axial_width)
    kinds = np.where(radii < sector.outer_radius, _DISK, np.where(blade, _BLADE, _OUTSIDE))
    if sector.cavity_length:
        end = sector.tip_radius - sector.tip_wall
        hollow = (angles < _angle(sector, sector.cavity_thickness)) & (heights < 0.5 * sector.cavity_width)
        kinds[hollow & (radii < end) & (radii > end - sector.cavity_length)] = _CAVITY
    return kinds


def _faces(sector: Sector, lines: list[np.ndarray], kinds: np.ndarray) -> list[tuple[str, np.ndarray, tuple[int, ...]]]:
    """Return the facet groups: name, first grid point of every facet, and the two directions in which it extends."""
    rim = int(np.searchsorted(lines[0], sector.outer_radius))
    sides: list[tuple[str, int, int, int, int | None]] = [
        ("low", 1, -1, _OUTSIDE, 0), ("high", 1, 1, _OUTSIDE, len(lines[1]) - 1), ("bore", 0, -1, _OUTSIDE, 0),
        ("rim", 0, 1, _OUTSIDE, rim),
    ]  # fmt: skip
    if sector.blade_length:
        sides.append(("tip", 0, 1, _OUTSIDE, len(lines[0]) - 1))
    if sector.cavity_length:
        walls = (("left", 1, 1), ("right", 1, -1), ("floor", 0, -1), ("roof", 0, 1))
        sides += [(f"cavity_{name}", axis, side, _CAVITY, None) for name, axis, side in walls]
    groups = []
    solid = np.pad((kinds == _DISK) | (kinds == _BLADE), 1)
    beyond = np.pad(kinds, 1)
    for name, axis, side, neighbour, plane in sides:
        cells = np.argwhere(solid & (np.roll(beyond, -side, axis) == neighbour)) - 1
        cells[:, axis] += side == 1  # the grid plane of the facet
        if plane is not None:
            cells = cells[cells[:, axis] == plane]
        across = tuple(np.delete(np.arange(3), axis).tolist())
        groups.append((name, cells, across))
    return groups


def _elements(first: np.ndarray, order: int, shape: tuple[int, ...], across: tuple[int, ...]) -> tuple[int, np.ndarray]:
    """Return gmsh's type and the node tags (m, k) of elements from their first grid points (m, 3)."""
    kind = gmsh.model.mesh.getElementType("Hexahedron" if len(across) == 3 else "Quadrangle", order)
    _, _, _, count, coordinates, _ = gmsh.model.mesh.getElementProperties(kind)
    offsets = np.zeros((count, 3), dtype=int)
    offsets[:, across] = np.rint((np.reshape(coordinates, (count, -1)) + 1.0) * 0.5 * order)
    points = order * first[:, None, :] + offsets
    return kind, 1 + np.ravel_multi_index(tuple(np.moveaxis(points, 2, 0)), [order * size + 1 for size in shape])


def _points(sector: Sector, lines: list[np.ndarray]) -> np.ndarray:
    """Return the coordinates (n, 3) of all grid points."""
    steps = [np.arange((len(line) - 1) * sector.order + 1) / sector.order for line in lines]
    finer = [np.interp(step, np.arange(len(line)), line) for step, line in zip(steps, lines, strict=True)]
    radii, angles, heights = (grid.ravel() for grid in np.meshgrid(*finer, indexing="ij"))
    inside = np.minimum(radii, sector.outer_radius)
    return np.column_stack([inside * np.cos(angles) + radii - inside, inside * np.sin(angles), heights])
