"""Scaling of sweeps: efficiency, memory, what handing out costs, and what limits many workers; short scenes.

Efficiency is time of one process over processes times their time, in turns. By the clock it suffers from whatever else
the machine does; so it is also taken from seconds of the processors: what one process needs, over processes times the
longer of the busiest worker's share and everybody's mean share. That is what the clock would show on a machine that
does nothing else. `busy` is the share of the workers' time in which they had a task.
"""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.apart import run_module
from benchmarks.benchmark import Benchmark, Result
from benchmarks.methods.peers import PEERS, version
from benchmarks.rows import Rows
from benchmarks.sweep.simulation import Costs, simulated
from benchmarks.sweep.worker import Job, scene
from benchmarks.timing import format_spread, spread
from vanedamp.coupling.sweep.checkpoint import SweepCheckpoint
from vanedamp.files.store import write_json
from vanedamp.studies.jobs.workers import available_cores

TARGET, MOST_MB = 0.95, 120
_MODULE = "benchmarks.sweep.worker"
_COLUMNS = (
    "executor", "points", "periods", "workers", "wall_s", "main_cpu_s", "worker_cpu_s", "tasks", "task_s",
    "main_peak_bytes", "worker_peak_bytes", "worker_own_bytes", "file_bytes", "load",
)  # fmt: skip
#: measures of efficiency, in words
EFFICIENCIES = {
    "clock": "parallel efficiency by the clock",
    "processor": "parallel efficiency by the processor",
    "busy": "share of the time with a task",
}
_EXECUTORS = {"pool": "process pool", "dask": "dask", "mpi": "mpi4py"}
_RANKS = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1", "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
}  # fmt: skip
_SHORT = "many short scenes"
#: points of a task when handing out is measured: two counts, for the cost of a task and of a point
_PER_TASK = (20, 200)
_SEED = 20_260_101


