"""Impact of viscoelastic spheres: a restitution that falls with the speed."""

from __future__ import annotations

from typing import Literal

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element
from vanedamp.files.toml_input import STRICT, InputError, Positive


@dataclass(frozen=True, config=STRICT)
class Viscoelastic(ContactLaw):
    """Rigid contact with the restitution 1 - c v^(1/5) at a speed of approach v.

    The leading term of Hertz's contact of viscoelastic spheres (Kuwabara and Kono 1987; Brilliantov, Spahn, Hertzsch
    and Poeschel 1996), good for c v^(1/5) well below 1 (the next is 3/5 c^2 v^(2/5): Schwager and Poeschel 1998), and 0
    at the speeds where it would be negative. Bodies have no restitution of their own.
    """

    coefficient: Positive
    """coefficient c of the restitution 1 - c v^(1/5) [(s/m)^(1/5)]"""
    law: Literal["viscoelastic"] = "viscoelastic"
    """"viscoelastic": rigid, with a restitution that falls with the speed"""

    @staticmethod
    def restitution_at(speed: float, coefficient: float) -> float:
        """Return the restitution at a speed of approach (m/s)."""
        return max(1.0 - coefficient * speed**0.2, 0.0)

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """Return the element of any pair. Raises InputError for a restitution."""
        if restitution != 1.0:
            raise InputError(
                f"restitution: that of a viscoelastic contact follows from its speed and contact.coefficient; "
                f"drop it (got {restitution:g})"
            )
        return Element(self.coefficient)
