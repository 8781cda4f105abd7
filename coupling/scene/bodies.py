"""Cavities, the bodies in them, friction dampers, and stops."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Fraction, NonNegative, Positive, Real


def _addressable(name: str) -> str:
    """Return a name that a dotted path such as cavity.c1.gap can hold, distinct from an index and from a key."""
    if not name or "." in name or name.isdecimal() or name in Cavity.__dataclass_fields__:
        raise ValueError("expected a word that is no number and no key and has no dot, such as 'c1'")
    return name


@dataclass(frozen=True, config=STRICT)
class Cavity:
    """A cavity with total free travel `gap` (m) along it and, for bodies with extent, `play` (m) across it.

    On a reduced model left, right, floor and ceiling name interface labels. normal_motion, rotation: motion across and
    rotation (rad/m) per unit of the floor's motion along the cavity, where the structure has no coordinates for them.
    radius: m, from the axis of rotation to the body's centre at mid-travel, with centrifugal_deg (0: the centrifugal
    load presses the bodies on the floor, 90: it pulls them along the cavity to its left wall) for a structure without a
    geometry; the cavity lies in the plane of rotation.
    """

    name: Annotated[str, AfterValidator(_addressable)]
    gap: Positive
    left: str | None = None
    right: str | None = None
    floor: str | None = None
    ceiling: str | None = None
    play: Positive | None = None
    normal_motion: Real = 0.0
    rotation: Real = 0.0
    radius: Positive | None = None
    centrifugal_deg: Real = 0.0

    def labels(self) -> tuple[str | None, str | None, str | None]:
        """Return the labels of left wall, right wall and floor; a single one serves all three."""
        given = self.floor or self.left or self.right
        return self.left or given, self.right or given, self.floor or given


@dataclass(frozen=True, config=STRICT)
class Damper:
    """A loose body: mass (kg), Coulomb friction and restitution coefficients, state relative to the cavity.

    shape: "slider", one coordinate along the cavity; "block" (length, height, m) and "disc" (radius, m) move in the
    plane of the cavity; "auto": a block, run as a slider where that changes the mean amplitude by at most `tolerance`
    (relative, 0.05 unless given). inertia: kg m^2 about the centre, that of the homogeneous body unless given. lift:
    height of its lowest point above the floor, m; tilt: rad. stiffness, dashpot: of a spring between body and floor,
    along it. track_radius: m, of the path of its centre on a concave floor, whose middle is that of the free travel.
    """

    cavity: str
    mass: Positive
    friction: NonNegative = 0.0
    restitution: Fraction = 1.0
    position: Real = 0.0
    velocity: Real = 0.0
    normal_load: NonNegative | None = None
    shape: Literal["slider", "block", "disc", "auto"] = "slider"
    length: Positive | None = None
    height: Positive | None = None
    radius: Positive | None = None
    inertia: Positive | None = None
    lift: NonNegative = 0.0
    tilt: Real = 0.0
    lift_velocity: Real = 0.0
    tilt_rate: Real = 0.0
    stiffness: Positive | None = None
    dashpot: NonNegative | None = None
    track_radius: Positive | None = None
    tolerance: Annotated[Real, Field(gt=0, lt=1)] | None = None

    def __post_init__(self) -> None:
        block = ("length", "height")
        wanted = {"slider": (), "block": block, "disc": ("radius",), "auto": block}[self.shape]
        for key in ("length", "height", "radius"):
            if (getattr(self, key) is not None) != (key in wanted):
                raise ValueError(f'{key}: {"missing" if key in wanted else "not a measure"} of shape = "{self.shape}"')
        if self.shape == "slider":
            for key in ("inertia", "lift", "tilt", "lift_velocity", "tilt_rate"):
                if getattr(self, key):
                    raise ValueError(f'{key}: a slider only moves along its cavity; take shape = "block" or "disc"')
        elif self.normal_load is not None:
            raise ValueError(f'normal_load: a body of shape = "{self.shape}" is pressed by its contacts; leave it out')
        if self.track_radius is not None and self.normal_load is not None:
            raise ValueError(
                "normal_load: on a track the load across the cavity brings the body back as well; leave it out"
            )
        if self.tolerance is not None and self.shape != "auto":
            raise ValueError(f'tolerance: of shape = "auto", which chooses; leave it out of shape = "{self.shape}"')

    @property
    def planar(self) -> bool:
        """Whether the body needs the plane: it has an extent, or a spring or a track of its own."""
        return self.shape != "slider" or self.sprung

    @property
    def sprung(self) -> bool:
        """Whether a spring, a dashpot or a concave track binds the body to its cavity."""
        return (self.stiffness, self.dashpot, self.track_radius) != (None, None, None)

    @property
    def half_extent(self) -> tuple[float, float]:
        """Half the length and half the height, m; 0 of a slider."""
        if self.shape == "disc":
            assert self.radius is not None
            return self.radius, self.radius
        return (self.length or 0.0) / 2, (self.height or 0.0) / 2

    @property
    def moment_of_inertia(self) -> float:
        """Moment of inertia about the centre, kg m^2."""
        if self.inertia is not None:
            return self.inertia
        a, b = self.half_extent
        return self.mass * (a * a / 2 if self.shape == "disc" else (a * a + b * b) / 3)


@dataclass(frozen=True, config=STRICT)
class FrictionDamper:
    """A Coulomb element between the structure and the casing: the spring-loaded damper that is the usual remedy.

    With a tangential `stiffness` (N/m) a Jenkins element: spring and slider in series, unloaded at time zero.
    It acts at interface label `at` of a reduced model (default: excitation.at).
    """

    normal_force: Positive
    friction: NonNegative
    stiffness: Positive | None = None
    at: str | None = None


@dataclass(frozen=True, config=STRICT)
class Stop:
    """Contact of the structure with the ground or with itself: a stop on one `side` of it, `gap` (m) away at rest.

    On a reduced model `at` and `to` name interface labels: the stop is at `to`, which moves, or at the ground.
    """

    side: Literal["left", "right"]
    gap: NonNegative
    restitution: Fraction = 1.0
    at: str | None = None
    to: str | None = None

    def __post_init__(self) -> None:
        if self.to is not None and self.to == self.at:
            raise ValueError(f"to: a point ('{self.to}') does not touch itself; name another, or leave it out")
