"""Scenes and methods of the comparison of methods: speed against accuracy, and where methods fail."""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks import CLUSTER_CASE
from benchmarks.engine import scenes as bench_scenes
from vanedamp.coupling.methods import Variant
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import METHODS, SteppingOptions
from vanedamp.files.extensions import ExtensionError
from vanedamp.files.toml_input import validate

if TYPE_CHECKING:
    from vanedamp.modal.matrices import SystemMatrices
    from vanedamp.rom.interface import Interface

#: a method's label in charts, or a peer's name, and its setting: steps per period or a tolerance
Key = tuple[str, float]


def charted() -> dict[str, tuple[str, Variant]]:
    """Return the methods by their label in charts: `solver.method` and its style. Raises ExtensionError."""
    found: dict[str, tuple[str, Variant]] = {}
    for name, method in METHODS.all().items():
        for variant in method.VARIANTS:
            if variant.label in found:
                raise ExtensionError(f"method {name}: another is '{variant.label}' in charts, too; name it otherwise")
            found[variant.label] = (name, variant)
    return found


def settings(steps: Sequence[float], tolerances: Sequence[float]) -> list[Key]:
    """Return every method's label with each of its settings, 0 for one that has none; the exact engine is the first."""
    return [
        (label, float(setting))
        for label, (_, variant) in charted().items()
        for setting in ((tolerances if variant.tolerance else steps) if variant.setting else (0,))
    ]


def solved(scene: Scene, key: Key, least: int) -> Scene:
    """Return the scene by a method with a setting. least: steps per period where the setting is a tolerance."""
    label, setting = key
    method, variant = charted()[label]
    options = dict(variant.options)
    if variant.setting:
        options[variant.setting] = setting if variant.tolerance else int(setting)
    if variant.tolerance and issubclass(METHODS.part(method).Options, SteppingOptions):
        options["steps_per_period"] = least
    return by(scene, method=method, **options)


def by(scene: Scene, **solver: Any) -> Scene:
    """Return the scene with another [solver] table."""
    return validate(Scene, scene.to_dict() | {"solver": solver}, "scene")


def periodic(settle: int) -> Scene:
    """Return a scene of one mode and one body in its steady state of two impacts per period."""
    return bench_scenes.settled(bench_scenes.one_mode(), settle)


def chatter() -> Scene:
    """Return a scene of a ball on a shaken plate that comes to rest and is thrown up in every period."""
    data = {
        "structure": {"model": "prescribed", "displacement_amplitude": 1e-3},
        "excitation": {"frequency": 17.0},
        "gravity": {"orientation_deg": 90.0},
        "cavity": [{"name": "c", "gap": 0.1}],
        "damper": [{"cavity": "c", "mass": 1.0, "restitution": 0.5, "position": -0.0495}],
    }
    return validate(Scene, data, "scene")


def single() -> Scene:
    """Return a scene of one mode and one body with friction, below resonance: a response that never repeats."""
    changes = {"damper.0.friction": 0.1, "gravity.acceleration": 9.81}
    return bench_scenes.one_mode(0.99, 1.0).replace(changes)


def double() -> Scene:
    """Return a scene of two bodies in a row that share the cavity of the single one."""
    data = single().to_dict()
    body = data["damper"][0] | {"mass": data["damper"][0]["mass"] / 2}
    data["damper"] = [body | {"position": -data["cavity"][0]["gap"] / 4}, body | {"position": 0.0}]
    return validate(Scene, data, "scene")


@dataclass(frozen=True)
class Cluster:
    """A cluster of linear elements in a folder: its mesh, and reduced models of it with a body on soft walls.

    size: of the elements, m (None: the shipped mesh); lumped: reduce the mesh with the row sums of its mass.
    """

    folder: Path
    size: float | None = None
    lumped: bool = False

    def scene(self, modes: int) -> Scene:
        """Return a scene of one body at the first natural frequency of the model with `modes` fixed-interface modes."""
        file = self.folder / f"cluster_{modes}.h5"
        if not file.is_file():
            self._reduce(file, modes)
        data = {
            "structure": {"model": "rom", "file": str(file)},
            "excitation": {
                "frequency": _first(file), "at": "shroud", "resonance_amplitude": bench_scenes.AMPLITUDE
            },
            "gravity": {"acceleration": 0.0},
            "contact": {"law": "compliant", "stiffness": 3e7},
            "cavity": [{"name": "c1", "gap": 0.2 * bench_scenes.AMPLITUDE, "floor": "c1_floor"}],
            "damper": [{"cavity": "c1", "mass": 0.003, "restitution": 0.7}],
        }  # fmt: skip
        return validate(Scene, data, "scene")

    def elements(self) -> tuple[SystemMatrices, Interface]:
        """Return the mesh without reduction: its matrices, as they are, and the interface."""
        from vanedamp.studies.case.stages import assemble, interface
        from vanedamp.studies.case.tables import Case

        case = Case.load(self._case())
        matrices = assemble(case).matrices
        return matrices, interface(case, matrices)

    def _case(self) -> Path:
        """Return the case file, written with its mesh on the first call."""
        case = self.folder / "cluster.toml"
        if not case.is_file():
            from vanedamp.meshes.parameters import VaneCluster
            from vanedamp.meshes.vane_cluster import SHIPPED, build

            self.folder.mkdir(parents=True, exist_ok=True)
            mesh = self.folder / "vane_cluster.msh"
            if self.size is None:
                shutil.copy(SHIPPED, mesh)
            else:
                build(VaneCluster(element_size=self.size), mesh)
            text = CLUSTER_CASE.read_text(encoding="utf-8")
            case.write_text(text.replace("degree = 2", "degree = 1"), encoding="utf-8")
        return case

    def _reduce(self, file: Path, modes: int) -> None:
        from benchmarks.methods.full_mesh_run import lumped
        from vanedamp.rom.bases.craig_bampton import reduce

        matrices, interface = self.elements()
        reduce(lumped(matrices) if self.lumped else matrices, interface, modes).save(file)


def _first(file: Path) -> float:
    from vanedamp.rom.reduced import ReducedModel

    return float(ReducedModel.load(file).natural_frequencies_hz[0])


def rod(folder: Path, modes: int) -> Path:
    """Return the Craig-Bampton model of a clamped unit rod, interface "tip"; 1 % damping in its first mode."""
    from benchmarks.model_order.structures import rod_model

    file = folder / f"rod_{modes}.h5"
    rod_model(modes, per_stiffness=0.02 / (math.pi / 2)).save(file)
    return file
