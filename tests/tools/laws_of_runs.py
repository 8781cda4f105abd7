"""What every run of a random scene obeys: Newton's laws, energy, walls; its images do the same.

Run as a script, it looks at thousands of scenes, event by event, and prints the largest violations with their seeds:

    .venv/bin/python -m tests.tools.laws_of_runs [PARTS [EXAMPLES [FIRST_SEED]]]
    .venv/bin/python -m tests.tools.laws_of_runs KIND SEED        one part again, with the scene that fails
"""

from __future__ import annotations

import math
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, assume, given, seed, settings
from hypothesis import strategies as st

from tests.tools.laws_by_event import Worst, check_events
from tests.tools.scene_strategies import scene_of, scene_tables
from tests.tools.scene_symmetries import compare, later, mirrored, perturbed, record, renumbered, reordered, unmirrored
from vanedamp.coupling.engine.line.gap_kinematics import SIMULTANEOUS
from vanedamp.coupling.numerics.codes import DONE, EVENT_BUDGET
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.simulation import simulate

#: contact law and whether there are friction dampers
KINDS = {"newton": ("newton", False), "elements": ("newton", True), "compliant": ("compliant", True)}
LOSSES = ("viscous", "friction", "impact", "contact")
# what fails becomes a scene in tests/coupling/engine/line/test_traps.py: no time is spent on making it small again
SETTINGS = settings(
    deadline=None,
    database=None,
    phases=[Phase.generate],
    report_multiple_bugs=False,
    suppress_health_check=list(HealthCheck),
)
#: steps of one scene among thousands that are looked at: a chatter can be followed for ever
LONGEST = 150
#: imbalance of the ledger, relative to the energy that flowed, but for what gaps that close with others make
LEDGER = 1e-10


def impacts(response):
    return [event for event in response.event_list if event.kind == "impact"]


def check_laws(data, longest=None):
    """The ledger closes, nothing gives energy, and the laws hold at the first `longest` events.

    Returns the largest violations.
    """
    scene = scene_of(data)
    response = simulate(scene, events=True, samples_per_period=32)
    assume(whole(scene, response))
    largest = max(abs(value) for value in response.energy.values())
    assert min(response.energy[name] for name in LOSSES) >= -1e-12 * largest
    times = [event.time for event in response.event_list]
    assert times == sorted(times)
    if scene.contact.law == "newton":
        check_newton(scene, impacts(response))
        if data["structure"]["model"] != "rom" or "left" not in data["cavity"][0]:
            check_walls(scene, response)
    worst = check_events(scene, longest)
    # at an impact all gaps up to SIMULTANEOUS close at once: that carries bodies as far against their weight
    weight = scene.gravity.components(np.zeros(3))[0] * sum(damper.mass for damper in scene.damper)
    jumps = len(impacts(response)) * abs(weight) * SIMULTANEOUS * max(cavity.gap for cavity in scene.cavity)
    worst.note("ledger", response.energy_residual, LEDGER + jumps / max(largest, np.finfo(float).tiny))
    return worst


def hops(scene):
    """Whether a body is elastic: pressed on its wall it hops as often as it likes, and no chatter ends that."""
    return max(damper.restitution for damper in scene.damper) > 0.995


def whole(scene, response):
    """Whether a run has come to its end. Asserts that, but for bodies that hop."""
    if hops(scene) and response.status == Status.EVENT_BUDGET:
        return False
    assert response.status == Status.OK
    return True


def restitutions(scene, event):
    """Restitution and reduced mass without the structure of an impact."""
    damper = scene.damper[event.damper]
    if event.side != "body":
        return damper.restitution, damper.mass
    other = scene.damper[event.damper + 1]
    restitution = math.sqrt(damper.restitution * other.restitution)
    return restitution, damper.mass * other.mass / (damper.mass + other.mass)


def check_newton(scene, found):
    """v+ = -k v- and impulse = m* (1 + k) |v-| at impacts alone in their instant; the last of a chatter is plastic."""
    fastest = max((abs(event.relative_velocity_before) for event in found), default=0.0)
    for index, event in enumerate(found):
        near = [e for e in found[max(index - 4, 0) : index + 5] if e is not event and abs(e.time - event.time) < 1e-9]
        before, after = event.relative_velocity_before, event.relative_velocity_after
        restitution, mass = restitutions(scene, event)
        assert event.impulse >= 0.0
        assert before * after <= 0.0
        if abs(before) < 1e-4 * fastest or near or after == 0.0:
            continue  # whether a plastic impact ends a chatter is judged by check_events, which knows the accelerations
        assert abs(after) >= restitution * abs(before) * (1 - 1e-12)
        if scene.structure.model == "rigid" and event.side != "body":
            mass = 1 / (1 / mass + 1 / scene.structure.mass)
        if scene.structure.model != "rom" and abs(after) <= restitution * abs(before) * (1 + 1e-12):
            # bodies at rest on other walls and neighbours take part in the impact: its mass is then larger
            assert event.impulse >= (1 + restitution) * mass * abs(before) * (1 - 1e-10)
            if len(scene.damper) == 1:
                assert event.impulse == pytest.approx((1 + restitution) * mass * abs(before), rel=1e-10)


