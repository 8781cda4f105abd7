"""Cavities, the bodies in them, and friction dampers."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, Field, GetJsonSchemaHandler
from pydantic.dataclasses import dataclass
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError

from vanedamp.coupling.scene.registration import SHAPES
from vanedamp.coupling.scene.repetition import Scatter, Sectors
from vanedamp.coupling.scene.shapes.shape import Shape
from vanedamp.coupling.tangents.dual import active, values
from vanedamp.coupling.tangents.opaque import opaque
from vanedamp.files.open_record import OpenRecord
from vanedamp.files.reference import unit_in
from vanedamp.files.toml_input import STRICT, Fraction, NonNegative, Positive, Real

#: characters of the name of a cavity
_LONGEST_NAME = 200


def _addressable(name: str) -> str:
    """Return a name that a dotted path such as cavity.c1.gap can hold, distinct from an index and from a key.

    The path names variables of HDF5 files, in which a slash stands for a group.
    """
    special = name.isdecimal() or name in Cavity.__dataclass_fields__ or not name.isprintable()
    if special or not 0 < len(name) <= _LONGEST_NAME or {".", "/"} & set(name):
        raise ValueError(
            f"expected a word of at most {_LONGEST_NAME} characters that is no number and no key and has no dot and no "
            "slash, such as 'c1'"
        )
    return name


@dataclass(frozen=True, config=STRICT)
class Cavity:
    """A cavity of the structure, in which bodies slide from its left wall (negative) to its right one (positive).

    On a reduced model left, right, floor and ceiling name interface labels; one label may serve all of them.
    """

    name: Annotated[str, AfterValidator(_addressable)]
    """name, by which bodies and dotted paths refer to it"""
    gap: Positive
    """total free travel of one body along the cavity, from the left wall to the right one [m]"""
    left: str | None = None
    """interface label of the left wall, at the negative end"""
    right: str | None = None
    """interface label of the right wall, at the positive end"""
    floor: str | None = None
    """interface label of the floor, on which the bodies slide"""
    ceiling: str | None = None
    """interface label of the ceiling, for bodies with extent (default: the floor's)"""
    play: Positive | None = None
    """free travel of a body with extent across the cavity, from the floor to the ceiling [m]"""
    normal_motion: Real = 0.0
    """motion across the cavity per motion of the floor along it, where the structure has no coordinate for it [-]"""
    rotation: Real = 0.0
    """rotation per motion of the floor along the cavity, where the structure has no coordinate for it [rad/m]"""
    radius: Positive | None = None
    """from the axis of rotation to a body's centre at mid-travel; the cavity lies in the plane of rotation [m]"""
    centrifugal_deg: Real = 0.0
    """angle of the centrifugal load: 0 presses the bodies on the floor, 90 pulls them to the left wall [degree]"""
    sectors: Sectors | None = None
    """sectors of a ring that have this cavity and its bodies, named "c@0", "c@1", ...: "all", "alternate", a number, or
    a list (default: as written)"""
    scatter: Scatter | None = None
    """scatter of gap and positions over these sectors"""

    def __post_init__(self) -> None:
        if self.scatter is not None and self.sectors is None:
            raise ValueError('scatter: is over the sectors of a ring; give sectors, such as "all"')

    def labels(self) -> tuple[str | None, str | None, str | None]:
        """Return the labels of left wall, right wall and floor; a single one serves all three."""
        given = self.floor or self.left or self.right
        return self.left or given, self.right or given, self.floor or given


def _known_shape(name: str) -> str:
    if name not in SHAPES:
        *names, last = map(repr, SHAPES.names())
        expected = {"expected": f"{', '.join(names)} or {last}"}
        raise PydanticCustomError("literal_error", "Input should be {expected}", expected)
    return name


class _Measures(NamedTuple):
    """What a shape asks of its body (shapes.shape.BodyMeasures)."""

    mass: float
    lengths: Mapping[str, float | None]

    def measure(self, key: str) -> float | None:
        """Return a measure by its key."""
        return self.lengths.get(key)


class _Shapes:
    """JSON Schema of `shape`: the names that are known."""

    @staticmethod
    def __get_pydantic_json_schema__(schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {"enum": SHAPES.names(), "type": "string"}


@dataclass(frozen=True, config=STRICT)
class Damper(OpenRecord):
    """A loose body in a cavity; bodies of one cavity stand in the file from left to right and hit each other."""

    cavity: str
    """name of the cavity that the body is in"""
    mass: Positive
    """mass of the body [kg]"""
    friction: NonNegative = 0.0
    """Coulomb coefficient of friction on the floor [-]"""
    restitution: Fraction = 1.0
    """coefficient of restitution at a wall; of two bodies the geometric mean of theirs [-]"""
    position: Real | None = None
    """position at time zero relative to the cavity, from mid-travel, positive to the right (default: bodies begin with
    equal gaps between each other and the walls, or the neighbours whose position is given; a single one at mid-travel)
    [m]"""
    velocity: Real = 0.0
    """velocity at time zero relative to the cavity, positive to the right [m/s]"""
    normal_load: NonNegative | None = None
    """load on the floor in place of the share of gravity and rotation, such as a centrifugal load [N]"""
    shape: Annotated[str, AfterValidator(_known_shape), _Shapes] = "slider"
    """"slider" moves along the cavity only, "block" and "disc" in its plane; "auto" is a block, run as a slider where
    that changes the mean amplitude by `tolerance` at most"""
    length: Positive | None = None
    """extent of a block along the cavity [m]"""
    height: Positive | None = None
    """extent of a block across the cavity; of a slider, optional: its centre is half of it above the floor, and moves
    with a cavity that turns [m]"""
    radius: Positive | None = None
    """radius of a disc [m]"""
    inertia: Positive | None = None
    """moment of inertia about the centre (default: that of the homogeneous body) [kg m^2]"""
    lift: NonNegative = 0.0
    """height of the lowest point above the floor at time zero [m]"""
    tilt: Real = 0.0
    """rotation at time zero relative to the cavity, positive against the clock [rad]"""
    lift_velocity: Real = 0.0
    """velocity across the cavity at time zero relative to it, positive away from the floor [m/s]"""
    tilt_rate: Real = 0.0
    """angular velocity at time zero relative to the cavity, positive against the clock [rad/s]"""
    stiffness: Positive | None = None
    """stiffness of a spring between body and floor, along the cavity, without force at mid-travel [N/m]"""
    dashpot: NonNegative | None = None
    """viscous damping between body and floor, along the cavity [N s/m]"""
    track_radius: Positive | None = None
    """radius of the path of the centre on a concave floor, whose lowest point is at mid-travel [m]"""
    tolerance: Annotated[Real, Field(gt=0, lt=1)] | None = None
    """of shape "auto": relative change of the mean amplitude that is allowed (default: 0.05) [-]"""

    def __post_init__(self) -> None:
        form = self.form
        for key in ("length", "height", "radius", *(self.added or {}), *form.measures):
            if (self.shape, key) == ("slider", "height"):
                continue  # says how high its centre is, if it is known
            if (self.measure(key) is not None) != (key in form.measures):
                reason = "missing" if key in form.measures else "not a measure"
                raise ValueError(f'{key}: {reason} of shape = "{self.shape}"')
        if not form.planar:
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

    @classmethod
    def keys_added(cls) -> Mapping[str, Any]:
        """Return the measures of all shapes that are no fields."""
        return {
            key: Annotated[Positive, Field(description=text, json_schema_extra={"x-unit": unit_in(text) or "m"})] | None
            for shape in SHAPES.all().values()
            for key, text in shape.measures.items()
            if key not in cls.__dataclass_fields__
        }

    @property
    def form(self) -> Shape:
        """Its shape."""
        form: Shape = SHAPES.part(self.shape)()
        return form

    def measure(self, key: str) -> float | None:
        """Return a measure of its shape, m; None: not given."""
        value: float | None = (self.added or {}).get(key, getattr(self, key, None))
        return value

    @property
    def planar(self) -> bool:
        """Whether the body needs the plane: it has an extent, or a spring or a track of its own."""
        return self.form.planar or self.sprung

    @property
    def sprung(self) -> bool:
        """Whether a spring, a dashpot or a concave track binds the body to its cavity."""
        return (self.stiffness, self.dashpot, self.track_radius) != (None, None, None)

    @property
    def half_extent(self) -> tuple[float, float]:
        """Half the length and half the height, m; 0 where a slider has none."""
        extents: tuple[float, float] = self.shaped("half_extent")
        return extents

    @property
    def moment_of_inertia(self) -> float:
        """Moment of inertia about the centre, kg m^2."""
        return self.shaped("inertia") if self.inertia is None else self.inertia

    def shaped(self, question: str, *given: Any) -> Any:
        """Return what its shape answers (shapes.shape.Shape)."""
        if active() is None:
            return getattr(self.form, question)(self, *given)
        lengths = {key: self.measure(key) for key in ("length", "height", "radius", *(self.added or {}))}
        mass = self.mass if question == "inertia" else values(self.mass)
        return opaque(getattr(self.form, question), _Measures(mass, lengths), *given)


def spread(given: Sequence[Any], gap: Any) -> list[Any]:
    """Return the positions at time zero of the bodies of a cavity, m: numbers, or (k,) for k cavities.

    given: from left to right, None for a body with equal gaps to its neighbours; gap: free travel, m.
    """
    marks = [
        (-1, -0.5),
        *((n, position / gap) for n, position in enumerate(given) if position is not None),
        (len(given), 0.5),
    ]
    places = list(given)
    for (first, low), (last, high) in itertools.pairwise(marks):
        for n in range(first + 1, last):
            places[n] = gap * (low + (high - low) * ((n - first) / (last - first)))
    return places


@dataclass(frozen=True, config=STRICT)
class FrictionDamper:
    """A Coulomb element of constant normal force between the structure and the casing, or two points of the structure:
    the spring-loaded damper that is the usual remedy."""

    normal_force: Positive
    """normal force in the contact [N]"""
    friction: NonNegative
    """Coulomb coefficient of friction [-]"""
    stiffness: Positive | None = None
    """tangential stiffness in series with the contact, unloaded at time zero (default: rigid Coulomb) [N/m]"""
    at: str | None = None
    """interface label of a reduced model where it acts (default: excitation.at)"""
    to: str | None = None
    """interface label of a reduced model that it is held by and moves with (default: the casing); of a ring,
    "shroud@+1" is in the next sector"""
    sectors: Sectors | None = None
    """sectors of a ring that have one (default: as written)"""

    def __post_init__(self) -> None:
        if self.to is not None and self.to == self.at:
            raise ValueError(f"to: '{self.to}' does not rub on itself; name another point, or leave it out")
