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

from vanedamp.files.toml_input import STRICT, InputError, Positive


class Element(NamedTuple):
    """A contact: rigid (stiffness inf) with Newton's restitution, or a spring (N/m) and dashpot (N s/m), no pull."""

    restitution: float
    stiffness: float = math.inf
    dashpot: float = 0.0


@dataclass(frozen=True, config=STRICT)
class Newton:
    """Rigid contact: the speed of separation is `restitution` times that of approach, at the contact's own mass."""

    law: Literal["newton"] = "newton"

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """The element of a pair with a coefficient of restitution and a reduced mass (kg)."""
        return Element(restitution)


@dataclass(frozen=True, config=STRICT)
class Compliant:
    """Spring (`stiffness`, N/m) and dashpot while the gap is closed; the contact ends when its force vanishes.

    The dashpot gives an isolated collision of the pair's reduced mass the restitution asked for. With `residual` the
    spring is in series with what a reduced model's modes lack of its wall's static flexibility; without a `stiffness`
    it is that alone.
    """

    stiffness: Positive | None = None
    residual: bool = False
    law: Literal["compliant"] = field(default="compliant", kw_only=True)

    def __post_init__(self) -> None:
        if self.stiffness is None and not self.residual:
            raise ValueError("give stiffness (N/m), or residual = true on a reduced model, or both")

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """The element of a pair with a coefficient of restitution, a reduced mass (kg) and what the wall yields.

        flexibility: m/N that the modes lack of the wall; None: not known yet. Raises InputError at restitution 0.
        """
        own = 0.0 if self.stiffness is None else 1.0 / self.stiffness
        stiffness = _series(own, flexibility) if self.residual else 1.0 / own
        dashpot = 2 * damping_ratio(restitution) * math.sqrt(stiffness * mass)
        return Element(restitution, stiffness, dashpot)


@dataclass(frozen=True, config=STRICT)
class Massless:
    """Contact on a boundary without mass: quasi-static, without loss and without impact law.

    The boundary follows its contact force by the static flexibility that the reduced model's modes lack, so that the
    contact is a spring of that flexibility (Monjaraz-Tec, Gross and Krack 2022). Restitution has no meaning here.
    """

    law: Literal["massless"] = "massless"

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """The wall as a spring; flexibility: m/N that the modes lack of it, None: not known yet.

        Raises InputError for a restitution.
        """
        if restitution != 1.0:
            raise InputError(
                f"restitution: a massless contact loses nothing and has no impact law; drop it (got {restitution:g})"
            )
        return Element(1.0, _series(0.0, flexibility), 0.0)


Contact = Annotated[Newton | Compliant | Massless, Field(discriminator="law")]


def _series(own: float, flexibility: float | None) -> float:
    """Stiffness of a spring (flexibility `own`) on a wall that yields; any where the wall is not known yet."""
    if flexibility is None:
        return 1.0
    if own + flexibility <= 0.0:
        raise InputError(
            "contact: the reduced model lacks no flexibility at the walls; take structure.natural = true with modes, "
            "or a model of basis macneal or massless"
        )
    return 1.0 / (own + flexibility)


def damping_ratio(restitution: float) -> float:
    """Damping ratio of a spring-dashpot contact that ends at zero force, from its restitution in (0, 1].

    restitution = exp(-(pi - 2 a) tan a) with damping ratio sin a, down to exp(-2) at critical damping; below, the same
    with hyperbolic functions: exp(-2 z acosh(z)/sqrt(z^2 - 1)). Raises InputError outside (0, 1].
    """
    if not 0 < restitution <= 1:
        raise InputError(f"restitution: a contact with a dashpot needs a value above 0, up to 1 (got {restitution:g})")
    loss = -math.log(restitution)
    return float(brentq(lambda ratio: 2 * ratio * _turn(ratio) - loss, 0.0, 1 / math.sqrt(restitution), xtol=1e-15))


def _turn(ratio: float) -> float:
    """acos(z)/sqrt(1 - z^2) of a damping ratio z, and its continuation acosh(z)/sqrt(z^2 - 1) above critical damping.

    By half angles, which keep their digits about z = 1.
    """
    if ratio == 1.0:
        return 1.0
    away = abs(1 - ratio)
    turn = math.asin if ratio < 1 else math.asinh
    return 2 * turn(math.sqrt(away / 2)) / math.sqrt(away * (1 + ratio))
