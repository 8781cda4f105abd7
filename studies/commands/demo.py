"""`vanedamp demo`: the whole pipeline on the shipped mesh."""

from __future__ import annotations

from argparse import Namespace

from vanedamp.studies.demo.demo import PIPELINE, run_demo
from vanedamp.studies.pipeline.pipeline import adopt


def run(arguments: Namespace) -> None:
    """Run the demonstration."""
    folder = arguments.folder
    run_demo(folder, arguments.workers, arguments.rigid)
    adopt(folder / PIPELINE)
