"""The [orbit] table of a scene: which periodic motion to find, and the branch to follow from it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, Real, Whole

#: what is followed over a second number
Kind = Literal["fold", "pitchfork", "period doubling", "neimark-sacker", "grazing", "sequence", "peak"]


@dataclass(frozen=True, config=STRICT)
class Track:
    """A second number of the scene, over which special points of the branches are followed: borders of motions."""

    parameter: str
    """dotted path of the second number"""
    to: Real
    """value of the second number where borders end [unit of the number]"""
    from_: Annotated[Real | None, Field(alias="from")] = None
    """other value where they end; the scene's own must lie between (default: the scene's own) [unit of the number]"""
    within: tuple[Real, Real] | None = None
    """values of the branch's own parameter between which borders are followed (default: its `from` and `to`)
    [unit of the parameter]"""
    kinds: tuple[Kind, ...] = ("fold", "pitchfork", "period doubling", "neimark-sacker", "grazing", "peak")
    """special points that are followed; "peak": the largest amplitude of a branch"""
    max_points: Annotated[Whole, Field(ge=2, le=100_000)] = 300
    """most points of a border on each side of the branch"""


@dataclass(frozen=True, config=STRICT)
class Orbit:
    """A periodic motion, and the branch through it."""

    periods: Annotated[Whole | None, Field(ge=1, le=64)] = None
    """periods of the excitation that the motion takes to repeat (default: those of the run; 1 with "linear")"""
    start: Literal["run", "linear"] = "run"
    """what the orbit is sought from: "run", the end of a run of the scene; "linear", the motion in
    which bodies rest on their floors, and joints and friction dampers stick"""
    wave: bool = False
    """find the travelling wave of a tuned ring, in which each sector does the same one phase later"""
    parameter: str = "excitation.frequency"
    """dotted path of the number that changes along the branch"""
    from_: Annotated[Real | None, Field(alias="from")] = None
    """value of the parameter where the branch begins (default: the scene's own) [unit of the parameter]"""
    to: Real | None = None
    """value of the parameter where the branch ends (default: one orbit, no branch) [unit of the parameter]"""
    step: Annotated[Real, Field(gt=0, le=1)] = 0.01
    """first step of the arclength, as a share of the range of the parameter [-]"""
    min_step: Annotated[Real, Field(gt=0, le=1)] = 1e-6
    """smallest step, as a share of the range [-]"""
    max_step: Annotated[Real, Field(gt=0, le=1)] = 0.05
    """largest step, as a share of the range [-]"""
    max_points: Annotated[Whole, Field(ge=1, le=100_000)] = 500
    """most points of a branch"""
    switch: bool = False
    """follow the branches that begin at period doublings and pitchforks as well"""
    track: Track | None = None
    """follow special points over a second number of the scene, such as {parameter = "cavity.c1.gap", to = 7e-6}"""

    def __post_init__(self) -> None:
        if not self.min_step <= self.step <= self.max_step:
            raise ValueError(
                f"step ({self.step:g}) must lie between min_step ({self.min_step:g}) and max_step ({self.max_step:g})"
            )
        if self.from_ is not None and self.to is None:
            raise ValueError("to: say where the branch that begins at `from` ends, or leave `from` out")
        if self.to is not None and self.to == self.from_:
            raise ValueError(f"to ({self.to:g}) must differ from `from`")
        if self.wave and (self.switch or (self.periods or 1) != 1):
            raise ValueError("wave: one takes a period, and is followed alone; leave `periods` and `switch` out")
        if self.track is not None and self.to is None:
            raise ValueError("track: special points are those of a branch; give `to`")
        within = None if self.track is None else self.track.within
        if within is not None and within[0] >= within[1]:
            raise ValueError(f"track.within: {within[0]:g} must be smaller than {within[1]:g}")
        if self.track is not None and self.track.parameter == self.parameter:
            raise ValueError(f"track.parameter: {self.parameter} is the branch's own; take another number")
