"""Identification on synthetic truth: recovery, coverage of intervals, engine runs, flat numbers, a wrong model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import chi2

from benchmarks.benchmark import Benchmark, Result, Row
from benchmarks.identification.coverage import rises
from benchmarks.identification.derivative_free import compared
from benchmarks.identification.truth import HELD, NUMBERS, TRUTH, study
from vanedamp.studies.identification.search import identify
from vanedamp.studies.identification.tables import SearchTable

#: data sets of a row of the coverage; seed of the other rows
_CHUNK, _SEED = 10, 10_000
#: rise of the misfit at the ends of an interval of 95 %
THRESHOLD = float(chi2.ppf(0.95, 1))
_RECOVERY, _RUNS, _STUCK, _BLOCK = "all numbers", "engine calls", "body that sticks", "block for a slider"


@dataclass(frozen=True)
class IdentificationBenchmark(Benchmark):
    """Number of data sets whose intervals are compared with the truth; candidates and starts of each search."""

    sets: int
    candidates: int
    starts: int

    NAME = "identification"
    COLUMNS = ("seed", "misfit", *NUMBERS, *(f"rise {path}" for path in NUMBERS))

    def rows(self, folder: Path) -> dict[str, Row]:
        search = SearchTable(self.candidates, self.starts)
        rows = {
            _RECOVERY: Row(60.0, partial(_found, study(_SEED, search=search)), _text),
            _RUNS: Row(120.0, partial(compared, _SEED, self.candidates)),
            _STUCK: Row(20.0, partial(_found, study(_SEED, stuck=True, search=search, numbers=HELD)), _text),
            _BLOCK: Row(60.0, partial(_found, study(_SEED, block=True, search=search)), _text),
        }
        for first in range(0, self.sets, _CHUNK):
            seeds = range(first, min(first + _CHUNK, self.sets))
            rows[f"data sets {seeds[0]} to {seeds[-1]}"] = Row(8.0 * len(seeds), partial(rises, seeds))
        return rows

    def result(self, values: Mapping[str, Any]) -> Result:
        sets = [one for name, rows in values.items() if name.startswith("data sets") for one in rows]
        inside = np.array([one["rise"] for one in sets]) <= THRESHOLD
        share = dict(zip(NUMBERS, inside.mean(axis=0).tolist(), strict=True))
        others = {name: values[name] for name in (_RECOVERY, _RUNS, _STUCK, _BLOCK)}
        return {"truth": TRUTH.tolist(), "coverage": share, "sets": sets} | others

    def lines(self, result: Mapping[str, Any]) -> Iterable[Sequence[Any]]:
        """Return a line per data set."""
        return ((one["seed"], one["misfit"], *one["best"], *one["rise"]) for one in result["sets"])

    def summary(self, result: Mapping[str, Any]) -> Iterator[str]:
        """Yield coverage, recovery, engine calls, flat numbers and the misfit of a wrong model."""
        count = len(result["sets"])
        for path, share in result["coverage"].items():
            error = 1.96 * np.sqrt(0.95 * 0.05 / count)
            yield f"{path:24} covered in {share:.1%} of {count} data sets (95 % +- {error:.1%} by chance)"
        for name in (_RECOVERY, _STUCK, _BLOCK):
            yield f"{name}: {_text(result[name])}"
        runs = result[_RUNS]
        ours = runs["ours"]["calls"]
        for name in ("nelder_mead", "differential_evolution"):
            other = runs[name]
            until = "to the same misfit" if other["reached"] else f"without reaching it ({other['misfit']:.3g})"
            share = ours / other["calls"]
            yield f"{name}: {other['calls']} engine calls {until}; with derivatives {ours} ({share:.3f})"


FULL = IdentificationBenchmark(300, 128, 3)
QUICK = IdentificationBenchmark(2, 128, 1)


def _found(sought: Any) -> dict[str, Any]:
    found = identify(sought)
    return {
        "status": found.status.value, "notes": list(found.notes), "best": found.best.tolist(),
        "interval": found.interval.tolist(), "flat": list(found.flat), "test": found.test._asdict(),
        "counts": dict(found.counts), "sentence": found.sentence,
    }  # fmt: skip


def _text(found: Mapping[str, Any]) -> str:
    test = found["test"]
    return f"{found['status']}, misfit {test['squares']:.3g} of {test['freedom']}; {found['sentence']}"
