"""What a device holds: each result with its interval, what the interval is due to, its limit and its source."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

from vanedamp.coupling.quantities.amplitude import amplitude_max_dynamic
from vanedamp.coupling.quantities.stress import damage_per_hour, utilisation_max
from vanedamp.files.store import finite
from vanedamp.studies.design.tables import DesignFile
from vanedamp.studies.design.worst import STRESS_MAX, Confirmation
from vanedamp.studies.hot_spots import DOUBTFUL
from vanedamp.studies.life.record import LifeRecord

#: grades, best first
GRADES = GREEN, AMBER, RED = "green", "amber", "red"
#: files of the sources of results, in the folder of the study
WORST, SPOTS, LIFE = "worst.toml", "stress.toml", "life.h5"
#: lives above this are not told apart, h
ENDLESS = 1e7


@dataclass(frozen=True)
class HeldValue:
    """A result of a device.

    name, unit   of it; value, low, high  with the ends of its interval, None: not known
    due          what the interval is due to
    limit        what must hold, None: nothing; least: whether it is the least value
    grade        "green", "amber" or "red" by the interval; "" without a limit
    source       file in the folder of the study, and the quantity there
    """

    name: str
    unit: str
    value: float
    low: float | None
    high: float | None
    due: str
    source: str
    limit: float | None = None
    least: bool = False
    doubtful: bool = False

    @property
    def grade(self) -> str:
        """Green: the whole interval is within the limit; red: the value is not; amber: else.

        A doubtful result is never green, and red only if its whole interval is beyond the limit.
        """
        if self.limit is None:
            return ""
        sign, limit = (-1.0, -self.limit) if self.least else (1.0, self.limit)
        best, worst = (self.high, self.low) if self.least else (self.low, self.high)
        surely = best if self.doubtful else self.value
        if surely is not None and sign * surely > limit:
            return RED
        return GREEN if worst is not None and sign * worst <= limit and not self.doubtful else AMBER

    @property
    def margin(self) -> float | None:
        """Distance of the value from its limit, relative to the limit; None without."""
        if self.limit is None:
            return None
        return (self.value - self.limit if self.least else self.limit - self.value) / self.limit

    def to_json(self) -> dict[str, Any]:
        """Return plain data."""
        return asdict(self) | {"grade": self.grade, "margin": self.margin}


class SpotFacts(NamedTuple):
    """Of a hot spot: relative error of its stress by the mesh (None: not known), steepest exponent of damage by it."""

    error: float | None
    exponent: float | None

    @property
    def doubtful(self) -> bool:
        """Whether the mesh does not decide the stress."""
        return self.error is None or self.error > DOUBTFUL


def held(
    study: DesignFile, worst: Confirmation, life: LifeRecord | None, spots: Mapping[str, SpotFacts]
) -> list[HeldValue]:
    """Return the results of a device; life: None without wear."""
    return [*_amplitudes(study, worst), *_stresses(study, worst, spots), *_lives(study, worst, life, spots)]


def overall(values: Sequence[HeldValue]) -> str:
    """Return the worst grade."""
    return max((value.grade for value in values if value.grade), key=GRADES.index, default=GREEN)


def _rise(worst: Confirmation) -> float:
    """Return by how much amplitudes may exceed the largest one that was found, relative to it."""
    return worst.expected / worst.amplitude - 1.0 if worst.amplitude > 0.0 else 0.0


def _amplitudes(study: DesignFile, worst: Confirmation) -> Iterator[HeldValue]:
    requirements, upper = study.requirements, worst.amplitude * (1.0 + _rise(worst))
    due = f"draws and starts that were not run {_percent(worst.missed / worst.amplitude)}"
    if worst.level is not None:
        due += f", fewer modes {_percent(abs(worst.level_difference) / worst.amplitude)}"
    for name, unit, over, limit in (
        ("largest amplitude", "m", 1.0, requirements.amplitude),
        ("largest amplitude over that without bodies", "1", worst.reference, requirements.amplitude_ratio),
    ):
        value, source = worst.amplitude / over, f"{WORST}: {amplitude_max_dynamic.name}"
        yield HeldValue(name, unit, value, value, finite(upper / over), due, source, limit, doubtful=worst.failed > 0)


def _stresses(study: DesignFile, worst: Confirmation, spots: Mapping[str, SpotFacts]) -> Iterator[HeldValue]:
    names = {
        STRESS_MAX: ("largest stress", None),
        utilisation_max.name: ("utilisation", study.requirements.utilisation),
    }
    for quantity, (name, limit) in names.items():
        for spot, values in worst.spots.items():
            if quantity in values:
                value, error = values[quantity], spots[spot].error or 0.0
                high = value * (1.0 + error) * (1.0 + _rise(worst))
                unit = "Pa" if quantity == STRESS_MAX else "1"
                yield HeldValue(
                    f"{name} at {spot}", unit, value, max(value * (1.0 - error), 0.0), finite(high),
                    f"mesh {_percent(spots[spot].error)}, draws, starts and modes {_percent(_rise(worst))}",
                    f"{SPOTS}: {quantity}", limit, doubtful=spots[spot].doubtful and limit is not None,
                )  # fmt: skip


def _lives(
    study: DesignFile, worst: Confirmation, life: LifeRecord | None, spots: Mapping[str, SpotFacts]
) -> Iterator[HeldValue]:  # fmt: skip
    """Yield the life of the vane at its worst hot spot, and that of the damper."""
    rates = {spot: of[damage_per_hour.name] for spot, of in worst.spots.items() if damage_per_hour.name in of}
    if rates:
        spot = max(rates, key=lambda name: rates[name])
        facts, source = spots[spot], f"{SPOTS}: {damage_per_hour.name} at {spot}"
        value = 1.0 / max(rates[spot], 1.0 / ENDLESS)
        if life is not None and life.damage is not None:
            most = max(float(life.damage[-1].max()), float(life.time[-1]) / ENDLESS)
            value = float(life.time[-1]) / most if life.vane_hours is None else life.vane_hours
            value, source = min(value, 1.0 / max(rates[spot], 1.0 / ENDLESS)), f"{source}, {LIFE}: damage"
        factor = (1.0 + (facts.error or 0.0)) * (1.0 + _rise(worst))
        exponent = facts.exponent or 1.0
        yield HeldValue(
            "median life of the vane", "h", value, value / factor**exponent, None,
            f"stress up to {factor:.3g} times by mesh, draws and modes, to the power {exponent:g}", source, study.hours,
            least=True, doubtful=facts.doubtful,
        )  # fmt: skip
    if life is not None:
        end = float(life.time[-1]) if life.worn_away is None else life.worn_away
        lost, early, late = life.hours
        yield HeldValue(
            "life of the damper", "h", end if lost is None else lost, end if early is None else early, late,
            "confidence of the runs, steps of the wear", f"{LIFE}: hours", study.hours, least=True,
        )  # fmt: skip


def text_of(number: float) -> str:
    """Return a number with three digits."""
    return f"{float(f'{number:.3g}'):.0f}" if 1e3 <= abs(number) < 1e6 else f"{number:.3g}"


def _percent(fraction: float | None) -> str:
    if fraction is None or not math.isfinite(fraction):
        return "not known"
    return f"{float(f'{100.0 * fraction:.2g}'):g} %"
