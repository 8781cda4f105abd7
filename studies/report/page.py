"""The report: one HTML page of results that needs no network."""

from __future__ import annotations

import itertools
import json
import math
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import jinja2
import plotly.graph_objects as go
import plotly.offline
from markupsafe import Markup

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.sweep.record import Sweep
from vanedamp.files.provenance import versions
from vanedamp.files.store import csv_text, decoding, digest, replacing
from vanedamp.studies.headline import leaves, without_round_off
from vanedamp.studies.hot_spots import plus_minus
from vanedamp.studies.report.charts import COLOURS, Chart, chart
from vanedamp.studies.report.claims import CLAIMS, ClaimStudy
from vanedamp.studies.report.forced_response import ForcedResponse, forced_responses, model_name
from vanedamp.studies.report.map_chart import has_responses
from vanedamp.studies.report.motion import RunFrames
from vanedamp.studies.report.motion_page import environment
from vanedamp.studies.report.origins import Origins
from vanedamp.studies.report.results import ReportSection, Result, Results, format_setting, sections
from vanedamp.studies.report.summary import summary

_FOLDER = Path(__file__).parent
#: largest number of scenes in the columns of a table; more are listed below each other
_MOST_COLUMNS = 4
#: headings of common sections, filled by templates of several sections, by their calls, in the order of the page
_COMMON = {"strength": "Strength and life", "later": "Where the energy goes"}
#: scripts of the page by the kind of chart that needs them
_SCRIPTS = {"motion.js": "motion", "modes.js": "mode", "curves.js": "response", "ring.js": "ring"}
_SLIDERS = (
    '{} only along the cavity. Of bodies with corners, shape = "auto" with their length and height tells whether that '
    "is enough."
)


@dataclass(frozen=True)
class Page:
    """The state of a page while its sections are written.

    known   the sections by the kind of result that they show
    names   short names of the result files by path
    origins what differs
    study   name of the study that the results belong to; None for results of their own
    charts  charts made so far, by the first part of their name
    colours of devices
    common  pieces that templates move to a common section, by the calls of _COMMON
    """

    results: Results
    known: Mapping[str, ReportSection]
    names: Mapping[str, str]
    origins: Origins
    environment: jinja2.Environment
    study: str | None = None
    charts: Counter[str] = field(default_factory=Counter)
    colours: dict[Hashable, str] = field(default_factory=dict)
    common: dict[str, list[str]] = field(default_factory=lambda: {name: [] for name in _COMMON})

    def chart(
        self, kind: str, figure: go.Figure, header: Sequence[str], rows: Iterable[Iterable[Any]], files: Iterable[str]
    ) -> Chart:
        """Return a chart for the template's macro `plot`, with its data as a table and the files of its results."""
        name = f"{kind}-{self.charts[kind]}"
        self.charts[kind] += 1
        return chart(name, figure, header, rows, files)

    def motion(self, motion: RunFrames, files: Iterable[str]) -> Chart:
        """Return the player of a motion for the template's macro `plot`."""
        name = f"motion-{self.charts['motion']}"
        self.charts["motion"] += 1
        html = self.environment.get_template("motion.html").render(name=name, data=motion.to_json())
        return Chart(name, html, csv_text(motion.header(), motion.rows()), tuple(files))

    def responses(self, sweeps: Mapping[str, Sweep]) -> list[ForcedResponse]:
        """Return the curves of sweeps; curves of a study are named after their files, others after their models."""
        sweeps = {file: sweep for file, sweep in sweeps.items() if has_responses(sweep)}
        models = [model_name(sweep.scene) for sweep in sweeps.values()]
        responses = []
        for model, (file, sweep) in zip(models, sweeps.items(), strict=True):
            stem = self.names[file].removesuffix(".h5")
            if self.study is not None:
                name = stem.removeprefix(self.study).strip("_").replace("_", " ") or model
            else:
                name = model if models.count(model) == 1 else f"{model} ({stem})"
                name = ", ".join(filter(None, [name, self.origins.label(file)]))
            responses += [replace(response, source=file) for response in forced_responses(sweep, name)]
        return responses

    def coloured(self, responses: Iterable[ForcedResponse]) -> list[ForcedResponse]:
        """Return the curves of a chart in colours, each device in its own."""
        curves: list[ForcedResponse] = []
        for response in responses:
            colour, used = self.colours.get(response.design), [curve.colour for curve in curves]
            if colour is None or colour in used:
                colour = min(COLOURS, key=lambda each: (used.count(each), [*self.colours.values()].count(each)))
            self.colours.setdefault(response.design, colour)
            curves.append(replace(response, colour=colour))
        return curves

    def blocks(self) -> str:
        """Return the sections of all results, as HTML; sections of a study have its title."""
        studies: list[tuple[ClaimStudy | None, set[str]]] = [
            (result.record, set(self.results.parts(file))) for file, result in self.results.kinds[CLAIMS].items()
        ]
        unclaimed = set(self.results.by_file).difference(*(files for _, files in studies))
        blocks = []
        for kind, section in sorted(self.known.items(), key=lambda item: item[0] == CLAIMS):  # the claims come last
            if kind == CLAIMS:
                blocks.append(self._common_sections())
            moves = {name: partial(self._put_off, name) for name in _COMMON}
            template = Path(getattr(section, "TEMPLATE", section.__file__)).with_suffix(".html")
            for study, files in [(None, unclaimed), *studies]:
                results = {file: result for file, result in self.results.kinds[kind].items() if file in files}
                if results:
                    name, title, not_ok = (None, "", "") if study is None else (study.study, study.title, study.not_ok)
                    shows = _shown(section, results, replace(self, study=name))
                    of = {"section": shows, "study": name, "title": title, "not_ok": not_ok, **moves}
                    blocks.append(self.environment.from_string(template.read_text(encoding="utf-8")).render(of))
        return "".join(blocks)

    def _put_off(self, section: str, caller: Callable[[], str]) -> str:
        """Store a piece of a template for a common section."""
        self.common[section].append(caller())
        return ""

    def _common_sections(self) -> str:
        """Return the stored pieces, below their headings."""
        sections = ([f"<h2>{_COMMON[name]}</h2>", *pieces] for name, pieces in self.common.items() if pieces)
        return "".join(itertools.chain.from_iterable(sections))


