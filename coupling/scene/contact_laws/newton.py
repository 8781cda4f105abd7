"""Newton's law of impact."""

from __future__ import annotations

from typing import Literal

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.files.toml_input import STRICT


@dataclass(frozen=True, config=STRICT)
class Newton(ContactLaw):
    """Rigid contact: the speed of separation is `restitution` times that of approach, at the contact's own mass."""

    law: Literal["newton"] = "newton"
    """"newton": rigid, by the ratio of speeds after and before an impact"""

    @property
    def title(self) -> str:
        """Name of the law in a sentence."""
        return "Newton's law, the default,"
