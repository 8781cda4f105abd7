"""A figure as a study: sweeps of its scenes, a picture, and claims with a verdict each.

What was computed before with the same scene, model and versions can be taken over, so that an interrupted run resumes.
"""

from __future__ import annotations

import json
import shutil
import textwrap
from collections import Counter
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene, relative
from vanedamp.coupling.scene.short_form import short_form
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.checkpoint_file import clear
from vanedamp.files.provenance import versions
from vanedamp.files.store import StoreError, digest, finite, load, write_json
from vanedamp.files.toml_input import InputError
from vanedamp.files.toml_output import schema_name, write_commented, write_schema
from vanedamp.meshes.vane_cluster import SHIPPED
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.demo.curve import Curve, curves
from vanedamp.studies.demo.figure_file import FOLDER, Effort, FigureScenes, Structure
from vanedamp.studies.demo.pictures import responses_picture
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.report.claims import CLAIMS, Claim, Study
from vanedamp.studies.terminal import progress

#: modes of the reduced model's file: what `modes = "auto"` chooses from
MODES = 12


@dataclass(frozen=True)
class Session:
    """Folder, pool and effort of studies.

    pool: of processes, None for this one; effort: less than the figures' files say; resume: take over what the folder
    has of the same scene, model and versions; computed: sweeps of this session by the stem of their files.
    """

    structure: Structure
    folder: Path
    pool: Executor | None = None
    effort: Effort | None = None
    resume: bool = False
    computed: dict[str, Sweep] = field(default_factory=dict)


@dataclass(frozen=True)
class Read:
    """A figure's scenes and curves; others: curves of other figures, by the stems of their files."""

    figure: FigureScenes
    curves: dict[str, list[Curve]]
    others: dict[str, dict[str, list[Curve]]]

    @property
    def labels(self) -> dict[str, list[Curve]]:
        """The curves by their names in pictures."""
        return {name.replace("_", " "): of for name, of in self.curves.items()}


def draw_first(read: Read, path: Path) -> None:
    """Draw the first curve of each name."""
    responses_picture({name: of[0] for name, of in read.labels.items()}, read.figure.title, path)


class FigureStudy(NamedTuple):
    """How a figure is judged and drawn. file: of its scenes; others: curves of other figures' files that it needs."""

    file: Path
    claims: Callable[[Read], list[Claim]]
    picture: Callable[[Read, Path], None] = draw_first
    others: Mapping[Path, tuple[str, ...]] = {}


def study(of: FigureStudy, session: Session) -> Study:
    """Run one study: scenes (.toml), sweeps (.h5), picture and, last, claims."""
    figure = FigureScenes.load(of.file, session.structure, session.effort)
    sweeps = {curve: swept(figure, curve, session) for curve in figure.scenes}
    read = Read(
        figure,
        {curve: curves(sweep, curve.replace("_", " ") or figure.name) for curve, sweep in sweeps.items()},
        {file.stem: _curves_of(file, names, session) for file, names in of.others.items()},
    )
    claims = of.claims(read)
    of.picture(read, session.folder / f"{figure.name}.png")
    trouble = [text for curve, sweep in sweeps.items() for text in _trouble(curve, sweep)]
    title = f"{figure.title} (not ok: {', '.join(trouble)})" if trouble else figure.title
    if trouble:
        count = sum(int((sweep.status != "ok").sum()) for sweep in sweeps.values())
        failed = f" ({count} of {sum(sweep.status.size for sweep in sweeps.values())} points are not ok.)"
        claims = [replace(claim, why=(claim.why + failed).strip()) for claim in claims]
    sources = [f"{figure.stem(curve)}.h5" for curve in sweeps]
    return written(Study(figure.name, title, sources, claims), session.folder)


