"""Cavities, the bodies in them, friction dampers, and stops."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Fraction, NonNegative, Positive, Real


def _addressable(name: str) -> str:
    """Return a name that a dotted path such as cavity.c1.gap can hold, distinct from an index and from a key."""
    if not name or "." in name or name.isdecimal() or name in ("name", "gap", "left", "right", "floor"):
        raise ValueError("expected a word that is no number and no key and has no dot, such as 'c1'")
    return name


@dataclass(frozen=True, config=STRICT)
class Cavity:
    """A cavity with total free travel `gap` (m). On a reduced model left, right and floor name interface labels."""

    name: Annotated[str, AfterValidator(_addressable)]
    gap: Positive
    left: str | None = None
    right: str | None = None
    floor: str | None = None

    def labels(self) -> tuple[str | None, str | None, str | None]:
        """Return the labels of left wall, right wall and floor; a single one serves all three."""
        given = self.floor or self.left or self.right
        return self.left or given, self.right or given, self.floor or given


@dataclass(frozen=True, config=STRICT)
class Damper:
    """A loose body: mass (kg), Coulomb friction and restitution coefficients, state relative to the cavity."""

    cavity: str
    mass: Positive
    friction: NonNegative = 0.0
    restitution: Fraction = 1.0
    position: Real = 0.0
    velocity: Real = 0.0
    normal_load: NonNegative | None = None


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
