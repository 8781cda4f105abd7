"""The tables of a study: what may be chosen, what a design cannot hold, and how the best one is sought."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.key_tables import documented
from vanedamp.files.toml_input import STRICT, NonNegative, Positive, Real, Whole
from vanedamp.studies.band import Band
from vanedamp.studies.measure import AMPLITUDES
from vanedamp.studies.numbers import INLINE, ByPath, Number
from vanedamp.studies.optimisation.measures import Limits


def _bounds(value: Any) -> Any:
    """Return the bounds of a variable; a single number holds it."""
    return [value, value] if isinstance(value, int | float) else value


def _number(value: Any) -> Any:
    """Return the keys of a number that is given by its bounds."""
    ends = _bounds(value)
    return {"min": ends[0], "max": ends[1]} if isinstance(ends, list | tuple) and len(ends) == 2 else value


_Count = Annotated[Whole, Field(ge=1, le=32)]
_Share = Annotated[Real, Field(ge=0, lt=1)]
Bounds = Annotated[
    tuple[Positive, Positive], BeforeValidator(_bounds, json_schema_input_type=Positive | tuple[Positive, Positive])
]
Counts = Annotated[
    tuple[_Count, _Count], BeforeValidator(_bounds, json_schema_input_type=_Count | tuple[_Count, _Count])
]


@dataclass(frozen=True, config=STRICT, repr=False)
class Variables(ByPath):
    """The variables of a design, each [lowest, highest], or one value, which holds it."""

    KIND: ClassVar[Any] = Annotated[
        Number,
        BeforeValidator(_number, json_schema_input_type=Real | tuple[Real, Real] | Number),
        Field(description='number at a dotted path of the scene, such as "damper.0.friction" [unit of the number]'),
    ]
    mass_ratio: Bounds | None = None
    """mass of all bodies over that of the structure (default: 0.005 to 0.05, with paths as in the scene) [-]"""
    gap_ratio: Bounds | None = None
    """free travel over X, the maximum without bodies of the resonance (default: 0.1 to 1.5, with paths as in the scene)
    [-]"""
    bodies: Counts | None = None
    """number of bodies (default: 1, with paths those of the scene)"""

    def __post_init__(self) -> None:
        usual: dict[str, Any] = {"mass_ratio": (0.005, 0.05), "gap_ratio": (0.1, 1.5), "bodies": (1, 1)}
        for name, bounds in usual.items():
            if getattr(self, name) is None and not self.numbers:
                object.__setattr__(self, name, bounds)
            low, high = getattr(self, name) or bounds
            if low > high:
                raise ValueError(f"{name}: expected [lowest, highest], not [{low:g}, {high:g}]")

    @property
    def all(self) -> dict[str, Number]:
        """All variables by name: keys, as far as they are not left to the scene, and paths."""
        own = {name: getattr(self, name) for name in ("mass_ratio", "gap_ratio", "bodies")}
        return {name: Number(*map(float, ends)) for name, ends in own.items() if ends is not None} | self.numbers

    @property
    def mapped(self) -> bool:
        """Whether there is a map over mass ratio and gap ratio: both are the study's."""
        return self.mass_ratio is not None and self.gap_ratio is not None

    @property
    def along(self) -> list[str]:
        """The variables along which the best design is drawn: those that vary and have no axis of the map."""
        others = ("bodies", *(("mass_ratio", "gap_ratio") if self.mapped else ()))
        return [name for name, number in self.all.items() if name not in others and number.min < number.max]


@dataclass(frozen=True, config=INLINE)
class Relative:
    """A half width over the number itself."""

    relative: _Share
    """over the number of the design [-]"""


def _form(value: Any) -> str:
    return "table" if isinstance(value, Mapping | Relative) else "number"


