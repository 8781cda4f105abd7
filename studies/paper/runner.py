"""Every figure of the paper as a study on the shipped cluster: sweeps, pictures, and claims with a verdict each.

A figure is a file in paper_scenes/ (paper.figure_file), rules for its claims and a picture. What was computed before
with the same scene, model and versions can be taken over, so that an interrupted run goes on.
"""

from __future__ import annotations

import json
import shutil
import textwrap
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from vanedamp.coupling.engine import simulate
from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene, relative
from vanedamp.coupling.scene.short_form import short_form
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.files.checkpoint_file import clear
from vanedamp.files.provenance import versions
from vanedamp.files.store import StoreError, digest, finite, load, write_json
from vanedamp.files.toml_input import InputError, nearest, read_toml, validate
from vanedamp.files.toml_output import schema_name, write_commented, write_schema
from vanedamp.meshes.vane_cluster import SHIPPED
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.paper import (
    blade,
    claims_blocks,
    claims_reduced,
    claims_rigid,
    claims_rotation,
    claims_self_tuning,
    claims_systems,
    plots,
    plots_rotation,
)
from vanedamp.studies.paper.curve import Curve, curves
from vanedamp.studies.paper.figure_file import FOLDER, Bar, Effort, PaperFigure, Structure
from vanedamp.studies.report.claims import CLAIMS, Claim, Study
from vanedamp.studies.terminal import progress
from vanedamp.studies.workers import workers

NAMES = (
    "fig9", "fig10", "fig12", "fig13", "fig14", "fig19", "mistuning", "systems", "blocks", "fit",
    "campbell", "rotating_body", "self_tuning",
)  # fmt: skip
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


def run_paper(folder: Path, names: Sequence[str] = (), count: int | None = None, resume: bool = False) -> list[Study]:
    """Compute the named studies (default: all) into a folder, and print their claims. Raises InputError."""
    for name in names:
        if name not in NAMES:
            raise InputError(f"no study '{name}'; {nearest(name, list(NAMES))}")
    started = time.perf_counter()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--output {folder}: cannot be made ({error.strerror})") from error
    structure = prepare(folder, resume)
    studies = []
    with workers(count) as pool:
        session = Session(structure, folder, pool, resume=resume)
        for name in names or NAMES:
            begun = time.perf_counter()
            studies.append(study(name, session))
            print_claims(studies[-1], time.perf_counter() - begun)
    print(f"\n{folder}: {time.perf_counter() - started:.0f} s; for a page: vanedamp report {folder} -o report.html")
    return studies


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


def study(name: str, session: Session) -> Study:
    """Run one study: scenes (.toml), sweeps (.h5), picture and, last, claims."""
    if name == "fig13":
        return _history(session)
    if name == "campbell":
        return _blade(session)
    figure = PaperFigure.load(name, session.structure, session.effort)
    sweeps = {curve: _swept(figure, curve, session) for curve in figure.scenes}
    read = {curve: curves(sweep, curve.replace("_", " ") or name) for curve, sweep in sweeps.items()}
    sliders = _sliders(name, session)
    claims = _claims(figure, read, sliders)
    _picture(figure, read, sliders, session.folder / f"{name}.png")
    trouble = [text for curve, sweep in sweeps.items() for text in _trouble(curve, sweep)]
    title = f"{figure.title} (not ok: {', '.join(trouble)})" if trouble else figure.title
    if trouble:
        count = sum(int((sweep.status != "ok").sum()) for sweep in sweeps.values())
        failed = f" ({count} of {sum(sweep.status.size for sweep in sweeps.values())} points are not ok.)"
        claims = [replace(claim, why=(claim.why + failed).strip()) for claim in claims]
    return _written(Study(name, title, [f"{figure.stem(curve)}.h5" for curve in sweeps], claims), session.folder)


def _trouble(curve: str, sweep: Sweep) -> list[str]:
    """Return how many points of a curve have which status other than ok, in words."""
    counts = Counter(status for status in sweep.status.ravel().tolist() if status != "ok")
    name = curve.replace("_", " ")
    return [f"{name} {count} of {sweep.status.size} {status}".strip() for status, count in counts.items()]


def _sliders(name: str, session: Session) -> dict[str, dict[str, list[Curve]]]:
    """Return the curves of other figures, by these, that a study's blocks stand beside."""
    read = {}
    for other, wanted in claims_blocks.SLIDERS.get(name, {}).items():
        figure = PaperFigure.load(other, session.structure, session.effort)
        read[other] = {curve: curves(_swept(figure, curve, session), curve or other) for curve in wanted}
    return read


def _swept(figure: PaperFigure, curve: str, session: Session) -> Sweep:
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


def write_scene(scene: Scene, path: Path, title: str) -> None:
    """Write a scene as one would write it by hand, with comments."""
    command = "sweep" if scene.sweep else "run"
    notes = {"": f"{title}. `vanedamp {command} {path.name}` runs it; every key: `vanedamp schema scene`. SI units."}
    if isinstance(scene.sweep.get(FREQUENCY), tuple):
        notes["sweep"] = "The frequencies lie closer around the resonances with the bodies loose and fixed."
    write_commented(path, relative(short_form(scene), path), KINDS["scene"], notes)


def _kept(path: Path) -> Sweep | None:
    try:
        return Sweep.load(path)
    except (StoreError, KeyError, InputError):  # none, or of another version
        return None


