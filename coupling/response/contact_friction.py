"""Friction by contact: the energy that it takes, and for how long the contact sticks, slips and is open."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.response.contact_work import ContactFriction
from vanedamp.coupling.response.evaluation import Fields, Needs, Observer, Outcome
from vanedamp.coupling.response.records import DETACHES, FRICTION, IMPACT, KINDS, RESTS, SLIPS, STICKS
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import METHODS
from vanedamp.coupling.system.system import System
from vanedamp.coupling.system.unit_laws import rubs

#: table of the elements that are always listed
JOINT = "joint"
_STICK, _SLIP, _OPEN, _CLOSED = range(4)
#: state after an event, and before it: a force that has fallen to zero slips first
_AFTER, _BEFORE = np.zeros((2, len(KINDS)), int)
_AFTER[[IMPACT, STICKS, SLIPS, DETACHES, RESTS]] = _CLOSED, _STICK, _SLIP, _OPEN, _CLOSED
_BEFORE[[IMPACT, STICKS, SLIPS, DETACHES, RESTS]] = _OPEN, _SLIP, _STICK, _SLIP, _OPEN
#: work of friction that is round-off, relative to the largest term of the energy balance
_NO_WORK = 1e-12


def wanted(scene: Scene) -> bool:
    """Whether results list friction by contact: of a scene with joints, by a method that logs how states change.

    Springs in parallel are several contacts in one.
    """
    logged = getattr(METHODS.part(scene.solver.method), "WEARS", False)
    return bool(scene.element_tables.get(JOINT)) and logged and not scene.contact.parallel


class FrictionObserver(Observer):
    """Keeps the friction of every contact that rubs."""

    def begin(self, scene: Scene, system: System) -> Needs:
        """Return the log, and work by contact where the energy balance has that of several."""
        return Needs(log=True, exponent=1.0 if np.sum(rubs(system)) > 1 else None)


def _fields(scene: Scene, run: Outcome, known: Fields) -> Fields:
    return {"contact_friction": contact_friction(run, known["transient"])} if run.periods else {}


#: lists friction by contact
FRICTION_BY_CONTACT = FrictionObserver(_fields)


def contact_friction(run: Outcome, first: int) -> tuple[ContactFriction, ...]:
    """Return the friction of joints and of contacts with friction over a run's periods from `first` on."""
    system, ledger, rubbing = run.system, run.records.ledger[: run.periods + 1], rubs(run.system)
    log = np.concatenate(run.log) if run.log else np.zeros((0, 3))
    worn = run.records.worn[: run.periods]
    work = worn if worn.shape[1] else np.diff(ledger[:, FRICTION])[:, None] * rubbing
    least, window = _NO_WORK * np.abs(ledger).max(), np.array([first, run.periods]) * system.period
    found = []
    for row, place in enumerate(run.rows.places):
        if not rubbing[row] and place[1] != JOINT:
            continue
        entries = log[log[:, 2] == row]
        # impacts on rigid contacts pass; those that close them come to rest
        lasting = entries[np.isfinite(run.rows.spring[row]) | (entries[:, 1] != IMPACT)]
        began = 0 if not len(lasting) else int(lasting[-1, 0] / system.period) + 1
        late = work[min(began, run.periods - 1) :, row].sum()
        held = _STICK if rubbing[row] and late <= least else _SLIP
        if not len(lasting) and (system.rest[row] > 0.0 or len(entries)):
            held = _OPEN
        energy = float(work[first:, row].mean())
        fractions = _fractions(lasting[:, 0], lasting[:, 1].astype(int), held, window)
        found.append(ContactFriction(*place, energy, energy / system.period, *fractions.tolist()))
    return tuple(found)


def _fractions(times: np.ndarray, kinds: np.ndarray, last: int, window: np.ndarray) -> np.ndarray:
    """Return the fractions (3,) of the time in which a contact sticks, slips and is open.

    times, kinds: (k,) of its events, s; last: its state after them, where they do not tell; window: (2,) s.
    """
    follows = np.r_[_BEFORE[kinds], last]
    states = np.r_[follows[0], _AFTER[kinds]]
    # a log does not say in which state a contact closes
    states = np.where(states == _CLOSED, np.where(follows == _OPEN, _SLIP, follows), states)
    lasted = np.diff(np.clip(np.r_[0.0, times, np.inf], *window))
    return np.bincount(states, lasted, minlength=3) / (window[1] - window[0])
