"""Rods, beams and plates for verification: blocks along x, of constant or tapering width, with named faces."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from vanedamp.files.toml_input import Real, Whole
from vanedamp.meshes.parameters import MeshParameters, ParameterError, check_elements, check_size
from vanedamp.modal import gmsh_on_demand as gmsh
from vanedamp.modal import msh

#: ratio of lengths; gmsh merges points nearer than 1e-8 of a model's size
_SLENDEREST = 1e5
_FACES = ("root", "tip", "left", "right", "bottom", "top")


@dataclass(frozen=True)
class TaperedBlock(MeshParameters):
    """A block from x = 0 to `length`, symmetric about y = 0, from z = 0 to `thickness`.

    Facet groups: `root` (x = 0), `tip` (x = length), `left` and `right` (the faces of negative and positive y),
    `bottom` (z = 0) and `top`. Volume group: `block`.
    """

    generator: Literal["block"] = field(default="block", kw_only=True)
    """"block": a rod, beam or plate for verification"""
    length: Real
    """length along x, from the root (x = 0) to the tip [m]"""
    width: Real
    """width along y, at the root [m]"""
    thickness: Real
    """thickness along z [m]"""
    tip_width: Real | None = None
    """width at the tip (default: that of the root) [m]"""
    divisions: tuple[Whole, Whole, Whole] = (8, 1, 1)
    """elements along x, y and z of a structured mesh"""
    hexahedra: bool = False
    """hexahedra in a structured mesh, in place of tetrahedra"""
    element_size: Real | None = None
    """size of the tetrahedra of an unstructured mesh (default: structured) [m]"""
    order: Whole = 1
    """order of the elements' geometry: 1 straight, 2 curved"""

    def __post_init__(self) -> None:
        for name in ("length", "width", "thickness", "tip_width", "element_size"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ParameterError(f"{name}: expected a positive number of metres, not {value}")
        lengths = [self.length, self.width, self.thickness, self.tip_width or self.width]
        if max(lengths) > _SLENDEREST * min(lengths):
            raise ParameterError(f"length: {max(lengths):g} m beside {min(lengths):g} m is more than gmsh can resolve")
        if len(self.divisions) != 3 or any(count < 1 for count in self.divisions):
            raise ParameterError(f"divisions: expected three counts of at least 1, not {self.divisions}")
        if self.hexahedra and self.element_size is not None:
            raise ParameterError("hexahedra: an unstructured mesh is of tetrahedra; leave out element_size")
        if self.element_size is None:
            check_elements(math.prod(self.divisions) * (1 if self.hexahedra else 6), "divisions")
        else:
            width = 0.5 * (self.width + (self.tip_width or self.width))
            check_size(self.element_size, self.length * width * self.thickness)


def build(block: TaperedBlock, path: str | os.PathLike[str]) -> Path:
    """Mesh the block and write it as gmsh 4.1 text. Returns the path."""
    with msh.session("block"):
        volume = _solid(block)
        gmsh.model.addPhysicalGroup(3, [volume], name="block")
        for name, surface in zip(_FACES, _faces(block, volume), strict=True):
            gmsh.model.addPhysicalGroup(2, [surface], name=name)
        if block.element_size is not None:
            gmsh.option.setNumber("Mesh.MeshSizeMin", block.element_size)
            gmsh.option.setNumber("Mesh.MeshSizeMax", block.element_size)
        gmsh.option.setNumber("Mesh.ElementOrder", block.order)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.renumberNodes()
        return msh.write(path)


def _solid(block: TaperedBlock) -> int:
    geo = gmsh.model.geo
    root, tip = 0.5 * block.width, 0.5 * (block.tip_width or block.width)
    corners = [geo.addPoint(x, y, 0.0) for x, y in ((0, -root), (block.length, -tip), (block.length, tip), (0, root))]
    edges = [geo.addLine(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    face = geo.addPlaneSurface([geo.addCurveLoop(edges)])
    along_x, along_y, along_z = block.divisions
    if block.element_size is None:
        for edge, count in zip(edges, (along_x, along_y, along_x, along_y), strict=True):
            geo.mesh.setTransfiniteCurve(edge, count + 1)
        geo.mesh.setTransfiniteSurface(face)
        if block.hexahedra:
            geo.mesh.setRecombine(2, face)
    layers = [along_z] if block.element_size is None else []
    solid = geo.extrude([(2, face)], 0.0, 0.0, block.thickness, numElements=layers, recombine=block.hexahedra)
    geo.synchronize()
    return next(tag for dimension, tag in solid if dimension == 3)


def _faces(block: TaperedBlock, volume: int) -> list[int]:
    """Return the surfaces in the order of `_FACES`, found by the middles of their bounding boxes."""
    surfaces = [tag for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False)]
    boxes = {tag: gmsh.model.getBoundingBox(2, tag) for tag in surfaces}
    middles = {tag: [0.5 * (box[axis] + box[axis + 3]) for axis in range(3)] for tag, box in boxes.items()}
    return [choose(surfaces, key=lambda tag: middles[tag][axis]) for axis in range(3) for choose in (min, max)]
