"""The [ramp] table of a scene: a run-up or run-down through resonance, at one or several rates."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.files.toml_input import STRICT, NonNegative, Positive, Whole

#: units of the quantities that a ramp changes
UNITS = {"frequency": "Hz", "speed": "rad/s", "rpm": "rpm"}


def _listed(rate: Any) -> Any:
    return [rate] if isinstance(rate, int | float) else rate


@dataclass(frozen=True, config=STRICT)
class Ramp:
    """A change of the excitation frequency or the speed of rotation that is linear in time.

    quantity: "frequency" (Hz), "speed" (rad/s) or "rpm", whose frequency follows by excitation.engine_order or
    stays; from, to: where it begins and ends, in that unit; rate: its change in a second, one or several, each a run of
    its own, or periods: of the excitation that it takes; both: whether it runs from `to` to `from` as well; start:
    "rest", with the state that the scene begins with, or "steady", with the end of a run of the scene at constant
    frequency and speed, those at the beginning.
    """

    from_: Annotated[NonNegative, Field(alias="from")]
    to: NonNegative
    quantity: Literal["frequency", "speed", "rpm"] = "frequency"
    rate: Annotated[tuple[Positive, ...], Field(min_length=1), BeforeValidator(_listed)] | None = None
    periods: Annotated[Whole, Field(gt=0)] | None = None
    both: bool = False
    start: Literal["rest", "steady"] = "rest"

    def __post_init__(self) -> None:
        if (self.rate is None) == (self.periods is None):
            raise ValueError(f"give one of rate ({UNITS[self.quantity]} a second) and periods")
        if self.to == self.from_:
            raise ValueError(f"to ({self.to:g}) must differ from `from`")
        if self.quantity == "frequency" and not min(self.from_, self.to) > 0.0:
            raise ValueError("from, to: expected frequencies above zero, Hz")

    @property
    def unit(self) -> str:
        """Unit of the quantity."""
        return UNITS[self.quantity]

    @property
    def path(self) -> str:
        """Dotted path of the quantity in the scene."""
        return FREQUENCY if self.quantity == "frequency" else f"rotation.{self.quantity}"