def check_walls(scene, response):
    """No body leaves its cavity or its place in the row, to 1e-12 of the gap and of the motion."""
    for cavity in scene.cavity:
        row = [index for index, damper in enumerate(scene.damper) if damper.cavity == cavity.name]
        ends = np.full((len(response.time), 1), cavity.gap / 2)
        openings = np.diff(np.hstack([-ends, response.body_displacement[:, row], ends]), axis=1)
        assert openings.min() >= -1e-12 * cavity.gap


def check_symmetries(data):
    """Mirror image, cavities in another order, and a start at another phase: the same motion.

    Returns the number of impacts that were compared.
    """
    may_hop = hops(scene_of(data))
    one = record(data)
    apart = [record(near) for near in perturbed(data)]
    codes = {run.code for run in (one, *apart)}
    assume(not (may_hop and EVENT_BUDGET in codes))
    assert codes == {DONE}

    def compared_with(other, **how):
        if may_hop and other.code == EVENT_BUDGET:
            return 0  # round-off decides whether an elastic body rests on its wall or hops
        return compare(one, other, apart, **how)

    image, change = mirrored(data)
    compared = compared_with(unmirrored(record(image, change)))
    moved, old = reordered(data, list(range(len(data["cavity"])))[::-1])
    compared += compared_with(renumbered(record(moved), old))
    start = later(data)
    if start is not None:
        time, change = start
        compared += compared_with(record(data, change), shift=time, sections=False)
    return compared


def laws_of(kind: str, first: int, examples: int, longest: int | None = LONGEST) -> Worst:
    """Check so many scenes of a kind, drawn from a seed, at their first events. Returns the largest violations."""
    law, elements = KINDS[kind]
    largest = Worst()

    @seed(first)
    @settings(SETTINGS, max_examples=examples)
    @given(data=st.data())
    def check(data):
        largest.merge(check_laws(data.draw(scene_tables(laws=(law,), elements=elements)), longest))

    check()
    return largest


def symmetries_of(law: str, first: int, examples: int) -> int:
    """Compare so many scenes, drawn from a seed, with their images. Returns the number of impacts compared."""
    compared = []

    @seed(first)
    @settings(SETTINGS, max_examples=examples)
    @given(data=st.data())
    def check(data):
        compared.append(check_symmetries(data.draw(scene_tables(laws=(law,)))))

    check()
    return sum(compared)


def _part(part: tuple[str, int, int]) -> Worst | str:
    try:
        return laws_of(*part)
    except Exception as error:  # the other parts go on
        return f"{part[0]} {part[1]}: {str(error).splitlines()[:1] or type(error).__name__}"


def main(parts: int = 14, examples: int = 250, first: int = 0) -> int:
    """Print the table of the largest violations. Returns the number of parts that failed."""
    jobs = [(kind, number, examples) for kind in KINDS for number in range(first, first + parts)]
    with ProcessPoolExecutor() as pool:
        found = list(zip(jobs, pool.map(_part, jobs), strict=True))
    good = [(job, worst) for job, worst in found if isinstance(worst, Worst)]
    failed = [worst for _, worst in found if isinstance(worst, str)]
    counts = {name: sum(getattr(worst, name) for _, worst in good) for name in ("scenes", "steps", "impacts")}
    print(*(f"{count} {name}" for name, count in counts.items()), sep=", ")
    print("| violation | largest | kind, seed |", "|---|---|---|", sep="\n")
    for field in fields(Worst):
        if field.name not in counts:
            job, worst = max(good, key=lambda pair: getattr(pair[1], field.name))
            print(f"| {field.name} | {getattr(worst, field.name):.1e} | {job[0]}, {job[1]} |")
    print(*failed, sep="\n")
    return len(failed)


if __name__ == "__main__":
    if len(sys.argv) > 1 and sys.argv[1] in KINDS:
        print(laws_of(sys.argv[1], int(sys.argv[2]), 250))
    else:
        sys.exit(min(main(*map(int, sys.argv[1:])), 1))