def _shown(section: ReportSection, results: Mapping[str, Result], page: Page) -> Any:
    """Return the data of a section's template."""
    if hasattr(section, "section"):
        return section.section(results, page)
    return [section.shown(file, result.record, page) for file, result in results.items()]


def write_report(results: Results, path: str | Path, title: str | None = None) -> None:
    """Write the page. A picture that cannot be rendered is left out, and the page says so. Raises StoreError."""
    with decoding(*results.records):
        html = _html(results, title)
    with replacing(path) as temporary:
        temporary.write_text(html, encoding="utf-8")


def _html(results: Results, title: str | None) -> str:
    """Return the text of the page."""
    names, by_file = results.names, results.by_file
    origins = Origins(results)
    page = Page(results, sections(), names, origins, _environment(names, origins))
    beginning = summary(results, page)
    blocks, contents = _with_contents(page.blocks())
    scenes = {names[file]: _flat(result.scene) for file, result in by_file.items() if result.scene is not None}
    bodies = any(result.scene["damper"] for result in by_file.values() if result.scene is not None)
    return page.environment.get_template("report.html").render(
        title=title or ("Forced response with loose damper bodies" if bodies else "Vibration of the structure"),
        bodies=bodies,
        origins=origins,
        summary=beginning,
        contents=contents,
        plotly=plotly.offline.get_plotlyjs() if page.charts else None,
        scripts=[(_FOLDER / name).read_text(encoding="utf-8") for name, kind in _SCRIPTS.items() if page.charts[kind]],
        blocks=blocks,
        provenance=_provenance(results),
        scenes=scenes,
        **_compared(scenes),
    )


def _with_contents(blocks: str) -> tuple[str, dict[str, Markup]]:
    """Return sections with an anchor at every heading, and the headings by their anchors."""
    contents: dict[str, Markup] = {}

    def anchored(heading: re.Match[str]) -> str:
        anchor = f"section-{len(contents)}"
        contents[anchor] = Markup(heading[1])
        return f'<h2 id="{anchor}">{heading[1]}</h2>'

    return re.sub("<h2>(.*?)</h2>", anchored, blocks, flags=re.DOTALL), contents


