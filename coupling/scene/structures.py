"""Structures of a scene."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic.dataclasses import dataclass

from vanedamp.coupling.scene.mistuning import Mistuning
from vanedamp.coupling.tangents.dual import sqrt
from vanedamp.files.toml_input import STRICT, NonNegative, Positive, Real, Whole


@dataclass(frozen=True, config=STRICT)
class Prescribed:
    """A shaker table: it moves by sines, whatever the bodies do."""

    model: Literal["prescribed"]
    """"prescribed": a motion that the bodies do not change"""
    displacement_amplitude: Positive
    """amplitude X of the sine X sin(2 pi f t) [m]"""


@dataclass(frozen=True, config=STRICT)
class Rigid:
    """One mode: a mass on a spring with viscous damping. Its displacement is positive towards the right walls."""

    model: Literal["rigid"]
    """"rigid": one mode, a mass on a spring"""
    mass: Positive
    """modal mass at the response point [kg]"""
    stiffness: Positive
    """modal stiffness at the response point [N/m]"""
    damping_ratio: NonNegative | None = None
    """share of critical damping; or give `damping` [-]"""
    damping: NonNegative | None = None
    """coefficient of the viscous damping; or give `damping_ratio` [N s/m]"""
    centrifugal_stiffness: Real = 0.0
    """stiffness gained by rotation over the squared speed, Southwell's coefficient times the mass; below zero where
    spin softening prevails [kg]"""
    base_mass: Real | None = None
    """load on the mode by an acceleration of the base, per acceleration (default: the mass); below zero for some modes
    (`vanedamp calibrate` gives it) [kg]"""

    def __post_init__(self) -> None:
        if (self.damping_ratio is None) == (self.damping is None):
            raise ValueError("give one of damping_ratio and damping")

    def stiffness_at(self, speed: float) -> float:
        """Return the stiffness, N/m, at a speed of rotation, rad/s."""
        return self.stiffness + speed**2 * self.centrifugal_stiffness

    @property
    def viscous(self) -> float:
        """Viscous damping at standstill, N s/m."""
        return self.viscous_at(0.0)

    def viscous_at(self, speed: float) -> float:
        """Return the viscous damping, N s/m, at a speed of rotation, rad/s."""
        if self.damping is not None:
            return self.damping
        ratio = 0.0 if self.damping_ratio is None else self.damping_ratio
        viscous: float = 2 * ratio * sqrt(self.mass * self.stiffness_at(speed))
        return viscous


#: models of a scene by the types of those in memory
_KINDS = {"ReducedModel": "rom", "RingModel": "ring", "SectorRing": "ring"}


def _file(model: Any) -> Any:
    """Return the file of a reduced model, or of a reduced ring, in memory; anything else as it is."""
    if type(model).__name__ not in _KINDS:
        return model
    from vanedamp.rom.in_memory import file_of

    return file_of(model)


def _structure(structure: Any) -> Any:
    """Return the table of a reduced model in memory; anything else as it is."""
    file = _file(structure)
    return structure if file is structure else {"model": _KINDS[type(structure).__name__], "file": file}


@dataclass(frozen=True, config=STRICT)
class Rom:
    """A reduced model from a file, or in Python a `ReducedModel`."""

    model: Literal["rom"]
    """"rom": a reduced model"""
    file: Annotated[str, BeforeValidator(_file)]
    """file of the reduced model (`vanedamp reduce`, `vanedamp import`), relative to the scene's"""
    modes: Annotated[Whole, Field(ge=0)] | Literal["auto"] | None = None
    """number of modes, the first ones (default: all); "auto": as many natural modes as the tolerance needs, all for
    few periods"""
    natural: bool = False
    """take the model's own lowest natural modes in place of those of its basis"""
    attached: bool = False
    """add residual attachment modes to natural ones, which keep the model's flexibility"""
    tolerance: Annotated[Real, Field(gt=0, lt=1)] = 0.01
    """of modes = "auto": error of the mean amplitude that is allowed, relative to the resonance's peak without bodies,
    with errors of the model's forces counted in full [-]"""

    def __post_init__(self) -> None:
        if self.attached and not (self.natural and isinstance(self.modes, int)):
            raise ValueError("attached: attachment modes go with natural = true and a number of modes")


@dataclass(frozen=True, config=STRICT)
class Ring(Rom):
    """A reduced ring of sectors. Interface labels end with their sector, "tip@0" to "tip@35" of 36."""

    model: Literal["ring"]  # type: ignore[assignment]
    """"ring": a ring of sectors"""
    file: Annotated[str, BeforeValidator(_file)]
    """file of the reduced ring (`vanedamp reduce` of a case with [ring]), relative to the scene's"""
    mistuning: Mistuning | None = None
    """deviations of the sectors (default: tuned)"""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.modes == "auto":
            raise ValueError('modes: "auto" is for model = "rom"; a ring has the modes of its file, or the first ones')


Structure = Annotated[Prescribed | Rigid | Rom | Ring, Field(discriminator="model"), BeforeValidator(_structure)]


@dataclass(frozen=True, config=STRICT)
class Initial:
    """State of a rigid structure at time zero. The bodies' own states are relative to their cavities."""

    displacement: Real = 0.0
    """displacement, positive towards the right walls [m]"""
    velocity: Real = 0.0
    """velocity, positive towards the right walls [m/s]"""
