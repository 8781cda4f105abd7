"""Contact laws: what a gap does when it closes.

A law is one class: its `law` names it in the scene's [contact] table, its fields are the table's other keys, and
`element` turns restitution and mass of a pair into the contact element that the engine works with. A new law goes into
`Contact`; no other file knows the laws by name.
"""

from __future__ import annotations

import math
from dataclasses import field
from typing import Annotated, Literal, NamedTuple

from pydantic import Field
from pydantic.dataclasses import dataclass
from scipy.optimize import brentq

from coupling.inputs import STRICT, InputError, Positive


class Element(NamedTuple):
    """A contact: rigid (stiffness inf) with Newton's restitution, or a spring (N/m) and dashpot (N s/m), no pull."""

    restitution: float
    stiffness: float = math.inf
    dashpot: float = 0.0


@dataclass(frozen=True, config=STRICT)
class Newton:
    """Rigid contact: the speed of separation is `restitution` times that of approach, at the contact's own mass."""

    law: Literal["newton"] = "newton"

    def element(self, restitution: float, mass: float) -> Element:
        """The element of a pair with a coefficient of restitution and a reduced mass (kg)."""
        return Element(restitution)


@dataclass(frozen=True, config=STRICT)
class Compliant:
    """Spring (`stiffness`, N/m) and dashpot while the gap is closed; the contact ends when its force vanishes.

    The dashpot gives an isolated collision of the pair's reduced mass the restitution asked for.
    """

    stiffness: Positive
    law: Literal["compliant"] = field(default="compliant", kw_only=True)

    def element(self, restitution: float, mass: float) -> Element:
        """The element of a pair with a coefficient of restitution and a reduced mass (kg). Raises InputError at 0."""
        dashpot = 2 * damping_ratio(restitution) * math.sqrt(self.stiffness * mass)
        return Element(restitution, self.stiffness, dashpot)


Contact = Annotated[Newton | Compliant, Field(discriminator="law")]


def damping_ratio(restitution: float) -> float:
    """Damping ratio of a spring-dashpot contact that ends at zero force, from its restitution in (0, 1].

    restitution = exp(-(pi - 2 a) tan a) with damping ratio sin a, down to exp(-2) at critical damping; below, the same
    with hyperbolic functions: exp(-2 z acosh(z)/sqrt(z^2 - 1)). Raises InputError outside (0, 1].
    """
    if not 0 < restitution <= 1:
        raise InputError(f"restitution: a contact with a dashpot needs a value above 0, up to 1 (got {restitution:g})")
    loss = -math.log(restitution)
    if loss < 2:
        angle = brentq(lambda a: (math.pi - 2 * a) * math.tan(a) - loss, 0, math.pi / 2 * (1 - 1e-12), xtol=1e-15)
        return math.sin(angle)

    def excess(ratio: float) -> float:
        spread = math.sqrt(ratio**2 - 1)
        return 2 * ratio * (math.acosh(ratio) / spread if spread > 0 else 1.0) - loss

    return float(brentq(excess, 1.0, 1 / math.sqrt(restitution), xtol=1e-15))
