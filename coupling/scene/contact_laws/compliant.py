"""Contact by a spring and a dashpot."""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated, ClassVar, Literal

from pydantic import Discriminator, Tag
from pydantic.dataclasses import dataclass

from vanedamp.coupling.contacts.collision import spring
from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element, spring_on_wall
from vanedamp.files.toml_input import STRICT, InputError, Positive

#: a number, or where it comes from
Stiffness = Annotated[
    Annotated[Positive, Tag("number")] | Annotated[Literal["hertz", "patch"], Tag("word")],
    Discriminator(lambda value: "word" if isinstance(value, str) else "number"),
]


@dataclass(frozen=True, config=STRICT)
class Compliant(ContactLaw):
    """Spring and dashpot while the gap is closed; the contact ends when its force vanishes.

    The dashpot gives an isolated collision of the pair's reduced mass the restitution asked for. The residual
    flexibility is the part of the wall's static one that a reduced model's modes lack.
    """

    rigid: ClassVar[bool] = False
    stiffness: Stiffness | None = None
    """stiffness of the contact's spring: a number, "hertz" (of the rounded contact in [contact.pair], as `match` says)
    or "patch" (residual = true with the body of [contact.pair]); or residual = true, or both [N/m]"""
    residual: bool = False
    """put the residual flexibility of the reduced model's wall in series with the spring"""
    match: Literal["force", "duration", "tangent"] = "force"
    """what the spring of "hertz" has in common with the contact: the largest "force" or the "duration" of a collision
    at `speed`, or the "tangent" at `preload`"""
    speed: Positive | None = None
    """speed of approach at which force or duration match [m/s]"""
    preload: Positive | None = None
    """force about which the contact vibrates, for the tangent [N]"""
    law: Literal["compliant"] = field(default="compliant", kw_only=True)
    """"compliant": spring and dashpot while the gap is closed"""

    def __post_init__(self) -> None:
        if self.stiffness is None and not self.residual:
            raise ValueError("give stiffness (N/m), or residual = true on a reduced model, or both")
        if self.stiffness == "patch" and (self.pair is None or self.pair.body_flexibility is None):
            raise ValueError('pair: stiffness = "patch" needs [contact.pair] with young, length and area of the body')
        hertz = self.stiffness == "hertz"
        if hertz and (self.pair is None or self.pair.radius is None):
            raise ValueError('pair: stiffness = "hertz" needs [contact.pair] with young and radius')
        needed = "preload" if self.match == "tangent" else "speed"
        for key in ("speed", "preload"):
            given = getattr(self, key) is not None
            if given and not (hertz and key == needed):
                raise ValueError(f'{key}: is of stiffness = "hertz" that matches otherwise; leave it out')
            if hertz and key == needed and not given:
                raise ValueError(f'{key}: missing; stiffness = "hertz" that matches the {self.match} depends on it')

    def flexibility(self, mass: float) -> float:
        """Return the flexibility of the spring, m/N, with a reduced mass, kg; 0 where there is only the wall's."""
        if self.stiffness is None:
            return 0.0
        if isinstance(self.stiffness, float):
            return 1.0 / self.stiffness
        assert self.pair is not None
        if self.stiffness == "patch":
            return self.pair.body_flexibility or 0.0
        contact = self.pair.contact
        assert contact is not None
        try:
            if self.preload is not None:
                return 1.0 / contact.stiffness(self.preload)
            return 1.0 / spring(contact, mass, self.speed or 0.0, self.match)
        except ValueError as error:
            raise InputError(f"contact.pair: {error}") from None

    @property
    def takes_residual_flexibility(self) -> bool:
        """Whether the wall's residual flexibility is in series with the spring."""
        return self.residual or self.stiffness == "patch"

    @property
    def needs_residual_flexibility(self) -> bool:
        """Whether a contact is one only with residual flexibility."""
        return self.takes_residual_flexibility and self.stiffness in (None, "patch")

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """Return the element of a pair, as every law does. Raises InputError at restitution 0."""
        local = self.flexibility(mass)
        if self.stiffness == "patch" and flexibility is not None and flexibility <= 0.0:
            local = 0.0  # a wall that lacks nothing is no patch
        stiffness = spring_on_wall(local, flexibility) if self.takes_residual_flexibility else 1.0 / local
        dashpot = 2 * damping_ratio(restitution) * math.sqrt(stiffness * mass)
        return Element(restitution, stiffness, dashpot)


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio of a spring-dashpot contact that ends at zero force, from its restitution in (0, 1].

    restitution = exp(-(pi - 2 a) tan a) with damping ratio sin a, down to exp(-2) at critical damping; below, the same
    with hyperbolic functions: exp(-2 z acosh(z)/sqrt(z^2 - 1)). Raises InputError outside (0, 1].
    """
    from scipy.optimize import brentq

    if not 0 < restitution <= 1:
        raise InputError(f"restitution: a contact with a dashpot needs a value above 0, up to 1 (got {restitution:g})")
    loss = -math.log(restitution)
    return float(brentq(lambda ratio: 2 * ratio * _turn(ratio) - loss, 0.0, 1 / math.sqrt(restitution), xtol=1e-15))


def peak_over_mean(restitution: float) -> float:
    """Return the largest force of a collision over the mean one, its impulse by its duration.

    With sin a the damping ratio it is m v omega exp(-(pi/2 - 3 a) tan a), or, from a ratio of 1/2 on, the dashpot's at
    the first moment. Restitutions beyond 1 and below 1e-6 count as these.
    """
    left = min(max(restitution, 1e-6), 1.0)
    ratio = damping_ratio(left)
    peak = 2 * ratio
    if ratio < 0.5:
        angle = math.asin(ratio)
        peak = math.exp(-(math.pi / 2 - 3 * angle) * math.tan(angle))
    return peak * 2 * _turn(ratio) / (1 + left)


def _turn(ratio: float) -> float:
    """Return acos(z)/sqrt(1 - z^2) of a damping ratio z, or its continuation acosh(z)/sqrt(z^2 - 1) above 1.

    By half angles, which keep their digits about z = 1.
    """
    if ratio == 1.0:
        return 1.0
    away = abs(1 - ratio)
    turn = math.asin if ratio < 1 else math.asinh
    return 2 * turn(math.sqrt(away / 2)) / math.sqrt(away * (1 + ratio))
