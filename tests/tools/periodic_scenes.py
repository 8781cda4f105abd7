"""Random periodic scenes of sliders, blocks and discs, of all contact laws and elements: how their passages end.

The engine runs each scene until its motion repeats; the passage of its period is then evaluated with its derivative.
Scenes that do not repeat after 100 periods are counted apart. A passage that is "grazing" or "coincident" has no
derivative on both sides; one that is "undetermined", "stopped" or "refused" lacks what could be derived. Run as a
script, it prints the seeds of all that are not "ok", and a table:

    .venv/bin/python -m tests.tools.periodic_scenes [FIRST_SEED [SCENES]]
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from tests.tools.planar_laws import crowd, jenkins, tables
from tests.tools.random_scenes import random_compliant, random_jenkins, random_scene
from vanedamp.coupling.derivatives.passage import PassageStatus
from vanedamp.coupling.orbits.period_map import PeriodMap, period_map
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError, validate

#: periods before a motion is to repeat, and the most periods after which it does so
SETTLED, LONGEST = 100, 4
#: largest change of a coordinate over that time, as a share of its typical size
REPEATS = 1e-6
LAWS = (
    {"law": "newton"}, {"law": "newton"}, {"law": "poisson"}, {"law": "viscoelastic", "coefficient": 0.2},
    {"law": "compliant", "stiffness": 300.0},
)  # fmt: skip
#: events after which a run is given up: some motions end in chatters without an end
MOST_EVENTS = 400 * SETTLED
#: endings of scenes that are no periodic motion
_UNUSED = ("not periodic", "no scene", "no run", "too many events")
_ORDER = list(PassageStatus)


class Found(NamedTuple):
    """How the passage of a scene's period ended, or why there is none; the scene's kind; the last event."""

    end: str
    kind: str
    why: str = ""


def scene_of(seed: int, folder: Path) -> tuple[str, Scene]:
    """Return the kind of a random scene and the scene, damped so that most motions repeat. Raises InputError."""
    rng = np.random.default_rng([seed, 23])
    kind = ("slider", "slider", "jenkins", "planar", "planar", "planar", "crowd", "beside")[rng.integers(8)]
    if kind == "slider":
        scene = random_compliant(seed)[0] if rng.random() < 0.3 else random_scene(seed)
        return kind, _damped(scene.to_dict(), rng)
    if kind == "jenkins":
        return kind, _damped(random_jenkins(seed)[0].to_dict(), rng)
    law = LAWS[rng.integers(len(LAWS))]
    data = {
        "planar": lambda: tables(seed),
        "crowd": lambda: crowd(seed, folder),
        "beside": lambda: jenkins(seed, folder),
    }
    table = data[kind]() | {"contact": law}
    for damper in table["damper"]:
        if law["law"] == "viscoelastic":
            damper.pop("restitution", None)
        else:
            damper["restitution"] = float(min(max(damper["restitution"], 0.05), 0.8))
    return f"{kind}, {law['law']}", _damped(table, rng)


def _damped(data: dict, rng: np.random.Generator) -> Scene:
    if data["structure"]["model"] == "rigid":
        data["structure"] = data["structure"] | {"damping_ratio": float(rng.uniform(0.05, 0.2))}
    solver = data.get("solver", {}) | {"max_events": MOST_EVENTS}
    return validate(Scene, data | {"time": {"periods": SETTLED, "transient": 0}, "solver": solver}, "scene")


def passage_of(seed: int, folder: Path) -> Found:
    """Return how the passage of a random scene's period ends."""
    kind = "none"
    try:
        kind, scene = scene_of(seed, folder)
        response = simulate(scene)
    except InputError as error:
        return Found("no scene", kind, str(error))
    if response.final is None:
        crowded = response.status is Status.EVENT_BUDGET
        return Found("too many events" if crowded else "no run", kind, str(response.status))
    _, _, periods = response.classification.partition("periodic-")
    if response.classification == "non-periodic" or int(periods or 1) > LONGEST:
        return Found("not periodic", kind)
    try:
        found = period_map(scene)
    except InputError as error:
        return Found("refused", kind, str(error))
    return _ended(found, found.state_of(response.final), kind)


def _ended(found: PeriodMap, start: np.ndarray, kind: str) -> Found:
    x, worst, last = start, PassageStatus.OK, ""
    for _ in range(LONGEST):
        passage = found(x)
        if _ORDER.index(passage.status) > _ORDER.index(worst):
            worst, last = passage.status, passage.sequence[-1] if passage.sequence else ""
        x = passage.state
        if worst is PassageStatus.STOPPED or np.all(np.abs(x - start) <= REPEATS * found.scale):
            return Found(str(worst), kind, last)
    return Found("not periodic", kind, last)


def table(found: list[Found]) -> str:
    """Return the counts of endings by the kinds of scenes."""
    columns = sorted({each.end for each in found})
    counts = Counter((each.kind, each.end) for each in found)
    kinds = sorted({each.kind for each in found})
    rows = [["", *columns]] + [[kind, *(str(counts[kind, end]) for end in columns)] for kind in kinds]
    rows.append(["all", *(str(sum(counts[kind, end] for kind in kinds)) for end in columns)])
    return "\n".join("".join(f"{cell:>22}" if i else f"{cell:22}" for i, cell in enumerate(row)) for row in rows)


def main(first: int = 0, count: int = 500) -> None:
    """Print how so many periodic scenes end, from a seed on: a table, and the seeds of all but "ok"."""
    found: list[Found] = []
    periodic, seed = 0, first
    with TemporaryDirectory() as folder:
        while periodic < count:
            each = passage_of(seed, Path(folder))
            found.append(each)
            periodic += each.end not in _UNUSED
            if each.end not in ("ok", *_UNUSED) or each.end == "no run":
                print(f"{each.end}: {each.kind} (seed {seed}) {each.why}", flush=True)
            seed += 1
    print(table(found), f"{periodic} periodic scenes of {len(found)}", sep="\n")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
