"""The [ring_down] table of a scene: free motion after a steady excitation, a hammer blow or a static pull."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Positive, Real, Whole


@dataclass(frozen=True, config=STRICT)
class RingDownTable:
    """How the free motion begins, and how long it lasts."""

    start: Literal["steady", "impulse", "displacement"]
    """how the motion begins: "steady", a run of the scene whose excitation ceases at the start of a period; "impulse",
    a hammer blow on the structure at rest; "displacement", a static pull, or the [initial] state, let go"""
    impulse: Real | None = None
    """impulse of the hammer blow, positive towards the right walls [N s]"""
    displacement: Real | None = None
    """displacement of the static pull, positive towards the right walls [m]"""
    at: str | None = None
    """interface label of a reduced model where blow or pull acts (default: excitation.at)"""
    duration: Positive | None = None
    """duration of the free motion; or give `periods` [s]"""
    periods: Annotated[Whole, Field(gt=0)] | None = None
    """duration in periods of the excitation, which stay the unit of time"""
    mode: Annotated[Whole, Field(ge=0)] | None = None
    """natural mode that is followed, from 0 (default: of those that move the nearest to the excitation's frequency, for
    "steady" and one sine, or the one that moves most)"""
    cycles: Annotated[Whole, Field(ge=1, le=1000)] = 1
    """periods of that mode over which damping is averaged"""
    bins: Annotated[Whole, Field(ge=0, le=1000)] = 0
    """classes of amplitude for means over many cycles; 0: none"""

    def __post_init__(self) -> None:
        if (self.duration is None) == (self.periods is None):
            raise ValueError("give one of duration (s) and periods (of the excitation)")
        if (self.impulse is not None) != (self.start == "impulse"):
            raise ValueError('impulse (N s): give it with start = "impulse", and only there')
        if self.displacement is not None and self.start != "displacement":
            raise ValueError('displacement (m): is for start = "displacement"')
        if self.at is not None and self.impulse is None and self.displacement is None:
            raise ValueError("at: is where an impulse or a displacement acts")
