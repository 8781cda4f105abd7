"""Contact by a spring and a dashpot."""

from __future__ import annotations

import math
from dataclasses import field
from typing import ClassVar, Literal

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element, spring_on_wall
from vanedamp.files.toml_input import STRICT, InputError, Positive


@dataclass(frozen=True, config=STRICT)
class Compliant(ContactLaw):
    """Spring and dashpot while the gap is closed; the contact ends when its force vanishes.

    The dashpot gives an isolated collision of the pair's reduced mass the restitution asked for. The residual
    flexibility is the part of the wall's static one that a reduced model's modes lack.
    """

    rigid: ClassVar[bool] = False
    stiffness: Positive | None = None
    """stiffness of the contact's spring; or residual = true, or both [N/m]"""
    residual: bool = False
    """put the residual flexibility of the reduced model's wall in series with the spring"""
    law: Literal["compliant"] = field(default="compliant", kw_only=True)
    """"compliant": spring and dashpot while the gap is closed"""

    def __post_init__(self) -> None:
        if self.stiffness is None and not self.residual:
            raise ValueError("give stiffness (N/m), or residual = true on a reduced model, or both")

    @property
    def flexibility(self) -> float:
        """Flexibility of the spring, m/N; 0 where there is only the wall's."""
        return 0.0 if self.stiffness is None else 1.0 / self.stiffness

    @property
    def takes_residual_flexibility(self) -> bool:
        """Whether the wall's residual flexibility is in series with the spring."""
        return self.residual

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """Return the element of a pair, as every law does. Raises InputError at restitution 0."""
        own = self.flexibility
        stiffness = spring_on_wall(own, flexibility) if self.residual else 1.0 / own
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


def _turn(ratio: float) -> float:
    """Return acos(z)/sqrt(1 - z^2) of a damping ratio z, or its continuation acosh(z)/sqrt(z^2 - 1) above 1.

    By half angles, which keep their digits about z = 1.
    """
    if ratio == 1.0:
        return 1.0
    away = abs(1 - ratio)
    turn = math.asin if ratio < 1 else math.asinh
    return 2 * turn(math.sqrt(away / 2)) / math.sqrt(away * (1 + ratio))
