"""Pipelines: stages from a case to a report; only stages with changed inputs run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from vanedamp.files.display import Displayed
from vanedamp.files.errors import VanedampError
from vanedamp.files.toml_input import InputError
from vanedamp.studies.jobs.workers import available_cores
from vanedamp.studies.jobs.workers import workers as worker_processes
from vanedamp.studies.pipeline.record import PipelineRecord
from vanedamp.studies.pipeline.stages import Stage, Tools, stages
from vanedamp.studies.pipeline.tables import PipelineFile


@dataclass(frozen=True)
class StageResult:
    """The outcome of a stage.

    status   "kept": nothing has changed, "done"; of a dry run "runs", or "perhaps": if its inputs change
    reasons  for running it
    found    its result, in one line
    outputs  its files
    """

    stage: str
    status: Literal["kept", "done", "runs", "perhaps"]
    reasons: tuple[str, ...]
    outputs: tuple[str, ...]
    found: str = ""
    wall_time_s: float = 0.0


@dataclass(frozen=True, repr=False)
class PipelineResult(Displayed):
    """The outcome of the stages of a pipeline, in their order."""

    stages: tuple[StageResult, ...]
    wall_time_s: float

    @property
    def done(self) -> list[str]:
        """The names of the stages that ran."""
        return [stage.stage for stage in self.stages if stage.status == "done"]

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {"status": "ok", "stages": [asdict(stage) for stage in self.stages], "wall_time_s": self.wall_time_s}


def pipeline(
    path: str | Path,
    folder: str | Path | None = None,
    workers: int | None = None,
    dry_run: bool = False,
    note: Callable[[str], None] | None = None,
) -> PipelineResult:
    """Run the stages of a pipeline file whose inputs have changed since their results were made.

    Inputs of a stage are tables of the case and the scene, files that they name, results of earlier stages,
    options, and the versions of the software; comments do not count. Finished work is kept in PIPELINE.record.json with
    the results, so that a killed run resumes, jobs from their checkpoints.

    folder: of the results, by default the one that the file names; workers: processes of jobs, by default one for
    every core; dry_run: name what would run; note: prints a line as stages begin and end. Raises InputError, with
    the stage's file: nothing has run then if the file, the case or a scene is bad, or would take a month.
    """
    table, source = PipelineFile.load(path), Path(path)
    target = Path(folder) if folder is not None else source.parent / table.folder
    listed = list(stages(table, source, target))
    return run_stages(listed, source, [*table.named_files.values()], target, workers, dry_run, note)


def run_stages(
    listed: Sequence[Stage], source: Path, files: Sequence[str], folder: Path, workers: int | None, dry_run: bool,
    note: Callable[[str], None] | None,
) -> PipelineResult:  # fmt: skip
    """Run the stages of a file whose inputs have changed, as `pipeline` says; files: those that it names."""
    started, say = time.perf_counter(), note or (lambda line: None)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{source}: folder: {folder} is a file; name a folder for the results")
    count = workers or available_cores()
    _check(listed, [source, *files], source, count)
    record = PipelineRecord(folder / f"{source.stem}.record.json")
    _keep_edited(listed, record)
    if dry_run:
        return PipelineResult(tuple(_plan(listed, record, say)), time.perf_counter() - started)
    folder.mkdir(parents=True, exist_ok=True)
    results = []
    with ExitStack() as stack:
        pool = cache(lambda: stack.enter_context(worker_processes(workers)))
        for stage in listed:
            with _located(stage):
                results.append(_done(stage, record, say, pool, count))
    result = PipelineResult(tuple(results), time.perf_counter() - started)
    say(f"{source}: {len(result.done)} of {len(listed)} stages ran, {result.wall_time_s:.1f} s")
    return result


def adopt(path: str | Path) -> None:
    """Record that results in the folder of a pipeline file match its present inputs, if made by other means."""
    table, source = PipelineFile.load(path), Path(path)
    folder = source.parent / table.folder
    record = PipelineRecord(folder / f"{source.stem}.record.json")
    for stage in stages(table, source, folder):
        if all(output.exists() for output in stage.outputs):
            record.end(stage.name, stage.inputs(), stage.outputs)


def _done(
    stage: Stage, record: PipelineRecord, say: Callable[[str], None], pool: Callable[[], Executor | None], workers: int
) -> StageResult:
    """Run a stage unless its results match its inputs."""
    outputs, inputs = tuple(map(_shown, stage.outputs)), stage.inputs()
    reasons = tuple(record.reasons(stage.name, inputs, stage.outputs))
    if not reasons:
        say(f"{stage.name}: kept")
        return StageResult(stage.name, "kept", (), outputs)
    say(f"{stage.name}: runs, {'; '.join(reasons)}")
    same = record.begin(stage.name, inputs)
    started = time.perf_counter()
    made_of = record.inputs(stage.name, stage.outputs)
    tools = Tools(lambda line: say(f"{stage.name}: {line}"), pool, workers, not same, made_of)
    words = stage.work(tools)
    seconds = time.perf_counter() - started
    record.end(stage.name, inputs, stage.outputs)
    say(f"{stage.name}: {words} ({seconds:.1f} s)")
    return StageResult(stage.name, "done", reasons, outputs, words, seconds)


def _plan(listed: Sequence[Stage], record: PipelineRecord, say: Callable[[str], None]) -> list[StageResult]:
    """Return which stages would run and why."""
    running: dict[Path, str] = {}
    plan = []
    for stage in listed:
        with _located(stage):
            reasons = tuple(record.reasons(stage.name, stage.inputs(), stage.outputs))
        before = tuple(dict.fromkeys(running[path] for path in stage.takes if path in running))
        status: Literal["kept", "runs", "perhaps"] = "runs" if reasons else "perhaps" if before else "kept"
        if not reasons and before:
            reasons = (f"takes results of {', '.join(before)}",)
        if status != "kept":
            running |= dict.fromkeys(stage.outputs, stage.name)
        word = {"kept": "kept", "runs": "runs, ", "perhaps": "runs if its input changes, "}[status]
        say(f"{stage.name}: {word}{'; '.join(reasons)}")
        plan.append(StageResult(stage.name, status, reasons, tuple(map(_shown, stage.outputs))))
    return plan


def _check(listed: Sequence[Stage], files: Iterable[str | Path], source: Path, workers: int) -> None:
    """Reject bad input before anything runs, and results that would overwrite an input."""
    inputs = {(source.parent / file).resolve() if file != source else source.resolve() for file in files}
    owners: dict[Path, str] = {}
    for stage in listed:
        with _located(stage):
            inputs |= {Path(file).resolve() for file in stage.check(workers)}
        for path in stage.outputs:
            if path in owners:
                raise InputError(
                    f"{source}: {owners[path]} and {stage.name} both write {path.name}; give one of them another name"
                )
            owners[path] = stage.name
    intermediate = {path for stage in listed for path in stage.takes}
    for path, name in owners.items():
        if path in inputs - intermediate:
            raise InputError(f"{source}: {name} writes {path.name}, which is an input; give another folder or name")


def _keep_edited(listed: Sequence[Stage], record: PipelineRecord) -> None:
    """Reject overwriting a case or scene that was edited by hand; other results are made again."""
    for stage in listed:
        for path in record.edited(stage.name, [path for path in stage.outputs if path.suffix == ".toml"]):
            raise InputError(
                f"{_shown(path)}: is not as {stage.name} wrote it, which would write it again; rename it to keep the "
                "changes, or delete it"
            )


@contextmanager
def _located(stage: Stage) -> Iterator[None]:
    """Name the stage's file in errors about input."""
    try:
        yield
    except VanedampError as error:
        file = _shown(stage.file)
        text = str(error).replace(str(stage.file), file)
        raise InputError(text if text.startswith(f"{file}:") else f"{file}: {text}") from error


def _shown(path: Path) -> str:
    """Return a path as seen from the working directory, if it lies below."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
