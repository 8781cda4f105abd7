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


_Several = Annotated[tuple[Positive, ...], Field(min_length=1)]
Rates = Annotated[_Several, BeforeValidator(_listed, json_schema_input_type=Positive | _Several)]


@dataclass(frozen=True, config=STRICT)
class Ramp:
    """A change of the excitation frequency or the speed of rotation that is linear in time."""

    from_: Annotated[NonNegative, Field(alias="from")]
    """value where the run begins [unit of the quantity]"""
    to: NonNegative
    """value where it ends [unit of the quantity]"""
    quantity: Literal["frequency", "speed", "rpm"] = "frequency"
    """what changes: "frequency" (Hz), or "speed" (rad/s) or "rpm", whose frequency follows by excitation.engine_order
    or stays"""
    rate: Rates | None = None
    """change in a second, above zero; of several each is a run of its own; or give `periods` [unit of the
    quantity/s]"""
    periods: Annotated[Whole, Field(gt=0)] | None = None
    """excitation periods from one end to the other"""
    both: bool = False
    """run from `to` to `from` as well"""
    start: Literal["rest", "steady"] = "rest"
    """"rest": with the state that the scene begins with; "steady": after a run of the scene at the first value"""
    passes: Positive = 1.0
    """how often a start passes the ramp, for lives in starts [-]"""

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
