"""Speed against accuracy: every method on the same scenes; reduced models beside whole meshes."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.methods import full_mesh_comparison, scenes
from benchmarks.methods.charts import FULL, ONE, QUICK, SEED, Chart, Effort
from benchmarks.rows import Rows
from benchmarks.tables import seconds_text, table
from benchmarks.timing import machine
from vanedamp.files.store import write_csv, write_json

__all__ = ["FULL", "QUICK", "Effort", "print_summary", "run_work_precision"]


def run_work_precision(folder: Path, effort: Effort = FULL) -> dict[str, Any]:
    """Measure; write work_precision.json, .csv and a figure into a folder. Returns what the JSON holds."""
    result: dict[str, Any] = {"machine": machine(), "seed": SEED, "effort": asdict(effort), "charts": {}}
    with tempfile.TemporaryDirectory() as temporary:
        charts = _charts(effort, Path(temporary))
        expected = {name: seconds for chart in charts for name, seconds in chart.rows().items()}
        if effort.modes is not None:
            expected |= full_mesh_comparison.LADDER_ROWS
        if effort.curve is not None:
            expected |= full_mesh_comparison.CURVE_ROWS
        rows = Rows(folder, "work-precision", asdict(effort), expected)
        for number, chart in enumerate(charts):
            result["charts"][chart.name] = chart.measure(rows, number)
        if effort.modes is not None:
            result["ladder"] = full_mesh_comparison.ladder(
                Path(temporary), effort.ladder, effort.rounds, SEED, rows.take
            )
        if effort.curve is not None:
            result["curve"] = full_mesh_comparison.curve(Path(temporary), effort.curve, rows.take)
    result["wall_time_s"] = rows.seconds
    write_json(folder / "work_precision.json", result)
    _write_csv(result, folder / "work_precision.csv")
    from benchmarks.methods.figures import work_precision_figure

    work_precision_figure(result, folder / "work_precision.png")
    rows.finish()
    return result


def print_summary(result: Mapping[str, Any]) -> None:
    """Print time a period and error of every method at its middle setting, and where the exact engine is not best."""
    charts = result["charts"]
    methods = dict.fromkeys(point["method"] for chart in charts.values() for point in chart["points"])
    lines = []
    for method in methods:
        setting = _middle(next(chart for chart in charts.values()), method)
        cells = (_cell(chart, method, setting) for chart in charts.values())
        lines.append((f"{method}, {setting:g}" if setting else method, *cells))
    print(table(("time a period, error", *charts), lines))
    for name, chart in charts.items():
        better = chart["dominated_by"]
        print(
            f"{name}: the exact engine is {'on the front' if not better else 'not on the front: ' + ', '.join(better)}"
        )
        for reason in chart["absent"].values():
            print(f"  without {reason}")


def _middle(chart: Mapping[str, Any], method: str) -> float:
    """Return the setting of a method that charts are told by: a tolerance of 1e-4, or 1000 steps, or near it."""
    settings = [point["setting"] for point in chart["points"] if point["method"] == method] or [0.0]
    return float(min(settings, key=lambda setting: abs(setting - (1000 if setting >= 1 else ONE))))


def _cell(chart: Mapping[str, Any], method: str, setting: float) -> str:
    """Return time a period and error of a point, or what its run came to."""
    mine = (point for point in chart["points"] if (point["method"], point["setting"]) == (method, setting))
    point = next(mine, None)
    if point is None:
        return ""
    if point["time"] is None:
        return str(point["status"])
    return f"{seconds_text(point['time']['median'])}, {point['error']:.1e}"


def _charts(effort: Effort, folder: Path) -> list[Chart]:
    """Return the charts: scenes that repeat, and scenes that never do."""
    checked = {"time.periods": effort.checked, "time.transient": 0}
    charts = [
        Chart("periodic 1:1 impact", lambda: scenes.periodic(3000).replace(checked), True, effort),
        Chart("chatter", lambda: scenes.chatter().replace(checked), True, effort),
        Chart("single damper, non-periodic", scenes.single, False, effort),
        Chart("double damper in one cavity, non-periodic", scenes.double, False, effort),
    ]
    modes = effort.modes
    if modes is not None:
        charts.append(Chart("cluster, reduced model", lambda: scenes.Cluster(folder).scene(modes), False, effort))
    return charts


def _write_csv(result: Mapping[str, Any], path: Path) -> None:
    """Write one line a point."""
    names = ("method", "setting", "status", "error", "interval", "floor", "energy_residual", "penetration")
    rows = []
    for scene, chart in result["charts"].items():
        for point in chart["points"]:
            times = point["time"] or {}
            row = [point[name] for name in names] + [times.get(key, "") for key in ("median", "low", "high")]
            rows.append((scene, *("" if value is None else value for value in row)))
    write_csv(path, ("scene", *names, "time_s", "time_low_s", "time_high_s"), rows)
