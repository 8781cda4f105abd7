"""The demonstration: the whole pipeline on the shipped mesh, or on its rigid model; all files are kept."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from vanedamp.coupling.sweep.grid import grid
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import warm_up_engine
from vanedamp.files.store import load
from vanedamp.files.toml_output import write_commented
from vanedamp.studies.demo import claims
from vanedamp.studies.demo.figure_file import FOLDER, Effort, FigureStructure
from vanedamp.studies.demo.figure_study import MODES, FigureStudy, Read, Session, prepare, print_claims, study
from vanedamp.studies.demo.pictures import responses_picture
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.jobs.sweep import peak
from vanedamp.studies.jobs.workers import WorkerPool, available_cores
from vanedamp.studies.report.claims import CLAIMS
from vanedamp.studies.report.forced_response import forced_responses
from vanedamp.studies.report.pictures import mode_picture, summary_picture
from vanedamp.studies.worst_start import STARTS


def _draw_gaps(read: Read, path: Path) -> None:
    names = ("reference", "reference/2", "reference/10")
    responses_picture(dict(zip(names, read.curves[""], strict=True)), read.figure.title, path)


#: figures of the paper, with fewer frequencies and periods than `vanedamp paper` takes
FIGURES = {
    "fig9": FigureStudy(FOLDER / "fig9.toml", lambda read: claims.fig9(read.curves), _draw_gaps),
    "fig10": FigureStudy(FOLDER / "fig10.toml", lambda read: claims.fig10(read.curves)),
    "fig12": FigureStudy(FOLDER / "fig12.toml", lambda read: claims.fig12(read.curves)),
}
#: those that need no reduced model
RIGID_FIGURES = ("fig9", "fig10")
#: the sweep whose peak runs once more, for the motion of its body
MOTION = "fig10_single"
#: the file that makes the sweeps again
PIPELINE = "pipeline.toml"
#: every curve is run from all starts: claims and pictures use the worst at each frequency
EFFORT = Effort(points=61, periods=1500, transient=700, starts=tuple(STARTS))
_COMMANDS = """\
The same, step by step:
    cd {folder}
    vanedamp modal case.toml -o modes.h5
    vanedamp reduce case.toml --modes {modes} -o rom.h5
    vanedamp sweep fig9.toml -o fig9.h5
    vanedamp sweep fig12_reduced.toml -o fig12_reduced.h5
    vanedamp report . -o report.html
After a change of the case or a scene, all that depends on it: vanedamp pipeline pipeline.toml
All figures of the paper, in a checkout of the project: vanedamp paper -o out/paper"""
_RIGID_COMMANDS = """\
The same, step by step:
    cd {folder}
    vanedamp sweep fig9.toml -o fig9.h5
    vanedamp report . -o report.html
After a change of a scene, all that depends on it: vanedamp pipeline pipeline.toml
With finite elements: vanedamp demo"""
_PIPELINE_NOTE = (
    "The whole demonstration again, but its comparison with the paper: `vanedamp pipeline pipeline.toml`. It does only "
    "what changed: edit the case or a scene and run it; with --dry-run it says what would run."
)


def run_demo(folder: Path, workers: int | None = None, rigid: bool = False) -> Path:
    """Make modes, rigid model, reduction, three figures of the paper and the report. Returns the report's path.

    Case and scenes are written as a user would write them, with a pipeline file that reproduces all results.

    rigid: use the shipped rigid model and omit all parts that need finite elements.
    """
    started = time.perf_counter()
    folder.mkdir(parents=True, exist_ok=True)
    results = [] if rigid else [folder / "modes.h5", folder / "rom.h5"]
    sources: list[str] = []
    with WorkerPool(workers or available_cores()) as pool:
        # compiling the engine takes as long as the finite elements: both run in parallel, once for all workers
        compiled = pool.submit(warm_up_engine, "line")
        if rigid:
            structure = FigureStructure.shipped()
        else:
            with _stage("mesh, modes, rigid model, reduced model"):
                structure = prepare(folder)
        with _stage("engine compiled, or found compiled"):
            compiled.result()
        session = Session(structure, folder, pool, EFFORT)
        for name in RIGID_FIGURES if rigid else FIGURES:
            begun = time.perf_counter()
            figure = study(FIGURES[name], session)
            print_claims(figure, time.perf_counter() - begun)
            sources += figure.sources
            results += [*(folder / source for source in figure.sources), folder / f"{name}{CLAIMS}"]
    with _stage("the motion at a peak"):
        motion = folder / f"{MOTION}_peak.h5"
        result = Sweep.load(folder / f"{MOTION}.h5")
        note, files = peak(grid(result.scene), result, motion.name)
        print(note)
        for write in files.values():
            write(str(motion))
            results.append(motion)
    _write_pipeline(folder, sources, rigid)
    from vanedamp.studies.report.page import write_report
    from vanedamp.studies.report.results import collect

    with _stage("report"):
        write_report(collect(results), folder / "report.html")
        if not rigid:
            _summary(folder)
    print((_RIGID_COMMANDS if rigid else _COMMANDS).format(folder=folder, modes=MODES))
    print(f"{folder / 'report.html'}: done in {time.perf_counter() - started:.0f} s")
    return folder / "report.html"


def _write_pipeline(folder: Path, sources: Sequence[str], rigid: bool) -> None:
    """Write the pipeline that makes these sweeps again."""
    case = {} if rigid else {"case": "case.toml", "modal": {}, "reduce": {"modes": MODES}}
    sweeps = [{"scene": f"{Path(source).stem}.toml"} for source in sources]
    tables = case | {"sweep": sweeps, "report": {"file": "results.html"}}
    write_commented(folder / PIPELINE, tables, KINDS["pipeline"], {"": _PIPELINE_NOTE})


def _summary(folder: Path) -> None:
    """Draw mode and forced response, rigid model with the gap reference/2, worst of all starts, as summary.png."""
    _, attributes = load(folder / "modes.h5", "modes")
    picture = mode_picture(folder / "modes.h5", int(attributes["first_bending"]))
    starts = forced_responses(Sweep.load(folder / "fig9.h5"))[1::3]  # of three gaps, the second
    worst = {
        curve: np.fmax.reduce([getattr(response, curve) for response in starts])
        for curve in ("damped_mean", "damped_max")
    }
    name = f"rigid model, gap reference/2, worst of {len(starts)} starts"
    summary_picture(picture, replace(starts[0], name=name, **worst), folder / "summary.png")


@contextmanager
def _stage(name: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    print(f"{time.perf_counter() - started:6.1f} s  {name}", flush=True)
