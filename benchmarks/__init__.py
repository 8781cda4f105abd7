"""Benchmarks of `vanedamp bench`: each folder here is one, and other packages add theirs.

A benchmark is a package (or any module) with

    SUMMARY             what it measures, in a line of --help without a full stop
    run(folder, quick)  measure, write results and figures into a folder, print a summary; quick: in seconds, roughly
    NAME                if it is not the folder's
    ORDER               place in --help

Import what is heavy inside `run`. Measure in `rows.Rows`: they are announced, printed as they come, and gone on
from after a stop. What several benchmarks need is in the files of this folder.
"""

from __future__ import annotations

from pathlib import Path

from vanedamp.files.extensions import ExtensionPoint

#: the case of the shipped mesh
CLUSTER_CASE = Path(__file__).with_name("cluster_case.toml")

BENCHMARKS = ExtensionPoint("benchmark", "benchmarks", "vanedamp.benchmarks", ("SUMMARY", "run"), folders=True)
