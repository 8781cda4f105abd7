"""Requirements of a scene before it runs, beyond its record's checks; quick to load, for quick answers."""

from __future__ import annotations

from pathlib import Path

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.files.toml_input import InputError


def load_scene(path: str | Path, ranges: bool = False) -> Scene:
    """Load a scene whose reduced model exists; ranges: whether its numbers may be ranges. Raises InputError."""
    scene = Scene.load(path)
    if not ranges:
        check_numbers(scene, f"{path}: ")
    check_model(scene)
    return scene


def check_numbers(scene: Scene, source: str = "") -> None:
    """Raise InputError for a scene with a number that is a range."""
    for path, (low, high) in scene.ranges.items():
        raise InputError(
            f"{source}{path}: the range [{low:g}, {high:g}] is for `vanedamp run` and `vanedamp sweep`; give a number"
        )


def check_moved(scene: Scene) -> None:
    """Raise InputError for a scene without excitation."""
    if not scene.moved:
        raise InputError(
            "excitation: nothing moves the structure; give force, base_acceleration, resonance_amplitude or load, or "
            "an [initial] state"
        )


def check_model(scene: Scene) -> None:
    """Raise InputError for a scene whose reduced model does not exist."""
    if isinstance(scene.structure, Rom) and not Path(scene.structure.file).is_file():
        raise InputError(f"structure.file: no such file {scene.structure.file}; `vanedamp reduce` writes one")
