"""Directions of cavities in space: those that a reduced model gives, and checks that they fit together.

Left wall, right wall, floor and ceiling of a cavity have one direction, the body's motion from the left wall to
the right one. Along it the body feels gravity and the base's motion. Across it they have one, too, from the floor to
the ceiling, where they have coordinates of that motion.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vanedamp.coupling.scene.bodies import Cavity
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.modal_basis import ModalBasis
from vanedamp.files.toml_input import InputError
from vanedamp.rom.reduced import NORMAL

#: degrees between the directions of one cavity's surfaces, for walls that open like a wedge, and off a wall's normal
_PARALLEL, _ALONG = 5.0, 45.0

Vectors = Mapping[str, np.ndarray]


def surface_labels(scene: Scene, index: int) -> tuple[str, str, str]:
    """Return the interface labels of left wall, right wall and floor of a cavity."""
    if not isinstance(scene.structure, Rom):
        return ("structure",) * 3
    left, right, floor = scene.cavity[index].labels()
    return str(left), str(right), str(floor)


def check_directions(scene: Scene, basis: ModalBasis) -> None:
    """Raise InputError where a reduced model lacks a direction that the scene needs, or where directions do not fit."""
    if not isinstance(scene.structure, Rom):
        return
    if scene.excitation.base_acceleration and not basis.base.any():
        raise InputError(
            "excitation.base_acceleration: the reduced model does not say how a base loads it (its base_load is zero); "
            "give it one, or excite by a force"
        )
    labels = [label for cavity in scene.cavity for label in (*cavity.labels(), cavity.ceiling) if label]
    if not {str(label) for label in [scene.excitation.at, *labels]} <= set(basis.rows):
        return  # an unknown label is rejected where its row is wanted
    _check_displacements(scene, basis.rotations)
    _check_known(scene, basis.directions)
    for index, cavity in enumerate(scene.cavity):
        key = f"cavity[{index}]"
        _check_parallel(cavity, key, basis.directions)
        _check_walls(cavity, key, basis.directions, basis.normals)
        if scene.planar:
            _check_across(cavity, key, basis.directions, basis.normals)


def _check_known(scene: Scene, directions: Vectors) -> None:
    """Raise InputError where base acceleration or gravity need a direction that the reduced model lacks."""
    excitation, gravity = scene.excitation, scene.gravity
    reasons = ["excitation.base_acceleration"] if excitation.base_acceleration else []
    wanted = [("excitation.at", str(excitation.at))] if reasons and excitation.base_direction is None else []
    if gravity.direction is not None and gravity.acceleration:
        reasons.append("gravity.direction")
    if reasons:
        used = {damper.cavity for damper in scene.damper}
        cavities = [(index, cavity) for index, cavity in enumerate(scene.cavity) if cavity.name in used]
        floors = [(f"cavity[{index}].floor", str(cavity.labels()[2])) for index, cavity in cavities]
        wanted += floors + [(key, label + NORMAL) for key, label in floors if label + NORMAL in directions]
    for key, label in wanted:
        if not directions[label].any():
            raise InputError(
                f"{key}: the reduced model knows no direction of '{label}', which {reasons[0]} needs; give the "
                "interface coordinate a direction and reduce or import again"
            )


def _check_displacements(scene: Scene, rotations: frozenset[str]) -> None:
    """Raise InputError where an angle stands for a displacement."""
    keys: dict[str, str | None] = {"excitation.at": scene.excitation.at}
    for index, cavity in enumerate(scene.cavity):
        keys |= {f"cavity[{index}].{side}": getattr(cavity, side) for side in ("left", "right", "floor", "ceiling")}
    for table, number, element in scene.elements:
        keys |= {f"{table}[{number}].{key}": label for key, label in element.labels().items()}
    keys |= {name: load.at for name, load in scene.excitation.loads.items()}
    for index, damper in enumerate(scene.friction_damper):
        keys |= {f"friction_damper[{index}].{key}": getattr(damper, key) for key in ("at", "to")}
    for key, label in keys.items():
        if label in rotations:
            raise InputError(f"{key}: '{label}' is a rotation (rad); name the interface coordinate of a displacement")


def _check_parallel(cavity: Cavity, key: str, directions: Vectors) -> None:
    """Raise InputError for surfaces with several directions (of interface labels; zeros, unknown, pass)."""
    left, right, floor = map(str, cavity.labels())
    ceiling = cavity.ceiling or floor
    pairs = ("right", right, left), ("left", left, floor), ("right", right, floor), ("ceiling", ceiling, floor)
    for side, label, other in pairs:
        angle = _angle(directions[label], directions[other])
        if angle > _PARALLEL:
            fault = "against" if angle > 180.0 - _PARALLEL else f"at {angle:.0f} degrees to"
            raise InputError(
                f"{key}.{side}: '{label}' points {fault} '{other}', {_format(directions[label])} and "
                f"{_format(directions[other])}: both walls and the floor take the one direction from the left wall to "
                "the right one; mend the interface's directions and reduce again"
            )


def _check_walls(cavity: Cavity, key: str, directions: Vectors, normals: Vectors) -> None:
    """Raise InputError for walls that do not face the cavity.

    One label for a whole cavity may be any surface, and a wall that is floor too follows the floor.
    """
    if len(set(cavity.labels())) == 1:
        return
    for side, label, opposite in (("left", cavity.left, cavity.right), ("right", cavity.right, cavity.left)):
        if label is None or label == cavity.floor or not (normals[label].any() and directions[label].any()):
            continue
        angle = _angle(directions[label], normals[label])
        along = normals[label] if side == "left" else -normals[label]
        if _ALONG < angle < 180.0 - _ALONG:
            raise InputError(
                f"{key}.{side}: '{label}' has a direction {_format(directions[label])} at {angle:.0f} degrees to its "
                f"wall's normal, so that bodies would slide along the wall; give the interface the direction "
                f"{_format(along)} and reduce again"
            )
        if opposite is not None and opposite != label and (angle > 90.0) == (side == "left"):
            raise InputError(
                f"{key}.{side}: along its direction {_format(directions[label])} '{label}' is the wall at the other "
                f"end (its material's outward normal is {_format(normals[label])}): swap left and right, or turn the "
                "directions of both walls and the floor round and reduce again"
            )


def _check_across(cavity: Cavity, key: str, directions: Vectors, normals: Vectors) -> None:
    """Raise InputError for surfaces with several directions across, and a floor or ceiling on the other side.

    The facets that make a floor face along its transverse direction, a ceiling's against it.
    """
    left, right, floor = map(str, cavity.labels())
    across = directions.get(floor + NORMAL, np.zeros(3))
    labels = {"left": left, "right": right, "ceiling": cavity.ceiling or floor}
    for side, label in labels.items():
        normal = directions.get(label + NORMAL, np.zeros(3))
        angle = _angle(normal, across)
        if angle > _PARALLEL:
            raise InputError(
                f"{key}.{side}: across the cavity '{label}' points at {angle:.0f} degrees to '{floor}', "
                f"{_format(normal)} and {_format(across)}: all surfaces take the one `normal` out of the floor; "
                "mend the interface's and reduce again"
            )
    for side, surface, sign in (("floor", floor, 1.0), ("ceiling", cavity.ceiling or floor, -1.0)):
        if side == "ceiling" and surface == floor:
            continue
        angle = _angle(across, sign * normals[surface])
        if angle > 90.0 - _ALONG:
            raise InputError(
                f"{key}.{side}: the facets of '{surface}' look along {_format(normals[surface])}, which is "
                f"{angle:.0f} degrees off a {side}'s where the direction across is {_format(across)}; name the {side}, "
                "or mend `normal`"
            )


def _angle(first: np.ndarray, second: np.ndarray) -> float:
    """Return the angle of two vectors, degrees; 0 where one is zero."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))


def _format(vector: np.ndarray) -> str:
    return "[" + ", ".join(f"{round(value, 3) + 0.0:g}" for value in vector) + "]"
