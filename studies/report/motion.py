"""Motion of bodies in their cavities for drawing: outlines, walls and contacts, frame by frame.

Clearances are micrometres and bodies millimetres: displacements, tilts and free travels are drawn `factor` times as
large. A corner moves by (x - theta b, y + theta a), as in the equations of motion, so that it is drawn on a surface if
and only if its gap is zero.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.response.response import PlanarSamples
from vanedamp.coupling.scene.bodies import Cavity
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.shapes.block import Block
from vanedamp.coupling.scene.shapes.shape import OUTWARDS, SIDES, Shape, common_heights
from vanedamp.coupling.scene.shapes.slider import Slider
from vanedamp.studies.report.charts import COLOURS

#: periods that are drawn, the last of a run; frames of each at most
_PERIODS, _MOST_FRAMES = 3, 200
#: fraction of a period for which a contact shows that it was hit
_FLASH = 0.03
#: free travels as drawn, over the bodies' length and height, and the cavity's own motion over their length
_ALONG, _ACROSS, _SWING = 0.35, 0.6, 0.25
#: width of the widest cavity's bodies in units of a drawing, and thickness of walls
_WIDTH, _WALL = 100.0, 9.0
#: of a contact in a frame
OPEN, CLOSED, HIT = range(3)
#: directions out of a body, of contacts without a corner
_SIDES = dict(zip(SIDES, OUTWARDS, strict=True))


@dataclass(frozen=True, eq=False)
class BodyFrames:
    """A body as drawn in n frames, in units of the drawing, y upwards.

    form: as which it ran
    outline: (n, k, 2) corners, of a slider as a rectangle; (n, 2, 2) centre and a point of the rim
    face: heights at which it touches a neighbour
    along, lift (m), tilt (rad): (n,) in the cavity, as sampled; nan of a slider
    """

    number: int
    form: Shape
    half: tuple[float, float]
    outline: np.ndarray
    face: tuple[float, float]
    along: np.ndarray
    lift: np.ndarray
    tilt: np.ndarray

    @property
    def round(self) -> bool:
        """Whether it has no corners."""
        return self.form.rolls


@dataclass(frozen=True, eq=False)
class ContactFrames:
    """A contact as drawn: body, side and corner as of an event, points (n, 2), light (n,) OPEN, CLOSED or HIT."""

    place: tuple[int, str, int]
    points: np.ndarray
    light: np.ndarray


class CeilingPart(NamedTuple):
    """The ceiling above a body: its ends along the cavity, and heights (n, 2) there."""

    ends: tuple[float, float]
    heights: np.ndarray


@dataclass(frozen=True, eq=False)
class CavityFrames:
    """A cavity as drawn, in the frame of its floor, whose middle is at (0, 0).

    left, right: (n, 2) faces of the walls at the height of the floor and at `height`; ceiling: parts above each body,
    empty without play; shift: (n, 3) displacement of the floor's middle, and rotation (rad)
    """

    name: str
    left: np.ndarray
    right: np.ndarray
    ceiling: list[CeilingPart]
    shift: np.ndarray
    height: float
    bodies: list[BodyFrames]
    contacts: list[ContactFrames]


@dataclass(frozen=True, eq=False)
class RunFrames:
    """Frames of the last periods of a run.

    time: (n,) periods; each: frames per period; displacement: (n,) m, of the response; factor: by which free travels
    are exaggerated; swing: the same for the motion of the cavities; scale: units of the drawing per metre
    """

    time: np.ndarray
    each: int
    displacement: np.ndarray
    factor: float
    swing: float
    scale: float
    cavities: list[CavityFrames]
    sampled: int

    @property
    def periods(self) -> float:
        """Number of periods that are drawn."""
        return len(self.time) / self.each

    @property
    def has_sliders(self) -> bool:
        """Whether there are bodies without a size, whose drawn size is arbitrary."""
        return any(not body.form.extended for cavity in self.cavities for body in cavity.bodies)

    @property
    def has_extent(self) -> bool:
        """Whether there are bodies with a size."""
        return any(body.form.extended for cavity in self.cavities for body in cavity.bodies)

    @property
    def first(self) -> int:
        """The frame to begin with: the first with a hit, or else with a closed contact."""
        light = np.max([contact.light for cavity in self.cavities for contact in cavity.contacts], axis=0)
        return int(np.argmax(light == light.max()))

    def to_json(self) -> str:
        """Return the data for the player of the page (motion.js), y downwards."""
        data = {
            "time": _short(self.time, 4), "each": self.each, "first": self.first,
            "displacement": _short(1e6 * self.displacement, 3), "cavities": [_drawn(item) for item in self.cavities],
        }  # fmt: skip
        return json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")

    def rows(self) -> Iterator[list[float]]:
        """Yield time (periods) and displacement, then along, lift and tilt of each body."""
        bodies = [body for cavity in self.cavities for body in cavity.bodies]
        columns = [column for body in bodies for column in (body.along, body.lift, body.tilt)]
        yield from np.column_stack([self.time, self.displacement, *columns]).tolist()

    def header(self) -> list[str]:
        """Return the names of the columns of `rows`."""
        numbers = [body.number + 1 for cavity in self.cavities for body in cavity.bodies]
        names = [f"body_{number}_{quantity}" for number in numbers for quantity in ("along", "lift", "tilt")]
        return ["period", "displacement", *names]


def motion_of(
    scene: Scene,
    time: np.ndarray,
    displacement: np.ndarray,
    along: np.ndarray,
    plane: PlanarSamples,
    impacts: list[tuple[float, tuple[int, str, int]]],
) -> RunFrames:
    """Return the last periods of a run.

    time: (t,) s; displacement: (t,) m; along: (t, b) m in the cavity; impacts: time (s) and place as of an event.
    """
    period = 1.0 / scene.frequency
    sampled = round(period / (time[1] - time[0])) if len(time) > 1 else 1
    stride = -(-sampled // _MOST_FRAMES)
    frames = slice(max(len(time) // sampled - _PERIODS, 0) * sampled, None, stride)
    plane = plane.cut(frames)
    time, forms, half = time[frames], _forms(scene, plane), _half_extents(scene)
    factor = _factor(scene, half)
    widths = [sum(2 * half[k][0] for k in scene.bodies_in(cavity)) for cavity in scene.cavity]
    swing = min(factor, _rounded(_SWING * max(widths) / max(np.abs(plane.floor_along).max(), 1e-300)))
    draw = _Drawing(scene, plane, along[frames], forms, half, factor, swing, _WIDTH / max(widths))
    light = np.where(plane.contact_closed, CLOSED, OPEN)
    for moment, struck_contact in impacts:
        recent = (time >= moment) & (time < moment + _FLASH * period)
        struck = np.array([contact == struck_contact for contact in plane.contacts])
        light[recent[:, None] & struck] = HIT
    cavities = [draw.cavity(cavity, light) for cavity in scene.cavity if scene.bodies_in(cavity)]
    return RunFrames(
        time / period, sampled // stride, displacement[frames], factor, swing, draw.scale, cavities, sampled,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Drawing:
    """Data for all cavities of a drawing."""

    scene: Scene
    plane: PlanarSamples
    along: np.ndarray
    forms: list[Shape]
    half: list[tuple[float, float]]
    factor: float
    swing: float
    scale: float

    def cavity(self, cavity: Cavity, light: np.ndarray) -> CavityFrames:
        """Draw a cavity and its bodies, which stand from left to right. light: (n, contacts)."""
        inside = self.scene.bodies_in(cavity)
        length = sum(2 * self.half[k][0] for k in inside)
        bodies, mids, ceiling, at = [], [], [], -length / 2
        for k in inside:
            mids.append(at + self.half[k][0])
            bodies.append(self._body(k, mids[-1]))
            at += 2 * self.half[k][0]
        highest = max(2 * self.half[k][1] for k in inside)
        if cavity.play is not None:
            for k, mid in zip(inside, mids, strict=True):
                a, b = self.half[k]
                heights = 2 * b + self.factor * (cavity.play + self._ceiling(cavity.play, k))
                ceiling.append(CeilingPart((self.scale * (mid - a), self.scale * (mid + a)), self.scale * heights))
            highest += self.factor * cavity.play
        walls = [self._wall(cavity, inside, side, highest) for side in ("left", "right")]
        k = inside[0]
        rotation = self.plane.floor_rotation[:, k]
        across = np.nan_to_num(self.plane.floor_across[:, k]) - rotation * mids[0]
        shift = self.swing * np.column_stack([self.scale * self.plane.floor_along[:, k], self.scale * across, rotation])
        contacts = [
            ContactFrames(contact, self._points(number, bodies), light[:, number])
            for number, contact in enumerate(self.plane.contacts)
            if contact[1] in (*SIDES, "body") and any(body.number == contact[0] for body in bodies)
        ]
        left, right = (
            self.scale * (sign * (length + self.factor * cavity.gap) / 2 + self.factor * wall)
            for sign, wall in zip((-1, 1), walls, strict=True)
        )
        return CavityFrames(cavity.name, left, right, ceiling, shift, self.scale * highest, bodies, contacts)

    def _pose(self, k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return along, lift and tilt (n,) of a body's centre in the frame of its floor."""
        return self.along[:, k], np.nan_to_num(self.plane.body_lift[:, k]), np.nan_to_num(self.plane.body_tilt[:, k])

    def _body(self, k: int, mid: float) -> BodyFrames:
        along, lift, tilt = self._pose(k)
        a, b = self.half[k]
        centre = np.column_stack([mid + self.factor * along, b + self.factor * lift])
        turn = self.factor * tilt[:, None]
        form, damper = self.forms[k], self.scene.damper[k]
        if form.rolls:
            rim = a * np.hstack([-np.sin(turn), np.cos(turn)])
            outline = np.stack([centre, centre + rim], axis=1)
        else:
            outline = centre[:, None, :] + _turned(turn, self._corners(k))
        face = form.face(damper) if form.extended else (b, b)
        return BodyFrames(
            k, form, (self.scale * a, self.scale * b), self.scale * outline,
            (self.scale * face[0], self.scale * face[1]), self.along[:, k], self.plane.body_lift[:, k],
            self.plane.body_tilt[:, k],
        )  # fmt: skip

    def _corners(self, k: int) -> np.ndarray:
        """Return the corners (c, 2) of a body from its centre; of one without any, of the rectangle around it."""
        corners = self.forms[k].corners(self.scene.damper[k])
        a, b = self.half[k]
        return corners if len(corners) else np.array([(-a, -b), (a, -b), (a, b), (-a, b)])

    def _moved(self, k: int, side: str, play: float, *ends: float) -> np.ndarray:
        """Return the outward displacement of a surface relative to the floor, (n, 2) at two ends.

        It is the contact's gap less the clearance from the body's pose, on the line through the contacts.
        ends: from the body's centre, across it for walls, along it for a ceiling.
        """
        along, lift, tilt = self._pose(k)
        across, sign = side == "ceiling", -1.0 if side == "left" else 1.0
        moved: dict[float, np.ndarray] = {}
        for number, (body, at, corner) in enumerate(self.plane.contacts):
            if (body, at) == (k, side):
                a, b = self._corners(k)[corner].tolist() if corner >= 0 else (0.0, 0.0)
                position = lift + a * tilt if across else along - b * tilt
                moved[a if across else b] = self.plane.contact_gap[:, number] - play + sign * position
        if not moved:
            return np.zeros((len(along), 2))
        low, high = min(moved), max(moved)
        slope = (moved[high] - moved[low]) / max(high - low, 1e-300)
        return np.column_stack([moved[low] + slope * (end - low) for end in ends])

    def _ceiling(self, play: float, k: int) -> np.ndarray:
        """Return the rise of the ceiling above a body relative to the floor, (n, 2) at the body's ends."""
        a = self.half[k][0]
        return self._moved(k, "ceiling", play, -a, a)

    def _wall(self, cavity: Cavity, inside: list[int], side: str, height: float) -> np.ndarray:
        """Return the displacement of a wall along the floor relative to it, (n, 2) at the floor and at a height."""
        k = inside[0 if side == "left" else -1]
        sign = -1.0 if side == "left" else 1.0
        b = self.half[k][1]
        return sign * self._moved(k, side, cavity.gap / 2, -b, height - b)

    def _points(self, number: int, bodies: list[BodyFrames]) -> np.ndarray:
        """Return the point of a body at which a contact acts (n, 2)."""
        k, side, corner = self.plane.contacts[number]
        index = next(i for i, body in enumerate(bodies) if body.number == k)
        body = bodies[index]
        centre = body.outline[:, 0] if body.round else body.outline.mean(axis=1)
        if corner >= 0:
            return body.outline[:, corner]
        if side != "body":
            return centre + np.array(_SIDES[side]) * body.half
        heights = common_heights(body.face, bodies[index + 1].face) or (body.half[1],)
        upper = sum(contact == self.plane.contacts[number] for contact in self.plane.contacts[:number])
        point = np.array([body.half[0], heights[upper] - body.half[1]])
        turn = self.factor * np.nan_to_num(body.tilt)[:, None] * (not body.round)
        return centre + _turned(turn, point[None])[:, 0]


