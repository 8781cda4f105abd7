"""The [ring_down] table of a scene: free motion after a steady excitation, a hammer blow or a static pull."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Positive, Real, Whole


@dataclass(frozen=True, config=STRICT)
class RingDownTable:
    """How the free motion begins, and how long it lasts.

    start: "steady", the end of a run of the scene, whose excitation then ceases at the start of a period; "impulse", a
    hammer blow of `impulse` (N s) on the structure at rest; "displacement", a static pull by `displacement` (m), or the
    scene's [initial] state, released. Blow and pull act at the interface label `at` of a reduced model, by default
    excitation.at. duration: s, or periods: of the excitation, which remain the unit of time of the run; mode: number of
    the natural mode that is followed, from 0, by default, of those that move, the one that the excitation's frequency
    is nearest to ("steady", one sine) or the one that moves the most; cycles: periods of that mode over which damping
    is averaged; bins: of amplitude, for means over many cycles (0: none).
    """

    start: Literal["steady", "impulse", "displacement"]
    impulse: Real | None = None
    displacement: Real | None = None
    at: str | None = None
    duration: Positive | None = None
    periods: Annotated[Whole, Field(gt=0)] | None = None
    mode: Annotated[Whole, Field(ge=0)] | None = None
    cycles: Annotated[Whole, Field(ge=1, le=1000)] = 1
    bins: Annotated[Whole, Field(ge=0, le=1000)] = 0

    def __post_init__(self) -> None:
        if (self.duration is None) == (self.periods is None):
            raise ValueError("give one of duration (s) and periods (of the excitation)")
        if (self.impulse is not None) != (self.start == "impulse"):
            raise ValueError('impulse (N s): give it with start = "impulse", and only there')
        if self.displacement is not None and self.start != "displacement":
            raise ValueError('displacement (m): is for start = "displacement"')
        if self.at is not None and self.impulse is None and self.displacement is None:
            raise ValueError("at: is where an impulse or a displacement acts")
