"""Runs of planar bodies: a table that hardly moves, or any structure, and what tests ask of them."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.engine.plane.planar_run import PlanarRun
from vanedamp.coupling.methods import moreau
from vanedamp.coupling.response.records import WIDTH, new_records
from vanedamp.coupling.response.restart import motion_of, start_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Coordinates, assemble
from vanedamp.files.toml_input import validate


class Run(PlanarRun):
    """A run with its status and its log."""

    status = None

    def events(self, kind):
        """Entries of the log of one kind (k, WIDTH)."""
        log = np.concatenate(self.chunks) if self.chunks else np.zeros((0, WIDTH))
        return log[log[:, 1] == kind]


def still_table(frequency=1.0, amplitude=1e-15, gravity=9.81):
    """Structure, excitation and gravity of a table that is prescribed to move, or as good as not to."""
    return {
        "structure": {"model": "prescribed", "displacement_amplitude": amplitude},
        "excitation": {"frequency": frequency}, "gravity": {"acceleration": gravity},
    }  # fmt: skip


def planar_scene(data, *bodies, periods=1, gap=1.0, play=1.0):
    """A scene with one cavity."""
    dampers = [{"cavity": "c1"} | body for body in bodies]
    cavity = [{"name": "c1", "gap": gap, "play": play}]
    time = {"periods": periods, "transient": 0}
    return validate(Scene, data | {"cavity": cavity, "damper": dampers, "time": time}, "scene")


def initial_motion(scene, system) -> Coordinates:
    """Coordinates and velocities with which a scene begins."""
    return motion_of(system, start_of(scene, system))


def open_run(scene, periods, events, samples=0):
    """A run of a scene that has not begun."""
    system = assemble(scene)._replace(in_plane=True)  # sliders, too
    return Run(system, start_of(scene, system), new_records(system, periods, samples), True, events)


def run_planar(scene, periods, events=10**7, samples=0):
    """The run of a scene by the exact engine of planar bodies."""
    run = open_run(scene, periods, events, samples)
    run.status = run.advance_to(periods)
    return run


def witness(scene, periods, steps, samples=0, **options):
    """The run of a scene by time stepping, with its status."""
    system = assemble(scene)
    stepped = scene.replace({"solver": {"method": "moreau", "steps_per_period": steps} | options})
    run = moreau.begin(stepped, system, new_records(system, periods, samples), True, start_of(scene, system))
    return run, run.advance_to(periods)


def planar_run(data, *bodies, periods, events=10**7, **cavity):
    """The run of a scene with one cavity."""
    return run_planar(planar_scene(data, *bodies, periods=periods, **cavity), periods, events)


def ledger(run):
    """Imbalance of the energy ledger, J."""
    change = run.records.ledger[run.state.counters[0]] - run.records.ledger[0]
    return change[0] - change[1:].sum()