def _turned(turn: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return points (k, 2) of a body turned by small angles (n, 1): (n, k, 2)."""
    return points + np.stack([-turn * points[:, 1], turn * points[:, 0]], axis=2)


def _forms(scene: Scene, plane: PlanarSamples) -> list[Shape]:
    """Return the shape as which each body ran: without tilt a slider, with tilt and an open shape a block."""
    return [
        Slider() if np.isnan(tilt).any() else damper.form if damper.form.extended else Block()
        for damper, tilt in zip(scene.damper, plane.body_tilt.T, strict=True)
    ]


def _half_extents(scene: Scene) -> list[tuple[float, float]]:
    """Return half length and half height of every body; bodies without a size get the mean of the others."""
    extents = [damper.half_extent for damper in scene.damper]
    sized = [extent for extent in extents if extent[0] > 0.0]
    a, b = np.mean(sized, axis=0) if sized else np.array([1.5, 1.0]) * max(cavity.gap for cavity in scene.cavity)
    return [extent if extent[0] > 0.0 else (float(a), float(b)) for extent in extents]


def _factor(scene: Scene, half: list[tuple[float, float]]) -> float:
    """Return the factor by which free travels are exaggerated, the largest that fits the drawing."""
    bounds = []
    for cavity in scene.cavity:
        inside = scene.bodies_in(cavity)
        if inside:
            bounds.append(_ALONG * sum(2 * half[k][0] for k in inside) / cavity.gap)
            bounds.append(_ACROSS * min(2 * half[k][1] for k in inside) / (cavity.play or 1e-300))
    return max(_rounded(min(bounds)), 1.0)


def _rounded(value: float) -> float:
    """Return a number of two digits not above a value."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / unit) * unit:.2g}")


