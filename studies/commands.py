"""What the commands do: check, compute, write, tell. Each imports what it needs, so that errors come quickly."""

from __future__ import annotations

import json
import math
import os
import sys
import time
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coupling.inputs import InputError
from modal.store import replacing
from studies.terminal import progress, tell_modes, tell_sweep
from studies.workers import workers

if TYPE_CHECKING:
    from coupling.scene import Scene


def mesh(arguments: Namespace) -> None:
    """Write the mesh of a case that names a generator."""
    from studies.config import Case, MeshFile

    _check_outputs(arguments, output=(".msh",))
    case = Case.load(arguments.input)
    if isinstance(case.mesh, MeshFile):
        raise InputError("mesh.file: the mesh exists already; to make one, name mesh.generator instead")
    case.mesh.build(arguments.output)
    print(f"{arguments.output}: mesh of {case.mesh.generator}")


def modal(arguments: Namespace) -> None:
    """Modes, effective masses, rigid model."""
    from studies.config import Case

    _check_outputs(arguments, vtk=(".vtu", ".vtk"))
    case = Case.load(arguments.input)
    from studies.pipeline import assemble, modal_analysis

    analysis = modal_analysis(assemble(case))
    if arguments.output:
        analysis.save(arguments.output)
    if arguments.vtk:
        from studies.pictures import save_vtk

        variables, cell_type = analysis.mesh()
        save_vtk(analysis.modes, variables["coordinates"].values, variables["cell"].values, cell_type, arguments.vtk)
    result = analysis.to_json()
    _write_json(arguments.json, result)
    for warning in analysis.warnings:
        print(f"vanedamp: {arguments.input}: warning: {warning}", file=sys.stderr)
    if arguments.json != "-":
        tell_modes(result)


def reduce(arguments: Namespace) -> None:
    """Craig-Bampton reduction."""
    from studies.config import Case

    _check_outputs(arguments)
    case = Case.load(arguments.input)
    if not case.interface:
        raise InputError("interface: missing; a reduction needs at least one [interface.<label>] table")
    from studies.pipeline import assemble, reduction

    started = time.perf_counter()
    model = reduction(assemble(case), arguments.modes)
    if arguments.output:
        model.save(arguments.output)
    result = {
        "frequency_hz": model.natural_frequencies_hz.tolist(),
        "modes": model.fixed_interface_modes,
        "interface": list(model.interface),
        "wall_time_s": time.perf_counter() - started,
    }
    _write_json(arguments.json, result)
    if arguments.json != "-":
        print(f"{model.size} coordinates: {', '.join(model.interface)} and {arguments.modes} fixed-interface modes")
        print("frequencies, Hz: " + ", ".join(f"{frequency:.6g}" for frequency in model.natural_frequencies_hz[:8]))


def run(arguments: Namespace) -> None:
    """One scene."""
    _check_outputs(arguments)
    scene = _load_scene(arguments.input)
    from coupling.engine import simulate
    from studies.provenance import versions

    response = simulate(scene, events=arguments.events, samples_per_period=arguments.samples)
    if arguments.output:
        response.save(arguments.output, {"versions": versions(), "scene": scene.to_dict()})
    result = response.to_json(events=arguments.events)
    _write_json(arguments.json, result)
    if arguments.json != "-":
        for name, value in result.items():
            if not isinstance(value, dict | list):
                print(f"{name:24} {_shown(value)}")


def sweep(arguments: Namespace) -> None:
    """A grid of runs; finished points are kept beside the result and taken up again after a kill."""
    _check_outputs(arguments)
    scene = _load_scene(arguments.input)
    from coupling.sweep import grid
    from coupling.sweep import sweep as run_sweep
    from studies.provenance import versions

    grid(scene)  # processes are slow to start: a bad grid is told before

    checkpoint = None if arguments.output is None else Path(f"{arguments.output}.partial")
    with workers(arguments.workers) as pool, progress("sweep") as report:
        result = run_sweep(scene, pool, report, checkpoint, {"versions": versions()})
    if arguments.output:
        result.save(arguments.output)
    _write_json(arguments.json, result.to_json())
    if checkpoint is not None:
        checkpoint.unlink(missing_ok=True)
    if arguments.json != "-":
        tell_sweep(result)


def report(arguments: Namespace) -> None:
    """One HTML page of results."""
    _check_outputs(arguments, output=(".html", ".htm"))
    from studies.report import collect, write_report

    write_report(collect(arguments.inputs), arguments.output)
    print(f"{arguments.output}: report")


def demo(arguments: Namespace) -> None:
    """The whole pipeline on the shipped mesh."""
    from studies.demo import run_demo

    run_demo(Path(arguments.output), arguments.workers)


def bench(arguments: Namespace) -> None:
    """Speed and accuracy, measured on this machine."""
    folder = Path(arguments.output)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--output {folder}: expected a folder, not a file")
    if arguments.study == "work-precision":
        from studies import work_precision

        effort = work_precision.QUICK if arguments.quick else work_precision.FULL
        work_precision.tell(work_precision.run_work_precision(folder, effort))
    elif arguments.study == "stability":
        from studies import stability

        stability.tell(stability.run_stability(folder, stability.QUICK if arguments.quick else stability.FULL))
    else:
        from studies import bench_engine

        bench_engine.tell(bench_engine.run_bench(folder, bench_engine.QUICK if arguments.quick else bench_engine.FULL))
    name = {"engine": "bench_engine", "work-precision": "work_precision"}.get(arguments.study, arguments.study)
    print(f"{folder}: {name}.json, {name}.csv and figures")


def _load_scene(path: str) -> Scene:
    from coupling.scene import Rom, Scene

    scene = Scene.load(path)
    if isinstance(scene.structure, Rom) and not Path(scene.structure.file).is_file():
        raise InputError(f"structure.file: no such file {scene.structure.file}; `vanedamp reduce` writes one")
    return scene


def _check_outputs(arguments: Namespace, **suffixes: tuple[str, ...]) -> None:
    """Refuse files that could not be written, before the work."""
    for option in ("output", "json", "vtk"):
        name = getattr(arguments, option, None)
        if name is None or (option == "json" and name == "-"):
            continue
        path = Path(name)
        if path.is_dir() or not path.parent.is_dir():
            raise InputError(f"--{option} {name}: " + ("is a folder" if path.is_dir() else "its folder does not exist"))
        if not os.access(path.parent, os.W_OK):
            raise InputError(f"--{option} {name}: its folder cannot be written to")
        if path.suffix not in suffixes.get(option, (path.suffix,)):
            raise InputError(f"--{option} {name}: expected a file name ending in {' or '.join(suffixes[option])}")


def _write_json(target: str | None, data: Mapping[str, Any]) -> None:
    if target is None:
        return
    text = json.dumps(_plain(data), indent=1, allow_nan=False) + "\n"
    if target == "-":
        print(text, end="")
        return
    with replacing(target) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _plain(data: Any) -> Any:
    """JSON knows no nan: null."""
    if isinstance(data, Mapping):
        return {key: _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    return None if isinstance(data, float) and not math.isfinite(data) else data


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
