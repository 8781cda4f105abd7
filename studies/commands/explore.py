"""`vanedamp explore`: a page with sliders, on this machine only: a forced response, or a ring's modes, follow them."""

from __future__ import annotations

import tempfile
import webbrowser
from argparse import Namespace
from pathlib import Path

from vanedamp.files.store import kind_of
from vanedamp.files.toml_input import InputError
from vanedamp.studies.commands.support.messages import print_note
from vanedamp.studies.demo.figure_file import FOLDER, FigureScenes, FigureStructure
from vanedamp.studies.explore.page import Exploration
from vanedamp.studies.explore.server import has_display, serve
from vanedamp.studies.explore.sweep_files import open_sweeps
from vanedamp.studies.jobs.workers import available_cores
from vanedamp.studies.kinds.ring_modes import NAME as RINGS
from vanedamp.studies.report.page import write_report
from vanedamp.studies.report.results import collect
from vanedamp.studies.scene_checks import check_moved, load_scene


def run(arguments: Namespace) -> None:
    """Serve the page until Ctrl-C."""
    sources = [Path(source) for source in arguments.inputs]
    if sources and all(source.suffix == ".h5" and kind_of(source) == RINGS for source in sources):
        _show_rings(arguments)
        return
    if arguments.output is not None and not arguments.output.endswith(".toml"):
        raise InputError(f"--output: a page such as {arguments.output} is written of a ring's modes; name SCENE.toml")
    scenes = [source for source in sources if source.suffix == ".toml"]
    if scenes and len(sources) > 1:
        raise InputError(f"{scenes[0]}: a scene is explored on a page of its own; name nothing beside it")
    sweeps = open_sweeps(sources) if sources and not scenes else {}
    if sources and not (scenes or sweeps):
        named = ", ".join(map(str, sources))
        raise InputError(f"{named}: holds no sweep; `vanedamp sweep SCENE.toml -o SWEEP.h5` writes one")
    exploration = None if sweeps else _exploration(scenes[0] if scenes else None, arguments)
    if sweeps and arguments.vary:
        raise InputError("--vary: sliders of sweeps are their axes; leave it out, or name a scene")
    if sweeps and arguments.output:
        raise InputError("--output: a scene is written from the page of a scene; leave it out, or name a scene")
    if exploration is not None and exploration.output is not None and exploration.output.exists():
        print_note(arguments.output, "is there already; the page's `write scene` replaces it")
    serve(exploration, sweeps, arguments.port, arguments.workers or available_cores(), not arguments.no_browser)


def _show_rings(arguments: Namespace) -> None:
    """Write the page of modes of rings, whose sliders need no server, and open it."""
    results = collect(arguments.inputs)
    arguments.outputs.keep(results.files)
    target = Path(arguments.output or Path(tempfile.mkdtemp(prefix="vanedamp-")) / "ring.html")
    write_report(results, target, "Modes of a ring")
    address = target.resolve().as_uri()
    print(address, flush=True)
    if not arguments.no_browser and has_display():
        webbrowser.open(address)


def _exploration(source: Path | None, arguments: Namespace) -> Exploration:
    """Return the exploration of a scene's file, or of the shipped rigid model. Raises InputError."""
    if source is None:
        figure = FigureScenes.load(FOLDER / "fig9.toml", FigureStructure.shipped())
        scene, name = figure.scenes[""].replace({"sweep": {}}), "rigid model of the shipped cluster"
    else:
        scene, name = load_scene(source), str(source)
        arguments.outputs.keep(scene.files)
        check_moved(scene)
    output = None if arguments.output is None else Path(arguments.output)
    return Exploration.of(scene, name, output, arguments.vary)