@dataclass(frozen=True)
class SweepScaling(Benchmark):
    """Scenes of a sweep and their periods.

    compared: those that one process and all cores run in turns, `rounds` times; sizes: further sweeps on all cores;
    others: with dask and MPI; tasks: handed out to find what that costs; timed: single scenes; simulated: numbers of
    workers, and scenes for each of them; short: scenes and periods that one core also runs by heyoka.
    """

    compared: tuple[int, int]
    rounds: int
    sizes: tuple[tuple[int, int], ...]
    others: tuple[int, int]
    tasks: int
    timed: int
    simulated: tuple[int, ...]
    each: int
    short: tuple[int, int]

    NAME = "sweep"
    CLOCK = "CPU time of the processes"
    COLUMNS = (*_COLUMNS, "scenes_per_second")

    @property
    def cores(self) -> int:
        """Workers of a sweep on all cores."""
        return max(2, available_cores())

    def expected(self, folder: Path) -> dict[str, float]:
        found = {
            f"{_name(job)}, round {turn + 1}": _seconds(job)
            for turn in range(self.rounds) for job in self.pair(turn)
        } | {_name(job): _seconds(job) for job in self.sizes_on(folder)}  # fmt: skip
        for executor, title in _EXECUTORS.items():
            found |= {_name(job): _seconds(job) for job in self.on(executor)} | {f"{title}, handing out": 10.0}
        found |= {_SHORT: 0.03 * self.short[0], "checkpoint": 3.0, "single scenes": 8.0}
        return found | {f"{n}, simulated": 5.0 for n in _EXECUTORS.values()}

    def pair(self, turn: int) -> list[Job]:
        """Return the same sweep in one process and on all cores, in the order of a round."""
        jobs = [Job("sweep", *self.compared, count, "") for count in (1, self.cores)]
        return jobs if turn % 2 == 0 else jobs[::-1]

    def sizes_on(self, folder: Path) -> list[Job]:
        """Return the further sweeps on all cores. Each keeps what is done beside the rows, and resumes from there."""
        return [
            Job("sweep", points, periods, self.cores, str(folder / f"bench_sweep_{points}.files"))
            for points, periods in self.sizes
        ]

    def on(self, executor: str) -> list[Job]:
        """Return the sweeps with an executor, on one and two workers."""
        return [Job("sweep", *self.others, count, "", executor) for count in (1, 2)]

    def measure(self, rows: Rows) -> Result:
        result: Result = {
            "periods": self.compared[1], "workers": self.cores, "target": TARGET,
            "pairs": [_pair(rows, self.pair(turn), turn) for turn in range(self.rounds)], "sizes": [],
        }  # fmt: skip
        for job in self.sizes_on(rows.folder):
            result["sizes"].append(rows.take(_name(job), partial(_run, job), tell=_tell_sweep))
            shutil.rmtree(job.folder, ignore_errors=True)
        result["executors"] = _executors(rows, self)
        result["short"] = _short(rows, self)
        result["checkpoint"] = rows.take("checkpoint", _checkpoint, tell=_tell_checkpoint)
        timed = Job("points", self.timed, self.compared[1], 1, "")
        result["point_s"] = rows.take("single scenes", lambda: _run(timed)["seconds"], tell=_tell_points)
        result["simulated"] = _simulations(rows, self, result)
        result["checks"] = _checks(result)
        result["efficiency"] = {
            name: spread(np.array([pair["efficiency"][name] for pair in result["pairs"]])) for name in EFFICIENCIES
        }
        return result | {"overhead": spread(np.array([_overhead(entry) for entry in result["sizes"]]))}

    def lines(self, result: Mapping[str, Any]) -> Iterator[Sequence[Any]]:
        """Yield a line a sweep."""
        entries = [entry for pair in result["pairs"] for entry in (pair["one"], pair["all"])] + result["sizes"]
        for entry in entries + [entry for found in result["executors"].values() for entry in found["sweeps"]]:
            yield *(_flat(entry[name]) for name in _COLUMNS), _speed(entry)

    def draw(self, result: Mapping[str, Any], folder: Path) -> None:
        from benchmarks.sweep.figures import sweep_figure

        sweep_figure(result, folder / "bench_sweep.png")

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield efficiency, memory and limits against their targets."""
        pairs = result["pairs"]
        points, workers = pairs[0]["all"]["points"], result["workers"]
        yield f"{points} scenes of {result['periods']} periods, {workers} workers and one process in turns:"
        for name, values in result["efficiency"].items():
            yield f"  {EFFICIENCIES[name]:38} {format_spread(values)}  target {result['target']}"
        most = max(pair["all"]["worker_peak_bytes"] for pair in pairs)
        yield f"  memory of a worker with its part of the server {most / 1e6:.0f} MB  target {MOST_MB} MB"
        yield f"  share of the main process in the processors' time {format_spread(result['overhead'])}"
        yield from _short_lines(result["short"])
        for check in result["checks"]:
            yield (
                f"  {_EXECUTORS[check['executor']]}, {check['workers']} workers, {check['points']} scenes: time with a "
                f"task {check['measured']:.3f} measured, {check['simulated']:.3f} simulated"
            )
        for name, runs in result["simulated"].items():
            least = next((run["workers"] for run in runs if run["efficiency"] < TARGET), None)
            text = f"up to {runs[-1]['workers']} workers" if least is None else f"below {least} workers"
            yield f"  {_EXECUTORS[name]}, simulated: {TARGET} of ideal {text}"
        yield f"load of the machine at the beginning: {result['machine']['load']:.1f}"


FULL = SweepScaling(
    (10_000, 1500), 3, ((1_000, 200), (100_000, 200), (1_000_000, 5)), (4000, 1500), 400, 300,
    (1, 2, 8, 64, 256, 1000, 4000), 1000, (1000, 50),
)  # fmt: skip
QUICK = SweepScaling((200, 300), 1, ((400, 20),), (100, 300), 40, 20, (1, 2, 1000), 200, (100, 50))


def _seconds(job: Job) -> float:
    return 4.0 + job.points * (1e-5 + 1.6e-6 * job.periods) / job.workers


def _name(job: Job) -> str:
    by = "one process" if job.workers == 1 and job.executor == "pool" else f"{job.workers} workers"
    by = by if job.executor == "pool" else f"{_EXECUTORS[job.executor]}, {job.workers} workers"
    return f"{job.points} scenes of {job.periods} periods, {by}"


def _pair(rows: Rows, jobs: Sequence[Job], turn: int) -> dict[str, Any]:
    """Run the same sweep in one process and on all cores."""
    runs = {
        job.workers: rows.take(f"{_name(job)}, round {turn + 1}", partial(_run, job), tell=_tell_sweep) for job in jobs
    }
    one, many = runs[1], runs[max(runs)]
    return {"one": one, "all": many, "efficiency": _efficiency(one, many)}


def _executors(rows: Rows, effort: SweepScaling) -> dict[str, dict[str, Any]]:
    """Measure every executor that is there: sweeps on one and two workers, and what handing out costs."""
    found: dict[str, dict[str, Any]] = {}
    for executor, title in _EXECUTORS.items():
        jobs = effort.on(executor)
        if (reason := _missing(executor)) is not None:
            for name in (*map(_name, jobs), f"{title}, handing out", f"{title}, simulated"):
                rows.leave_out(name, reason)
            continue
        sweeps = [rows.take(_name(job), partial(_run, job), tell=_tell_sweep) for job in jobs]
        handing = rows.take(f"{title}, handing out", partial(_handing_out, executor, effort.tasks), tell=_tell_tasks)
        found[executor] = {"sweeps": sweeps, "costs": handing}
    return found


def _short(rows: Rows, effort: SweepScaling) -> dict[str, Any]:
    """Measure many short scenes on one core, by heyoka too where it is installed."""
    job, installed = Job("short", *effort.short, 1, ""), version("heyoka")
    inputs = asdict(effort) | {"heyoka": installed}
    found: dict[str, Any] = rows.take(_SHORT, partial(_run, job), inputs=inputs, tell=_tell_short)
    return found | {"heyoka": installed}


def _short_lines(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield scenes per second on one core, and how heyoka compares."""
    yield f"{_SHORT}, {found['points']} of {found['periods']} periods, one core, scenes per second:"
    for name, speed in found["scenes_per_second"].items():
        text = f"  {name:38} {speed['median']:8.0f}  ({speed['low']:.0f} to {speed['high']:.0f})"
        if name in found["ratio"]:
            text += (
                f"; vd.sweep over it {format_spread(found['ratio'][name]).strip()}, states within "
                f"{found['difference'][name]:.1e}, other impacts in {found['scenes_with_other_impacts'][name]} scenes"
            )
        yield text
    if found["heyoka"] is None:
        yield f"  heyoka: not installed; {PEERS['heyoka'].remedy}"


