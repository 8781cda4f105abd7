"""The report: results in, one HTML page out that needs no network."""

from __future__ import annotations

import base64
import itertools
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import jinja2
import numpy as np
import plotly.offline

from vanedamp.coupling.sweep.record import Sweep
from vanedamp.coupling.sweep.sweep import LOSSES
from vanedamp.files.provenance import versions
from vanedamp.files.store import digest, replacing
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.headline import shown
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.report import forced_response_charts as figures
from vanedamp.studies.report.charts import Chart, chart, dressed
from vanedamp.studies.report.forced_response import ForcedResponse, forced_responses, model_name
from vanedamp.studies.report.map_chart import map_axes, map_figure, map_rows
from vanedamp.studies.report.mode_chart import mode_figure, mode_rows, small_surface
from vanedamp.studies.report.optimum_chart import optimisation_figure
from vanedamp.studies.report.pictures import mode_picture
from vanedamp.studies.report.results import Results, Study
from vanedamp.studies.report.time_history import History, history_figure

_TEMPLATE = Path(__file__).with_name("report.html")
#: curves of a section's charts, and of one sweep that a map shows as a whole; of more, evenly chosen ones are drawn
_MOST_CURVES, _MOST_BESIDE_MAP = 12, 5
#: scenes that a table can have side by side; of more, each is told below the other
_MOST_COLUMNS = 4


@dataclass(frozen=True)
class Section:
    """Charts and tables of results that belong together."""

    study: Study | None
    groups: list[dict[str, Any]]
    maps: list[Chart]
    histories: list[dict[str, Any]]


def write_report(results: Results, path: str | Path) -> None:
    """Write the page. A picture that cannot be rendered is left out, and the page says so."""
    names = results.names
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters |= {"shown": shown, "name": names.__getitem__, "anchor": lambda file: _anchor(names[file])}
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    scenes = {names[file]: _flat(_without_sweep(sweep)) for file, sweep in results.sweeps.items()}
    scenes |= {
        names[file]: _flat(history.scene.to_dict())
        for file, history in results.histories.items()
        if history.scene is not None
    }
    sections = list(_sections(results, names))
    analyses = [_analysis(number, name, *record) for number, (name, record) in enumerate(results.modes.items())]
    html = template.render(
        plotly=plotly.offline.get_plotlyjs(),
        charted=any(section.groups or section.maps or section.histories for section in sections)
        or bool(results.optimisations)
        or any(analysis["chart"] for analysis in analyses),
        sections=sections,
        analyses=analyses,
        reductions=[_reduction(name, model) for name, model in results.reduced.items()],
        optimisations=[
            _optimisation(number, file, found) for number, (file, found) in enumerate(results.optimisations.items())
        ],
        provenance=_provenance(results),
        scenes=scenes,
        **_compared(scenes),
    )
    with replacing(path) as temporary:
        temporary.write_text(html, encoding="utf-8")


def _anchor(name: str) -> str:
    """Where the page tells the provenance of a file."""
    return "from-" + re.sub(r"\W", "-", name)


def _sections(results: Results, names: Mapping[str, str]) -> Iterator[Section]:
    """What no study names, then every study with its own results."""
    claimed = {str(Path(name).with_name(source)) for name, study in results.studies.items() for source in study.sources}
    numbers = itertools.count()
    yield _section(None, results, names, lambda name: name not in claimed, numbers)
    for file, study in results.studies.items():
        mine = {str(Path(file).with_name(source)) for source in study.sources}
        yield _section(study, results, names, mine.__contains__, numbers)


def _section(
    study: Study | None,
    results: Results,
    names: Mapping[str, str],
    mine: Callable[[str], bool],
    numbers: Iterator[int],
) -> Section:
    sweeps = {name: sweep for name, sweep in results.sweeps.items() if mine(name)}
    histories = {name: history for name, history in results.histories.items() if mine(name)}
    named = {file: (names[file], sweep) for file, sweep in sweeps.items()}
    return Section(
        study,
        groups=[_group(next(numbers), group) for group in _by_axis(_responses(named, study))],
        maps=[_map(next(numbers), name, sweep) for name, sweep in sweeps.items() if map_axes(sweep)],
        histories=[_history(next(numbers), name, history) for name, history in histories.items()],
    )  # fmt: skip


