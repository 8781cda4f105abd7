"""Scenes of a command, loaded and checked, and the choices made for them."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.resonance import chosen_resonance
from vanedamp.studies.commands.support.messages import print_note, print_warnings
from vanedamp.studies.commands.support.outputs import Outputs
from vanedamp.studies.scene_checks import check_model, check_moved


def read_scene(arguments: Namespace) -> Scene:
    """Load the scene of a command; as load_scene."""
    return load_scene(arguments.input, arguments.outputs)


def read_any_scene(arguments: Namespace) -> Scene:
    """Load the scene of a command; as load_any_scene."""
    return load_any_scene(arguments.input, arguments.outputs)


def load_scene(path: str, outputs: Outputs) -> Scene:
    """Load a scene that moves and whose files are there; none of them may be an output. Raises InputError."""
    scene = load_any_scene(path, outputs)
    check_moved(scene)
    return scene


def load_any_scene(path: str, outputs: Outputs) -> Scene:
    """Load a scene whose files are there, whether or not something moves it; as load_scene."""
    scene = Scene.load(path)
    outputs.keep(scene.files)
    check_model(scene)
    return scene


def print_choices(
    source: str, estimate: Mapping[str, Any] | None, advice: Mapping[str, Any] | None, warnings: Iterable[str]
) -> None:
    """Print which model `modes = "auto"` and which bodies `shape = "auto"` have chosen and why, and warnings."""
    for key, chosen in (("structure.modes", estimate), ("damper.shape", advice)):
        if chosen is not None:
            print_note(source, f"{key}: {chosen['sentence']}")
    print_warnings(source, warnings)


def print_resonance(source: str, scene: Scene) -> dict[str, Any]:
    """Print which resonance `resonance_amplitude` belongs to where there are several.

    Returns `resonance` of the results for machines, nothing without such a level.
    """
    level = scene.excitation.resonance_amplitude
    if level is None:
        return {}
    if isinstance(scene.structure, Rom) and scene.structure.modes == "auto":
        scene = replace(scene, structure=replace(scene.structure, modes=None))
    resonance = chosen_resonance(scene)
    force = level / resonance.flexibility
    loads = scene.excitation.distributed
    if resonance.modes > 1:
        print_note(
            source,
            f"excitation.resonance_amplitude: of the resonance at {resonance.frequency:.6g} Hz (mode "
            f"{resonance.mode + 1}), {f'loads times {force:.4g}' if loads else f'force {force:.4g} N'}; resonance_near "
            "names another",
        )
    key = "load_factor" if loads else "force"
    return {"resonance": {"frequency": resonance.frequency, "mode": resonance.mode, key: force}}
