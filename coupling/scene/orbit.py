"""The [orbit] table of a scene: which periodic motion to find, and the branch to follow from it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Real, Whole


@dataclass(frozen=True, config=STRICT)
class Orbit:
    """A periodic motion, and the branch through it.

    periods: of the excitation that the motion takes to repeat; start: "run", the end of a run of the scene, or
    "linear", the motion without contact; parameter: dotted path of a number in the scene that changes along the
    branch, from `from` (the scene's own value if left out) to `to` (no branch if left out); step, min_step, max_step:
    of the arclength, as shares of that range; max_points: of a branch; switch: whether branches that begin at period
    doublings and pitchforks are followed as well.
    """

    periods: Annotated[Whole, Field(ge=1, le=64)] = 1
    start: Literal["run", "linear"] = "run"
    parameter: str = "excitation.frequency"
    from_: Annotated[Real | None, Field(alias="from")] = None
    to: Real | None = None
    step: Annotated[Real, Field(gt=0, le=1)] = 0.01
    min_step: Annotated[Real, Field(gt=0, le=1)] = 1e-6
    max_step: Annotated[Real, Field(gt=0, le=1)] = 0.05
    max_points: Annotated[Whole, Field(ge=1, le=100_000)] = 500
    switch: bool = False

    def __post_init__(self) -> None:
        if not self.min_step <= self.step <= self.max_step:
            raise ValueError(
                f"step ({self.step:g}) must lie between min_step ({self.min_step:g}) and max_step ({self.max_step:g})"
            )
        if self.from_ is not None and self.to is None:
            raise ValueError("to: say where the branch that begins at `from` ends, or leave `from` out")
        if self.to is not None and self.to == self.from_:
            raise ValueError(f"to ({self.to:g}) must differ from `from`")
