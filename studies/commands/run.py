"""`vanedamp run`: one scene at one excitation frequency."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from functools import partial
from typing import Any

from vanedamp.studies.commands.support.arguments import add_input, add_json, add_output, count
from vanedamp.studies.terminal import progress

ORDER = 70
SUMMARY = "one scene at one excitation frequency"


def add_arguments(parser: ArgumentParser) -> None:
    """Take a scene, the result files and what to keep."""
    add_input(parser, "SCENE.toml")
    add_output(parser, "RESPONSE.h5")
    add_json(parser)
    parser.add_argument("--events", action="store_true", help="keep the list of events")
    parser.add_argument("--samples", type=count, default=0, metavar="N", help="keep N samples of every period")


def run(arguments: Namespace) -> None:
    """Simulate the scene."""
    from vanedamp.studies.commands.support.messages import write_result
    from vanedamp.studies.commands.support.outputs import RECORD, check_outputs

    outputs = check_outputs(arguments, output=RECORD)
    from vanedamp.studies.commands.support.scenes import load_scene, print_choices, print_resonance

    scene = load_scene(arguments.input, outputs)
    from vanedamp.coupling.engine import simulate
    from vanedamp.coupling.response.response import UNITS
    from vanedamp.files.provenance import versions
    from vanedamp.studies.commands.support.budget import check_run

    check_run(scene, arguments.samples)

    with progress("run") as report:
        response = simulate(scene, arguments.events, arguments.samples, progress=report)
    result = response.to_json(events=arguments.events) | print_resonance(arguments.input, scene)
    print_choices(arguments.input, response.estimate, response.advice, response.warnings)
    files = (
        partial(response.save, arguments.output, {"versions": versions(), "scene": scene.to_dict()})
        if arguments.output
        else None
    )
    write_result(arguments.json, result, files)
    if arguments.json != "-":
        for name, value in result.items():
            if not isinstance(value, dict | list):
                print(f"{name:26} {_format(value)} {UNITS.get(name, '')}".rstrip())


def _format(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
