"""`vanedamp run`: one scene at one excitation frequency."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

from vanedamp.coupling.response.response import UNITS
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.provenance import versions
from vanedamp.studies.commands.support.budget import check_run
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.commands.support.scenes import print_choices, print_resonance
from vanedamp.studies.headline import without_round_off
from vanedamp.studies.sweep_steps import compile_engine
from vanedamp.studies.terminal import progress


def run(arguments: Namespace, scene: Scene) -> None:
    """Simulate the scene."""
    check_run(scene, arguments.samples)

    compile_engine([scene])
    with progress("run") as report:
        response = simulate(scene, arguments.events, arguments.samples, progress=report)
    result = response.to_json(events=arguments.events) | print_resonance(arguments.input, scene)
    print_choices(arguments.input, response.estimate, response.advice, response.warnings)
    lines = [
        f"{name:26} {_format(value, response.amplitude_max if UNITS.get(name) == 'm' else 1.0)} "
        f"{UNITS.get(name, '')}".rstrip()
        for name, value in result.items()
        if not isinstance(value, dict | list)
    ]

    def save(path: str) -> None:
        response.save(path, {"versions": versions(), "scene": scene.to_dict()})

    write_result(arguments, result, lines, output=save)


def _format(value: Any, scale: float) -> str:
    return f"{without_round_off(value, scale):.6g}" if isinstance(value, float) else str(value)
