"""The demonstration: the shipped mesh through the whole pipeline, leaving every file of it."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import jinja2
import numpy as np
from scipy.linalg import eigh

from coupling.scene import Scene
from coupling.sweep import Sweep, sweep, warm_up
from meshes.vane_cluster import SHIPPED
from modal.calibrate import RigidModel
from modal.store import load, replacing
from studies.forced_response import forced_responses, resonance_grid
from studies.pictures import mode_picture, summary_picture
from studies.provenance import versions
from studies.terminal import progress, tell_sweep
from studies.workers import available_cores, new_pool

_MODES = 3
_BODY = 0.02  # of the mass of the rigid model
_GAP = 0.5  # of the undamped amplitude
_RANGE = (0.95, 1.03)  # of the first bending frequency
_PERIODS, _TRANSIENT = 1000, 600
_POINTS = {"rigid": 81, "rom": 61}
_COMMANDS = """\
The same, step by step:
    cd {folder}
    vanedamp modal case.toml -o modes.h5
    vanedamp reduce case.toml --modes {modes} -o rom.h5
    vanedamp sweep scene_rigid.toml -o sweep_rigid.h5
    vanedamp sweep scene_rom.toml -o sweep_rom.h5
    vanedamp report . -o report.html"""


def run_demo(folder: Path, workers: int | None = None) -> Path:
    """Modes, rigid model, reduction, sweeps of both models and the report in a folder. Returns the report's path."""
    started = time.perf_counter()
    folder.mkdir(parents=True, exist_ok=True)
    results = [folder / "modes.h5", folder / "rom.h5"]
    with new_pool(workers or available_cores()) as pool:
        # compiling the engine takes as long as the finite elements: side by side, and once for all workers
        compiled = pool.submit(warm_up)
        _structure(folder)
        with _stage("engine compiled, or found compiled"):
            compiled.result()
        for model, points in _POINTS.items():
            scene = Scene.load(folder / f"scene_{model}.toml")
            with _stage(f"sweep, {model} model, {points} frequencies"), progress(model) as report:
                result = sweep(scene, pool, report, provenance={"versions": versions()})
            results.append(folder / f"sweep_{model}.h5")
            result.save(results[-1])
            tell_sweep(result)
    from studies.report import write_report
    from studies.results import collect

    with _stage("report"):
        write_report(collect(results), folder / "report.html")
        _summary(folder)
    print(_COMMANDS.format(folder=folder, modes=_MODES))
    print(f"{folder / 'report.html'}: done in {time.perf_counter() - started:.0f} s")
    return folder / "report.html"


def _summary(folder: Path) -> None:
    """The mode and the rigid model's forced response in one picture, summary.png."""
    _, attributes = load(folder / "modes.h5", "modes")
    picture = mode_picture(folder / "modes.h5", int(attributes["first_bending"]))
    (response,) = forced_responses(Sweep.load(folder / "sweep_rigid.h5"))
    summary_picture(picture, response, folder / "summary.png")


def _structure(folder: Path) -> None:
    """From the mesh to modes.h5, rom.h5 and the two scenes."""
    from studies.config import Case
    from studies.pipeline import assemble, modal_analysis, reduction

    shutil.copyfile(SHIPPED, folder / "vane_cluster.msh")
    shutil.copyfile(Path(__file__).with_name("demo_case.toml"), folder / "case.toml")
    with _stage("mesh and matrices"):
        structure = assemble(Case.load(folder / "case.toml"))
    with _stage("modes and rigid model"):
        analysis = modal_analysis(structure)
        analysis.save(folder / "modes.h5")
    with _stage("reduction"):
        reduced = reduction(structure, _MODES)
        reduced.save(folder / "rom.h5")
    rigid, amplitude = analysis.rigid, analysis.amplitude
    assert rigid is not None and amplitude is not None  # the case names an interface and a fatigue strength
    body = _BODY * rigid.mass
    _write_scene(
        folder,
        "rigid",
        _peaks(np.eye(1) * rigid.mass, np.eye(1) * rigid.stiffness, np.ones(1), body),
        rigid,
        body,
        amplitude,
    )
    _write_scene(
        folder, "rom", _peaks(reduced.mass, reduced.stiffness, reduced.row("c1_floor"), body), rigid, body, amplitude
    )


def _peaks(mass: np.ndarray, stiffness: np.ndarray, floor: np.ndarray, body: float) -> list[float]:
    """First natural frequencies with the body fixed and without it, Hz."""
    fixed = mass + body * np.outer(floor, floor)
    squares = [eigh(stiffness, inertia, eigvals_only=True)[0] for inertia in (fixed, mass)]
    return [float(np.sqrt(square) / (2 * np.pi)) for square in squares]


def _write_scene(
    folder: Path, model: str, peaks: list[float], rigid: RigidModel, body: float, amplitude: float
) -> None:
    first = peaks[-1]
    width = 2 * rigid.damping_ratio
    frequencies = resonance_grid(_RANGE[0] * first, _RANGE[1] * first, peaks, width, _POINTS[model])
    template = Path(__file__).with_name("demo_scene.toml").read_text(encoding="utf-8")
    text = jinja2.Template(template, trim_blocks=True, keep_trailing_newline=True).render(
        model=model, mass=rigid.mass, stiffness=rigid.stiffness, damping_ratio=rigid.damping_ratio, frequency=first,
        amplitude=amplitude, gap=_GAP * amplitude, body=body, periods=_PERIODS, transient=_TRANSIENT,
        frequencies=frequencies.tolist(),
    )  # fmt: skip
    with replacing(folder / f"scene_{model}.toml") as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextmanager
def _stage(name: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    print(f"{time.perf_counter() - started:6.1f} s  {name}", flush=True)
