"""A parametric vane cluster: outer shroud, airfoils, and an inner shroud with cavities for damper bodies.

The machine's axis is x. The cluster is centred on the z axis: there z is radial and y tangential, so that a bending of
the airfoils moves the inner shroud along y. The casing holds the outer shroud on its outer surface.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

import numpy as np

from vanedamp.meshes.parameters import ParameterError, VaneCluster
from vanedamp.modal import gmsh_on_demand as gmsh
from vanedamp.modal import msh

__all__ = ["SHIPPED", "ParameterError", "VaneCluster", "build"]

SHIPPED = Path(__file__).with_name("vane_cluster.msh")
_TOLERANCE = 1e-7  # m


def build(parameters: VaneCluster, path: str | os.PathLike[str]) -> Path:
    """Mesh the cluster and write it as gmsh 4.1 text. Returns the path.

    Raises ParameterError for a geometry that does not come out as it should, MeshError when groups overlap and
    files.store.StoreError when there is no folder to write to.
    """
    if Path(path).suffix != ".msh":
        raise ParameterError(f"path: expected a file name ending in .msh, not {path}")
    with msh.session("vane_cluster"):
        volumes = solids(parameters)
        for name, tags in volumes.items():
            gmsh.model.addPhysicalGroup(3, tags, name=name)
        for name, tags in facets(parameters).items():
            gmsh.model.addPhysicalGroup(2, tags, name=name)
        for option in ("Mesh.MeshSizeMin", "Mesh.MeshSizeMax"):
            gmsh.option.setNumber(option, parameters.element_size)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.optimize("Netgen")
        gmsh.model.mesh.setOrder(parameters.order)
        if parameters.order > 1 and msh.inverted():
            # flat elements at a coarse arc fold over when they are bent to it
            gmsh.model.mesh.optimize("HighOrder")
        gmsh.model.mesh.renumberNodes()
        msh.check_disjoint(2, "facet")
        return msh.write(path)


def solids(parameters: VaneCluster) -> dict[str, list[int]]:
    """Make the volumes: shrouds with pockets, the airfoils between them and the bodies in them, with shared faces."""
    occ = gmsh.model.occ
    inner = _annular_sector(parameters, parameters.inner_radius, parameters.platform_radius)
    outer = _annular_sector(parameters, parameters.casing_radius, parameters.outer_radius)
    angles = (np.arange(parameters.airfoils) - 0.5 * (parameters.airfoils - 1)) * math.radians(parameters.pitch_deg)
    blades = [(3, _airfoil(parameters, angle)) for angle in angles]
    airfoils, _ = occ.cut(blades, [(3, inner), (3, outer)], removeTool=False)
    if parameters.cavities:
        pockets = [(3, _pocket(parameters, angle)) for angle in parameters.cavity_angles()]
        occ.cut([(3, inner)], pockets)
    bodies = [(3, _damper(parameters, angle)) for angle in parameters.cavity_angles() if any(parameters.damper_size)]
    _, pieces = occ.fragment([(3, outer), (3, inner)], airfoils + bodies)
    occ.synchronize()
    groups = {
        "outer_shroud": [tag for _, tag in pieces[0]],
        "airfoils": [tag for piece in pieces[2 : 2 + len(airfoils)] for _, tag in piece],
        "inner_shroud": [tag for _, tag in pieces[1]],
        "damper": [tag for piece in pieces[2 + len(airfoils) :] for _, tag in piece],
    }
    if not bodies:
        del groups["damper"]
    counts = {name: len(tags) for name, tags in groups.items()}
    expected = {"outer_shroud": 1, "airfoils": parameters.airfoils, "inner_shroud": 1, "damper": parameters.cavities}
    if counts != {name: expected[name] for name in groups}:
        raise ParameterError(f"span: the cluster falls into {counts} pieces; check span, stagger and chord")
    return groups


def _annular_sector(parameters: VaneCluster, inner: float, outer: float) -> int:
    occ = gmsh.model.occ
    half = 0.5 * math.radians(parameters.sector_deg)
    back = -0.5 * parameters.axial_length

    def point(radius: float, angle: float) -> int:
        return occ.addPoint(back, radius * math.sin(angle), radius * math.cos(angle))

    centre = occ.addPoint(back, 0.0, 0.0)
    corners = [point(inner, -half), point(inner, half), point(outer, half), point(outer, -half)]
    edges = [
        occ.addCircleArc(corners[0], centre, corners[1]),
        occ.addLine(corners[1], corners[2]),
        occ.addCircleArc(corners[2], centre, corners[3]),
        occ.addLine(corners[3], corners[0]),
    ]
    face = occ.addPlaneSurface([occ.addCurveLoop(edges)])
    solid = occ.extrude([(2, face)], parameters.axial_length, 0.0, 0.0)
    occ.remove([(0, centre)])
    return next(tag for dimension, tag in solid if dimension == 3)


def _airfoil(parameters: VaneCluster, angle: float) -> int:
    """Make a prism whose ends lie inside both shrouds."""
    occ = gmsh.model.occ
    foot = parameters.platform_radius - 0.5 * parameters.inner_thickness
    tip = parameters.casing_radius + 0.5 * parameters.outer_thickness
    suction, pressure = parameters.profile()
    upper = [occ.addPoint(x, y, foot) for x, y in suction]
    lower = [upper[0]] + [occ.addPoint(x, y, foot) for x, y in pressure[1:]]
    edges = [occ.addSpline(upper), occ.addLine(upper[-1], lower[-1]), occ.addSpline(lower)]
    face = occ.addPlaneSurface([occ.addCurveLoop(edges)])
    solid = [entity for entity in occ.extrude([(2, face)], 0.0, 0.0, tip - foot) if entity[0] == 3]
    occ.rotate(solid, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -angle)
    return int(solid[0][1])


def _pocket(parameters: VaneCluster, angle: float) -> int:
    # reaching out of the end face keeps the cut free of coincident faces
    reach = parameters.cavity_depth + parameters.axial_length
    size = (reach, parameters.cavity_width, parameters.cavity_height)
    return _box(parameters, angle, 0.5 * parameters.axial_length - parameters.cavity_depth, size)


def _damper(parameters: VaneCluster, angle: float) -> int:
    middle = 0.5 * (parameters.axial_length - parameters.cavity_depth)
    return _box(parameters, angle, middle - 0.5 * parameters.damper_depth, parameters.damper_size)


def _box(parameters: VaneCluster, angle: float, back: float, size: tuple[float, float, float]) -> int:
    """Make a box on the floor of a cavity, from the axial position `back` on; axial, tangential and radial size."""
    occ = gmsh.model.occ
    floor = parameters.cavity_radius - 0.5 * parameters.cavity_height
    box = occ.addBox(back, -0.5 * size[1], floor, *size)
    occ.rotate([(3, box)], 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -angle)
    return int(box)


def facets(parameters: VaneCluster) -> dict[str, list[int]]:
    """Return the facet groups, found by the position of their surfaces."""
    surfaces = [tag for _, tag in gmsh.model.getBoundary(gmsh.model.getEntities(3), combined=True, oriented=False)]
    groups = {
        "clamp": [tag for tag in surfaces if _on_cylinder(tag, parameters.outer_radius)],
        "shroud": [tag for tag in surfaces if _on_cylinder(tag, parameters.inner_radius)],
    }
    centres = {tag: np.array(gmsh.model.occ.getCenterOfMass(2, tag)) for tag in surfaces}
    groups |= _ends(parameters, centres)
    for number, angle in enumerate(parameters.cavity_angles(), start=1):
        for side, tags in _walls(parameters, angle, centres).items():
            # a tied body may cover a wall
            if tags or not any(parameters.damper_size):
                groups[f"c{number}_{side}"] = tags
    empty = [name for name, tags in groups.items() if not tags]
    if empty:
        raise ParameterError(f"cavity_width: no surface found for facet groups {', '.join(empty)}")
    return groups


def _walls(parameters: VaneCluster, angle: float, centres: dict[int, np.ndarray]) -> dict[str, list[int]]:
    """Return the surfaces of the walls of the cavity at an angle, from the centres (axial, y, z) of all surfaces."""
    sine, cosine = math.sin(angle), math.cos(angle)
    half = 0.5 * np.array([parameters.cavity_depth, parameters.cavity_width, parameters.cavity_height])
    middle = np.array([0.5 * parameters.axial_length - half[0], 0.0, parameters.cavity_radius])
    walls: dict[str, list[int]] = {"left": [], "right": [], "floor": [], "roof": []}
    for tag, (x, y, z) in centres.items():
        offset = np.array([x, y * cosine - z * sine, y * sine + z * cosine]) - middle
        inside = np.abs(offset) < half - _TOLERANCE
        for side, axis, sign in (("left", 1, -1), ("right", 1, 1), ("floor", 2, -1), ("roof", 2, 1)):
            others = np.delete(inside, axis)
            if others.all() and abs(offset[axis] - sign * half[axis]) < _TOLERANCE:
                walls[side].append(tag)
    return walls


def _ends(parameters: VaneCluster, centres: dict[int, np.ndarray]) -> dict[str, list[int]]:
    """Return the end faces of the inner shroud, at the smaller and the larger angle, from the centres of surfaces."""
    half = 0.5 * math.radians(parameters.sector_deg)
    ends: dict[str, list[int]] = {"shroud_low": [], "shroud_high": []}
    for tag, (_, y, z) in centres.items():
        if math.hypot(y, z) < parameters.platform_radius:
            for name, angle in (("shroud_low", -half), ("shroud_high", half)):
                if abs(math.atan2(y, z) - angle) * parameters.inner_radius < _TOLERANCE:
                    ends[name].append(tag)
    return ends


def _on_cylinder(surface: int, radius: float) -> bool:
    """Return whether a surface lies on the cylinder of that radius about the machine's axis."""
    lower, upper = (np.array(bound) for bound in gmsh.model.getParametrizationBounds(2, surface))
    shares = np.array([[0.5, 0.5], [0.2, 0.3], [0.9, 0.6]])
    points = np.array(gmsh.model.getValue(2, surface, (lower + shares * (upper - lower)).ravel())).reshape(-1, 3)
    return bool(np.all(np.abs(np.hypot(points[:, 1], points[:, 2]) - radius) < _TOLERANCE))
