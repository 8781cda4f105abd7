"""Model order selection: how many modes of a reduced model a scene needs, and how long its transient is.

`modes = "auto"` takes the fewest natural modes whose estimated error stays within the tolerance (rom.error_estimate):
of the receptance from the excitation to the response, the cavity's surfaces and joints at the excitation frequencies,
with joints open and stuck, plus the error of a collision's pulse, in proportion to the bodies' possible effect on the
response. The whole model of the file is the measure; of scenes at several speeds of rotation at the lowest, the middle
and the highest of these.

A boundary without mass yields under its contact force by the flexibility G that the modes lack, u = Phi eta + G f,
while it touches and not otherwise. For one contact at a time this is a spring 1/G between body and modes, which is what
the engine runs, at every wall with its own G. Left out are the boundary's motion under friction on the floor and under
forces at other coordinates; where walls that can be touched at once have much of G in common, the estimate warns.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.model_order.collision_sensitivity import sensitivity
from vanedamp.coupling.model_order.confirmation import WORTH, confirmed, peak, unconfirmed, with_modes
from vanedamp.coupling.response.moved_start import touching
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.solver_options import METHODS
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.body_loads import load_warnings
from vanedamp.coupling.system.linear_response import linear_response
from vanedamp.coupling.system.modal_basis import modal_basis
from vanedamp.coupling.system.reduced_model_file import greatest_speed, reduced_model
from vanedamp.coupling.system.resonance import excitation_force
from vanedamp.files.toml_input import InputError
from vanedamp.rom.contact_pulse import WallContact, pulse
from vanedamp.rom.dense_modes import spectrum
from vanedamp.rom.error_estimate import Choice, Rung, choose, frequency_grid, natural_ladder, rigid_errors, worst_rungs
from vanedamp.rom.recovery import SHOWN, shown_modes
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless

#: bodies that hit twice per period act like up to 1.7 times their mass, and damp the response as well
_IMPACTS = 2.0
#: common fraction of a flexibility from which on a warning is given
_SHARED = 0.1
#: empirical upper bound of sensitivity(richer model) / sensitivity(one mode)
_CAUTION = 5.0
#: resonances in the range that are tried, fraction of the highest from which on they count, and steps from
#: loose (0) to fixed bodies (1)
_RESONANCES, _SEEN, _PLACES = 4, 0.03, (0.0, 0.5, 1.0)
#: scenes of a sweep that are tried, of those that differ in more than their frequency
_SCENES = 4
#: speeds of rotation that are tried, of those that the scenes have
_SPEEDS = 3
#: safety factor: collisions interact through residual vibration
_SAFETY = 1.5
_NEWTON = "; of the forced response only: Newton's impacts do not converge as modes are added, compliant contacts do"


#: the choice of a number of modes by file, `modes` and tolerance
Choices = Mapping[tuple[Any, ...], Choice]


class Selected(NamedTuple):
    """A scene without open choices, and the estimate of the model chosen (None if there was no choice)."""

    scene: Scene
    estimate: dict[str, Any] | None


def select_model_order(scene: Scene) -> Selected:
    """Return the scene with its number of modes. Raises InputError when there is no good choice."""
    return select_model_orders([scene])[0]


def select_model_orders(scenes: Sequence[Scene]) -> list[Selected]:
    """Select for the points of a sweep: points with one model and tolerance have the choice that suits them all."""
    choices = choices_of(scenes)
    return [with_choice(scene, choices) for scene in scenes]


def choices_of(scenes: Iterable[Scene], more: bool = False) -> Choices:
    """Return the number of modes that suits all scenes with one model and tolerance, for each of these.

    more: whether many more periods follow.
    Raises InputError for a scene with stops, whose impacts the estimate does not include, and for one whose sines it
    cannot try.
    """
    groups: dict[tuple[Any, ...], list[Scene]] = {}
    for scene in filter(needs_selection, scenes):
        fault = ""
        if any(one.on_structure and not (one.rubs and one.yields) for _, _, one in scene.elements):
            fault = "weighs collisions of bodies, not those of stops and of joints without normal_stiffness"
        elif scene.excitation.signal is not None:
            fault = "weighs errors at the frequencies of sines, and a waveform has no highest one"
        elif not _has_first_order(scene):
            fault = "tries the bodies at resonances that sines of order 1 meet, and this excitation has none"
        if fault:
            raise InputError(f'structure.modes: "auto" {fault}; give a number of modes')
        groups.setdefault(_group(scene), []).append(scene)
    return {key: _choice(members, math.inf if more else periods_of(members)) for key, members in groups.items()}


def periods_of(scenes: Iterable[Scene]) -> int:
    """Return the number of periods that scenes run, at least."""
    return sum(scene.time.simulated for scene in scenes)


def _has_first_order(scene: Scene) -> bool:
    excitation = scene.excitation
    if excitation.distributed:
        return any(load.order == 1 and load.force for load in excitation.loads.values())
    return excitation.waveform is None or bool(excitation.shares[1])


def needs_selection(scene: Scene) -> bool:
    """Whether a scene leaves its number of modes open."""
    return isinstance(scene.structure, Rom) and scene.structure.modes == "auto"


def _group(scene: Scene) -> tuple[Any, ...]:
    structure = scene.structure
    return (structure.file, structure.modes, structure.tolerance) if isinstance(structure, Rom) else ()


def with_choice(scene: Scene, choices: Choices) -> Selected:
    """Return the scene with the choice that was made for it."""
    structure, choice = scene.structure, choices.get(_group(scene))
    if not isinstance(structure, Rom):
        return Selected(scene, None)
    if choice is None:
        return Selected(scene, _shared_flexibility(scene, structure))
    structure = replace(structure, modes=choice.chosen.modes, natural=True, attached=choice.chosen.attached)
    scene = replace(scene, structure=structure)
    contacts = _collisions(scene, reduced_model(structure, scene.speed))
    stiffness = min((collision.stiffness for collision in contacts), default=None)
    estimate = choice.to_json() | {"stiffness": stiffness}
    warning = _shared_flexibility(scene, structure)
    sentences = [choice.sentence]
    if warning is not None:
        estimate |= warning
        sentences.append(warning["sentence"])
    if any(damper.form.planar for damper in scene.damper):
        sentences.append("planar bodies count as sliders")
    return Selected(scene, estimate | {"sentence": "; ".join(sentences)})


def warnings_of(scene: Scene) -> tuple[str, ...]:
    """Return the warnings of a scene without open choices: of method, impact laws on several modes, loads,
    ranges, bodies that begin as one."""
    rubs = any(damper.form.planar and damper.friction > 0.0 for damper in scene.damper)
    method = METHODS.part(scene.solver.method)
    warning = getattr(method, "RUBBING_WARNING", None) if rubs else None
    ranges = ", ".join(scene.ranges)
    return (
        *([] if warning is None else [f"solver.method: {warning}"]),
        *getattr(method, "run_warnings", lambda _: ())(scene),
        *([f"ranges: {ranges}: the scene's own numbers are taken; vanedamp.ensemble samples ranges"] if ranges else []),
        *_of_rotation(scene),
        *_of_hot_spots(scene),
        *_of_impact_laws(scene),
        *load_warnings(scene),
        *touching(scene),
    )


def _of_rotation(scene: Scene) -> tuple[str, ...]:
    """Return a warning of a model that is for speeds in a scene that names none."""
    if scene.rotation is not None or not isinstance(scene.structure, Rom):
        return ()
    greatest = greatest_speed(scene.structure)
    if greatest == 0.0:
        return ()
    return (
        f"rotation: missing, so that the structure stands still; its model is for speeds up to {greatest:.6g} rad/s, "
        "and speed = 0 says that standstill is meant",
    )


def _of_hot_spots(scene: Scene) -> tuple[str, ...]:
    """Return a warning of hot spots that do not show the largest stress of the mode nearest to the excitation."""
    if type(scene.structure) is not Rom or not scene.moved:
        return ()
    modes = shown_modes(reduced_model(scene.structure, scene.speed).provenance)
    if not modes:
        return ()
    number = int(np.argmin([abs(frequency - scene.frequency) for frequency, _ in modes]))
    frequency, shown = modes[number]
    if shown >= SHOWN:
        return ()
    return (
        f"hot spots: show {shown:.0%} of the largest stress over strength of mode {number + 1} ({frequency:.6g} Hz), "
        "the nearest to the excitation; stress, utilisation and life are those of other places; reduce with more "
        "--hot-spots",
    )


def _of_impact_laws(scene: Scene) -> tuple[str, ...]:
    hits = scene.damper or any(not element.yields for _, _, element in scene.elements)
    if not (isinstance(scene.structure, Rom) and scene.contact.rigid and hits):
        return ()
    size = reduced_model(scene.structure, scene.speed).size
    if size == 1:
        return ()
    return (
        f"contact: {scene.contact.title} does not converge as modes are added, and the answer is that of {size} "
        'coordinates; take law = "compliant" with a stiffness, residual = true or both, or one natural mode '
        "(structure.modes = 1, natural = true)",
    )


def _shared_flexibility(scene: Scene, structure: Rom) -> dict[str, Any] | None:
    """Return a warning of the largest shared flexibility of two walls that can be touched at once, over their own."""
    law = scene.contact
    if not law.takes_residual_flexibility:
        return None
    model = reduced_model(structure, scene.speed)
    residual = model.residual_flexibility
    if residual is None:
        return None
    of_law, largest = min((law.flexibility(damper.mass) for damper in scene.damper), default=0.0), 0.0
    for (one, first), (other, second) in itertools.combinations(_touched(scene, model), 2):
        if one != other:
            size = math.sqrt((residual[first, first] + of_law) * (residual[second, second] + of_law))
            largest = max(largest, abs(float(residual[first, second])) / size if size > 0.0 else 0.0)
    if largest <= _SHARED:
        return None
    return {
        "shared_flexibility": largest,
        "sentence": f"walls have up to {100 * largest:.0f} % of their residual flexibility in common, which contacts "
        "closed at the same time do not feel; more modes lessen it",
    }


def _touched(scene: Scene, model: ReducedModel) -> list[tuple[int, int]]:
    """Return (body, wall's index in the interface) of all contacts of bodies with walls."""
    pairs = []
    for cavity in scene.cavity:
        bodies = scene.bodies_in(cavity)
        ends = zip(bodies[:1] + bodies[-1:], cavity.labels()[:2], strict=False)
        pairs += [(body, model.interface.index(label)) for body, label in ends if label in model.interface]
    return pairs


def _choice(scenes: Sequence[Scene], periods: float) -> Choice:
    """Return the fewest natural modes for all of these scenes, which have one model. periods: to be run with it."""
    first = scenes[0]
    rigid_contacts = any(scene.contact.rigid for scene in scenes if scene.damper)
    trying = not rigid_contacts and bool(first.damper or _rubbing(first))
    brief = trying and periods <= WORTH
    structure, at = first.structure, first.excitation.at
    assert isinstance(structure, Rom) and at is not None
    forced = list(dict.fromkeys(label for scene in scenes for label in _forced(scene)))
    labels = list(dict.fromkeys([at, *forced, *(label for scene in scenes for label in _surfaces(scene))]))
    driven = [scene.frequency * order for scene in scenes for order in scene.excitation.shares]
    speeds = sorted({scene.speed for scene in scenes})
    compared = []
    for index in np.unique(np.linspace(0, len(speeds) - 1, _SPEEDS).astype(int)):
        model = reduced_model(replace(structure, modes=None), speeds[index])
        for label in labels:
            if label not in model.interface:
                raise InputError(f"structure: no interface label '{label}'; it has {', '.join(model.interface)}")
        at_speed = [scene for scene in scenes if scene.speed == speeds[index]]
        frequencies = _with_stuck(at_speed, frequency_grid(model, min(driven), max(driven)))
        compared.append(_ladders(at_speed, model, frequencies, at, labels, brief))
    rigid = max(ladders.rigid for ladders in compared)
    choices = [
        choose(worst_rungs([ladders.rungs[attached] for ladders in compared]), structure.tolerance, rigid)
        for attached in (False, True)
    ]
    # the first of equals: natural modes without attachment modes
    choice = min(choices, key=lambda item: (not item.met, item.chosen.size))
    if not choice.met:
        raise InputError(f"structure.modes: {choice.sentence}: raise structure.tolerance or reduce with more modes")
    if rigid_contacts:
        return replace(choice, sentence=choice.sentence + _NEWTON)
    if brief:
        return unconfirmed(choice, periods)
    return confirmed(choice, scenes, periods) if trying and peak(first) else choice


class _Ladders(NamedTuple):
    """Errors of models at one speed: of the rigid model, and of natural modes without and with attachments."""

    rigid: float
    rungs: tuple[list[Rung], list[Rung]]


def _ladders(
    scenes: Sequence[Scene], model: ReducedModel, frequencies: np.ndarray, at: str, labels: list[str], brief: bool
) -> _Ladders:
    """Return the errors of models of fewer modes for scenes at the speed of a whole model. brief: of the whole one."""
    forced = list(dict.fromkeys(label for scene in scenes for label in _forced(scene)))
    rigid = float(rigid_errors(model, frequencies, at, labels, forced).max())
    if brief:
        size = min(_finest(scene, model).size for scene in scenes)
        return _Ladders(rigid, ([Rung(size, size, 0.0, 0.0)], [Rung(size, size, 0.0, 0.0)]))

    def collisions(smaller: ReducedModel) -> list[WallContact]:
        if any(scene.contact.needs_residual_flexibility for scene in scenes) and not _yields(smaller):
            return []  # it has no boundary without mass
        return list(dict.fromkeys(item for scene in scenes for item in _collisions(scene, smaller)))

    stuck = [partial(_stuck_receptance, scene) for scene in _joined(scenes)]
    share = min(1.0, _IMPACTS * max(_influence(scene, model, frequencies) for scene in scenes))
    share = _SAFETY * min(share, _CAUTION * _sensitivity(scenes, model, frequencies))
    loose, attached = (
        [
            replace(rung, collision=share * rung.collision)
            for rung in natural_ladder(model, frequencies, labels, forced, collisions, attached, stuck)
        ]
        for attached in (False, True)
    )
    return _Ladders(rigid, (loose, attached))


def _joined(scenes: Sequence[Scene]) -> list[Scene]:
    """Return scenes that differ in joints and friction dampers, with all modes."""
    apart = {(one.friction_damper, tuple(one.elements)): with_modes(one, None) for one in scenes if _rubbing(one)}
    return list(apart.values())


def _rubbing(scene: Scene) -> list[str]:
    """Return the labels of joints and friction dampers."""
    given = [one for damper in scene.friction_damper for one in (damper.at or scene.excitation.at, damper.to)]
    given += [label for _, _, one in scene.elements for label in one.labels().values()]
    return [label for label in given if label is not None]


def _with_stuck(scenes: Sequence[Scene], frequencies: np.ndarray) -> np.ndarray:
    """Return frequencies (f,), Hz, with those around the resonances of stuck joints between them."""
    squares = [linear_response(assemble(scene), True).natural[0] for scene in _joined(scenes)]
    natural = np.sqrt(np.concatenate([np.zeros(0), *squares])) / (2 * math.pi)
    near = np.multiply.outer(natural, [0.999, 1.001]).ravel()  # undamped ones have no height
    return np.union1d(frequencies, near[(near > frequencies[0]) & (near < frequencies[-1])])


def _stuck_receptance(scene: Scene, model: ReducedModel, frequencies: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the receptance (f, k, k) of a model whose bodies are fixed and whose joints stick."""
    basis, omega = modal_basis(model), 2 * math.pi * np.asarray(frequencies)
    held, rows = linear_response(assemble(scene, basis), True), np.array(list(basis.rows.values()))
    return np.stack([held.steady(row, omega) @ rows.T for row in rows], axis=2)


def _influence(scene: Scene, model: ReducedModel, frequencies: np.ndarray) -> float:
    """Return the difference of the responses with loose and with fixed bodies, relative to the larger."""
    loose, glued = (_waves(scene, item, frequencies) for item in (model, _glued(scene, model)))
    size = np.maximum(np.abs(loose), np.abs(glued)).max(axis=0)
    return float((np.abs(glued - loose).max(axis=0) / size).max())


def _forced(scene: Scene) -> list[str]:
    """Return the labels at which forces act."""
    if not scene.excitation.distributed:
        return [str(scene.excitation.at)]
    return list(dict.fromkeys(load.at for load in scene.excitation.loads.values()))


def _waves(scene: Scene, model: ReducedModel, frequencies: np.ndarray) -> np.ndarray:
    """Return complex displacements (e, f) of the response to the forces of each order, m, for a level of 1."""
    at = str(scene.excitation.at)
    if not scene.excitation.distributed:
        return model.frf(frequencies, at, at)[None]
    orders: dict[int, np.ndarray] = {}
    for load in scene.excitation.loads.values():
        wave = load.amplitude * model.frf(frequencies, at, load.at)
        orders[load.order] = orders.get(load.order, 0.0) + wave
    return np.array(list(orders.values()))


def _glued(scene: Scene, model: ReducedModel) -> ReducedModel:
    """Return the model with bodies fixed."""
    floors = {cavity.name: str(cavity.labels()[2]) for cavity in scene.cavity}
    return model.with_masses((floors[damper.cavity], damper.mass) for damper in scene.damper)


def _sensitivity(scenes: Sequence[Scene], model: ReducedModel, frequencies: np.ndarray) -> float:
    """Return the largest sensitivity over collisions and scenes that differ in more than frequency; 1 if unknown."""
    squares, shapes = spectrum(model.mass, model.stiffness)
    apart = list({_but_for_frequency(scene): scene for scene in scenes}.values())
    worst, met = 0.0, False
    for scene in (apart[index] for index in np.unique(np.linspace(0, len(apart) - 1, _SCENES).astype(int))):
        smaller = _finest(scene, model)
        collisions = list(dict.fromkeys(_collisions(scene, smaller)))
        if not collisions:
            continue
        met = True
        trials, modes = _trials(scene, model, frequencies)
        undamped = _undamped(scene, model, frequencies)
        if not undamped > 0.0:
            return 1.0
        for collision in collisions:
            row = (model.row(collision.label) @ shapes)[: smaller.size]
            felt = pulse(squares[: smaller.size], row, collision, float(np.median(trials)))
            worst = max(worst, sensitivity(scene, trials, collision, float(row[0]), felt, modes, undamped))
    return worst if met else 1.0


def _but_for_frequency(scene: Scene) -> tuple[Any, ...]:
    """Return the key of scenes of one model, other than their frequency."""
    drive = replace(scene.excitation, frequency=1.0, engine_order=None)
    return (drive, scene.cavity, scene.damper, scene.friction_damper, scene.gravity, scene.contact)


def _trials(scene: Scene, model: ReducedModel, frequencies: np.ndarray) -> tuple[list[float], int]:
    """Return frequencies (Hz) at which bodies collide if they do anywhere in the range, and the modes needed there.

    The highest resonances in the range, from loose to fixed bodies, between which a damped peak
    lies; without one, the ends and the middle of the range.
    """
    low, high = float(frequencies[0]), float(frequencies[-1])
    loose = model.natural_frequencies_hz
    glued = _glued(scene, model).natural_frequencies_hz
    inside = [k for k in range(model.rigid_modes, len(loose)) if loose[k] >= low and glued[k] <= high]
    heights = np.abs(_waves(scene, model, loose)).max(axis=0)
    chosen = sorted(inside, key=lambda k: -heights[k])[:_RESONANCES]
    chosen = [k for k in chosen if heights[k] > _SEEN * heights[chosen[0]]]
    if not chosen:
        return [low, 0.5 * (low + high), high], max(1, model.rigid_modes)
    places = [loose[k] + share * (glued[k] - loose[k]) for k in chosen for share in _PLACES]
    return [float(np.clip(place, low, high)) for place in places], max(chosen) + 1


def _undamped(scene: Scene, model: ReducedModel, frequencies: np.ndarray) -> float:
    """Return the largest amplitude without bodies in the range, m; 0 where no force drives it."""
    force = excitation_force(with_modes(scene, None))
    return force * float(np.abs(_waves(scene, model, frequencies)).max())


def _collisions(scene: Scene, model: ReducedModel) -> list[WallContact]:
    """Return the contacts of bodies with walls on a model; none for rigid contacts. Raises InputError."""
    if scene.contact.rigid:
        return []
    first = spectrum(model.mass, model.stiffness)[1][:, 0]
    flexibility = model.residual_flexibility
    residual = np.zeros(len(model.interface)) if flexibility is None else np.diag(flexibility)
    contacts = []
    for damper in scene.damper:
        for label in dict.fromkeys(filter(None, scene.cavity[scene.cavity_of(damper)].labels()[:2])):
            reduced = 1.0 / (1.0 / damper.mass + float(model.row(label) @ first) ** 2)
            lost = float(residual[model.interface.index(label)])
            element = scene.contact.element(damper.restitution, reduced, lost)
            contacts.append(WallContact(label, damper.mass, element.stiffness, element.dashpot))
    return contacts


def _finest(scene: Scene, model: ReducedModel) -> ReducedModel:
    """Return the largest model on which the scene's contacts have a meaning."""
    complete = not scene.contact.needs_residual_flexibility or _yields(model)
    return model if complete else massless(model, model.size - 1)


def _yields(model: ReducedModel) -> bool:
    return model.residual_flexibility is not None and bool(np.diag(model.residual_flexibility).max() > 0.0)


def _surfaces(scene: Scene) -> list[str]:
    """Return the labels of cavities and joints."""
    return [label for cavity in scene.cavity for label in cavity.labels() if label is not None] + _rubbing(scene)
