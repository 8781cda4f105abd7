"""A figure as a study: sweeps of its scenes, a picture, and claims with a verdict each."""

from __future__ import annotations

import shutil
import textwrap
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene, relative
from vanedamp.coupling.scene.short_form import short_form
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.checkpoint_file import clear
from vanedamp.files.store import finite, write_json
from vanedamp.files.toml_output import schema_name, write_commented, write_schema
from vanedamp.meshes.vane_cluster import SHIPPED
from vanedamp.studies.demo.curve import DampedCurve, curves, worst_of
from vanedamp.studies.demo.figure_file import FOLDER, Effort, FigureScenes, FigureStructure
from vanedamp.studies.demo.pictures import responses_picture
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.jobs.sweep import SweepJob
from vanedamp.studies.report.claims import CLAIMS, Claim, ClaimStudy
from vanedamp.studies.worst_start import STARTS

#: modes of the reduced model's file: what `modes = "auto"` chooses from
MODES = 12
#: text of the shipped cluster's case
CASE = f"#:schema ./{schema_name('case')}\n" + (FOLDER / "case.toml").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Session:
    """Folder, pool and effort of studies.

    pool: of processes, None for this one; effort: changes of the figures' files; resume: continue from checkpoints
    in the folder.
    """

    structure: FigureStructure
    folder: Path
    pool: Executor | None = None
    effort: Effort | None = None
    resume: bool = False

    def figure(self, file: Path) -> FigureScenes:
        """Read a figure's scenes, on the structure."""
        return FigureScenes.load(file, self.structure, self.effort)

    def read(self, sweep: Sweep, name: str) -> list[DampedCurve]:
        """Return the curves of a sweep, each the worst of the effort's starts."""
        lines, starts = curves(sweep, name), [] if self.effort is None else [STARTS[key] for key in self.effort.starts]
        if not starts:
            return lines
        count = len(lines) // len(starts)
        return [worst_of(lines[index::count], starts) for index in range(count)]

    def swept(self, figure: FigureScenes, curve: str) -> Sweep:
        """Run the sweep of a curve, and write its scene (.toml) and result (.h5)."""
        scene, stem = figure.scenes[curve], figure.stem(curve)
        path = self.folder / f"{stem}.h5"
        checkpoint = Path(f"{path}.partial")
        if not self.resume:
            clear(checkpoint)
        write_scene(scene, path.with_suffix(".toml"), f"{figure.title}{f': {curve}' if curve else ''}")
        job = SweepJob(str(path), scene)
        outcome, _ = job.run(lambda: self.pool, checkpoint, stem)
        outcome.record.save(str(path))
        outcome.clear(checkpoint)
        return Sweep.load(path)


@dataclass(frozen=True)
class Read:
    """A figure's scenes and curves, and the session in which they were computed."""

    figure: FigureScenes
    curves: dict[str, list[DampedCurve]]
    session: Session

    @property
    def labels(self) -> dict[str, list[DampedCurve]]:
        """The curves by their names in pictures."""
        return {name.replace("_", " "): of for name, of in self.curves.items()}


def draw_first(read: Read, path: Path) -> None:
    """Draw the first curve of each name."""
    responses_picture({name: of[0] for name, of in read.labels.items()}, read.figure.title, path)


class FigureStudy(NamedTuple):
    """How a figure is evaluated and drawn. file: of its scenes."""

    file: Path
    claims: Callable[[Read], list[Claim]]
    picture: Callable[[Read, Path], None] = draw_first


def study(of: FigureStudy, session: Session) -> ClaimStudy:
    """Run one study: scenes (.toml), sweeps (.h5), picture and, last, claims."""
    figure = session.figure(of.file)
    sweeps = {curve: session.swept(figure, curve) for curve in figure.scenes}
    mine = {curve: session.read(sweep, curve.replace("_", " ") or figure.name) for curve, sweep in sweeps.items()}
    read = Read(figure, mine, session)
    claims = of.claims(read)
    of.picture(read, session.folder / f"{figure.name}.png")
    trouble = [text for curve, sweep in sweeps.items() for text in _trouble(curve, sweep)]
    if trouble:
        count = sum(int((sweep.status != "ok").sum()) for sweep in sweeps.values())
        failed = f" ({count} of {sum(sweep.status.size for sweep in sweeps.values())} points are not ok.)"
        claims = [replace(claim, why=(claim.why + failed).strip()) for claim in claims]
    sources = [f"{figure.stem(curve)}.h5" for curve in sweeps]
    return written(ClaimStudy(figure.name, figure.title, sources, claims, ", ".join(trouble)), session.folder)


def _trouble(curve: str, sweep: Sweep) -> list[str]:
    """Return the numbers of points that are not ok, by status, in words."""
    counts = Counter(status for status in sweep.status.ravel().tolist() if status != "ok")
    name = curve.replace("_", " ")
    return [f"{name} {count} of {sweep.status.size} {status}".strip() for status, count in counts.items()]


def prepare(folder: Path) -> FigureStructure:
    """Make the shipped cluster's case, with its modes.h5 and rom.h5, in a folder."""
    from vanedamp.studies.case.stages import assemble, modal_analysis, reduction
    from vanedamp.studies.case.tables import Case

    shutil.copyfile(SHIPPED, folder / "vane_cluster.msh")
    case, modes, reduced = (folder / name for name in ("case.toml", "modes.h5", "rom.h5"))
    case.write_text(CASE, encoding="utf-8")
    write_schema(folder / schema_name("case"), KINDS["case"].schema)
    structure = assemble(Case.load(case))
    modal_analysis(structure).save(modes)
    reduction(structure, MODES).save(reduced)
    return FigureStructure.load(modes, reduced)


def write_scene(scene: Scene, path: Path, title: str) -> None:
    """Write a scene as one would write it by hand, with comments."""
    command = "sweep" if scene.axes else "run"
    notes = {"": f"{title}. `vanedamp {command} {path.name}` runs it; every key: `vanedamp schema scene`. SI units."}
    if isinstance(scene.axes.get(FREQUENCY), tuple):
        notes["sweep"] = "The frequencies lie closer around the resonances with the bodies loose and fixed."
    write_commented(path, relative(short_form(scene), path), KINDS["scene"], notes)


def written(study: ClaimStudy, folder: Path) -> ClaimStudy:
    """Write a study's claims, and return it."""
    write_json(folder / f"{study.study}{CLAIMS}", finite(asdict(study)))
    return study


def print_claims(study: ClaimStudy, seconds: float) -> None:
    """Print a study's claims: the paper's words, the finding here, the verdict."""
    print(f"\n{study.study}: {study.title} ({seconds:.1f} s)")
    if study.not_ok:
        print(f"  not ok    {study.not_ok}")
    for claim in study.claims:
        rows = [("paper", claim.claim), ("here", claim.ours), (claim.verdict, claim.why)]
        for head, text in rows:
            lines = textwrap.wrap(text, 105) or [""]
            print(f"  {head:10}{lines[0]}".rstrip())
            print("".join(f"            {line}\n" for line in lines[1:]), end="")
