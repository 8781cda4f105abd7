"""Speed against accuracy: every method on the same scenes; reduced models beside whole meshes."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from vanedamp.files.store import write_csv, write_json
from vanedamp.studies.bench.methods import full_mesh_comparison, scenes
from vanedamp.studies.bench.methods.charts import FULL, QUICK, SEED, Chart, Effort
from vanedamp.studies.bench.rows import Rows
from vanedamp.studies.bench.timing import machine

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
    from vanedamp.studies.bench.methods.figures import work_precision_figure

    work_precision_figure(result, folder / "work_precision.png")
    rows.finish()
    return result


def print_summary(result: Mapping[str, Any]) -> None:
    """Print for every chart whether the exact engine is on its Pareto front."""
    for name, chart in result["charts"].items():
        better = chart["dominated_by"]
        print(
            f"{name}: the exact engine is {'on the front' if not better else 'not on the front: ' + ', '.join(better)}"
        )


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
