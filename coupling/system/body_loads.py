"""Gravity and rotation of bodies: they pull along their cavities, press on floors, and bring back on concave tracks.

In a frame that turns at a constant speed W, a body of mass m whose centre is at X, from a point of the axis, feels the
centrifugal load m W^2 P X, P the projector across the axis. With t the direction of its cavity and n the normal from
floor to ceiling it pulls along by m W^2 t.P X and presses on the floor by N = -m W^2 n.P X. Its gradient along the
cavity, m W^2 t.P t, drives the body on from wherever it is. On a concave track, a path of its centre of radius rho, the
floor turns towards the load: the body is brought back by N/rho per displacement from the middle of its floor. In the
plane of rotation both leave m W^2 R/rho, R from the axis to the track's centre of curvature (Den Hartog 1956,
Mechanical Vibrations, section 6.7: the rotating pendulum).

The gradient counts for bodies with a spring or a track, which it detunes; for others it is small against friction, and
`load_warnings` says where it is not. Gravity turns once a revolution in that frame: only its part along the axis, which
stays, counts there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.bodies import Cavity, Damper
from vanedamp.coupling.scene.excitation import pulled
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.cavities import surface_labels
from vanedamp.coupling.system.modal_basis import ModalBasis, basis_of
from vanedamp.coupling.tangents.dual import array, cos, radians, sin, zeros
from vanedamp.files.toml_input import InputError

#: fraction of its reference above which a neglected term is warned of
_SEEN = 0.01
#: directions along and across of cavities of a structure without a geometry: both in the plane of rotation
_ALONG, _ACROSS = np.eye(3)[:2]


class BodyLoads(NamedTuple):
    """Loads of b bodies in the middle of their cavities."""

    along: np.ndarray  # (b,) acceleration along the cavity, positive to the right, m/s^2
    across: np.ndarray  # (b,) acceleration that presses on the floor, m/s^2
    track: np.ndarray  # (b,) stiffness that brings a body on a track back to the middle of its floor, N/m
    gradient: np.ndarray  # (b,) of the centrifugal pull along the cavity, N/m, of bodies with a spring or a track


class _Field(NamedTuple):
    """The field at a body: acceleration (3,) m/s^2, its gradient along the cavity, 1/s^2, and these directions (3,).

    across: None where it is not known; the floor is then where the field presses.
    """

    acceleration: np.ndarray
    gradient: float
    along: np.ndarray
    across: np.ndarray | None


def body_loads(scene: Scene, basis: ModalBasis) -> BodyLoads:
    """Return the loads of a scene's bodies. Raises InputError where the structure lacks them."""
    loads = []
    for index, (damper, centre) in enumerate(zip(scene.damper, centres(scene), strict=True)):
        if scene.speed:
            field = _field(scene, basis, index)
            gradient = field.gradient
            along, across = pulled(field.acceleration, field.along, field.across)
        else:
            gradient = 0.0
            label = surface_labels(scene, scene.cavity_of(damper))[2]
            normal = basis.across(label) if damper.form.planar else None
            along, across = scene.gravity.components(basis.directions[label], normal)
        curvature = 0.0 if damper.track_radius is None else across / damper.track_radius
        if curvature < 0.0 and -across > 1e-12 * abs(along):
            raise InputError(
                f"damper[{index}].track_radius: the body is pulled off its concave floor by {-across:.4g} m/s^2; turn "
                "the cavity round, or leave it out"
            )
        # of several bodies side by side, none is in the middle
        along = along + (gradient - curvature) * centre
        loads.append((along, across, damper.mass * curvature, damper.mass * gradient * _held(damper)))
    return BodyLoads(*array(loads).reshape(-1, 4).T)


