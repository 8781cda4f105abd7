"""What the commands do: check, compute, write, tell. Each imports what it needs, so that errors come quickly."""

from __future__ import annotations

import importlib.util
import sys
import time
from argparse import Namespace
from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vanedamp.files.store import clear_leftovers, finite, json_text, write_json
from vanedamp.files.toml_input import InputError
from vanedamp.studies.commands.output_files import check_outputs, checkpoint_file, keep, output_folder, refuse_input
from vanedamp.studies.commands.summaries import tell_calibration, tell_modes, tell_sweep
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import workers

if TYPE_CHECKING:
    from vanedamp.coupling.scene.scene import Scene


def mesh(arguments: Namespace) -> None:
    """Write the mesh of a case that names a generator."""
    from vanedamp.studies.case.tables import Case, MeshFile

    check_outputs(arguments, output=(".msh",))
    case = Case.load(arguments.input)
    keep(arguments, case.files)
    if isinstance(case.mesh, MeshFile):
        raise InputError("mesh.file: the mesh exists already; to make one, name mesh.generator instead")
    case.mesh.build(arguments.output)
    print(f"{arguments.output}: mesh of {case.mesh.generator}")


def modal(arguments: Namespace) -> None:
    """Modes, effective masses, rigid model."""
    from vanedamp.studies.case.tables import Case

    check_outputs(arguments, vtk=(".vtu", ".vtk"))
    if arguments.vtk and importlib.util.find_spec("pyvista") is None:  # told before the work
        raise ModuleNotFoundError("--vtk writes with it", name="pyvista")
    case = Case.load(arguments.input)
    keep(arguments, case.files)
    from vanedamp.studies.case.stages import assemble, modal_analysis

    analysis = modal_analysis(assemble(case))
    if arguments.output:
        analysis.save(arguments.output)
    if arguments.vtk:
        from vanedamp.studies.report.pictures import save_vtk

        variables, cell_type = analysis.mesh()
        save_vtk(analysis.modes, variables["coordinates"].values, variables["cell"].values, cell_type, arguments.vtk)
    result = analysis.to_json()
    _write_json(arguments.json, result)
    _warn(arguments.input, analysis.warnings)
    if arguments.json != "-":
        tell_modes(result)


def calibrate(arguments: Namespace) -> None:
    """Tuning, damping, rigid model, excitation."""
    from vanedamp.studies.case.tables import Case

    check_outputs(arguments)
    case = Case.load(arguments.input)
    keep(arguments, case.files)
    from vanedamp.studies.case import calibration

    found = calibration.calibrate(case)
    if arguments.output:
        found.save(arguments.output)
    result = found.to_json()
    _write_json(arguments.json, result)
    _warn(arguments.input, found.warnings)
    if arguments.json != "-":
        tell_calibration(result)


def matrices(arguments: Namespace) -> None:
    """Matrices for other codes."""
    from vanedamp.studies.case.tables import Case

    folder = output_folder(arguments)
    case = Case.load(arguments.input)
    from vanedamp.modal.matrix_files import FILES, write_folder

    for name in FILES:
        refuse_input("--output", folder / name, [arguments.input, *case.files])
    from vanedamp.studies.case.stages import assemble

    system = assemble(case).matrices
    write_folder(system, folder)
    print(f"{folder}: stiffness and mass ({system.size} x {system.size}), nodes, sets, fixed nodes")


def reduce(arguments: Namespace) -> None:
    """A reduced model, with the estimate of its error."""
    from vanedamp.rom.reduction import check_basis
    from vanedamp.studies.case.tables import Case

    check_outputs(arguments)
    check_basis(arguments.basis)
    case = Case.load(arguments.input)
    keep(arguments, case.files)
    if not case.interface:
        raise InputError("interface: missing; a reduction needs at least one [interface.<label>] table")
    from vanedamp.studies.case.stages import assemble, reduction, unit_doubts, with_hot_spots

    started = time.perf_counter()
    structure = assemble(case)
    spots = arguments.hot_spots
    model = reduction(
        structure, arguments.modes, arguments.basis, arguments.tolerance, arguments.max_frequency, bool(spots)
    )
    if spots:
        model = replace(
            with_hot_spots(structure, model, spots), recovery=None, residual_recovery=None, coordinates=None
        )
    estimate = model.provenance["estimate"]
    if arguments.output:
        model.save(arguments.output)
    result = {
        "frequency_hz": model.natural_frequencies_hz.tolist(),
        "modes": model.modes,
        "basis": arguments.basis,
        "interface": list(model.interface),
        "outputs": list(model.outputs),
        "estimate": estimate,
        "warnings": list(unit_doubts(structure, float(model.natural_frequencies_hz[model.rigid_modes]))),
        "wall_time_s": time.perf_counter() - started,
    }
    _write_json(arguments.json, result)
    _warn(arguments.input, result["warnings"])
    if arguments.json != "-":
        kind = "natural" if model.free_modes else "fixed-interface"
        print(f"{model.size} coordinates, {model.modes} of them {kind} modes; interface: {', '.join(model.interface)}")
        print(f"{estimate['sentence']}, up to {estimate['frequencies_hz'][1]:.4g} Hz")
        print("frequencies, Hz: " + ", ".join(f"{frequency:.6g}" for frequency in model.natural_frequencies_hz[:8]))


