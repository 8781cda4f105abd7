"""`vanedamp explore`: a page with sliders, on this machine only, whose forced response follows them."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.toml_input import InputError
from vanedamp.studies.commands.support.messages import print_note
from vanedamp.studies.commands.support.outputs import Outputs
from vanedamp.studies.demo.figure_file import FOLDER, FigureScenes, Structure
from vanedamp.studies.explore.page import Exploration
from vanedamp.studies.explore.server import serve
from vanedamp.studies.explore.sweep_files import open_sweeps
from vanedamp.studies.scene_checks import check_moved, load_scene
from vanedamp.studies.workers import available_cores


def run(arguments: Namespace) -> None:
    """Serve the page until Ctrl-C."""
    sources = [Path(source) for source in arguments.inputs]
    scenes = [source for source in sources if source.suffix == ".toml"]
    if scenes and len(sources) > 1:
        raise InputError(f"{scenes[0]}: a scene is explored on a page of its own; name nothing beside it")
    sweeps = _sweeps(sources) if sources and not scenes else {}
    exploration = None if sweeps else _exploration(scenes[0] if scenes else None, arguments.output, arguments.outputs)
    if sweeps and arguments.output:
        raise InputError("--output: a scene is written from the page of a scene; leave it out, or name a scene")
    if exploration is not None and exploration.output is not None and exploration.output.exists():
        print_note(arguments.output, "is there already; the page's `write scene` replaces it")
    serve(exploration, sweeps, arguments.port, arguments.workers or available_cores(), not arguments.no_browser)


def _exploration(source: Path | None, output: str | None, outputs: Outputs) -> Exploration:
    """Return the exploration of a scene's file, or of the shipped rigid model. Raises InputError."""
    if source is None:
        figure = FigureScenes.load(FOLDER / "fig9.toml", Structure.shipped())
        scene, name = figure.scenes[""].replace({"sweep": {}}), "rigid model of the shipped cluster"
    else:
        scene, name = load_scene(source), str(source)
        outputs.keep(scene.files)
        check_moved(scene)
    return Exploration.of(scene, name, None if output is None else Path(output))


def _sweeps(sources: list[Path]) -> dict[str, Sweep]:
    """Return the sweeps in files and folders, by their short names. Raises InputError where there is none."""
    sweeps = open_sweeps(sources)
    if not sweeps:
        named = ", ".join(map(str, sources))
        raise InputError(f"{named}: holds no sweep; `vanedamp sweep SCENE.toml -o SWEEP.h5` writes one")
    return sweeps