def swept(figure: FigureScenes, curve: str, session: Session) -> Sweep:
    """Return the sweep of a curve: of this session, of the folder with `resume`, or computed."""
    scene, stem = figure.scenes[curve], figure.stem(curve)
    path = session.folder / f"{stem}.h5"
    checkpoint = Path(f"{path}.partial")
    provenance: dict[str, Any] = {"versions": versions()}
    if isinstance(scene.structure, Rom):
        provenance["model"] = digest(scene.structure.file)
    old = session.computed.get(stem) or (_kept(path) if session.resume else None)
    if old is None or old.scene != scene or any(old.provenance.get(key) != provenance[key] for key in provenance):
        if not session.resume:
            clear(checkpoint)
        write_scene(scene, session.folder / f"{stem}.toml", f"{figure.title}{f': {curve}' if curve else ''}")
        with progress(stem) as report:
            old = sweep(scene, session.pool, report, checkpoint, provenance)
        old.save(path)
        clear(checkpoint)
    session.computed[stem] = old
    return old


def _curves_of(file: Path, names: tuple[str, ...], session: Session) -> dict[str, list[Curve]]:
    figure = FigureScenes.load(file, session.structure, session.effort)
    return {curve: curves(swept(figure, curve, session), curve or figure.name) for curve in names}


def _trouble(curve: str, sweep: Sweep) -> list[str]:
    """Return how many points of a curve have which status other than ok, in words."""
    counts = Counter(status for status in sweep.status.ravel().tolist() if status != "ok")
    name = curve.replace("_", " ")
    return [f"{name} {count} of {sweep.status.size} {status}".strip() for status, count in counts.items()]


def _kept(path: Path) -> Sweep | None:
    try:
        return Sweep.load(path)
    except (StoreError, KeyError, InputError):  # none, or of another version
        return None


def prepare(folder: Path, resume: bool = False) -> Structure:
    """Make the shipped cluster's modes.h5 and rom.h5 in a folder; resume: unless those of this case are there."""
    case, mesh, modes, reduced = (folder / name for name in ("case.toml", "vane_cluster.msh", "modes.h5", "rom.h5"))
    text = f"#:schema ./{schema_name('case')}\n" + (FOLDER / "case.toml").read_text(encoding="utf-8")
    same = case.is_file() and case.read_text(encoding="utf-8") == text
    same = same and mesh.is_file() and mesh.read_bytes() == SHIPPED.read_bytes()
    if not (resume and same and _made_by_us(modes, reduced, MODES)):
        shutil.copyfile(SHIPPED, mesh)
        case.write_text(text, encoding="utf-8")
        write_schema(folder / schema_name("case"), KINDS["case"].schema)
        from vanedamp.studies.case.stages import assemble, modal_analysis, reduction
        from vanedamp.studies.case.tables import Case

        structure = assemble(Case.load(case))
        modal_analysis(structure).save(modes)
        reduction(structure, MODES).save(reduced)
    return Structure.load(modes, reduced)


def _made_by_us(modes: Path, reduced: Path, count: int) -> bool:
    try:
        _, attributes = load(modes, "modes")
        return json.loads(attributes["versions"]) == versions() and ReducedModel.load(reduced).modes == count
    except (StoreError, KeyError):
        return False


def write_scene(scene: Scene, path: Path, title: str) -> None:
    """Write a scene as one would write it by hand, with comments."""
    command = "sweep" if scene.sweep else "run"
    notes = {"": f"{title}. `vanedamp {command} {path.name}` runs it; every key: `vanedamp schema scene`. SI units."}
    if isinstance(scene.sweep.get(FREQUENCY), tuple):
        notes["sweep"] = "The frequencies lie closer around the resonances with the bodies loose and fixed."
    write_commented(path, relative(short_form(scene), path), KINDS["scene"], notes)


def written(study: Study, folder: Path) -> Study:
    """Write a study's claims, and return it."""
    write_json(folder / f"{study.study}{CLAIMS}", finite(asdict(study)))
    return study


def print_claims(study: Study, seconds: float) -> None:
    """Print a study's claims: the paper's words, the finding here, the verdict."""
    print(f"\n{study.study}: {study.title} ({seconds:.1f} s)")
    for claim in study.claims:
        rows = [("paper", claim.claim), ("here", claim.ours), (claim.verdict, claim.why)]
        for head, text in rows:
            lines = textwrap.wrap(text, 105) or [""]
            print(f"  {head:10}{lines[0]}".rstrip())
            print("".join(f"            {line}\n" for line in lines[1:]), end="")
