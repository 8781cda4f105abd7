"""What a study requires of its scene, its variables and its tolerances, before anything runs."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from vanedamp.coupling.model_order.choices import leaves_open
from vanedamp.coupling.scene.paths import namesake, places
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Prescribed, Rom
from vanedamp.coupling.system.linear_response import linear_amplitudes
from vanedamp.coupling.system.transient import left_over, settled_after, timed
from vanedamp.files.toml_input import InputError
from vanedamp.studies.band import drive
from vanedamp.studies.numbers import check_number
from vanedamp.studies.optimisation.changes import Width
from vanedamp.studies.optimisation.tables import Optimise

#: longest transient that is proposed, in periods
_MOST_PERIODS = 10_000_000
#: relative difference of amplitudes without bodies that a variable does not change
_SAME = 1e-9
#: tables that runs do not feel, besides those of no scene
_OTHERS = ("ring_down", "initial")


def check_scene(scene: Scene, table: Optimise) -> None:
    """Raise InputError for a scene of which there are no designs to compare."""
    variables = table.variables
    if isinstance(scene.structure, Prescribed):
        raise InputError('structure: a prescribed motion is not damped; take model = "rigid" or "rom"')
    if isinstance(scene.structure, Rom) and scene.structure.modes == "auto":
        raise InputError("structure.modes: name a number, so that all designs are compared on one model")
    if leaves_open(scene):
        raise InputError("damper.shape: name one, so that all designs are compared on one model")
    if not scene.damper and {"mass_ratio", "gap_ratio", "bodies"} & set(variables.all):
        raise InputError("damper: missing; the first one says what the bodies are like")
    if variables.mass_ratio is not None and any(body.inertia is not None for body in scene.damper):
        raise InputError(
            "damper.inertia: does not follow the mass, which mass_ratio changes; leave it out, or vary other numbers "
            'with optimise.variables, such as "damper.friction"'
        )
    if scene.excitation.base_acceleration:
        raise InputError(
            "excitation.base_acceleration: name force or resonance_amplitude, the level that is to be damped"
        )


def check_settled(scene: Scene, band: np.ndarray) -> None:
    """Raise InputError where runs would be evaluated before the structure's own transient has ended.

    Bodies may end it sooner, but those that do are not the best ones for that.
    """
    ends = [timed(scene.replace(drive(scene, float(frequency)))) for frequency in (band[0], band[-1])]
    if scene.time.steady == "auto":
        return
    left, dropped = max((left_over(end, end.time.dropped), end.time.dropped) for end in ends)
    if left > scene.time.tolerance:
        enough = max(settled_after(end, range(dropped, _MOST_PERIODS)) for end in ends)
        raise InputError(
            f"time.transient: {dropped} periods leave {min(left, 1.0):.2g} of the structure's own transient, so that "
            f'designs cannot be compared; give transient = {enough} and more periods in all, or steady = "auto"'
        )


def check_variables(scene: Scene, table: Optimise, band: np.ndarray, axes: Iterable[str]) -> None:
    """Raise InputError for a path that cannot vary in a scene of designs. band: (f,) Hz; axes: of the [sweep] table."""
    where, given = "optimise.variables", table.variables.numbers
    known = {"damper.mass": "mass_ratio", "cavity.gap": "gap_ratio"}
    fixed = {path: f"{name} as well" for path, name in known.items() if name in table.variables.all}
    fixed |= dict.fromkeys(drive(scene, float(band[0])), "the band")
    fixed |= dict.fromkeys(axes, "an axis of [sweep]")
    undamped = linear_amplitudes(scene, band)[0]
    for place, (path, number) in enumerate(given.items()):
        check_number(scene, path, ends := (number.min, number.max), where, _OTHERS)
        _check_alone(scene, path, fixed, list(given)[:place], where)
        found = [linear_amplitudes(scene.replace({path: end}), band)[0] for end in ends] if table.linear else []
        if any(np.any(np.abs(each - undamped) > _SAME * undamped) for each in found):
            raise InputError(
                f"{where}: {path} changes the amplitude without bodies, with which designs are compared; take a number "
                "of bodies, cavities, stops or friction dampers, or give it a tolerance"
            )


def check_tolerances(scene: Scene, table: Optimise, widths: dict[str, Width]) -> None:
    """Raise InputError for a tolerance of what a scene of designs does not have, and for two of one number."""
    where, data, fixed = "optimise.tolerances", scene.to_dict(), dict[str, str]()
    for name, width in widths.items():
        if name == width.path:
            for path in places(data, name):
                check_number(scene, path, (), where, _OTHERS)
            _check_alone(scene, name, fixed | dict.fromkeys(drive(scene, scene.frequency), "the band"), (), where)
        if not places(data, width.path):
            raise InputError(f"{where}: {name}: the scene has no {width.path.split('.')[0]}")
        fixed[width.path] = name if name != width.path else "another path"


def _check_alone(scene: Scene, path: str, fixed: dict[str, str], others: Iterable[str], where: str) -> None:
    """Raise InputError for a path whose number something else says. fixed: what, by its path; others: paths."""
    data = scene.to_dict()
    if (other := namesake(data, path, fixed)) is not None:
        raise InputError(f"{where}: {path} is given by {fixed[other]}; leave one of them out")
    if (other := namesake(data, path, others)) is not None:
        raise InputError(f"{where}: {path} names the same number as {other}; leave one of them out")
