"""The units of a scene: contacts of bodies with their cavities and with each other, stops, friction elements.

A contact is a normal row, its gap, and a slip row with a coefficient of friction; a friction element is a slip row with
a constant limit: the floor under a body that only slides, or a friction damper between structure and casing. Contacts
come first, cavity by cavity from left to right, then contacts of stops and other elements. A slip may have a spring and
a slider behind it (of a friction element: a Jenkins element, which come last).

A body whose height is known lies in a cavity that turns by theta: a point at the height y above the floor meets walls
that move by u - theta y where the floor moves by u.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from vanedamp.coupling.scene.bodies import Cavity, Damper
from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element
from vanedamp.coupling.scene.elements.element import Unit
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.shapes.shape import CEILING, FLOOR, LEFT, RIGHT, SIDES, Shape, common_heights
from vanedamp.coupling.system.modal_basis import ModalBasis, interface_row
from vanedamp.coupling.system.surfaces import Surface, flexibility
from vanedamp.coupling.tangents.dual import scalar, values, vanishes, zeros
from vanedamp.coupling.tangents.opaque import opaque
from vanedamp.files.toml_input import InputError

#: smaller coefficients of friction are treated as zero: their forces are lost in the round-off of others
_SMOOTH = 1e-9
#: singular values of normals below which they depend on each other
_ONE = 1e-9
#: mobility (1/kg) of a point that the first mode does not move
_LIGHT = 1e-30


class Body(NamedTuple):
    """A body: its number, its coordinate x, half its length and the height of its centre above the floor, m.

    centre: position of its middle along the cavity while the bodies stand side by side, m.
    """

    number: int
    damper: Damper
    x: int
    a: float
    b: float
    centre: float

    @property
    def shape(self) -> Shape:
        """Its shape."""
        return self.damper.form

    @property
    def coordinates(self) -> slice:
        """Its coordinates in q."""
        return slice(self.x, self.x + (3 if self.shape.extended else 1))

    def point(self, a: float, b: float, size: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the motion (N,) along and across of a point of the body."""
        along, across = zeros(size), zeros(size)
        along[self.x] = 1.0
        if self.shape.extended:
            along[self.x + 2], across[self.x + 1], across[self.x + 2] = -b, 1.0, a
        return along, across


class Law(NamedTuple):
    """The contact law of a scene at the surfaces of its structure, with the masses (N,) of the coordinates."""

    contact: ContactLaw
    basis: ModalBasis
    mass: np.ndarray

    def element(self, normal: np.ndarray, restitution: float, yields: float) -> Element:
        """Return the element of a contact from its normal row (N,) and the residual flexibility of its wall, m/N.

        The structure's mass is its first mode's, the same for every number of modes.
        """
        mobility = normal**2 / self.mass
        mobility[1 : len(self.basis.stiffness)] = 0.0
        return element_of(self.contact, restitution, 1 / max(scalar(mobility.sum()), _LIGHT), yields)


def element_of(contact: ContactLaw, *numbers: float) -> Element:
    """Return the element of a contact (ContactLaw.element)."""
    if type(contact).element is ContactLaw.element:
        return contact.element(*numbers)
    return Element(*opaque(lambda law, *given: law.element(*given), contact, *numbers))


def layers_of(contact: ContactLaw, element: Element) -> tuple[tuple[float, Element], ...]:
    """Return the elements that make up a contact (ContactLaw.layers)."""
    if type(contact).layers is ContactLaw.layers:
        return contact.layers(element)
    layers: tuple[tuple[float, Element], ...] = opaque(lambda law, local: law.layers(local), contact, element)
    return layers


def layered(contact: ContactLaw, unit: Unit) -> Iterator[Unit]:
    """Yield the units of a contact of the scene's law: springs in parallel begin one below the other."""
    for depth, element in layers_of(contact, unit.element):
        yield unit._replace(rest=unit.rest + depth, element=element)


def contacts_of(law: Law, cavity: Cavity, surfaces: tuple[Surface, ...], bodies: list[Body]) -> Iterator[Unit]:
    """Yield the contacts in a cavity, from left to right: of each body with walls, floor and ceiling, and neighbours.

    Raises InputError for neighbours that do not meet at a common height.
    """
    length = 2 * sum(body.a for body in bodies)
    for index, body in enumerate(bodies):
        right = bodies[index + 1] if index + 1 < len(bodies) else None
        if index == 0:
            yield from _at_wall(law, cavity, surfaces, body, LEFT, -cavity.gap / 2 - length / 2)
        if right is None:
            yield from _at_wall(law, cavity, surfaces, body, RIGHT, cavity.gap / 2 + length / 2)
        for surface in (FLOOR, CEILING):
            yield from _at_floor(law, cavity, surfaces, body, surface)
        if right is not None:
            yield from _between(law, cavity, surfaces, body, right)