def _missing(executor: str) -> str | None:
    if executor == "dask" and find_spec("distributed") is None:
        return "distributed is not installed"
    if executor == "mpi" and (find_spec("mpi4py") is None or shutil.which("mpirun") is None):
        return "mpi4py or mpirun is not installed"
    return None


def _handing_out(executor: str, tasks: int) -> dict[str, float]:
    """Return the main process's time for a task and for each of its points, s, from tasks of two sizes."""
    found = []
    for count in _PER_TASK:
        job = Job("tasks", tasks * count, 5, 2, "", executor, count)
        found.append(_run(job))
    matrix = np.array([[entry["tasks"], entry["points"]] for entry in found], float)
    task, point = np.linalg.solve(matrix, [entry["main_cpu_s"] for entry in found])
    return {"task": max(float(task), 0.0), "point": max(float(point), 0.0)}


def _checkpoint() -> dict[str, float]:
    """Return the time of writing a checkpoint, s: of any, and of each of its points; and bytes of a point."""
    rng, sizes, times, files = np.random.default_rng(_SEED), (1000, 300_000), [], []
    with tempfile.TemporaryDirectory() as folder:
        for size in sizes:
            made, path = scene(size, 5), Path(folder, f"{size}.partial")
            kept = SweepCheckpoint(path, made, size, {})
            kept.finished.put(
                np.arange(size), rng.normal(size=kept.finished.values.shape), np.zeros((size, 2), int), ["ok"]
            )
            took = []
            for _ in range(5):
                kept._unsaved = True
                started = time.perf_counter()
                kept.write()
                took.append(time.perf_counter() - started)
            times.append(min(took))
            files.append(path.stat().st_size)
    point, of_file = (float(np.diff(pair)[0] / np.diff(sizes)[0]) for pair in (times, files))
    return {"write": max(times[0] - sizes[0] * point, 0.0), "write_point": max(point, 0.0), "bytes_point": of_file}


