"""Hertzian contact: springs in parallel that stiffen it as it is pressed."""

from __future__ import annotations

from dataclasses import field
from typing import Annotated, ClassVar, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.contacts.collision import speed_of_force, spring
from vanedamp.coupling.contacts.hertz import Contact
from vanedamp.coupling.contacts.parallel_springs import Spring, parallel_springs
from vanedamp.coupling.scene.contact_laws.law import ContactLaw, Element
from vanedamp.files.toml_input import STRICT, InputError, Positive, Whole


@dataclass(frozen=True, config=STRICT)
class Hertz(ContactLaw):
    """Elastic contact of the rounded surfaces in [contact.pair], without loss and without friction.

    Springs in parallel (contacts.parallel_springs), each a contact of the engine: an impact counts for each spring that
    it closes. Largest forces and durations of free collisions are right within 1e-3 up to `force` and from a quarter of
    its speed on, with ten springs at a point of contact.
    """

    rigid: ClassVar[bool] = False
    parallel: ClassVar[bool] = True
    force: Positive
    """largest force up to which the springs follow the contact; beyond, they stiffen no more [N]"""
    springs: Annotated[Whole, Field(ge=4, le=40)] = 10
    """number of springs [-]"""
    law: Literal["hertz"] = field(default="hertz", kw_only=True)
    """"hertz": elastic contact of rounded surfaces, which stiffens as it is pressed"""

    def __post_init__(self) -> None:
        if self.pair is None or self.pair.radius is None:
            raise ValueError('pair: law = "hertz" needs [contact.pair] with young and radius')
        try:
            self._parallel()
        except ValueError as error:
            raise ValueError(f"force: {error}") from None

    @property
    def _contact(self) -> Contact:
        assert self.pair is not None
        contact = self.pair.contact
        assert contact is not None
        return contact

    def _parallel(self) -> tuple[Spring, ...]:
        return parallel_springs(self._contact, self.force, self.springs)

    def flexibility(self, mass: float) -> float:
        """Return the flexibility of the spring whose collision at `force` lasts as long, m/N."""
        return 1.0 / spring(self._contact, mass, speed_of_force(self._contact, mass, self.force), "duration")

    def element(self, restitution: float, mass: float, flexibility: float | None = None) -> Element:
        """Return the spring whose collision at `force` lasts as long. Raises InputError for a restitution.

        It is for estimates; the units have those of `layers`.
        """
        if restitution != 1.0:
            raise InputError(f"restitution: a Hertzian contact loses nothing; drop it (got {restitution:g})")
        return Element(1.0, 1.0 / self.flexibility(mass))

    def layers(self, element: Element) -> tuple[tuple[float, Element], ...]:
        """Return the springs, each with the depth at which it begins, m."""
        return tuple((one.depth, Element(1.0, one.stiffness)) for one in self._parallel())
