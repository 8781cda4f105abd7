"""The same orbit from several moments of its period: sines that begin later, and the state then.

Run as a script, it prints the random orbits that are judged differently, or have no derivatives:

    .venv/bin/python -m tests.tools.orbit_phases [FIRST_SEED [ORBITS]]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import vanedamp as vd
from tests.tools.sensitive_scenes import scene_of
from vanedamp.coupling.orbits.newton import PeriodicOrbit
from vanedamp.coupling.response.evaluation import periods_of
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.scene.orbit import Orbit as Table
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import InputError

#: degrees
PHASES = (0.0, 20.0, 60.0, 120.0)
#: excitation periods of orbits
_LONGEST = 4


class Judged(NamedTuple):
    """What is said of an orbit."""

    status: str
    stable: bool
    undetermined: bool
    sensitivity: str


def later(scene: Scene, orbit: PeriodicOrbit, phase: float) -> tuple[Scene, RestartState]:
    """Return a scene of sines that begin at a phase of its own, in degrees, and the orbit's state then."""
    sines = [
        {"order": sine.order, "amplitude": sine.amplitude, "phase": sine.phase} for sine in scene.excitation.harmonic
    ]
    if all(sine["order"] != 1 for sine in sines):
        sines.append({"order": 1, "amplitude": 1.0, "phase": 0.0})
    turned = [sine | {"phase": sine["phase"] + sine["order"] * phase} for sine in sines]
    assert orbit.map is not None
    found = orbit.map.later(orbit.state, phase / 360.0) if phase else (None, orbit.state)
    assert found is not None
    return scene.replace({"excitation.harmonic": turned}), orbit.map.restart_of(found[1])


def judged(seed: int, folder: Path) -> list[Judged] | None:
    """Return what is said of a random orbit at every phase; None for a scene without one."""
    try:
        scene = replace(scene_of(seed, folder)[1], orbit=None)
        if scene.excitation.load or scene.excitation.waveform:
            return None
        response = vd.simulate(scene)
        periods = periods_of(response.classification)
        if response.final is None or periods is None or periods > _LONGEST:
            return None
        scene = replace(scene, orbit=Table(periods=periods))
        orbit = vd.find_orbit(scene, response.final)
    except InputError:
        return None
    if orbit.status != "ok":
        return None
    paths = [f"cavity.{cavity.name}.gap" for cavity in scene.cavity[:1]]
    if scene.excitation.engine_order is None:
        paths.append("excitation.frequency")
    found = []
    for phase in PHASES:
        other = vd.find_orbit(*later(scene, orbit, phase))
        status = vd.sensitivity(other, paths).status
        found.append(Judged(other.status.value, other.stable, other.undetermined, status.value))
    return found


def main(first: int = 0, count: int = 200) -> None:
    """Print them, and how many there were."""
    seed, orbits, different = first, 0, 0
    with TemporaryDirectory() as folder:
        while orbits < count:
            if (found := judged(seed, Path(folder))) is not None:
                orbits, different = orbits + 1, different + (len(set(found)) > 1)
                if len(set(found)) > 1 or found[0].sensitivity != "ok":
                    print(seed, *found, sep="\n    ", flush=True)
            seed += 1
    print(f"{orbits} orbits, {different} judged differently")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