def import_model(arguments: Namespace) -> None:
    """Check another code's reduced model and keep it as one of ours."""
    from vanedamp.studies.case.external_model import External

    check_outputs(arguments)
    external = External.read(arguments.input)
    keep(arguments, external.files(arguments.input))
    model, findings, warnings = external.model(arguments.input)
    if arguments.output:
        model.save(arguments.output)
    result = {
        "frequency_hz": model.natural_frequencies_hz.tolist(),
        "interface": list(model.interface),
        "checks": asdict(findings),
        "warnings": list(warnings),
    }
    _write_json(arguments.json, result)
    _warn(arguments.input, warnings)
    if arguments.json != "-":
        print(f"{model.size} coordinates; interface: {', '.join(model.interface)}")
        print("frequencies, Hz: " + ", ".join(f"{frequency:.6g}" for frequency in model.natural_frequencies_hz[:8]))
        print(
            f"checks: asymmetry {findings.asymmetry:.1e}, {findings.rigid_motions} rigid motions, "
            f"{findings.condensed} coordinates without mass condensed"
        )


def run(arguments: Namespace) -> None:
    """One scene."""
    check_outputs(arguments)
    scene = _load_scene(arguments)
    from vanedamp.coupling.engine import simulate
    from vanedamp.files.provenance import versions
    from vanedamp.studies.commands.effort import check_run

    check_run(scene, arguments.samples)

    with progress("run") as report:
        response = simulate(scene, arguments.events, arguments.samples, progress=report)
    if arguments.output:
        response.save(arguments.output, {"versions": versions(), "scene": scene.to_dict()})
    result = response.to_json(events=arguments.events) | _tell_resonance(arguments.input, scene)
    _tell_choice(arguments.input, response.estimate, response.warnings)
    _write_json(arguments.json, result)
    if arguments.json != "-":
        for name, value in result.items():
            if not isinstance(value, dict | list):
                print(f"{name:24} {_shown(value)}")


def sweep(arguments: Namespace) -> None:
    """A grid of runs; finished points are kept beside the result and taken up again after a kill."""
    check_outputs(arguments)
    checkpoint = checkpoint_file(arguments.output)
    if arguments.resume and (checkpoint is None or not checkpoint.exists()):
        raise InputError(
            "--resume: name the result with -o, its checkpoint lies beside it"
            if checkpoint is None
            else f"--resume: nothing to resume, there is no checkpoint {checkpoint}; leave --resume out to begin"
        )
    scene = _load_scene(arguments)
    from vanedamp.coupling.sweep.checkpoint import Checkpoint, clear
    from vanedamp.coupling.sweep.grid import grid
    from vanedamp.coupling.sweep.sweep import sweep as run_sweep
    from vanedamp.files.provenance import versions
    from vanedamp.studies.commands.effort import check_sweep
    from vanedamp.studies.report.forced_response import forced_responses

    check_sweep(scene, arguments.workers)
    # processes are slow to start: a bad grid or the checkpoint of another sweep is told before
    points, provenance = grid(scene), {"versions": versions()}
    resumed = Checkpoint(checkpoint, scene, points.size, provenance).finished.count
    _tell_choice(arguments.input, points.estimate, points.warnings)
    resonance = _tell_resonance(arguments.input, points.base)
    with workers(arguments.workers) as pool, progress("sweep") as report:
        started = time.perf_counter()
        result = run_sweep(points, pool, report, checkpoint, provenance)
    if arguments.output:
        result.save(arguments.output)
    took = time.perf_counter() - started
    # times are told, and not kept in the result, which is the same however it came about
    told = {"points_resumed": resumed, "wall_time_s": took, "points_per_second": (points.size - resumed) / took}
    headlines = [response.to_json() for response in forced_responses(result)] if arguments.json else []
    _write_json(arguments.json, result.to_json() | told | resonance | {"headlines": headlines})
    if checkpoint is not None:
        clear(checkpoint)
        clear_leftovers(arguments.output)
    if arguments.json != "-":
        tell_sweep(result)
        print(f"{points.size} points, {resumed} of them from the checkpoint, in {took:.1f} s")


