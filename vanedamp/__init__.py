"""Vibration damping of vane clusters by loose bodies in cavities.

The parts, in the order of the pipeline: `modal` (finite elements: mesh to matrices, modes, rigid model), `rom` (reduced
models), `coupling` (scenes of a structure and its bodies, run by the exact event engine and other methods), `studies`
(cases, sweeps' pictures, reports, the command line); `meshes` has meshes by parameters, `files` what all stand on.

The names below are loaded when they are first used, so that `import vanedamp` takes no time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vanedamp.coupling.engine import simulate
    from vanedamp.coupling.orbits.branch import Branches
    from vanedamp.coupling.orbits.orbits import find_orbit, orbits
    from vanedamp.coupling.response.response import Response, Status
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.coupling.sweep.record import Sweep
    from vanedamp.coupling.sweep.steady_states import steady_states
    from vanedamp.coupling.sweep.sweep import sweep
    from vanedamp.coupling.transients.ramp import ramp
    from vanedamp.coupling.transients.ramp_record import Ramp
    from vanedamp.coupling.transients.ring_down import ring_down
    from vanedamp.coupling.transients.ring_down_record import RingDown
    from vanedamp.files.errors import VanedampError
    from vanedamp.files.toml_input import InputError
    from vanedamp.modal.campbell import Campbell, campbell
    from vanedamp.modal.eigen import Modes, solve_modes
    from vanedamp.modal.matrices import Patch, SystemMatrices
    from vanedamp.modal.rigid_model import RigidModel, rigid_model
    from vanedamp.rom.interface import Interface, InterfaceCoordinate
    from vanedamp.rom.reduced import ReducedModel
    from vanedamp.rom.reduction import reduce
    from vanedamp.studies.case.stages import assemble
    from vanedamp.studies.case.tables import Case
    from vanedamp.studies.export.export import export
    from vanedamp.studies.optimisation.search import optimise
    from vanedamp.studies.optimisation.study import Study
    from vanedamp.studies.pipeline.pipeline import pipeline
    from vanedamp.studies.report.plot import plot

__all__ = [
    "Branches", "Campbell", "Case", "InputError", "Interface", "InterfaceCoordinate", "Modes", "Patch", "Ramp",
    "ReducedModel", "Response", "RigidModel", "RingDown", "Scene", "Status", "Study", "Sweep", "SystemMatrices",
    "VanedampError", "assemble", "campbell", "export", "find_orbit", "optimise", "orbits", "pipeline", "plot", "ramp",
    "reduce", "rigid_model", "ring_down", "simulate", "solve_modes", "steady_states", "sweep",
]  # fmt: skip

_PARTS = ("files", "meshes", "modal", "rom", "coupling", "studies")
_HOMES = {
    "Branches": "coupling.orbits.branch",
    "Campbell": "modal.campbell",
    "Case": "studies.case.tables",
    "InputError": "files.toml_input",
    "Interface": "rom.interface",
    "InterfaceCoordinate": "rom.interface",
    "Modes": "modal.eigen",
    "Patch": "modal.matrices",
    "Ramp": "coupling.transients.ramp_record",
    "ReducedModel": "rom.reduced",
    "Response": "coupling.response.response",
    "RigidModel": "modal.rigid_model",
    "RingDown": "coupling.transients.ring_down_record",
    "Scene": "coupling.scene.scene",
    "Status": "coupling.response.response",
    "Study": "studies.optimisation.study",
    "Sweep": "coupling.sweep.sweep",
    "SystemMatrices": "modal.matrices",
    "VanedampError": "files.errors",
    "assemble": "studies.case.stages",
    "campbell": "modal.campbell",
    "export": "studies.export.export",
    "find_orbit": "coupling.orbits.orbits",
    "optimise": "studies.optimisation.search",
    "orbits": "coupling.orbits.orbits",
    "pipeline": "studies.pipeline.pipeline",
    "plot": "studies.report.plot",
    "ramp": "coupling.transients.ramp",
    "reduce": "rom.reduction",
    "rigid_model": "modal.rigid_model",
    "ring_down": "coupling.transients.ring_down",
    "simulate": "coupling.engine",
    "solve_modes": "modal.eigen",
    "steady_states": "coupling.sweep.steady_states",
    "sweep": "coupling.sweep.sweep",
}


def __getattr__(name: str) -> Any:
    """Load a public name, or a part, where it is first used."""
    if name in _PARTS:
        return import_module(f"vanedamp.{name}")
    if name in _HOMES:
        return getattr(import_module(f"vanedamp.{_HOMES[name]}"), name)
    raise AttributeError(f"module 'vanedamp' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, *_PARTS])
