"""What later commands would complain of in a scene, or what looks like a slip of units, from its linear response."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from vanedamp.coupling.scene.rotation import FREQUENCY
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.units import unit_of
from vanedamp.coupling.sweep.grid import Points, grid, resonance_axis
from vanedamp.coupling.sweep.sweep import linear_tops
from vanedamp.coupling.system.linear_response import linear_amplitudes
from vanedamp.coupling.system.reduced_model_file import ring_in_file
from vanedamp.coupling.system.sectors import unrolled
from vanedamp.files.toml_input import InputError
from vanedamp.modal.units import strength_absurdity
from vanedamp.studies.headline import headline
from vanedamp.studies.machining import fine_gap
from vanedamp.studies.references import reference_names

#: gaps beyond this many amplitudes are slips of units, as a rule
_WIDE = 20.0
#: friction beyond this is none of two dry solids: clean metals in air are below 1.5
_ROUGH = 2.0
#: Pa, moduli and hardnesses below these are those of no solid part; 1/Pa, K/H above which nothing wears
_SOFTEST, _INDENTED, _WORN = 1e6, 1e6, 1e-8


def sweep_doubts(scene: Scene) -> Iterator[str]:
    """Yield what the headline of the scene's sweep will say against its frequencies, by the linear curves.

    scene: without open choices. Of the first values of the other axes.
    """
    swept = resonance_axis(scene, scene.axes)[0]
    if swept is None:
        return
    points = grid(replace(scene, sweep={swept: scene.sweep[swept]}))
    x = np.sort(np.array(points.axes[swept], float))
    if len(set(x)) < 2:
        return
    scenes = Points(points.base)
    try:
        made = [scenes.scene({swept: float(value)}) for value in x]
        curves = [linear_amplitudes(one, np.array([one.frequency])) for one in made]
    except InputError:  # a waveform, or a point that is no scene
        return
    undamped, fixed = np.reshape(curves, (len(x), 2)).T
    peaks = {name: float(values) for name, values in linear_tops(points).items()}
    damped = fixed if reference_names(scene) else undamped  # the damped peak lies between them, as a rule
    none = np.zeros(len(x))
    found = headline(x, damped, damped, none, none, none, undamped, fixed, peaks, along_frequency=True)
    unit = "Hz" if swept == FREQUENCY else unit_of(swept)
    for remark in found.remarks_in(unit):
        yield f"sweep.{swept}: by the linear curves, {remark}"


def part_doubts(scene: Scene, mass: float | None) -> Iterator[str]:
    """Yield friction, masses and gaps that no parts have, and sectors that cannot alternate.

    scene: as its file has it; mass: of the structure, modal, kg; None where it is not known.
    """
    tables = {"damper": scene.damper, "friction_damper": scene.friction_damper} | scene.element_tables
    for table, entries in tables.items():
        for number, one in enumerate(entries):
            if (friction := getattr(one, "friction", 0.0)) > _ROUGH:
                yield (
                    f"{table}[{number}].friction: {friction:g} is implausible: dry metals have 0.1 to 1, and none more "
                    f"than {_ROUGH:g}"
                )
    for number, cavity in enumerate(scene.cavity):
        if told := fine_gap(cavity.gap):
            yield f"cavity[{number}].gap: {told}"
    yield from _material_doubts(scene)
    bodies = sum(body.mass for body in unrolled(scene).damper)
    if mass is not None and bodies > mass:
        yield (
            f"damper.mass: the bodies have {bodies:.3g} kg, {bodies / mass:.3g} times the modal mass {mass:.3g} kg of "
            "the structure; masses are in kg, not in g"
        )
    alternating = [f"cavity[{number}]" for number, one in enumerate(scene.cavity) if one.sectors == "alternate"]
    ring = ring_in_file(scene.structure) if alternating else None
    if ring is not None and ring.sectors % 2:
        yield (
            f"{alternating[0]}.sectors: {ring.sectors} sectors cannot alternate: sectors {ring.sectors - 1} and 0 are "
            "neighbours, and both have a cavity"
        )


def _material_doubts(scene: Scene) -> Iterator[str]:
    """Yield moduli, strengths and rates of wear that look like MPa for Pa."""
    pair, wear = scene.contact.pair, scene.wear
    moduli = {} if pair is None else {"young": pair.young, "wall_young": pair.wall_young}
    for key, young in moduli.items():
        if young is not None and young < _SOFTEST:
            yield f"contact.pair.{key}: no solid part has {young:.4g} Pa; it is in Pa, not in MPa or GPa"
    if pair is not None and pair.yield_strength is not None:
        # of the softer of both, whichever that is
        told = [strength_absurdity(pair.yield_strength, young) for young in moduli.values() if young is not None]
        if all(told):
            yield f"contact.pair.yield_strength: {told[0]}; both are in Pa"
    rates = {} if wear is None else {"wear": wear} | {f"wear.pair[{n}]": one for n, one in enumerate(wear.pair)}
    for name, one in rates.items():
        if one.hardness is not None and one.hardness < _INDENTED:
            yield (
                f"{name}.hardness: no solid part has {one.hardness:.4g} Pa; it is in Pa, not in MPa or kgf/mm^2 "
                "(HV 200 is 2e9 Pa)"
            )
        if one.rate is not None and one.rate > _WORN:
            yield (
                f"{name}.rate: {one.rate:.3g} 1/Pa is that of no solid part; 1 mm^3/(N m) is 1e-9 1/Pa, 1/MPa is 1e-6"
            )


def gap_doubts(scene: Scene, amplitude: float) -> Iterator[str]:
    """Yield cavities that are wide against X, m, and walls softer than their gaps allow."""
    omega = 2 * math.pi * scene.frequency
    for index, cavity in enumerate(scene.cavity):
        bodies = [scene.damper[number] for number in scene.bodies_in(cavity)]
        if amplitude and cavity.gap > _WIDE * amplitude and bodies:
            yield (
                f"cavity[{index}].gap: {cavity.gap / amplitude:.3g} times the amplitude X = {amplitude:.3g} m, so that "
                "bodies hardly meet a wall; lengths are in m, not in mm"
            )
        soft = [math.sqrt(body.mass * scene.contact.flexibility(body.mass)) for body in bodies]
        depth = omega * amplitude * max(soft, default=0.0)
        if depth > cavity.gap:
            yield (
                f"contact.stiffness: a body that meets a wall at the speed omega X overlaps it by {depth:.2g} m, more "
                f"than the gap of cavity {cavity.name!r}, {cavity.gap:.2g} m; the stiffness is in N/m"
            )
