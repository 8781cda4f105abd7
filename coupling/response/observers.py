"""What a run may keep besides its sums: samples, the list of events, the wear of its contacts."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from vanedamp.coupling.response.contact_work import ContactWork
from vanedamp.coupling.response.evaluation import Fields, Needs, Observer, Outcome
from vanedamp.coupling.response.event_log import events_of, impact_energies
from vanedamp.coupling.response.moved_start import as_one
from vanedamp.coupling.response.plane import planar_samples
from vanedamp.coupling.response.wear import contact_wear, ledger_warning
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.unit_laws import sharing


def samples(each: int) -> Observer:
    """Return the observer of equidistant samples of every period: displacements, any modal coordinates."""
    return Observer(partial(_samples, each), Needs(samples=each))


def _samples(per_period: int, scene: Scene, run: Outcome, known: Fields) -> Fields:
    if not per_period:
        return {}
    records, each = run.records, run.records.samples_per_period  # others may need more
    rows = slice(None, run.periods * each, each // per_period)
    taken, coordinates, x = records.samples[rows], records.coordinates[rows], records.samples[rows, 0].copy()
    time = np.arange(len(x)) * (run.system.period / per_period)
    made: dict[str, Any] = {"time": time, "displacement": x, "body_displacement": taken[:, 1:].copy()}
    if coordinates.size and np.all(np.isfinite(coordinates)):
        made["coordinates"] = coordinates.copy()
    if run.plane is not None and run.system.bodies:
        made["in_plane"] = planar_samples(run.system, x, records.sampled[rows], records.shut[rows])
    return made


def wear(scene: Scene) -> Observer:
    """Return the observer of contact work of a scene with [wear], exact engine, and their wear."""
    assert scene.wear is not None
    # the energies of impacts on contacts that yield are in the log
    return Observer(_worn, Needs(log=scene.yields, exponent=scene.wear.impact_exponent))


def _worn(scene: Scene, run: Outcome, known: Fields) -> Fields:
    work = contact_work(scene, run, known["transient"])
    if not work or not len(work[0].course):
        return {"contact_work": work}
    warnings = ledger_warning(work, known["energy"]["friction"])
    return {"contact_work": work, "wear": contact_wear(scene, work), "warnings": warnings}


def _together(scene: Scene, run: Outcome, known: Fields) -> Fields:
    first = known["transient"]
    if not run.records.impacts[first : run.periods].any():
        return {}
    return {"warnings": as_one(scene, *(known[name][first:] for name in ("slip", "slip_velocity")))}


#: keeps the list of events
EVENT_LIST = Observer(lambda _, run, known: {"event_list": events_of(run.rows, run.log)}, Needs(log=True))
#: warns of neighbours that move as one
TOGETHER = Observer(_together)


def contact_work(scene: Scene, run: Outcome, first: int) -> tuple[ContactWork, ...]:
    """Return the work of each contact of a run over its periods from `first` on."""
    records, rows, window = run.records, run.rows, slice(first, run.periods)
    struck = _struck(run)
    contacts = []
    for row, (number, side, corner) in enumerate(rows.places):
        friction = _friction(scene, run, row)
        sliding = records.worn[window, row] / friction if friction > 0.0 else np.zeros(run.periods - first)
        course = np.stack([sliding, struck[window, row]], axis=1)
        contacts.append(ContactWork(number, side, corner, friction, int(records.hits[window, row].sum()), course))
    return tuple(contacts)


def _struck(run: Outcome) -> np.ndarray:
    """Return the sums (periods + 1, rows) of the energies of impacts to the power of [wear], J^n."""
    struck, exponent = run.records.struck.copy(), float(run.records.exponent[0])
    struck[:, np.flatnonzero(np.isfinite(run.rows.spring))] = 0.0  # known only as a contact ends
    if run.log:
        period, row, energy = impact_energies(run.rows, run.log, run.system.period)
        np.add.at(struck, (np.minimum(period, len(struck) - 1), row), energy**exponent)
    return struck


def _friction(scene: Scene, run: Outcome, row: int) -> float:
    """Return the coefficient of friction of a row of the log; 0: none, and no work of it."""
    number, side, _ = run.rows.places[row]
    if side == "casing":
        return scene.friction_damper[number].friction
    if run.system.in_plane and row < run.system.contacts:
        return float(run.system.friction[row]) / int(sharing(run.system)[row])
    return scene.damper[number].friction if side == "floor" else 0.0
