"""Benchmarks of `vanedamp bench`: each folder here is one, and other packages add theirs.

A benchmark is a package (or any module) with

    SUMMARY             what it measures, in a line of --help without a full stop
    run(folder, quick)  measure, write results and figures into a folder, print a summary; quick: in seconds, roughly
    NAME                if it is not the folder's
    ORDER               place in --help

Ours derive from `benchmark.Benchmark` in a module of the folder, which `running` imports when it runs; the module has
two of them, FULL and QUICK. What several benchmarks need is in the files of this folder.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from vanedamp.files.extensions import ExtensionPoint

#: the case of the shipped mesh
CLUSTER_CASE = Path(__file__).with_name("cluster_case.toml")

BENCHMARKS = ExtensionPoint("benchmark", "benchmarks", "vanedamp.benchmarks", ("SUMMARY", "run"), folders=True)


def running(*modules: str) -> Callable[[Path, bool], None]:
    """Return the `run` of benchmarks in modules: all are announced before the first begins."""

    def run(folder: Path, quick: bool) -> None:
        chosen = [getattr(import_module(module), "QUICK" if quick else "FULL") for module in modules]
        for benchmark, rows in [(benchmark, benchmark.announced(folder)) for benchmark in chosen]:
            benchmark.print_summary(benchmark.run(folder, rows))

    return run
