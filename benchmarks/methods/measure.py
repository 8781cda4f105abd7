"""Speed against accuracy: every method on the same scenes; reduced models beside whole meshes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.benchmark import Benchmark, Result
from benchmarks.methods import full_mesh_comparison, scenes
from benchmarks.methods.charts import ONE, SEED, Chart, Settings
from benchmarks.methods.full_mesh_comparison import CurveEffort
from benchmarks.rows import Rows
from benchmarks.tables import seconds_text, table

_POINT = ("method", "setting", "status", "error", "steady", "interval", "floor", "energy_residual", "penetration")


@dataclass(frozen=True)
class WorkPrecision(Settings, Benchmark):
    """Charts, the model ladder and the damped curve of a whole mesh."""

    NAME = "work-precision"
    FILES = "work_precision"
    COLUMNS = ("scene", *_POINT, "time_s", "time_low_s", "time_high_s")

    def expected(self, folder: Path) -> dict[str, float]:
        expected = {name: seconds for chart in self.charts(folder) for name, seconds in chart.rows().items()}
        expected |= full_mesh_comparison.LADDER_ROWS if self.modes is not None else {}
        return expected | (full_mesh_comparison.CURVE_ROWS if self.curve is not None else {})

    def charts(self, folder: Path) -> list[Chart]:
        """Return the charts: scenes that repeat, and scenes that never do. folder: of the cluster's model."""
        checked, modes = {"time.periods": self.checked, "time.transient": 0}, self.modes
        charts = [
            Chart("periodic 1:1 impact", lambda: scenes.periodic(3000).replace(checked), True, self),
            Chart("chatter", lambda: scenes.chatter().replace(checked), True, self),
            Chart("single damper, non-periodic", scenes.single, False, self),
            Chart("double damper in one cavity, non-periodic", scenes.double, False, self),
        ]
        if modes is not None:
            charts.append(Chart("cluster, reduced model", lambda: scenes.Cluster(folder).scene(modes), False, self))
        return charts

    def measure(self, rows: Rows) -> Result:
        with tempfile.TemporaryDirectory() as home:
            folder, charts = Path(home), self.charts(Path(home))
            result: Result = {"seed": SEED, "charts": {c.name: c.measure(rows, n) for n, c in enumerate(charts)}}
            if self.modes is not None:
                result["ladder"] = full_mesh_comparison.ladder(folder, self.ladder, self.rounds, SEED, rows.take)
            if self.curve is not None:
                result["curve"] = full_mesh_comparison.curve(folder, self.curve, rows.take)
        return result

    def lines(self, result: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
        """Yield a line a point."""
        for scene, chart in result["charts"].items():
            for point in chart["points"]:
                times = point["time"] or {}
                values = [point[name] for name in _POINT] + [times.get(key) for key in ("median", "low", "high")]
                yield scene, *values

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        from benchmarks.methods.figures import work_precision_figure

        work_precision_figure(result, folder / "work_precision.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield time per period and error of every method at its middle setting, and where the exact engine is best.

        Then the errors of the steady response, all methods and settings.
        """
        charts = result["charts"]
        methods = dict.fromkeys(point["method"] for chart in charts.values() for point in chart["points"])
        lines = []
        for method in methods:
            setting = _middle(next(chart for chart in charts.values()), method)
            cells = (_cell(chart, method, setting) for chart in charts.values())
            lines.append((f"{method}, {setting:g}" if setting else method, *cells))
        yield table(("time per period, error of the steady response", *charts), lines)
        for name, chart in charts.items():
            better = chart["dominated_by"]
            yield f"{name}: the exact engine is {'not ' if better else ''}on the front" + (
                f": {', '.join(better)}" if better else ""
            )
            yield from (f"  without {reason}" for reason in chart["absent"].values())
        yield table(("error of the steady response", *charts), _steady_lines(charts))


FULL = WorkPrecision(
    3, (100, 300, 1000, 3000, 10_000), (1e-4, 1e-6, 1e-8, 1e-10), 10, 2000, 30_000, 400, 1e8, 100_000, 10,
    (0, 1, 2, 4, 7, 10, 15, 20), (300, 1000), 500, CurveEffort(),
)  # fmt: skip
QUICK = WorkPrecision(2, (100, 1000), (1e-4, 1e-8), 3, 200, 600, 40, 1e6, 50_000, None, (), (300,), 100)


def _steady_lines(charts: Mapping[str, Any]) -> Iterator[Sequence[str]]:
    """Yield the errors of the steady response of a method at a setting in every chart, or why there is none."""
    found: dict[tuple[str, float], dict[str, str]] = {}
    for name, chart in charts.items():
        for point in chart["points"]:
            status = point["status"] if point["status"] != "ok" or point["error"] is None else "fails later"
            text = status if point["steady"] is None else f"{point['steady']:.1e}"
            found.setdefault((point["method"], point["setting"]), {})[name] = text
    for (method, setting), texts in found.items():
        yield f"{method}, {setting:g}" if setting else method, *(texts.get(name, "") for name in charts)


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
    steady = "fails later" if point["steady"] is None else f"{point['steady']:.1e}"
    return f"{seconds_text(point['time']['median'])}, {steady}"
