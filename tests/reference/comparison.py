"""Whether the engine follows the reference: events, motion and energies up to where chaos parts any two ways."""

from __future__ import annotations

import numpy as np

from tests.reference.integrator import Reference, with_horizon
from tests.reference.ledger import ledger
from vanedamp.coupling.response.response import Event, Response, Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.rom.reduced import ReducedModel

SAMPLES = 32
# impacts slower than this share of the fastest are decided by round-off: a graze is a miss a hair away
FADING = 1e-3


def follow(scene: Scene, periods: int, reduced: ReducedModel | None = None, folder=None) -> Response:
    """Run both ways and compare: impacts in the same order at times equal to 1e-8 periods, motion to 1e-7.

    The comparison ends where the reference at other step lengths and tolerances parts from itself; if it never does,
    the energies are compared as well. folder: where the engine may find the file of the reduced model.
    """
    scene = scene.replace({"time": {"periods": periods, "transient": 0}})
    if reduced is not None:
        reduced.save(folder / "rom.h5")
        scene = scene.replace({"structure.file": str(folder / "rom.h5")})
    reference, end = with_horizon(scene, periods, reduced)
    response = simulate(scene, events=True, samples_per_period=SAMPLES)
    assert response.status == Status.OK
    assert response.energy_residual < 1e-10
    _compare_events(scene, response, reference, end)
    compare_motion(scene, response, reference, end)
    if end == reference.time and end * scene.excitation.frequency > periods - 1e-9:
        _compare_energies(response, reference)
    return response


def impacts(events, end: float) -> list:
    """Impacts up to `end` that are fast enough to be certain."""
    fastest = max((abs(event.relative_velocity_before) for event in events), default=0.0)
    return [
        event
        for event in events
        if event.time < end and event.kind == "impact" and abs(event.relative_velocity_before) > FADING * fastest
    ]


def compare_motion(
    scene: Scene, response: Response, reference: Reference, end: float, structure: float = 1e-7, bodies: float = 1e-7
) -> None:
    """Assert that samples before `end` agree. structure, bodies: shares of the amplitude and of the gap."""
    time = response.time[response.time < end]
    given_up = reference.time * scene.excitation.frequency < scene.time.simulated - 1e-9  # its events have no end
    assert len(time) > (0 if given_up else 2 * SAMPLES)
    apart = response.displacement[: len(time)] - reference.x(time)
    assert np.abs(apart).max() <= structure * np.abs(response.displacement).max()
    for body, damper in enumerate(scene.damper):
        gap = next(cavity.gap for cavity in scene.cavity if cavity.name == damper.cavity)
        apart = response.body_displacement[: len(time), body] - reference.r(body, time)
        assert np.abs(apart).max() <= bodies * gap


def _compare_events(scene: Scene, response: Response, reference: Reference, end: float) -> None:
    both = [impacts(events, end) for events in (response.event_list, reference.events)]
    assert abs(len(both[0]) - len(both[1])) <= 1  # one may lie just beyond the end
    fastest = max((abs(event.relative_velocity_before) for event in reference.events), default=0.0)
    masses = sum(damper.mass for damper in scene.damper)
    for found, expected in zip(*both, strict=False):
        sign = -1.0 if expected.side == "neighbour" else 1.0
        assert (found.damper, found.side) == (expected.damper, expected.side.replace("neighbour", "body"))
        assert abs(found.time - expected.time) < 1e-8 / scene.excitation.frequency
        assert abs(found.relative_velocity_before - sign * expected.relative_velocity_before) < 1e-6 * fastest
        if scene.contact.law == "compliant" and _over(response, found) < end:
            assert abs(found.relative_velocity_after - sign * expected.relative_velocity_after) < 1e-6 * fastest
            assert abs(found.impulse - expected.impulse) < 1e-6 * fastest * masses
    if scene.friction_damper:
        _compare_slips(scene, response, reference, end)


def _compare_slips(scene: Scene, response: Response, reference: Reference, end: float) -> None:
    """Sticks of the Jenkins elements: their slips may be as short as round-off wants."""
    for element in range(len(scene.friction_damper)):
        found, expected = (
            [e.time for e in run.events if (e.kind, e.side, e.damper) == ("slip", "casing", element)]
            for run in (_Listed(response), reference)
        )
        for time in expected:
            if time < end:
                assert min(abs(np.array(found) - time), default=np.inf) < 1e-6 / scene.excitation.frequency


class _Listed:
    def __init__(self, response: Response) -> None:
        self.events = response.event_list


def _over(response: Response, impact: Event) -> float:
    """When an impact on a compliant wall is over: the contact's last "detach" before it is hit again."""
    same = [event for event in response.event_list if (event.damper, event.side) == (impact.damper, impact.side)]
    again = next((event.time for event in same if event.kind == "impact" and event.time > impact.time), np.inf)
    over = [event.time for event in same if event.kind == "detach" and impact.time <= event.time <= again]
    return max(over, default=np.inf)


def _compare_energies(response: Response, reference: Reference) -> None:
    expected = ledger(reference)
    largest = max(map(abs, expected.values()))
    assert abs(response.periods / response.frequency - reference.time) < 1e-9 * reference.time
    for name, value in response.energy.items():
        assert abs(value - expected[name]) < 1e-7 * largest, name