def _responses(sweeps: Mapping[str, tuple[str, Sweep]], study: Study | None) -> list[ForcedResponse]:
    """The curves of named sweeps; those of a study are called by their files, others by their models."""
    models = [model_name(sweep.scene) for _, sweep in sweeps.values()]
    found = []
    for model, (file, (name, sweep)) in zip(models, sweeps.items(), strict=True):
        stem = name.removesuffix(".h5")
        if study is not None:
            called = stem.removeprefix(study.study).strip("_").replace("_", " ") or model
        else:
            called = model if models.count(model) == 1 else f"{model} ({stem})"
        found += _curves(file, sweep, called, max(1, _MOST_CURVES // len(sweeps)))
    return found


def _curves(file: str, sweep: Sweep, name: str, most: int) -> list[ForcedResponse]:
    found = [replace(response, source=file) for response in forced_responses(sweep, name)]
    if map_axes(sweep) is not None:
        most = min(most, _MOST_BESIDE_MAP)
    if len(found) <= most:
        return found
    return [found[index] for index in np.linspace(0, len(found) - 1, most).round().astype(int)]


def _by_axis(responses: Sequence[ForcedResponse]) -> list[list[ForcedResponse]]:
    """Responses that share a chart: those along the same axis."""
    axes = dict.fromkeys(response.axis for response in responses)
    return [[response for response in responses if response.axis == axis] for axis in axes]


def _group(number: int, responses: Sequence[ForcedResponse]) -> dict[str, Any]:
    made = {
        "response": (figures.responses_figure, ("undamped", "fixed", "damped_max", "damped_mean")),
        "mistuning": (figures.mistuning_figure, ("attached_mass_fraction", "impacts_per_period")),
        "energy": (figures.energy_figure, LOSSES),
    }
    charts = {
        kind: chart(
            f"{kind}-{number}", figure(responses), ("response", responses[0].axis, *columns),
            _table(responses, columns), [response.source for response in responses],
        )
        for kind, (figure, columns) in made.items()
    }  # fmt: skip
    return charts | {
        "axis": responses[0].axis, "units": responses[0].units, "rows": [_key_figures(r) for r in responses]
    }  # fmt: skip


def _table(responses: Sequence[ForcedResponse], columns: Sequence[str]) -> Iterator[list[Any]]:
    """A line a point: name, place on the axis, and the columns in SI units."""
    for response in responses:
        shares = dict(zip(LOSSES, response.energy_share.T, strict=True))
        values = [shares[name] if name in shares else getattr(response, name) for name in columns]
        yield from ([response.name, *line] for line in np.column_stack([response.x, *values]).tolist())


def _map(number: int, name: str, sweep: Sweep) -> Chart:
    header = ("panel", *(map_axes(sweep) or ()), "relative_amplitude")
    return chart(f"map-{number}", map_figure(sweep), header, map_rows(sweep), [name])


def _history(number: int, name: str, history: History) -> dict[str, Any]:
    """A run: its time history, if it was sampled, and its figures."""
    drawn = None
    if len(history.time):
        late = history.late()
        header = ("time", "displacement", *(f"body_{body + 1}" for body in range(late.bodies.shape[1])))
        drawn = chart(f"history-{number}", history_figure(late), header, late.rows(), [name])
    return {"file": name, "chart": drawn, "measures": history.measures}


def _optimisation(number: int, file: str, found: Optimisation) -> dict[str, Any]:
    """The optima, and the map of the reduction that they stand in."""
    figure = dressed(optimisation_figure(found), height=560)
    header = ("mass_ratio", "gap_ratio", "relative_amplitude")
    rows = (
        (mass, gap, found.map_amplitude[i, j])
        for i, mass in enumerate(found.map_mass_ratio.tolist())
        for j, gap in enumerate(found.map_gap_ratio.tolist())
    )
    optima = {"as designed": found.nominal, "within the tolerances": found.robust}
    return {"record": found, "optima": optima, "chart": chart(f"optimum-{number}", figure, header, rows, [file])}


def _key_figures(response: ForcedResponse) -> dict[str, Any]:
    return {
        "name": response.name,
        "headline": response.headline,
        "impacts": float(np.nan_to_num(response.impacts_per_period).max()),
    }


def _analysis(number: int, name: str, values: dict[str, Any], attributes: dict[str, Any]) -> dict[str, Any]:
    bending = int(attributes["first_bending"]) if "first_bending" in attributes else None
    turned, picture = None, None
    outside = small_surface(values)
    if outside is not None:
        first = bending or 0
        header = ("x", "y", "z", "dx", "dy", "dz")
        figure, rows = mode_figure(values, outside, first), mode_rows(values, outside, first)
        turned = chart(f"mode-{number}", figure, header, rows, [name])
    elif bending is not None:
        picture = mode_picture(name, bending)
    return {
        "file": name,
        "chart": turned,
        "picture": None if picture is None else base64.b64encode(picture).decode(),
        "first_bending": bending,
        "modes": [
            {"frequency": frequency, "mass": mass, "residual": residual}
            for frequency, mass, residual in zip(
                values["frequency"], values["effective_mass"], values["residual"], strict=True
            )
        ],
        "sum": values["effective_mass"].sum(axis=0),
        "movable_mass": values["movable_mass"],
        "rigid": json.loads(attributes["rigid"]) if "rigid" in attributes else None,
        "fatigue": json.loads(attributes["fatigue"]) if "fatigue" in attributes else None,
    }


def _reduction(name: str, model: ReducedModel) -> dict[str, Any]:
    return {
        "file": name,
        "interface": [(label, model.contact_mass(label)) for label in model.interface],
        "modes": model.modes,
        "frequencies": model.natural_frequencies_hz,
        "damping_ratio": model.damping_ratio,
    }


def _provenance(results: Results) -> dict[str, dict[str, str]]:
    """What is known of every file, by its path; of the page itself under ""."""
    tables = {"": versions()}
    for file, (_, attributes) in results.modes.items():
        extra = json.loads(attributes.get("versions", "{}"))
        tables[file] = _flat({"matrices": json.loads(attributes["provenance"]), "versions": extra})
    for file, record in (results.reduced | results.sweeps | results.histories | results.optimisations).items():
        tables[file] = _flat({key: value for key, value in record.provenance.items() if key != "scene"})
    for file in results.names:
        tables[file]["sha256"] = digest(file)
    return tables


def _compared(scenes: Mapping[str, dict[str, str]]) -> dict[str, Any]:
    """What all scenes have in common, by key, and the keys in which they differ."""
    keys = dict.fromkeys(key for scene in scenes.values() for key in scene)
    values = {key: [scene.get(key, "") for scene in scenes.values()] for key in keys}
    common = {key: found[0] for key, found in values.items() if len(set(found)) == 1}
    return {"common": common, "differing": [key for key in keys if key not in common], "most_columns": _MOST_COLUMNS}


def _without_sweep(sweep: Sweep) -> dict[str, Any]:
    """The scene as data, with the sweep's axes in short."""
    axes = {
        path: f"{len(values)} values, {_digits(values[0])} to {_digits(values[-1])}"
        for path, values in sweep.axes.items()
    }
    return sweep.scene.to_dict() | {"sweep": axes}


def _flat(data: Any, path: str = "") -> dict[str, str]:
    """Nested data as text by dotted path."""
    if isinstance(data, Mapping):
        items = [(f"{path}.{key}" if path else str(key), value) for key, value in data.items()]
    elif isinstance(data, list | tuple) and any(isinstance(entry, Mapping | list | tuple) for entry in data):
        items = [(f"{path}[{index}]", value) for index, value in enumerate(data)]
    elif isinstance(data, list | tuple):
        return {path: ", ".join(map(str, data))}
    else:
        return {path: _digits(data)}
    return {key: text for name, value in items for key, text in _flat(value, name).items()}


def _digits(value: Any) -> str:
    return f"{value:.8g}" if isinstance(value, float) else str(value)
