"""Scenes of a command, loaded and checked, and the choices made for them."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from typing import Any

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.resonance import chosen_resonance
from vanedamp.studies.commands.support.messages import print_note
from vanedamp.studies.scene_checks import check_moved, load_scene


def read_scene(arguments: Namespace) -> Scene:
    """Load the scene of a command and check that it is excited; as read_any_scene."""
    scene = read_any_scene(arguments)
    check_moved(scene)
    return scene


def read_scene_or_ranges(arguments: Namespace) -> Scene:
    """Load the scene of a command that runs ranges as an ensemble; as read_scene."""
    scene = read_any_scene(arguments, ranges=True)
    check_moved(scene)
    return scene


def read_any_scene(arguments: Namespace, ranges: bool = False) -> Scene:
    """Load the scene of a command. Its files must exist, and none of them may be an output. Raises InputError.

    ranges: whether its numbers may be ranges.
    """
    scene = load_scene(arguments.input, ranges)
    arguments.outputs.keep(scene.files)
    return scene


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