def _simulations(rows: Rows, effort: SweepScaling, result: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Simulate each executor that was measured, for growing numbers of workers."""
    found = {}
    for executor, measured in result["executors"].items():
        kept = result["checkpoint"]
        costs = Costs(**measured["costs"], write=kept["write"], write_point=kept["write_point"])
        inputs = asdict(effort) | {"costs": costs._asdict(), "points": result["point_s"]}
        found[executor] = rows.take(
            f"{_EXECUTORS[executor]}, simulated", partial(_growing, effort, result["point_s"], costs),
            inputs=inputs, tell=_tell_simulated,
        )  # fmt: skip
    return found


def _checks(result: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the share of the time in which workers have a task, as measured and as simulated, of every sweep."""
    found = []
    for executor, measured in result["executors"].items():
        kept = result["checkpoint"]
        costs = Costs(**measured["costs"], write=kept["write"], write_point=kept["write_point"])
        for entry in [*measured["sweeps"], *(pair["all"] for pair in result["pairs"] if executor == "pool")]:
            if not entry["tasks"]:  # in one process
                continue
            seconds = np.full(entry["points"], entry["task_s"] / entry["points"])
            found.append({
                "executor": executor, "workers": entry["workers"], "points": entry["points"],
                "measured": entry["task_s"] / (entry["workers"] * entry["wall_s"]),
                "simulated": simulated(entry["workers"], seconds, costs).efficiency,
            })  # fmt: skip
    return found


def _growing(effort: SweepScaling, seconds: Sequence[float], costs: Costs) -> list[dict[str, Any]]:
    found = []
    for workers in effort.simulated:
        rng = np.random.default_rng([_SEED, workers])
        run = simulated(workers, rng.choice(np.array(seconds), effort.each * workers), costs)
        found.append(run._asdict() | {"limit": run.limit})
    return found


def _efficiency(one: Mapping[str, Any], many: Mapping[str, Any]) -> dict[str, float]:
    count = many["workers"]
    everybody = (sum(many["worker_cpu_s"]) + many["main_cpu_s"]) / count
    return {
        "clock": one["wall_s"] / (count * many["wall_s"]),
        "processor": one["main_cpu_s"] / (count * max(everybody, *many["worker_cpu_s"])),
        "busy": many["task_s"] / (count * many["wall_s"]),
    }


def _overhead(many: Mapping[str, Any]) -> float:
    """Return the share of all processor time that handing out, collecting and writing take."""
    own: float = many["main_cpu_s"]
    return own / (own + sum(many["worker_cpu_s"]))


def _run(job: Job) -> dict[str, Any]:
    """Run a job in a process of its own, one thread a process."""
    with tempfile.TemporaryDirectory() as folder:
        files = Path(job.folder or folder)
        files.mkdir(parents=True, exist_ok=True)
        orders, answer = Path(folder, "job.json"), Path(folder, "result.json")
        write_json(orders, asdict(replace(job, folder=str(files.resolve()))))
        ranks = ["mpirun", "-n", str(job.workers + 1)] if job.executor == "mpi" else []
        done = run_module(_MODULE, str(orders), str(answer), threads=1, launcher=ranks, variables=_RANKS)
        done.check_returncode()
        result: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    return result


def _speed(entry: Mapping[str, Any]) -> float:
    return float((entry["points"] - entry["resumed"]) / entry["wall_s"])


def _tell_sweep(entry: Mapping[str, Any]) -> str:
    text = (
        f"{entry['wall_s']:.1f} s, {_speed(entry):.1f} scenes/s; main process {entry['main_peak_bytes'] / 1e6:.0f} MB"
    )
    if entry["worker_cpu_s"]:
        busy = entry["task_s"] / (entry["workers"] * entry["wall_s"])
        text += f", a worker {entry['worker_peak_bytes'] / 1e6:.0f} MB; workers busy {busy:.3f}"
    return f"{text}; file {entry['file_bytes'] / 1e6:.2f} MB"


def _tell_short(found: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name}: {speed['median']:.0f} scenes/s" for name, speed in found["scenes_per_second"].items()
    )  # fmt: skip


def _tell_tasks(costs: Mapping[str, float]) -> str:
    return f"{1e6 * costs['task']:.0f} us a task, {1e6 * costs['point']:.1f} us a point"


def _tell_checkpoint(kept: Mapping[str, float]) -> str:
    return (
        f"{1e3 * kept['write']:.1f} ms a write, {1e6 * kept['write_point']:.2f} us and {kept['bytes_point']:.0f} bytes "
        "a point"
    )


def _tell_points(seconds: Sequence[float]) -> str:
    low, median, high = np.quantile(seconds, (0.0, 0.5, 1.0))
    return f"{1e3 * low:.1f}, {1e3 * median:.1f}, {1e3 * high:.1f} ms (least, median, most)"


def _tell_simulated(runs: Sequence[Mapping[str, Any]]) -> str:
    return ", ".join(f"{run['workers']}: {run['efficiency']:.3f}{_because(run['limit'])}" for run in runs)


def _because(limit: str) -> str:
    return "" if limit == "nothing" else f" ({limit})"


def _flat(value: Any) -> Any:
    return " ".join(f"{item:.3f}" for item in value) if isinstance(value, list) else value