def _claims(
    figure: PaperFigure, by_name: dict[str, list[Curve]], sliders: dict[str, dict[str, list[Curve]]]
) -> list[Claim]:
    first = next(iter(figure.scenes.values()))
    reference = next(iter(by_name.values()))[0].reference
    match figure.name:
        case "fig9":
            return claims_rigid.fig9(by_name)
        case "fig10":
            return claims_rigid.fig10(by_name)
        case "fig12":
            return claims_reduced.fig12(by_name)
        case "fig14":
            return claims_rigid.fig14(by_name)
        case "fig19":
            return claims_rigid.fig19(by_name, _bar(figure), figure.scenes["nominal"].damper[0].mass)
        case "mistuning":
            return claims_rigid.mistuning(by_name, _half_gaps(first, reference), first.damper[0].restitution)
        case "blocks":
            return claims_blocks.blocks(by_name, sliders, _bar(figure), figure.scenes["nominal"].damper[0].mass)
        case "fit":
            _, play, friction, _ = figure.scenes["map"].sweep_points()[0].values()
            return claims_blocks.fit(by_name, play, friction, sliders["fig9"][""][1])
        case "rotating_body":
            return claims_rotation.rotating_body(by_name, figure.scenes)
        case "self_tuning":
            return claims_self_tuning.self_tuning(by_name, figure.scenes)
    return claims_systems.claims(by_name)


def _bar(figure: PaperFigure) -> Bar:
    return validate(Bar, read_toml(FOLDER / f"{figure.name}.toml")["bar"], "bar")


def _picture(
    figure: PaperFigure, by_name: dict[str, list[Curve]], sliders: dict[str, dict[str, list[Curve]]], path: Path
) -> None:
    title = figure.title
    match figure.name:
        case "fig9":
            names = ("reference", "reference/2", "reference/10")
            plots.responses_picture(dict(zip(names, by_name[""], strict=True)), title, path)
        case "fig14":
            scene = figure.scenes["single"]
            angles = scene.sweep_points()[0]["gravity.orientation_deg"]
            plots.orientations_picture(_named(by_name), angles.tolist(), title, path)
        case "fig19":
            both = _named(by_name)
            ours = {name: of[0] for name, of in both.items()}
            panels = {
                "mass and gap by the bar's length": {n: c for n, c in ours.items() if "gap" not in n},
                "mass alone, gap reference/2": {n.removesuffix(" same gap"): c for n, c in ours.items() if "gap" in n},
            }
            plots.panels_picture(panels, title, path)
        case "mistuning":
            first = figure.scenes[""]
            gaps = _half_gaps(first, by_name[""][0].reference)
            plots.mistuning_picture(by_name[""], gaps, first.damper[0].restitution, title, path)
        case "systems":
            plots.systems_picture(by_name, title, path)
        case "blocks":
            plots.blocks_picture(by_name, sliders, title, path)
        case "fit":
            _, play, friction, _ = figure.scenes["map"].sweep_points()[0].values()
            tops = claims_blocks.highest_means(by_name["map"], (2, len(play), len(friction)))
            plots.fit_picture(tops, play, friction, sliders["fig9"][""][1], title, path)
        case "rotating_body":
            plots_rotation.rotating_body_picture(by_name, figure.scenes, title, path)
        case "self_tuning":
            plots_rotation.self_tuning_picture(by_name, figure.scenes, title, path)
        case _:
            plots.responses_picture({name: of[0] for name, of in _named(by_name).items()}, title, path)


def _named(by_name: dict[str, list[Curve]]) -> dict[str, list[Curve]]:
    return {name.replace("_", " "): of for name, of in by_name.items()}


def _half_gaps(scene: Scene, reference: float) -> list[float]:
    gaps = scene.sweep_points()[0]["cavity.c1.gap"]
    return (gaps / 2 / reference).tolist()


def _history(session: Session) -> Study:
    """Run Fig. 13: the scene at the damped peak of Fig. 12, with samples and events."""
    data = read_toml(FOLDER / "fig13.toml")
    figure = PaperFigure.load("fig12", session.structure, session.effort)
    runs = {}
    for curve, of in figure.scenes.items():
        damped = curves(_swept(figure, curve, session), curve)[0]
        scene = of.replace({"excitation.frequency": damped.peak().frequency, "sweep": {}, "time": data["time"]})
        aside = scene.replace({"damper.0.position": data["aside"] * scene.cavity[0].gap})
        runs[curve] = scene, simulate(scene, events=True, samples_per_period=data["samples"]), simulate(aside)
    scene, response, alike = runs["reduced"]
    folder = session.folder
    write_scene(scene, folder / "fig13.toml", data["title"])
    response.save(folder / "fig13_response.h5", {"versions": versions(), "scene": scene.to_dict()})
    title = f"{data['title']}, {response.frequency:.1f} Hz"
    plots.history_picture(response, session.structure.amplitude, title, folder / "fig13.png")
    claims = claims_reduced.fig13(response, runs["rigid"][1], alike)
    return _written(Study("fig13", title, ["fig13_response.h5"], claims), folder)


def _blade(session: Session) -> Study:
    """Run `campbell`: no sweep of scenes, but finite elements over the speed."""
    found = blade.blade()
    plots_rotation.campbell_picture(found, blade.TITLE, session.folder / "campbell.png")
    sources = blade.save(found, session.folder)
    return _written(Study("campbell", blade.TITLE, sources, claims_rotation.campbell(found)), session.folder)


def _written(study: Study, folder: Path) -> Study:
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