def _at_wall(
    law: Law, cavity: Cavity, surfaces: tuple[Surface, ...], body: Body, surface: int, wall: float
) -> Iterator[Unit]:
    """Yield the contacts with the left or the right wall, at `wall` (m) along the cavity."""
    sign, moving = 1.0 if surface == LEFT else -1.0, surfaces[surface]
    for corner, a, b in body.damper.shaped("points", surface):
        along, across = body.point(a, b, len(law.mass))
        moved_along, moved_across = moving.motion(wall, body.b + b)
        # a slider without a height meets the wall where the wall's motion is known
        along[: len(moving.along)] -= moved_along if body.b > 0.0 else moving.along
        across[: len(moving.along)] -= moved_across
        lever = 0.0 if moving.y is None or not body.b else moving.y - body.b - b
        yield _touching(
            law, (sign * along, across), cavity.gap / 2, cavity.gap, body, surface, corner,
            flexibility(law.basis, moving, True, lever),
        )  # fmt: skip


def _at_floor(law: Law, cavity: Cavity, surfaces: tuple[Surface, ...], body: Body, surface: int) -> Iterator[Unit]:
    """Yield the contacts with floor or ceiling."""
    below, play, moving = surface == FLOOR, cavity.play or 0.0, surfaces[surface]
    sign = 1.0 if below else -1.0
    for corner, a, b in body.damper.shaped("points", surface):
        along, across = body.point(a, b, len(law.mass))
        moved_along, moved_across = moving.motion(body.centre + a, 0.0 if below else 2 * body.b + play)
        along[: len(moved_along)] -= moved_along
        across[: len(moved_across)] -= moved_across
        lever = 0.0 if moving.x is None else body.centre + a - moving.x
        yield _touching(
            law, (sign * across, along), 0.0 if below else play, play, body, surface, corner,
            flexibility(law.basis, moving, False, lever),
        )  # fmt: skip


def _touching(
    law: Law, rows: tuple[np.ndarray, np.ndarray], rest: float, play: float, body: Body, surface: int, corner: int,
    yields: float,
) -> Unit:  # fmt: skip
    """Return the contact of a point of a body with a surface; rows: normal and slip, which sliders do not have."""
    (normal, slip), extended = rows, body.shape.extended
    return Unit(
        normal, slip * extended, rest, body.damper.friction * extended,
        law.element(normal, body.damper.restitution, yields), play, body.number, SIDES[surface], corner,
    )  # fmt: skip


def _between(law: Law, cavity: Cavity, surfaces: tuple[Surface, ...], left: Body, right: Body) -> Iterator[Unit]:
    """Yield the contacts of two neighbours at the ends of their common face."""
    if left.shape.extended != right.shape.extended:
        raise InputError(
            f"damper[{right.number}].shape: a slider and a body with extent share cavity '{cavity.name}'; a slider has "
            "no height at which they could touch: give it a shape"
        )
    faces = [item.damper.shaped("face") for item in (right, left)]
    heights, size = common_heights(*faces), len(law.mass)
    if not heights:
        spans = [" to ".join(f"{height:g}" for height in face) for face in faces]
        raise InputError(
            f"damper[{right.number}].shape: touches a neighbour in cavity '{cavity.name}' from {spans[0]} m above the "
            f"floor, and damper[{left.number}] from {spans[1]} m: neighbours must have a height in common"
        )
    both = left.damper, right.damper
    coefficient = opaque(law.contact.pair_restitution, *(body.restitution for body in both))
    smooth = not left.shape.extended or any(vanishes(body.friction) for body in both)
    friction = 0.0 if smooth else (both[0].friction * both[1].friction) ** 0.5
    # the mean flexibility of the cavity's walls
    yields = 0.5 * sum(flexibility(law.basis, surfaces[side], True) for side in (LEFT, RIGHT))
    for height in heights:
        right_along, right_across = right.point(-right.a, height - right.b, size)
        left_along, left_across = left.point(left.a, height - left.b, size)
        normal = right_along - left_along
        yield Unit(
            normal, (right_across - left_across) * (friction > 0.0), 0.0, friction,
            law.element(normal, coefficient, yields), cavity.gap, left.number, "body", other=right.number,
        )  # fmt: skip


