"""The energy ledger as a judge: what it is measured by, and that a run which does not balance says so."""

import time
from dataclasses import replace

import numpy as np
import pytest

from tests.coupling.engine.line.test_traps import cluster
from vanedamp.coupling.methods.registry import run_of
from vanedamp.coupling.numerics import codes
from vanedamp.coupling.numerics.tolerances import OPEN_LEDGER
from vanedamp.coupling.response import records as recs
from vanedamp.coupling.response.evaluation import STATUS_OF, Ended, closed_status, evaluate, residual
from vanedamp.coupling.response.figures import contact_gain
from vanedamp.coupling.response.response import Status


def test_what_is_only_carried_along_is_no_flow():
    """A body that carries 1e3 J past a structure which exchanges 1 J with it does not hide a missing 0.1 J."""
    ledger, parts = np.zeros((3, len(recs.ENERGIES))), np.zeros((3, 2))
    ledger[:, recs.STORED] = [1e3, 1e3 + 0.4, 1e3 + 0.1]
    parts[:, 0], parts[:, 1] = [0.0, 1.0, 0.5], [1e3, 999.4, 999.6]
    assert residual(ledger, parts) == pytest.approx(0.1 / 1.6)
    assert residual(ledger, parts, exchanged=10.0) == pytest.approx(0.01)


def test_terms_that_cancel_are_no_flow():
    """What the loads do and undo within a period counts by its cumulative value at the periods' ends."""
    ledger = np.zeros((2, len(recs.ENERGIES)))
    ledger[1, [recs.EXCITATION, recs.VISCOUS]] = 2.0, 1.5
    assert residual(ledger, np.zeros((2, 1))) == pytest.approx(0.25)
    assert residual(np.zeros((2, len(recs.ENERGIES))), np.zeros((2, 1))) == 0.0


def test_energy_that_contacts_make_counts_from_the_start_and_over_the_evaluated_periods():
    ledger, parts = np.zeros((4, len(recs.ENERGIES))), np.zeros((4, 1))
    ledger[:, recs.EXCITATION] = [0.0, 2.0, 4.0, 4.0]
    ledger[:, recs.IMPACT_LOSS] = [0.0, 1.0, 0.9, 0.8]
    assert contact_gain(ledger, parts, 0, 3, 0.0) == 0.0
    assert contact_gain(ledger, parts, 1, 3, 0.0) == pytest.approx(0.2 / 4.0)
    ledger[3, recs.CONTACT] = -0.4
    assert contact_gain(ledger, parts, 2, 3, 8.0) == pytest.approx(0.4 / 8.0)


@pytest.mark.parametrize("entry", [recs.IMPACT_LOSS, recs.CONTACT])
def test_contacts_that_make_energy_end_a_run_and_a_point_of_a_sweep(entry):
    """The ledger closes: what an impact is short of is in another term."""
    scene = cluster(15e-6).replace({"time.periods": 20})
    for made, status in ((1e-11, Status.OK), (1e-6, Status.ENERGY)):
        run = run_of(scene)
        run.advance_to(20)
        ledger = run.records.ledger
        taken = ledger[-1, entry] + made * np.abs(ledger).max()
        ledger[-1, entry] -= taken
        ledger[-1, recs.VISCOUS] += taken
        assert evaluate(scene, run.outcome(), Ended(Status.OK, 0), time.perf_counter()).status == status
        assert closed_status(STATUS_OF[codes.DONE], 0.0, made, OPEN_LEDGER) == status


@pytest.mark.parametrize("missing", [0.0, 1e-4, np.nan])
def test_a_ledger_that_does_not_close_ends_a_run(missing):
    """A millionth of what flowed is not missing without a word, and no figure that is not a number passes."""
    scene = cluster(15e-6).replace({"time.periods": 20})
    run = run_of(scene)
    assert run.advance_to(20) is Status.OK
    run.records.ledger[-1, recs.VISCOUS] += missing * np.abs(run.records.ledger).max()
    response = evaluate(scene, run.outcome(), Ended(Status.OK, 0), time.perf_counter())
    assert response.status == (Status.ENERGY if missing else Status.OK)


@pytest.mark.parametrize(("solver", "bound"), [({"method": "moreau"}, 0.1), ({"method": "solve_ivp"}, 1e-6)])
def test_every_method_is_judged(solver, bound):
    """Time steps may lose a tenth of what flows, an integrator a thousand times its tolerance."""
    scene = cluster(15e-6).replace({"time.periods": 5, "solver": solver})
    for missing, status in ((0.1 * bound, Status.OK), (10 * bound, Status.ENERGY)):
        run = run_of(scene)
        assert run.advance_to(5) is Status.OK
        ledger = run.outcome().records.ledger
        ledger[5, recs.VISCOUS] += missing * np.abs(ledger).max()
        assert evaluate(scene, run.outcome(), Ended(Status.OK, 0), time.perf_counter()).status == status


def test_a_run_that_has_ended_otherwise_keeps_its_status():
    scene = cluster(15e-6).replace({"time.periods": 5})
    run = run_of(scene)
    run.advance_to(5)
    outcome = replace(run.outcome(), open_ledger=0.0)
    for status in (Status.EVENT_BUDGET, Status.ACCURACY_LOST, Status.ILL_CONDITIONED):
        assert evaluate(scene, outcome, Ended(status, 0), time.perf_counter()).status == status