def _drawn(cavity: CavityFrames) -> dict[str, Any]:
    """Return the data of a cavity for the player: shapes, and moving quantities with one entry per frame."""
    down = np.array([1.0, -1.0])
    shift = cavity.shift * (1.0, -1.0, -180.0 / math.pi)
    reach = np.abs(shift[:, 0]).max() + _WALL + 2.0
    low = np.abs(shift[:, 1]).max() + _WALL + 2.0
    left, right = float(cavity.left.min()) - reach, float(cavity.right.max()) + reach
    return {
        "name": cavity.name, "wall": _WALL, "height": round(cavity.height, 2),
        "box": [round(value, 2) for value in (left, -cavity.height - low, right - left, cavity.height + 2 * low)],
        "left": _short(cavity.left, 2), "right": _short(cavity.right, 2), "shift": _short(shift, 3),
        "ceiling": [{"ends": part.ends, "heights": _short(part.heights, 2)} for part in cavity.ceiling],
        "bodies": [
            {
                "number": body.number + 1, "round": body.round, "colour": COLOURS[body.number % len(COLOURS)],
                "radius": round(body.half[0], 2), "outline": _short((body.outline * down).reshape(len(shift), -1), 2),
                "along": _short(1e6 * body.along, 3), "lift": _short(1e6 * body.lift, 3),
                "tilt": _short(1e3 * body.tilt, 4),
            }
            for body in cavity.bodies
        ],
        "contacts": [
            {
                "points": _short(contact.points * down, 2), "light": "".join(map(str, contact.light.tolist())),
                "normal": _short(np.array(_SIDES.get(contact.place[1], (0.0, 0.0))) * down, 0),
            }
            for contact in cavity.contacts
        ],
    }  # fmt: skip


def _short(values: np.ndarray, digits: int) -> Any:
    """Return numbers with some digits behind the point as lists, None for nan."""
    if np.isnan(values).any():
        return None
    return (np.round(values, digits) + 0.0).tolist()
