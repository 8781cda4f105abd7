"""Contact on a boundary without mass."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element, spring_on_wall
from vanedamp.files.toml_input import STRICT, InputError


@dataclass(frozen=True, config=STRICT)
class Massless(ContactLaw):
    """Contact on a boundary without mass: quasi-static, without loss and without impact law.

    The boundary follows its contact force by the static flexibility that the reduced model's modes lack, so that the
    contact is a spring of that flexibility (Monjaraz-Tec, Gross and Krack 2022). Restitution has no meaning here.
    """

    rigid: ClassVar[bool] = False
    law: Literal["massless"] = "massless"
    """"massless": quasi-static contact on a boundary without mass"""

    @property
    def takes_residual_flexibility(self) -> bool:
        """Whether a wall yields by its residual flexibility: by nothing else."""
        return True

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """Return the element of a pair: the wall as a spring. Raises InputError for a restitution."""
        if restitution != 1.0:
            raise InputError(
                f"restitution: a massless contact loses nothing and has no impact law; drop it (got {restitution:g})"
            )
        return Element(1.0, spring_on_wall(0.0, flexibility), 0.0)