@dataclass(frozen=True, config=STRICT, repr=False)
class Tolerances(ByPath):
    """Half widths of what the design cannot hold."""

    KIND: ClassVar[Any] = Annotated[
        Annotated[NonNegative, Tag("number")] | Annotated[Relative, Tag("table")],
        Discriminator(_form),
        Field(description="of the number at a dotted path of the scene: in its unit, or {relative = 0.03}"),
    ]
    mass: _Share = 0.0
    """of the mass of a body, relative [-]"""
    gap: _Share = 0.0
    """of the gap, relative [-]"""
    excitation: _Share = 0.0
    """of the level of the excitation, relative [-]"""
    restitution: NonNegative = 0.0
    """of the coefficient of restitution, as it is [-]"""
    friction: NonNegative = 0.0
    """of the coefficient of friction, as it is [-]"""
    orientation_deg: NonNegative = 0.0
    """of the angle of gravity [degree]"""

    @property
    def given(self) -> Iterator[tuple[str, float, bool]]:
        """Those that are not zero: name or path, half width, and whether it is relative."""
        for name in NO_DEVIATION:
            yield name, getattr(self, name), name in ("mass", "gap", "excitation")
        for path, half in self.numbers.items():
            yield path, half.relative if isinstance(half, Relative) else half, isinstance(half, Relative)


#: of a design as it is
NO_DEVIATION = dict.fromkeys(("mass", "gap", "excitation", "restitution", "friction", "orientation_deg"), 0.0)


@dataclass(frozen=True, config=STRICT)
class Map:
    """The map of designs over mass ratio and gap ratio, and sections along other variables."""

    mass_ratio: Annotated[Whole, Field(ge=2, le=1000)] = 9
    """points along the mass ratio"""
    gap_ratio: Annotated[Whole, Field(ge=2, le=1000)] = 12
    """points along the gap ratio"""
    along: Annotated[Whole, Field(ge=2, le=1000)] | None = None
    """points along each variable without an axis of the map, through the best design as designed (default: 9)"""


@dataclass(frozen=True, config=STRICT)
class Optimise(Band):
    """The objective, and how it is minimised."""

    TABLE: ClassVar[str] = "optimise"
    variables: Variables = field(default_factory=Variables)
    """what may be chosen"""
    tolerances: Tolerances = field(default_factory=Tolerances)
    """what the design cannot hold (default: nothing)"""
    map: Map = field(default_factory=Map)
    """map over mass ratio and gap ratio"""
    limits: Limits = field(default_factory=Limits)
    """what designs must keep (default: nothing)"""
    measure: str = "amplitude_mean"
    """what counts of a run: "amplitude_mean" or "amplitude_max" of its periods, without static deflection; "stress" at
    the worst hot spot; in 10,000 h "life", its damage, or "wear", the deepest over X; or a quantity over its
    limits.quantities"""
    over_band: Literal["worst", "mean"] = "worst"
    """what counts of the band's amplitudes"""
    over_tolerances: Literal["worst", "mean"] = "worst"
    """what counts of the tolerances' amplitudes"""
    samples: Annotated[Whole, Field(ge=1, le=10_000)] = 12
    """samples of the tolerances, by Latin hypercube"""
    evaluations: Annotated[Whole, Field(ge=5, le=100_000)] = 150
    """designs that each of the two searches may try"""
    gradient_steps: Annotated[Whole, Field(ge=0, le=1000)] = 20
    """designs by gradient that follow the best one as designed, at most; 0: none"""
    seed: Annotated[Whole, Field(ge=0)] = 1
    """seed of searches and samples"""

    @property
    def by_amplitude(self) -> bool:
        """Whether an amplitude counts, which has derivatives and a resonance curve."""
        return self.measure in AMPLITUDES

    @property
    def linear(self) -> bool:
        """Whether what counts is over that without bodies at the same level."""
        return self.by_amplitude or self.measure == "stress"


@documented
@dataclass(frozen=True, config=STRICT, repr=False)
class StudyFile(Scene):
    """A scene, and what is best for it."""

    optimise: Optimise = field(kw_only=True)
    """what is best, and which designs are tried"""
