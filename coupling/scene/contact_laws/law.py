"""The contract of contact laws: other code asks a law these questions, and never for its class."""

from __future__ import annotations

import math
from dataclasses import field
from typing import TYPE_CHECKING, ClassVar, NamedTuple

from pydantic.dataclasses import dataclass

from vanedamp.coupling.contacts.pair import Pair
from vanedamp.files.toml_input import STRICT, InputError


class Element(NamedTuple):
    """The contact of a pair: rigid (stiffness inf), or a spring (N/m) and dashpot (N s/m) that push and never pull.

    restitution: coefficient of restitution of the pair, or the coefficient that its law's `restitution_at` takes.
    """

    restitution: float
    stiffness: float = math.inf
    dashpot: float = 0.0


@dataclass(frozen=True, config=STRICT)
class ContactLaw:
    """Base of the laws: a frozen record whose `law` names it in the scene's [contact] table, its fields the other keys.

    A law that says nothing else is rigid: a closed gap is a constraint, and an impact multiplies the relative velocity
    by minus the restitution, which is the coefficient of the pair at every speed.
    """

    if TYPE_CHECKING:

        @property
        def law(self) -> str:
            """The value of `law` in the scene."""

    #: whether a closed gap is a constraint with impacts, not a spring
    rigid: ClassVar[bool] = True
    #: whether the restitution is that of impulses, of expansion to compression (Poisson), not of speeds (Newton)
    two_phases: ClassVar[bool] = False
    #: whether a contact is several units of the engine, whose impacts count one by one
    parallel: ClassVar[bool] = False
    pair: Pair | None = field(default=None, kw_only=True)
    """shapes and materials of what touches: for stiffness, and for the strength of contacts"""

    @property
    def title(self) -> str:
        """Name of the law in a sentence."""
        return f'the law "{self.law}"'

    @staticmethod
    def restitution_at(speed: float, coefficient: float) -> float:
        """Return the restitution, within [0, 1], of a rigid contact at a speed of approach (m/s, from 0 on).

        coefficient: the `restitution` of the pair's element. A law that overrides this is compiled (numba): arithmetic
        and `math` on two floats. Anything that depends on its fields or on the pair goes into the coefficient, so that
        a sweep over a field compiles nothing.
        """
        return coefficient

    @property
    def depends_on_speed(self) -> bool:
        """Whether the restitution does."""
        return type(self).restitution_at is not ContactLaw.restitution_at

    def flexibility(self, mass: float) -> float:
        """Return the flexibility of the contact's own spring, m/N, with a reduced mass (kg); 0 without one."""
        return 0.0

    @property
    def takes_residual_flexibility(self) -> bool:
        """Whether a wall yields, too, by the part of its static flexibility that a reduced model's modes lack."""
        return False

    @property
    def needs_residual_flexibility(self) -> bool:
        """Whether nothing else yields, so that a model without residual flexibility has no such contact."""
        return self.takes_residual_flexibility

    def pair_restitution(self, left: float, right: float) -> float:
        """Return the coefficient of two bodies that meet, from theirs at a wall: the geometric mean."""
        mean: float = (left * right) ** 0.5
        return mean

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """Return the element of a pair with a restitution, a reduced mass (kg) and a residual flexibility.

        flexibility: of the wall, m/N; None: not known yet.
        Raises InputError, whose message begins with "restitution: ", for a coefficient that the law has no element for.
        """
        return Element(restitution)

    def layers(self, element: Element) -> tuple[tuple[float, Element], ...]:
        """Return the elements that make up a contact, each with the depth, m, at which it begins: one, at once."""
        return ((0.0, element),)


def spring_on_wall(local: float, flexibility: float | None) -> float:
    """Return the stiffness of a spring (flexibility `local`) on a wall that yields; 1 where the wall is not known yet.

    Raises InputError where nothing yields.
    """
    if flexibility is None:
        return 1.0
    if local + flexibility <= 0.0:
        raise InputError(
            "contact: the reduced model lacks no flexibility at the walls; take structure.natural = true with modes, "
            "or a model of basis macneal or massless"
        )
    return 1.0 / (local + flexibility)