def _environment(names: Mapping[str, str], origins: Origins) -> jinja2.Environment:
    """Return the common tools of all templates: filters, and the macro `plot` of a chart."""
    shared = environment()
    shared.filters |= {"ratio": lambda value: "none" if value is None or not math.isfinite(value) else f"{value:z.3f}"}
    shared.filters["clean"] = without_round_off
    shared.filters["plus_minus"] = lambda error: plus_minus(error or None)  # files before 0.4 have none
    shared.filters["told"] = lambda file: f": {label}" if (label := origins.label(file)) else ""
    shared.filters |= {"name": names.__getitem__, "anchor": lambda file: _anchor(names[file])}
    shared.globals["plot"] = shared.get_template("plot.html").make_module().plot  # type: ignore[attr-defined]
    return shared


def _anchor(name: str) -> str:
    """Return the anchor of the provenance of a file."""
    return "from-" + re.sub(r"\W", "-", name)


def _provenance(results: Results) -> dict[tuple[str, ...], dict[str, str]]:
    """Return the facts of files by the paths that they apply to; facts of the page itself have no path."""
    mine = versions()
    facts = {
        file: {
            key: value
            for key, value in _flat(result.provenance).items()
            if mine.get(key.removeprefix("versions.")) != value
        }
        for file, result in results.by_file.items()
        if result.provenance is not None
    }
    groups = {(): mine, **_by_owners(facts)}
    for file in facts:  # also for files with equal facts
        groups.setdefault((file,), {})["sha256"] = digest(file)
    return groups


def _by_owners(tables: Mapping[str, Mapping[str, str]]) -> dict[tuple[str, ...], dict[str, str]]:
    """Return the entries of tables by the names of all tables with them; the most common ones first."""
    owners: dict[tuple[str, str], tuple[str, ...]] = {}
    for name, table in tables.items():
        for entry in table.items():
            owners[entry] = (*owners.get(entry, ()), name)
    groups: dict[tuple[str, ...], dict[str, str]] = {}
    for (key, value), names in sorted(owners.items(), key=lambda item: -len(item[1])):
        groups.setdefault(names, {})[key] = value
    return groups


def _compared(scenes: Mapping[str, dict[str, str]]) -> dict[str, Any]:
    """Return the common values of all scenes, by key, and the keys in which they differ."""
    keys = dict.fromkeys(key for scene in scenes.values() for key in scene)
    values = {key: [scene.get(key, "") for scene in scenes.values()] for key in keys}
    common = {key: entries[0] for key, entries in values.items() if len(set(entries)) == 1}
    differing = [key for key in keys if key not in common]
    different = {name: {key: scene[key] for key in differing if key in scene} for name, scene in scenes.items()}
    return {"common": common, "differing": differing, "most_columns": _MOST_COLUMNS, "owners": _by_owners(different)}


def _flat(data: Any) -> dict[str, str]:
    """Return nested data as text by dotted path."""
    return {
        path: ", ".join(map(str, value)) if isinstance(value, list | tuple) else format_setting(value)
        for path, value in leaves(data).items() if value != {}
    }  # fmt: skip


def body_note(notes: Mapping[str, Any], scene: Scene | None) -> str | None:
    """Return a sentence on the bodies of a scene; notes: with the advice, as data or as text."""
    advice = notes.get("advice")
    if advice is None:
        sliders = [number for number, damper in enumerate(scene.damper, 1) if not damper.form.planar] if scene else []
        if not scene or not sliders:
            return None
        if len(sliders) < len(scene.damper):
            return _SLIDERS.format(f"Sliders, here body {', '.join(map(str, sliders))}, move")
        return _SLIDERS.format(
            "The body is a slider, which moves" if len(sliders) == 1 else "The bodies are sliders, which move"
        )
    sentence: str = (json.loads(advice) if isinstance(advice, str) else advice)["sentence"]
    return f"Bodies run as {sentence}."