def optimise(arguments: Namespace) -> None:
    """Mass, gap and number of bodies that reduce most, as designed and within tolerances."""
    check_outputs(arguments)
    from vanedamp.files.provenance import versions
    from vanedamp.studies.commands.effort import check_optimise
    from vanedamp.studies.optimisation.search import optimise as search
    from vanedamp.studies.optimisation.study import Study

    study = Study.load(arguments.input)
    keep(arguments, study.scene.files)
    check_optimise(study, arguments.workers)
    _tell_resonance(arguments.input, study.scene)
    with workers(arguments.workers) as pool, progress("optimise") as report:
        found = search(study, pool, report, {"versions": versions()})
    if arguments.output:
        found.save(arguments.output)
    _write_json(arguments.json, found.to_json())
    if arguments.json != "-":
        print(found.sentence)
        if found.trouble:
            print(f"{found.trouble} of {found.scenes} scenes are not ok")


def report(arguments: Namespace) -> None:
    """One HTML page of results."""
    check_outputs(arguments, output=(".html", ".htm"))
    from vanedamp.studies.report.page import write_report
    from vanedamp.studies.report.results import collect

    results = collect(arguments.inputs)
    keep(arguments, results.files)
    write_report(results, arguments.output)
    print(f"{arguments.output}: report")


def paper(arguments: Namespace) -> None:
    """The paper's figures as studies."""
    from vanedamp.studies.paper.runner import run_paper

    run_paper(output_folder(arguments), arguments.studies, arguments.workers, arguments.resume)


def demo(arguments: Namespace) -> None:
    """The whole pipeline on the shipped mesh."""
    from vanedamp.studies.demo import run_demo

    run_demo(output_folder(arguments), arguments.workers)


#: module of studies, function and files of each benchmark
_BENCHES = {
    "engine": ("engine.measure", "run_bench", "bench_engine"),
    "modal": ("modes.measure", "run_bench", "bench_modal"),
    "sweep": ("sweep.measure", "run_bench", "bench_sweep"),
    "ladder": ("model_order.measure", "run_ladder", "ladder"),
    "work-precision": ("methods.measure", "run_work_precision", "work_precision"),
    "stability": ("stability.limits", "run_stability", "stability"),
}


def bench(arguments: Namespace) -> None:
    """Speed and accuracy, measured on this machine."""
    folder = output_folder(arguments)
    module, function, files = _BENCHES[arguments.study]
    study = importlib.import_module(f"vanedamp.studies.bench.{module}")
    study.tell(getattr(study, function)(folder, study.QUICK if arguments.quick else study.FULL))
    print(f"{folder}: {files}.json and figures")


def _tell_choice(source: str, estimate: Mapping[str, Any] | None, warnings: Iterable[str]) -> None:
    """What was chosen automatically is said, with its reason, and warnings, wherever the results go."""
    if estimate is not None:
        print(f"vanedamp: {source}: structure.modes: {estimate['sentence']}", file=sys.stderr)
    _warn(source, warnings)


def _warn(source: str, warnings: Iterable[str]) -> None:
    for warning in warnings:
        print(f"vanedamp: {source}: warning: {warning}", file=sys.stderr)


def _tell_resonance(source: str, scene: Scene) -> dict[str, Any]:
    """Which resonance `resonance_amplitude` is that of is said where there are several; `resonance` of the results."""
    from vanedamp.coupling.scene.structures import Rom
    from vanedamp.coupling.system.resonance import chosen_resonance

    level = scene.excitation.resonance_amplitude
    if level is None:
        return {}
    if isinstance(scene.structure, Rom) and scene.structure.modes == "auto":
        scene = replace(scene, structure=replace(scene.structure, modes=None))
    found = chosen_resonance(scene)
    force = level / found.flexibility
    if found.modes > 1:
        print(
            f"vanedamp: {source}: excitation.resonance_amplitude: of the resonance at {found.frequency:.6g} Hz (mode "
            f"{found.mode + 1}), force {force:.4g} N; resonance_near names another",
            file=sys.stderr,
        )
    return {"resonance": {"frequency": found.frequency, "mode": found.mode, "force": force}}


def _load_scene(arguments: Namespace) -> Scene:
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.coupling.scene.structures import Rom

    scene = Scene.load(arguments.input)
    keep(arguments, scene.files)
    if isinstance(scene.structure, Rom) and not Path(scene.structure.file).is_file():
        raise InputError(f"structure.file: no such file {scene.structure.file}; `vanedamp reduce` writes one")
    if not scene.moved:
        raise InputError(
            "excitation: nothing moves the structure; give force, base_acceleration or resonance_amplitude, or an "
            "[initial] state"
        )
    return scene


def _write_json(target: str | None, data: Mapping[str, Any]) -> None:
    if target is None:
        return
    if target == "-":
        print(json_text(finite(data)), end="")
    else:
        write_json(target, finite(data))


def _shown(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