class ElementParts(NamedTuple):
    """Ingredients of the rows of a scene's elements (scene.elements.element.Parts): N coordinates, n of them modes.

    law: of contacts; label: of the response; reach: (n,) static displacements of the modes under the excitation; start:
    displacement of the structure by its initial motion, m; floor (b, N), along (b,): as in System; speed: of rotation,
    rad/s.
    """

    law: Law
    label: str
    reach: np.ndarray
    start: float
    floor: np.ndarray
    along: np.ndarray
    speed: float

    def motion(self, label: str | None, key: str) -> np.ndarray:
        """Return the displacement of an interface label. Raises InputError for an unknown one."""
        row, n = zeros(self.floor.shape[1]), len(self.reach)
        row[:n] = interface_row(self.law.basis, label or self.label, key)
        return row

    def slip(self, body: int) -> np.ndarray:
        """Return the displacement of a body along its cavity, relative to it."""
        row = -self.floor[body]
        row[self.along[body]] += 1.0
        return row

    def contact(self, normal: np.ndarray, restitution: float, *labels: str | None) -> Element:
        """Return the scene's contact of a row between points of the structure."""
        yields = sum(self.flexibility({label or self.label: 1.0}) for label in labels)
        return self.law.element(normal, restitution, yields)

    def flexibility(self, shares: Mapping[str, float]) -> float:
        """Return the residual flexibility of a weighted sum of interface labels, m/N."""
        return self.law.basis.flexibility(shares)

    def travel(self, normal: np.ndarray) -> float:
        """Return how far a row of the structure moves, m, at least the smallest number."""
        reach = np.abs(values(normal[: len(self.reach)])) @ self.reach
        return float(reach + values(self.start) + np.finfo(float).tiny)


def element_units(scene: Scene, parts: ElementParts) -> Iterator[Unit]:
    """Yield the units of the scene's elements. Raises TypeError for springs or friction that one does not declare."""
    for table, number, element in scene.elements:
        for unit in opaque(lambda one, of, number=number: tuple(one.units(number, of)), element, parts):
            springs = np.isfinite(unit.element.stiffness) and scene.contact.rigid
            if (springs and not element.yields) or ((unit.friction or unit.limit) and not element.rubs):
                raise TypeError(f"{table}: its units have springs or friction: declare `yields` or `rubs` of its class")
            play = unit.play or max(abs(values(unit.rest)), parts.travel(unit.normal))
            named = unit._replace(side=table, play=play)
            yield from (named,) if element.yields or not unit.normal.any() else layered(scene.contact, named)


def check_friction(contacts: list[Unit], mass: np.ndarray) -> None:
    """Raise InputError for friction by which a motion is not unique.

    That of a single contact that may jam or have two motions (Painleve 1895), and that of rigid contacts of the
    structure closed at rest whose normal forces the equations do not tell apart: joints all round a ring would lose
    their preload to each other.
    """
    at_rest = [u for u in contacts if u.friction > 0.0 and u.rest <= 0.0 and u.other < 0 and u.side not in SIDES]
    rows = [unit.normal / np.linalg.norm(unit.normal) for unit in at_rest if np.isinf(unit.element.stiffness)]
    if len(rows) > 1 and np.linalg.matrix_rank(rows, tol=_ONE) < len(rows):
        raise InputError(
            f"{at_rest[0].side}: the modes do not tell normal forces of rigid ones apart, which friction needs; "
            "give normal_stiffness"
        )
    for unit in contacts:
        if np.isfinite(unit.element.stiffness):  # its force is that of its spring
            continue
        normal = (unit.normal**2 / mass).sum()
        coupled = abs((unit.normal * unit.slip / mass).sum())
        if unit.friction > 0.0 and unit.friction * coupled >= normal:
            if unit.side in SIDES or unit.other >= 0:
                raise InputError(
                    f"damper[{unit.body}].friction: {unit.friction:g} lets the body jam at the {unit.side}; with its "
                    f"length, height and inertia a corner has a unique motion only below {normal / coupled:.4g}"
                )
            raise InputError(
                f"{unit.side}[{unit.body}].friction: {unit.friction:g} lets the structure jam; its motion is unique "
                f"only below {normal / coupled:.4g}; give normal_stiffness or another contact law"
            )


def friction_elements(
    bodies: list[Body],
    floor: np.ndarray,
    holds: np.ndarray,
    casing: np.ndarray,
    grip: np.ndarray,
    casing_spring: np.ndarray,
) -> Iterator[Unit]:
    """Yield the friction elements: floors under bodies that only slide, rigid friction dampers, those with springs.

    floor (b, N), holds (b,), casing (d, N), grip, casing_spring (d,): as in System. Those without a limit do not count.
    """
    none = zeros(floor.shape[1])
    for body in bodies:
        if not body.shape.extended and holds[body.number] > 0.0:
            slip = -floor[body.number]
            slip[body.x] += 1.0
            yield Unit(none, slip, body=body.number, side="floor", limit=scalar(holds[body.number]))
    for number in sorted(np.flatnonzero(grip > 0.0), key=lambda number: bool(casing_spring[number] < np.inf)):
        yield Unit(
            none, casing[number], body=int(number), limit=scalar(grip[number]), tangential=scalar(casing_spring[number])
        )


def coefficient(friction: float) -> float:
    """Return a coefficient of friction, zero where it is lost in the round-off of other forces."""
    # at zero it may begin
    return friction if friction > _SMOOTH else friction - values(friction)
