"""What a run may keep beside its sums: samples, the list of events, the wear of its contacts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.coupling.response.contact_work import ContactWork
from vanedamp.coupling.response.evaluation import Needs, Observer, Outcome
from vanedamp.coupling.response.event_log import events_of, impact_energies
from vanedamp.coupling.response.moved_start import as_one
from vanedamp.coupling.response.plane import planar_samples
from vanedamp.coupling.response.wear import contact_wear, ledger_warning
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.system import System


class Samples(Observer):
    """Keeps `each` equidistant samples of every period; 0: none."""

    def __init__(self, each: int) -> None:
        self.each = each

    def needs(self, scene: Scene, system: System) -> Needs:
        """Return the samples. Raises InputError for a number that steps do not meet."""
        scene.solver.check_samples(self.each)
        return Needs(samples=self.each)

    def fields(self, scene: Scene, run: Outcome, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return times, displacements, modal coordinates if the method keeps any, and what bodies do in the plane."""
        if not self.each:
            return {}
        system, records, count = run.system, run.records, run.periods * self.each
        each = records.samples_per_period  # others may need more
        kept = slice(None, run.periods * each, each // self.each)
        samples, coordinates, x = records.samples[kept], records.coordinates[kept], records.samples[kept, 0].copy()
        made: dict[str, Any] = {
            "time": np.arange(count) * (system.period / self.each), "displacement": x,
            "body_displacement": samples[:, 1:].copy(),
        }  # fmt: skip
        if coordinates.size and np.all(np.isfinite(coordinates)):
            made["coordinates"] = coordinates.copy()
        if run.plane is not None:
            made["in_plane"] = planar_samples(system, x, records.sampled[kept], records.shut[kept])
        return made


class Events(Observer):
    """Keeps the list of events."""

    def needs(self, scene: Scene, system: System) -> Needs:
        """Return the log."""
        return Needs(log=True)

    def fields(self, scene: Scene, run: Outcome, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return the list."""
        return {"event_list": events_of(run.rows, run.log)}


class Wear(Observer):
    """Keeps the work of the contacts of a scene with [wear], exact engine, and their wear."""

    def needs(self, scene: Scene, system: System) -> Needs:
        """Return the sums by contact, and the log where contacts yield: the energies of their impacts are in it."""
        assert scene.wear is not None
        return Needs(log=scene.yields, exponent=scene.wear.impact_exponent)

    def fields(self, scene: Scene, run: Outcome, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return work and wear, and a warning if it does not fit the friction work of the energy balance."""
        work = _contact_work(scene, run, found["transient"])
        if not work or not len(work[0].course):
            return {"contact_work": work}
        warnings = ledger_warning(work, found["energy"]["friction"])
        return {"contact_work": work, "wear": contact_wear(scene, work), "warnings": warnings}


class AsOne(Observer):
    """Warns of neighbours that move as one."""

    def fields(self, scene: Scene, run: Outcome, found: Mapping[str, Any]) -> dict[str, Any]:
        """Return the warning."""
        if not found["impacts_per_period"]:
            return {}
        return {"warnings": as_one(scene, *(found[name][found["transient"] :] for name in ("slip", "slip_velocity")))}


def _contact_work(scene: Scene, run: Outcome, first: int) -> tuple[ContactWork, ...]:
    """Return the work of each contact of a run over its periods from `first` on."""
    records, rows, window = run.records, run.rows, slice(first, run.periods)
    struck = _struck(run)
    found = []
    for row, (number, side, corner) in enumerate(rows.places):
        friction = _friction(scene, run, row)
        sliding = records.worn[window, row] / friction if friction > 0.0 else np.zeros(run.periods - first)
        course = np.stack([sliding, struck[window, row]], axis=1)
        found.append(ContactWork(number, side, corner, friction, int(records.hits[window, row].sum()), course))
    return tuple(found)


def _struck(run: Outcome) -> np.ndarray:
    """Return the sums (periods + 1, rows) of the energies of impacts to the power of [wear], J^n."""
    struck, exponent = run.records.struck.copy(), float(run.records.exponent[0])
    struck[:, np.flatnonzero(np.isfinite(run.rows.spring))] = 0.0  # known only as a contact ends
    period, row, energy = impact_energies(run.rows, run.log, run.system.period)
    np.add.at(struck, (np.minimum(period, len(struck) - 1), row), energy**exponent)
    return struck


def _friction(scene: Scene, run: Outcome, row: int) -> float:
    """Return the coefficient of friction of a row of the log; 0: none, and no work of it."""
    number, side, _ = run.rows.places[row]
    if run.rows.without_body[row]:
        return scene.friction_damper[number].friction if side == "casing" else 0.0
    if run.system.in_plane and row < run.system.contacts:
        return float(run.system.friction[row])
    return scene.damper[number].friction if side == "floor" else 0.0
