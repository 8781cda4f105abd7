"""Every figure of the paper as a study on the shipped cluster: sweeps, pictures, and claims with a verdict each.

A figure is a file in scenes/ (paper.figure_scenes), rules for its claims and a picture; those that the
demonstration shows are its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from paper import (
    blade,
    claims_blocks,
    claims_history,
    claims_rigid,
    claims_rotation,
    claims_self_tuning,
    claims_systems,
    plots,
    plots_rotation,
)
from paper.figure_scenes import Bar
from paper.scene_files import FOLDER, scene_file
from paper.session import PaperSession, prepared
from vanedamp.coupling.simulation import simulate
from vanedamp.files.provenance import versions
from vanedamp.files.toml_input import InputError, nearest, read_toml, validate
from vanedamp.studies.demo import demo
from vanedamp.studies.demo.curve import DampedCurve, curves
from vanedamp.studies.demo.figure_file import FigureScenes
from vanedamp.studies.demo.figure_study import FigureStudy, Read, Session, print_claims, write_scene, written
from vanedamp.studies.demo.figure_study import study as figure_study
from vanedamp.studies.jobs.workers import workers
from vanedamp.studies.report.claims import Claim, ClaimStudy


def run_paper(
    folder: Path, names: Sequence[str] = (), count: int | None = None, resume: bool = False
) -> list[ClaimStudy]:
    """Compute the named studies (default: all) into a folder, and print their claims. Raises InputError."""
    for name in names:
        if name not in STUDIES:
            raise InputError(f"no study '{name}'; {nearest(name, list(STUDIES))}")
    started = time.perf_counter()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"--output {folder}: cannot be made ({error.strerror})") from error
    structure = prepared(folder, resume)
    studies = []
    with workers(count) as pool:
        session = PaperSession(structure, folder, pool, resume=resume)
        for name in names or STUDIES:
            begun = time.perf_counter()
            studies.append(study(name, session))
            print_claims(studies[-1], time.perf_counter() - begun)
    print(f"\n{folder}: {time.perf_counter() - started:.0f} s; for a page: vanedamp report {folder} -o report.html")
    return studies


def study(name: str, session: Session) -> ClaimStudy:
    """Run one study: scenes (.toml), sweeps (.h5), picture and, last, claims."""
    return STUDIES[name](session)


def _figure(
    name: str, claims: Callable[[Read], list[Claim]], picture: Callable[[Read, Path], None] | None = None
) -> Callable[[Session], ClaimStudy]:
    """Return what runs the study of a file in scenes/."""
    made = FigureStudy(FOLDER / f"{name}.toml", claims)
    return partial(figure_study, made if picture is None else made._replace(picture=picture))


def others(read: Read) -> dict[str, dict[str, list[DampedCurve]]]:
    """Return the curves of other figures that a figure is compared with, by figure and curve."""
    session, found = read.session, {}
    for name, wanted in claims_blocks.SLIDERS[read.figure.name].items():
        figure = session.figure(scene_file(name))
        found[name] = {curve: curves(session.swept(figure, curve), curve or name) for curve in wanted}
    return found


def _bar(figure: FigureScenes) -> tuple[Bar, float]:
    """Return the bar of a figure, and its nominal mass, kg."""
    bar = read_toml(FOLDER / f"{figure.name}.toml")["bar"]
    return validate(Bar, bar, "bar"), figure.scenes["nominal"].damper[0].mass


def _mistuned(read: Read) -> tuple[list[float], float]:
    """Return half gaps over the amplitude without bodies, and the restitution."""
    first, reference = read.figure.scenes[""], read.curves[""][0].reference
    gaps = first.sweep_points()[0]["cavity.c1.gap"]
    return (gaps / 2 / reference).tolist(), first.damper[0].restitution


def _draw_orientations(read: Read, path: Path) -> None:
    angles = read.figure.scenes["single"].sweep_points()[0]["gravity.orientation_deg"]
    plots.orientations_picture(read.labels, angles.tolist(), read.figure.title, path)


def _draw_masses(read: Read, path: Path) -> None:
    ours = {name: of[0] for name, of in read.labels.items()}
    panels = {
        "mass and gap by the bar's length": {n: c for n, c in ours.items() if "gap" not in n},
        "mass alone, gap reference/2": {n.removesuffix(" same gap"): c for n, c in ours.items() if "gap" in n},
    }
    plots.panels_picture(panels, read.figure.title, path)


def _judge_fit(read: Read) -> list[Claim]:
    _, play, friction, _ = read.figure.scenes["map"].sweep_points()[0].values()
    return claims_blocks.fit(read.curves, play, friction, others(read)["fig9"][""][1])


def _draw_fit(read: Read, path: Path) -> None:
    _, play, friction, _ = read.figure.scenes["map"].sweep_points()[0].values()
    tops = claims_blocks.highest_means(read.curves["map"], (2, len(play), len(friction)))
    plots.fit_picture(tops, play, friction, others(read)["fig9"][""][1], read.figure.title, path)


def _history(session: Session) -> ClaimStudy:
    """Run Fig. 13: the scene at the damped peak of Fig. 12, with samples and events."""
    data = read_toml(FOLDER / "fig13.toml")
    figure = session.figure(scene_file("fig12"))
    runs = {}
    for curve, of in figure.scenes.items():
        damped = curves(session.swept(figure, curve), curve)[0]
        scene = of.replace({"excitation.frequency": damped.peak().frequency, "sweep": {}, "time": data["time"]})
        aside = scene.replace({"damper.0.position": data["aside"] * scene.cavity[0].gap})
        runs[curve] = scene, simulate(scene, events=True, samples_per_period=data["samples"]), simulate(aside)
    scene, response, alike = runs["reduced"]
    folder = session.folder
    write_scene(scene, folder / "fig13.toml", data["title"])
    response.save(folder / "fig13_response.h5", {"versions": versions(), "scene": scene.to_dict()})
    title = f"{data['title']}, {response.frequency:.1f} Hz"
    plots.history_picture(response, session.structure.amplitude, title, folder / "fig13.png")
    claims = claims_history.fig13(response, runs["rigid"][1], alike)
    return written(ClaimStudy("fig13", title, ["fig13_response.h5"], claims), folder)


def _blade(session: Session) -> ClaimStudy:
    """Run `campbell`: no sweep of scenes, but finite elements over the speed."""
    found = blade.blade()
    plots_rotation.campbell_picture(found, blade.TITLE, session.folder / "campbell.png")
    sources = blade.save(found, session.folder)
    return written(ClaimStudy("campbell", blade.TITLE, sources, claims_rotation.campbell(found)), session.folder)


#: the studies in their order: each runs in a session
STUDIES: dict[str, Callable[[Session], ClaimStudy]] = {
    **{name: partial(figure_study, demo.FIGURES[name]) for name in ("fig9", "fig10", "fig12")},
    "fig13": _history,
    "fig14": _figure("fig14", lambda read: claims_rigid.fig14(read.curves), _draw_orientations),
    "fig19": _figure("fig19", lambda read: claims_rigid.fig19(read.curves, *_bar(read.figure)), _draw_masses),
    "mistuning": _figure(
        "mistuning",
        lambda read: claims_rigid.mistuning(read.curves, *_mistuned(read)),
        lambda read, path: plots.mistuning_picture(read.curves[""], *_mistuned(read), read.figure.title, path),
    ),
    "systems": _figure(
        "systems",
        lambda read: claims_systems.claims(read.curves),
        lambda read, path: plots.systems_picture(read.curves, read.figure.title, path),
    ),
    "blocks": _figure(
        "blocks",
        lambda read: claims_blocks.blocks(read.curves, others(read), *_bar(read.figure)),
        lambda read, path: plots.blocks_picture(read.curves, others(read), read.figure.title, path),
    ),
    "fit": _figure("fit", _judge_fit, _draw_fit),
    "campbell": _blade,
    "rotating_body": _figure(
        "rotating_body",
        lambda read: claims_rotation.rotating_body(read.curves, read.figure.scenes),
        lambda read, path: plots_rotation.rotating_body_picture(
            read.curves, read.figure.scenes, read.figure.title, path
        ),
    ),
    "self_tuning": _figure(
        "self_tuning",
        lambda read: claims_self_tuning.self_tuning(read.curves, read.figure.scenes),
        lambda read, path: plots_rotation.self_tuning_picture(read.curves, read.figure.scenes, read.figure.title, path),
    ),
}
