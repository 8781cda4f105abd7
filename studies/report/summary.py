"""The summary at the beginning of a report: the structure, the bodies, and the answer with its chart."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rigid
from vanedamp.coupling.sweep.grid import base_scene
from vanedamp.studies.headline import format_value
from vanedamp.studies.hot_spots import plus_minus
from vanedamp.studies.references import ReferenceNames
from vanedamp.studies.report.designs import DesignCurves, designs
from vanedamp.studies.report.forced_response import linear_curves, model_name
from vanedamp.studies.report.forced_response_charts import responses_figure
from vanedamp.studies.report.pictures import mode_picture
from vanedamp.studies.report.results import Results

_COLUMNS = ("undamped", "fixed", "damped_max", "damped_mean", "confidence")


def summary(results: Results, page: Any) -> dict[str, Any]:
    """Return picture and facts of the structure, the bodies, and the answer; page: a studies.report.page.Page."""
    answer: list[str] = []
    scene, chart, source = None, None, ""
    responses = page.responses({file: result.record for file, result in results.kinds["sweep"].items()})
    if responses:
        judged = designs(responses)
        (best,) = page.coloured([judged[0].worst])
        source = best.source
        sweep = results.kinds["sweep"][source].record
        scene = base_scene(sweep.scene).replace(best.settings)
        answer += _answer(judged[0], len(judged))
        rows = zip(best.x.tolist(), *(getattr(best, name).tolist() for name in _COLUMNS), strict=True)
        figure = responses_figure([best], [linear_curves(sweep, best)])
        chart = page.chart("summary", figure, (best.axis, *_COLUMNS), rows, [source])
    elif results.kinds["response"]:
        history = next(iter(results.kinds["response"].values())).record
        scene = history.scene
        answer.append(_of_run(history.measures))
    for kind in ("optimisation", "life", "identification"):
        answer += [result.record.sentence for result in results.kinds[kind].values()]
    picture, facts, mass = _structure(page, scene, source)
    bodies = [] if scene is None else list(_bodies(scene, mass))
    return {"picture": picture, "facts": facts, "bodies": bodies, "answer": answer, "chart": chart}


def _structure(page: Any, scene: Scene | None, source: str) -> tuple[str | None, dict[str, str], float]:
    """Return the picture of the first bending, facts by name, and the mass that moves in it, kg; source: preferred."""
    model = page.origins.group(source)
    for file, result in sorted(page.results.kinds["modes"].items(), key=lambda item: item[0] not in model):
        values, attributes = result.record
        if "first_bending" in attributes:
            mode = int(attributes["first_bending"])
            png = mode_picture(file, mode)
            facts = {"first bending": f"{values['frequency'][mode]:.2f} Hz, mode {mode + 1}"}
            facts["mass that can move"] = f"{values['movable_mass'].max():.4g} kg"
            mass = math.nan
            if label := page.origins.label(file):
                facts["of"] = f"{page.names[file]}: {label}"
            if "rigid" in attributes:
                rigid = json.loads(attributes["rigid"])
                mass = rigid["mass"]
                facts["mass of the rigid model"] = f"{mass:.4g} kg at {rigid['at']}"
                facts["damping ratio"] = f"{rigid['damping_ratio']:.4g}"
            if "fatigue" in attributes:
                limit = json.loads(attributes["fatigue"])
                name = f"amplitude at {limit['share']:.0%} of the fatigue strength"
                facts[name] = f"{1e6 * limit['amplitude']:.4g} µm{plus_minus(limit.get('error'))}"
            return None if png is None else base64.b64encode(png).decode(), facts, mass
    if scene is None:
        return None, {}, math.nan
    facts, structure = {"structure": model_name(scene)}, scene.structure
    if isinstance(structure, Rigid):
        frequency = math.sqrt(structure.stiffness / structure.mass) / (2.0 * math.pi)
        facts |= {"natural frequency": f"{frequency:.2f} Hz", "mass": f"{structure.mass:.4g} kg"}
        return None, facts, structure.mass
    if isinstance(structure, Prescribed):
        facts["amplitude"] = f"{1e6 * structure.displacement_amplitude:.4g} µm"
    return None, facts, math.nan


def _bodies(scene: Scene, mass: float) -> Iterator[str]:
    """Yield one line per cavity with bodies; mass: reference for their masses, kg, nan if unknown."""
    for cavity in scene.cavity:
        inside = [damper for damper in scene.damper if damper.cavity == cavity.name]
        play = "" if cavity.play is None else f", play {1e6 * cavity.play:.4g} µm"
        words = []
        for damper in inside:
            sizes = [f"{key} {1e3 * (damper.measure(key) or 0.0):.4g} mm" for key in damper.form.measures]
            of = f" ({damper.mass / mass:.2%} of the structure's)" if mass > 0.0 else ""
            laws = [f"friction {damper.friction:.4g}", f"restitution {damper.restitution:.4g}"]
            words.append(", ".join([f"{damper.shape} of {1e3 * damper.mass:.4g} g{of}", *sizes, *laws]))
        if words:
            yield f"Cavity {cavity.name}, gap {1e6 * cavity.gap:.4g} µm{play}: {'; '.join(words)}."


def _answer(design: DesignCurves, count: int) -> list[str]:
    """Return sentences on the best of a number of designs, by its worst curve."""
    best, headline = design.worst, design.worst.headline
    which = f"The best of {count} designs" if count > 1 else "The design"
    unit = "" if best.units == "1" else f" {best.units}"
    if not math.isfinite(headline.peak_ratio):
        return [f"{design.sentence}."]
    at = f"{format_value(headline.damped_peak_at)}{unit}"
    damped, free, fixed, onset = "", best.names.undamped, best.names.fixed, "Without impacts"
    if best.names == ReferenceNames():
        damped, free, fixed, onset = (
            "with the bodies ",
            "without them",
            "with the bodies fixed",
            "The bodies hit no wall",
        )
    first = (
        f"{which} ({best.name}): {damped}the highest mean amplitude is {1e6 * headline.damped_peak:.4g} µm "
        f"at {at}, the largest amplitude {1e6 * headline.damped_maximum:.4g} µm, "
        f"{free} {1e6 * headline.undamped_peak:.4g} µm at {format_value(headline.undamped_peak_at)}{unit}: "
        f"{headline.peak_ratio:.1%} is left, at its largest {headline.maximum_ratio:.1%}"
    )
    if headline.onset is not None:
        ok_x = best.x[np.isfinite(best.damped_mean)]
        first_point = ""
        if headline.onset == ok_x[0]:
            first_point = " or below, the first point" + (" that is ok" if ok_x[0] != best.x[0] else "")
        onset = f"{best.onset_of.capitalize()} begin at {format_value(headline.onset)}{unit}{first_point}"
    if headline.touched_below is not None:
        onset += f"; below, from {format_value(headline.touched_below)}{unit} on, a body hits its floor or ceiling"
    second = (
        f"{onset}; {fixed} the maximum would be {1e6 * headline.fixed_peak:.4g} µm at "
        f"{format_value(headline.fixed_peak_at)}{unit}."
    )
    first = "; ".join([first, *design.remarks]) + "."
    return [first, "; ".join([second.removesuffix("."), *headline.remarks_in(best.units, names=best.names)]) + "."]


def _of_run(measures: Any) -> str:
    """Return a sentence on a run."""
    about = measures.get("static_deflection", 0.0)
    dynamic = f" ({1e6 * measures['amplitude_mean_dynamic']:.4g} µm about the static deflection)" if about else ""
    return (
        f"At {measures['frequency']:.6g} Hz the mean of the periods' peaks is {1e6 * measures['amplitude_mean']:.4g} "
        f"µm{dynamic}, with {measures['impacts_per_period']:.3g} impacts per period ({measures['classification']}, "
        f"status {measures['status']})."
    )
