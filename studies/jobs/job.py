"""A long command: its input, checks, work and results. A job is run by a command or by a stage of a pipeline.

A job is one class in a file of its own, named in `studies.commands.declarations`, and in `studies.pipeline.tables` if
a pipeline may hold it.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from argparse import Namespace
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Protocol, Self

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.reduced_model_file import origin_in_file
from vanedamp.files.checkpoint_file import clear
from vanedamp.files.provenance import versions
from vanedamp.files.store import clear_leftovers
from vanedamp.studies.scene_checks import check_moved, check_numbers
from vanedamp.studies.terminal import progress

#: writes the file at a path
Write = Callable[[str], object]


class SavedResult(Protocol):
    """A result with a file and JSON."""

    def save(self, path: str) -> object:
        """Write the file."""

    def to_json(self) -> dict[str, Any]:
        """Return it as plain data."""


class Means(NamedTuple):
    """Resources of a job.

    pool: worker processes, None: this process; report: called with the parts done and in total; checkpoint: a file to
    which finished parts are written and from which the same job resumes, None: nowhere; provenance: of the result;
    finished: parts that the checkpoint has.
    """

    pool: Executor | None
    report: Callable[[int, int], None]
    checkpoint: Path | None
    provenance: dict[str, Any]
    finished: int = 0


@dataclass(frozen=True)
class JobResult:
    """The outcome of a job.

    record     the result
    lines      function of the elapsed time, s, that returns printed lines
    sentence   the result in one line
    notes      about choices that were made, on standard error
    warnings   about the input
    files      further files by the options that name them; `output` is the record's unless it is here
    data       JSON in addition to the record's, or in its place
    ran        points that ran now, of a job that counts them
    unfinished whether the checkpoint is kept, so that the same command can resume
    """

    record: SavedResult
    lines: Callable[[float], Iterable[str]]
    sentence: str
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    files: Mapping[str, Write] = field(default_factory=dict)
    data: Mapping[str, Any] = field(default_factory=dict)
    ran: int | None = None
    unfinished: bool = False

    def to_json(self, seconds: float) -> dict[str, Any]:
        """Return the JSON result. The record itself does not contain the time, so that it is reproducible."""
        rate = {} if self.ran is None else {"points_per_second": self.ran / seconds}
        return {"wall_time_s": seconds} | rate | self.record.to_json() | dict(self.data)

    @property
    def writers(self) -> dict[str, Write]:
        """Function that writes each file, by the option that names it."""
        writers: dict[str, Write] = {"output": self.record.save}
        return writers | dict(self.files)

    def clear(self, checkpoint: Path | None) -> None:
        """Remove the checkpoint after the files are written, unless the same command is to resume from it."""
        if checkpoint is not None and not self.unfinished:
            clear(checkpoint)
            clear_leftovers(checkpoint.with_suffix(""))


@dataclass(frozen=True)
class Job(ABC):
    """A long command with its input, which has been read.

    source: the input file, which errors and notes name.
    """

    source: str

    #: of its progress
    TITLE: ClassVar[str]
    #: whether it uses worker processes
    PARALLEL: ClassVar[bool] = False

    @classmethod
    def of_arguments(cls, arguments: Namespace, *inputs: Any) -> Job:
        """Return the job of a command line and of what the command has read. Raises InputError."""
        return cls(arguments.input, *inputs)

    @classmethod
    def of_tables(cls, tables: Mapping[str, Any], path: Path, **options: Any) -> Self:
        """Return the job of the tables of an input file at a path, with fields of its own. Raises InputError."""
        raise NotImplementedError

    @property
    def scene(self) -> Scene | None:
        """The scene that it runs; None without one."""
        return None

    @property
    def files(self) -> Iterable[str | Path]:
        """The files that the input names, by default those of the scene."""
        return () if self.scene is None else self.scene.files

    def check(self, workers: int) -> None:  # noqa: B027
        """Reject a job that takes too long or too much memory. Raises InputError."""

    @property
    def origin(self) -> dict[str, Any]:
        """What its result records: versions, and the model of its scene."""
        return {"versions": versions()} | ({} if self.scene is None else origin_in_file(self.scene.structure))

    def notes(self) -> Iterable[str]:
        """Return notes to print before it runs."""
        return ()

    def warnings(self) -> Iterable[str]:
        """Return warnings before it runs."""
        return ()

    def finished(self, checkpoint: Path | None) -> int:
        """Return the number of parts in a checkpoint. Raises InputError for one of another input.

        Jobs that read the checkpoint when their work begins return 0.
        """
        return 0

    def compiled(self) -> Iterable[Scene]:
        """Return scenes whose engine is compiled before the timing of the progress starts."""
        return () if self.scene is None else (self.scene,)

    @abstractmethod
    def work(self, means: Means) -> JobResult:
        """Do it. Raises VanedampError."""

    def run(
        self, pool: Callable[[], Executor | None] = lambda: None, checkpoint: Path | None = None, title: str = "",
        resumes: Callable[[int], object] = lambda finished: None,
    ) -> tuple[JobResult, float]:  # fmt: skip
        """Compile the engine, and do the work with its progress shown. Returns the outcome and its time, s.

        pool: returns worker processes, which are slow to start; called when the checkpoint is known to fit the job.
        resumes: called with the number of parts in the checkpoint, before the work.
        """
        finished = self.finished(checkpoint)
        resumes(finished)
        processes = pool() if self.PARALLEL else None
        started = time.perf_counter()
        if scenes := list(self.compiled()):
            from vanedamp.studies.jobs.engine import compile_engine  # loads it, which finite elements do not use

            compile_engine(scenes, processes)
        with progress(title or self.TITLE) as report:
            outcome = self.work(Means(processes, report, checkpoint, self.origin, finished))
        return outcome, time.perf_counter() - started


@dataclass(frozen=True)
class SceneJob(Job):
    """A job on a scene."""

    of: Scene
    #: the record of its input file
    FILE: ClassVar[type[Scene]] = Scene

    @property
    def scene(self) -> Scene:
        """The scene."""
        return self.of

    @classmethod
    def of_tables(cls, tables: Mapping[str, Any], path: Path, **options: Any) -> Self:
        """Return the job on the scene in the tables of a file. Raises InputError."""
        scene = Scene.of(dict(tables), path)
        cls.check_scene(scene, f"{path}: ")
        return cls(str(path), scene, **options)

    @classmethod
    def check_scene(cls, scene: Scene, source: str) -> None:
        """Raise InputError for a scene that the job does not accept."""
        check_moved(scene)
        check_numbers(scene, source)


@dataclass(frozen=True)
class StudyJob(Job):
    """A job on a study of a scene. STUDY: its class; FILE: the record of its input file."""

    study: Any
    STUDY: ClassVar[Any]
    FILE: ClassVar[type[Scene]]
    PARALLEL: ClassVar[bool] = True

    @property
    def scene(self) -> Scene:
        """The study's scene."""
        scene: Scene = self.study.scene
        return scene

    @classmethod
    def of_arguments(cls, arguments: Namespace, *inputs: Any) -> Job:
        """Read the study."""
        return cls(arguments.input, cls.STUDY.load(arguments.input))

    @classmethod
    def of_tables(cls, tables: Mapping[str, Any], path: Path, **options: Any) -> Self:
        """Return the job on the study in the tables of a file. Raises InputError."""
        return cls(str(path), cls.STUDY.of(tables, path), **options)


def choice_notes(estimate: Mapping[str, Any] | None, advice: Mapping[str, Any] | None) -> Iterator[str]:
    """Yield the model chosen by `modes = "auto"` and the bodies chosen by `shape = "auto"`, with reasons."""
    for key, chosen in (("structure.modes", estimate), ("damper.shape", advice)):
        if chosen is not None:
            yield f"{key}: {chosen['sentence']}"
