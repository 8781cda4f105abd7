"""The report: result files in, one HTML page out that needs no network."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import jinja2
import numpy as np
import plotly.offline

from coupling.inputs import InputError
from coupling.sweep import Sweep
from modal.store import StoreError, load, replacing
from rom.reduced import ReducedModel
from studies import figures
from studies.forced_response import ForcedResponse, forced_responses, model_name, shown
from studies.pictures import mode_picture
from studies.provenance import versions

_TEMPLATE = Path(__file__).with_name("report.html")
_KINDS = ("modes", "reduced-model", "sweep")


@dataclass(frozen=True)
class Results:
    """What a report is made of: records by the name of their file."""

    modes: dict[str, tuple[dict[str, Any], dict[str, Any]]] = field(default_factory=dict)
    reduced: dict[str, ReducedModel] = field(default_factory=dict)
    sweeps: dict[str, Sweep] = field(default_factory=dict)


def collect(paths: Sequence[str | Path]) -> Results:
    """The results of modal, reduce and sweep in files, and in all .h5 files of folders (others there are passed over).

    Raises InputError for a file that is none, and when there is nothing to report.
    """
    results = Results()
    for path in map(Path, paths):
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
        for file in sorted(path.glob("*.h5")) if path.is_dir() else [path]:
            kind = _kind(file)
            if kind not in _KINDS:
                if path.is_dir():
                    continue
                raise InputError(f"{file}: holds no result of modal, reduce or sweep")
            if kind == "modes":
                results.modes[str(file)] = load(file, "modes")
            elif kind == "reduced-model":
                results.reduced[str(file)] = ReducedModel.load(file)
            else:
                results.sweeps[str(file)] = Sweep.load(file)
    if not (results.modes or results.reduced or results.sweeps):
        raise InputError(f"{', '.join(map(str, paths))}: no results of modal, reduce or sweep (.h5)")
    return results


def write_report(results: Results, path: str | Path) -> None:
    """Write the page. A picture that cannot be rendered is left out, and the page says so."""
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["shown"] = shown
    template = environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))
    responses = _responses(results.sweeps)
    scenes = {Path(name).name: _flat(_without_sweep(sweep)) for name, sweep in results.sweeps.items()}
    html = template.render(
        plotly=plotly.offline.get_plotlyjs(),
        analyses=[_analysis(name, *record) for name, record in results.modes.items()],
        reductions=[_reduction(name, model) for name, model in results.reduced.items()],
        groups=[_group(number, group) for number, group in enumerate(_by_axis(responses))],
        provenance=_provenance(results),
        scenes=scenes,
        keys=list(dict.fromkeys(key for scene in scenes.values() for key in scene)),
    )
    with replacing(path) as temporary:
        temporary.write_text(html, encoding="utf-8")


def _kind(path: Path) -> str | None:
    try:
        with h5py.File(path, "r") as file:
            return str(file.attrs.get("kind"))
    except OSError as error:
        raise StoreError(f"{path}: not a readable HDF5 file ({error})") from error


def _responses(sweeps: Mapping[str, Sweep]) -> list[ForcedResponse]:
    names = {file: model_name(sweep.scene) for file, sweep in sweeps.items()}
    taken = list(names.values())
    return [
        response
        for file, sweep in sweeps.items()
        for response in forced_responses(
            sweep, names[file] if taken.count(names[file]) == 1 else f"{names[file]} ({Path(file).stem})"
        )
    ]


def _by_axis(responses: Sequence[ForcedResponse]) -> list[list[ForcedResponse]]:
    """Responses that share a chart: those along the same axis."""
    axes = dict.fromkeys(response.axis for response in responses)
    return [[response for response in responses if response.axis == axis] for axis in axes]


def _group(number: int, responses: Sequence[ForcedResponse]) -> dict[str, Any]:
    charts = {
        "response": figures.responses_figure(responses),
        "mistuning": figures.mistuning_figure(responses),
        "energy": figures.energy_figure(responses),
    }
    html = {name: figures.to_html(figure, f"{name}-{number}") for name, figure in charts.items()}
    return html | {"axis": responses[0].axis, "units": responses[0].units, "rows": [_key_figures(r) for r in responses]}


def _key_figures(response: ForcedResponse) -> dict[str, Any]:
    curves = ("undamped", "fixed", "damped_max", "damped_mean")
    peaks = {curve: response.peak(curve) for curve in curves}
    return peaks | {
        "name": response.name,
        "reference": response.reference,
        "onset": response.onset,
        "impacts": float(np.nan_to_num(response.impacts_per_period).max()),
        "points": len(response.x),
        "trouble": response.trouble,
    }


def _analysis(name: str, values: dict[str, Any], attributes: dict[str, Any]) -> dict[str, Any]:
    bending = int(attributes["first_bending"]) if "first_bending" in attributes else None
    picture = None if bending is None else mode_picture(name, bending)
    return {
        "file": Path(name).name,
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
        "file": Path(name).name,
        "interface": [(label, model.contact_mass(label)) for label in model.interface],
        "modes": model.modes,
        "frequencies": model.natural_frequencies_hz,
        "damping_ratio": model.damping_ratio,
    }


def _provenance(results: Results) -> dict[str, dict[str, str]]:
    tables = {"report": versions()}
    for name, (_, attributes) in results.modes.items():
        extra = json.loads(attributes.get("versions", "{}"))
        tables[Path(name).name] = _flat({"matrices": json.loads(attributes["provenance"]), "versions": extra})
    for name, model in results.reduced.items():
        tables[Path(name).name] = _flat(model.provenance)
    for name, sweep in results.sweeps.items():
        tables[Path(name).name] = _flat(sweep.provenance)
    return tables


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
