"""`vanedamp run`: one scene at one excitation frequency."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from typing import Any

from vanedamp.coupling.exponents.lyapunov import lyapunov
from vanedamp.coupling.response.response import Response, Status, units
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.provenance import versions
from vanedamp.files.reference import field_docstrings
from vanedamp.files.toml_input import InputError
from vanedamp.studies.commands.support.budget import check_run
from vanedamp.studies.commands.support.messages import wear_lines, write_result
from vanedamp.studies.commands.support.scenes import print_choices, print_resonance
from vanedamp.studies.headline import without_round_off
from vanedamp.studies.sweep_steps import compile_engine
from vanedamp.studies.terminal import progress


def run(arguments: Namespace, scene: Scene) -> None:
    """Simulate the scene, or all samples of its ranges."""
    if scene.ranges:
        # loads pools of processes, which a single run does not use
        from vanedamp.studies.commands.support.ensembles import run_at_one_frequency

        run_at_one_frequency(arguments, scene)
        return
    check_run(scene, arguments.samples)

    compile_engine([scene])
    with progress("run") as report:
        response = simulate(
            scene, arguments.events, arguments.samples, progress=report, moved_start=not arguments.no_moved_start
        )
    if arguments.exponents is not None:
        response = replace(response, lyapunov=_exponents(scene, arguments.exponents, response))
    result = response.to_json(events=arguments.events) | print_resonance(arguments.input, scene)
    print_choices(arguments.input, response.estimate, response.advice, response.warnings)
    of = units()
    lines = [
        f"{name:26} {_format(value, response.amplitude_max if of.get(name) == 'm' else 1.0)} "
        f"{of.get(name, '')}".rstrip()
        for name, value in result.items()
        if not isinstance(value, dict | list)
    ]
    lines += [f"{'stress':26} {spot.sentence}" for spot in response.stress or ()]
    if (found := response.lyapunov) is not None:
        lines.append(
            f"{'motion':26} {found['motion']}: largest exponent {found['exponent']:.4g} +- {found['confidence']:.2g} "
            f"1/s, {found['exponent_per_period']:.4g} per period ({found['status']}, {found['periods']} periods)"
        )
    if response.sectors is not None:
        lines.append(f"{'sectors':26} {response.sectors.sentence}")
    lines += [f"{'contact':26} {contact.sentence}" for contact in response.contacts or ()]
    lines += wear_lines(response)
    if response.status is not Status.OK:  # last, where a reader looks
        lines.append(f"status {response.status}: {field_docstrings(Status)[response.status.name]}")

    def save(path: str) -> None:
        response.save(path, {"versions": versions(), "scene": scene.to_dict()})

    write_result(arguments, result, lines, output=save)


def _exponents(scene: Scene, periods: int, response: Response) -> dict[str, Any]:
    """Return the Lyapunov exponents of the motion from the end of a run. Raises InputError for one that ended early."""
    if response.final is None:
        raise InputError(f"--exponents: the run ends early ({response.status}); leave the option out")
    with progress("exponents") as report:
        return lyapunov(scene, periods, response.final, report).to_json()


def _format(value: Any, scale: float) -> str:
    return f"{without_round_off(value, scale):.6g}" if isinstance(value, float) else str(value)
