"""Poisson's law of impact."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.files.toml_input import STRICT


@dataclass(frozen=True, config=STRICT)
class Poisson(ContactLaw):
    """Rigid contact: the normal impulse of expansion is `restitution` times that of compression.

    Friction acts in both phases (Glocker and Pfeiffer 1995). The same as Newton's law where a contact collides on its
    own and without friction, or keeps its slip; another where friction ends the slip, or several contacts collide.
    """

    two_phases: ClassVar[bool] = True
    law: Literal["poisson"] = "poisson"
    """"poisson": rigid, by the ratio of impulses of expansion and compression"""