def binding(scene: Scene, loads: BodyLoads) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness, N/m, and dashpot, N s/m, (b,) each, that bind the bodies to their floors."""
    springs = array([0.0 if damper.stiffness is None else damper.stiffness for damper in scene.damper]) + loads.track
    return springs, array([0.0 if damper.dashpot is None else damper.dashpot for damper in scene.damper])


def centres(scene: Scene) -> np.ndarray:
    """Return where the centres of the bodies (b,) stand in their cavities, m from the middle, side by side."""
    places = zeros(len(scene.damper))
    for cavity in scene.cavity:
        half = {number: scene.damper[number].half_extent[0] for number in scene.bodies_in(cavity)}
        end = -sum(half.values())
        for number, extent in half.items():
            places[number] = end + extent
            end = places[number] + extent
    return places


def greatest_pull(scene: Scene) -> float:
    """Return the largest acceleration, m/s^2, that gravity and rotation give a body."""
    if not scene.speed:
        return scene.gravity.acceleration
    loads = body_loads(scene, basis_of(scene))
    return float(np.hypot(loads.along, loads.across).max(initial=0.0))


def load_warnings(scene: Scene) -> tuple[str, ...]:
    """Return the warnings of a scene on neglected loads of its bodies, of each kind the first."""
    if not scene.speed and all(damper.track_radius is None for damper in scene.damper):
        return ()
    try:
        basis = basis_of(scene)
        loads = body_loads(scene, basis)
    except InputError:  # which the run reports
        return ()
    by_kind: dict[str, str] = {}
    for index, damper in enumerate(scene.damper):
        body = _Body(scene, damper, float(loads.along[index]), float(loads.across[index]))
        for kind, sentence in itertools.chain(
            _of_rotation(body, _field(scene, basis, index), _standing_gravity(scene, basis)) if scene.speed else (),
            _of_track(body, damper.track_radius) if damper.track_radius is not None else (),
        ):
            by_kind.setdefault(kind, f"damper[{index}]: {sentence}")
    return tuple(by_kind.values())


class _Body(NamedTuple):
    """A body with its accelerations along and across the cavity, m/s^2."""

    scene: Scene
    damper: Damper
    along: float
    across: float

    @property
    def cavity(self) -> Cavity:
        return self.scene.cavity[self.scene.cavity_of(self.damper)]

    @property
    def pressed(self) -> float:
        """Acceleration that presses on the floor, or of a planar body on the ceiling, m/s^2."""
        return abs(self.across)

    @property
    def reach(self) -> float:
        """Travel from the middle to a wall, m."""
        return self.cavity.gap / 2

    @property
    def speed(self) -> float:
        """Speed of a body that goes from wall to wall with the excitation, m/s."""
        return 2 * math.pi * self.scene.frequency * self.reach

    @property
    def inertia(self) -> float:
        """Its largest acceleration then, m/s^2."""
        return 2 * math.pi * self.scene.frequency * self.speed

    def aside(self, field: _Field) -> float:
        """Return the acceleration across the plane of its motion, m/s^2; 0 of a slider, which has no such plane."""
        if field.across is None or not self.damper.form.planar:
            return 0.0
        return abs(float(field.acceleration @ np.cross(field.along, field.across)))


def _of_rotation(body: _Body, field: _Field, gravity: np.ndarray) -> Iterator[tuple[str, str]]:
    """Yield kinds and sentences on neglected effects in a rotating frame. gravity: (3,) that counts, m/s^2."""
    scene, pull = body.scene, float(np.linalg.norm(field.acceleration))
    turning = math.sqrt(max(scene.gravity.acceleration**2 - float(gravity @ gravity), 0.0))
    if turning > _SEEN * pull > 0.0:
        yield (
            "gravity",
            f"gravity turns once a revolution in the rotating frame and is left out; it is {turning / pull:.2g} of the "
            "centrifugal load",
        )
    if not _held(body.damper):
        drift = field.gradient * body.reach
        others = max(body.damper.friction * body.pressed, abs(body.along), body.inertia)
        if drift > _SEEN * others:
            yield (
                "gradient",
                f"along the straight cavity the centrifugal load grows by {drift:.3g} m/s^2 from the middle to a wall, "
                f"which is left out; it is {drift / others:.2g} of what else moves the body. A body with a stiffness "
                "or a track_radius feels it",
            )
    turn = abs(body.cavity.rotation) * body.pressed * body.reach
    if turn > _SEEN * body.inertia:
        yield (
            "rotation",
            f"a cavity that turns by its rotation turns the load on its floor, which is left out; it is "
            f"{turn / body.inertia:.2g} of the body's inertia",
        )
    aside = body.aside(field)
    if body.damper.friction > 0.0 and aside > _SEEN * body.pressed:
        yield (
            "side",
            f"the load has {aside:.3g} m/s^2 across the plane in which the body moves, beside {body.pressed:.3g} "
            "between floor and ceiling; what it presses on there, and that friction, are left out",
        )
    if body.damper.friction > 0.0 and body.pressed > 0.0:
        change = 2 * scene.speed * body.speed / body.pressed
        if change > _SEEN:
            yield (
                "coriolis",
                f"Coriolis' acceleration, which is left out, changes the normal load by {change:.2g} of it at "
                f"{body.speed:.3g} m/s, the speed of a body that goes from wall to wall with the excitation",
            )


def _of_track(body: _Body, radius: float) -> Iterator[tuple[str, str]]:
    """Yield kinds and sentences on neglected effects of a track of that radius (m)."""
    angle = body.reach / radius
    neglected = {"the frequency": angle**2 / 16}
    if body.damper.form.extended and not body.damper.form.rolls:
        neglected["the moving mass"] = body.damper.moment_of_inertia / (body.damper.mass * radius**2)
    if body.across > 0.0 and body.damper.friction > 0.0:
        neglected["the normal load"] = (abs(body.along) * angle + body.speed**2 / radius) / body.across
    for name, share in neglected.items():
        if share > _SEEN:
            yield (
                f"track, {name}",
                f"from the middle to a wall the track turns by {angle:.3g} rad; what small angles neglect is up to "
                f"{share:.2g} of {name}",
            )


def _held(damper: Damper) -> bool:
    return damper.stiffness is not None or damper.track_radius is not None


def _field(scene: Scene, basis: ModalBasis, index: int) -> _Field:
    """Return the field at a body in the middle of its cavity, in a scene that rotates. Raises InputError."""
    damper, square = scene.damper[index], scene.speed**2
    cavity = scene.cavity[scene.cavity_of(damper)]
    if not isinstance(scene.structure, Rom):
        angle = radians(cavity.centrifugal_deg)
        outward = -sin(angle) * _ALONG - cos(angle) * _ACROSS
        return _Field(square * (0.0 if cavity.radius is None else cavity.radius) * outward, square, _ALONG, _ACROSS)
    axis, point = basis.rotation_axis, basis.rotation_point
    if axis is None or point is None:
        raise InputError(
            "rotation: the reduced model knows no axis, which turns the bodies; give its case a [rotation] table with "
            "axis and point, and reduce again"
        )
    label = str(cavity.labels()[2])
    along, across = basis.directions[label], basis.across(label) if damper.form.planar else None
    for name, known in (("direction", along.any()), ("position", label in basis.positions)):
        if not known:
            raise InputError(
                f"cavity[{scene.cavity_of(damper)}].floor: the reduced model knows no {name} of '{label}', which "
                "[rotation] needs for the bodies on it; give it and reduce or import again"
            )
    arm = basis.positions[label] - point
    walls = [str(wall) for wall in cavity.labels()[:2]]
    inside = cavity.floor is None or label not in walls  # else a wall is the floor, at the cavity's position
    if inside and all(wall in basis.positions for wall in walls):
        middle = 0.5 * (basis.positions[walls[0]] + basis.positions[walls[1]]) - point
        arm = arm + along * ((middle - arm) @ along)
    if across is not None:
        arm = arm + across * damper.half_extent[1]
    load = square * (arm - axis * (arm @ axis))
    gradient = square * (1.0 - (along @ axis) ** 2)
    return _Field(load + _standing_gravity(scene, basis), gradient, along, across)


def _standing_gravity(scene: Scene, basis: ModalBasis) -> np.ndarray:
    """Return the part (3,) of gravity along the axis, m/s^2, which stands still in the rotating frame."""
    if scene.gravity.direction is None or basis.rotation_axis is None:
        return np.zeros(3)
    down = np.array(scene.gravity.direction)
    share = scene.gravity.acceleration * (float(down @ basis.rotation_axis) / float(np.linalg.norm(down)))
    load: np.ndarray = share * basis.rotation_axis
    return load
