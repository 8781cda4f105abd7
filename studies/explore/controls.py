"""What can be moved in a scene, and the scene with its values moved."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from typing import Any

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rigid
from vanedamp.coupling.scene.units import label_of, limits_of, unit_of
from vanedamp.files.toml_input import InputError

#: range of a slider over and below a number whose key has no ends, and ends by the unit of a key
_AROUND, _ENDS = 20.0, {"degree": (-90.0, 90.0)}
#: bodies of a cavity, beyond which a curve would take minutes
MOST_BODIES = 12
#: keys of a body that may differ between bodies which are equal otherwise
_OWN = ("cavity", "position", "velocity")


@dataclass(frozen=True)
class Control:
    """A number of a scene that is moved: a slider and a field.

    name            identifier in the page
    label, unit     for people; "" of a ratio
    factor          of the scene's SI unit in a unit shown
    value           where it starts, in the unit shown
    low, high, log  ends of the slider, in the unit shown, and whether it is even in the logarithm
    whole           whether only whole numbers make sense
    changes         of a scene, by their dotted paths, for a number in SI units
    """

    name: str
    label: str
    unit: str
    factor: float
    value: float
    low: float
    high: float
    log: bool
    changes: Callable[[Scene, float], dict[str, Any]]
    whole: bool = False

    @property
    def text(self) -> str:
        """The value where it starts, as the field shows it."""
        return f"{self.value:.4g}"

    def parse(self, text: str) -> float:
        """Return the number in a field, in SI units. Raises InputError."""
        return number_in(text, self.label, self.unit, self.whole) * self.factor


def number_in(text: str, label: str, unit: str = "", whole: bool = False) -> float:
    """Return the finite number in a field. Raises InputError, naming the field by its label."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number) or (whole and number != int(number)):
        kind = "a whole number" if whole else f"a number in {unit}" if unit else "a number"
        raise InputError(f"{label}: expected {kind}, not {text if len(text) <= 20 else text[:20] + '…'!r}")
    return number


def moved(scene: Scene, controls: Sequence[Control], texts: Mapping[str, str]) -> Scene:
    """Return the scene with the fields' numbers, by the controls' names; those that were not touched stay as they are.

    Raises InputError, naming the control.
    """
    for control in controls:
        text = texts.get(control.name, control.text)
        if text == control.text:
            continue
        number = control.parse(text)
        try:
            scene = scene.replace(control.changes(scene, number))
        except InputError as error:
            raise InputError(f"{control.label}: {str(error).removeprefix('scene: ')}") from None
    return scene


def controls_of(scene: Scene, wanted: Sequence[str] = ()) -> list[Control]:
    """Return the controls that make sense for a scene, and of wanted paths, in the order in which they are applied."""
    planar = any(damper.form.planar for damper in scene.damper)
    rigid = isinstance(scene.structure, Rigid)  # a reduced model holds its own damping
    return [
        *_bodies(scene),
        *_listed("cavity", scene.cavity, (_GAP,), _gap_changes),
        *(_listed("cavity", scene.cavity, (_PLAY,), _changes) if planar else ()),
        *_listed("damper", scene.damper, _MEASURES_OF_DAMPER, _changes),
        *_listed("damper", scene.damper, _EXTENTS if planar else _EXTENTS[-4:], _changes),
        *(_listed("cavity", scene.cavity, _FLOORS, _changes) if planar else ()),
        *(_starts(scene, planar) if scene.damper else ()),
        *(_given("structure", scene.structure, _DAMPINGS) if rigid else ()),
        *_given("excitation", scene.excitation, _LEVELS),
        *_orientation(scene),
        *(control_at(scene, path) for path in dict.fromkeys([*_others(scene), *wanted])),
    ]


def control_at(scene: Scene, path: str) -> Control:
    """Return the control of the number at a path: label, unit and range are those of its key."""
    (low, high), units = limits_of(path), unit_of(path)
    factor, unit = (1e-6, "µm") if units == "m" else (1.0, units.removesuffix("1"))
    ends = (low / factor, high / factor) if math.isfinite(low + high) else _ENDS.get(units)
    measure = _Measure(path, label_of(path), unit, factor, _AROUND if ends is None else None, *(ends or ()))
    label = f"{measure.label} ({path})"
    return _control(measure, path.replace(".", "-"), label, scene.number(path), partial(_changes, path))


def _others(scene: Scene) -> Iterator[str]:
    """Yield the paths of the numbers of tables that have no controls of their own: one for entries that agree."""
    data = scene.to_dict()
    for table in dict.fromkeys(("friction_damper", *(name for name, *_ in scene.elements), "contact", "rotation")):
        given = data.get(table) or []
        entries = given if isinstance(given, list) else [given]
        for key in entries[0] if entries else ():
            values = [entry.get(key) for entry in entries]
            if not all(isinstance(value, float) for value in values):
                continue
            places = [table] if len(set(values)) == 1 else [f"{table}.{index}" for index in range(len(values))]
            yield from (f"{place}.{key}" for place in places)


@dataclass(frozen=True)
class _Measure:
    """A key of a cavity or a body: how it is shown, and the slider's range as multiples of its value or as numbers."""

    key: str
    label: str
    unit: str
    factor: float
    around: float | None = None
    low: float = 0.0
    high: float = 1.0


_GAP = _Measure("gap", "gap", "µm", 1e-6, around=20.0)
_PLAY = _Measure("play", "play", "µm", 1e-6, around=10.0)
_MEASURES_OF_DAMPER = (
    _Measure("mass", "mass of a body", "g", 1e-3, around=10.0),
    _Measure("friction", "friction", "", 1.0, high=1.0),
    _Measure("restitution", "restitution", "", 1.0),
)
_EXTENTS = (
    _Measure("length", "length", "mm", 1e-3, around=5.0),
    _Measure("height", "height", "mm", 1e-3, around=5.0),
    _Measure("radius", "radius of a disc", "mm", 1e-3, around=5.0),
    _Measure("inertia", "moment of inertia", "g mm²", 1e-9, around=10.0),
    _Measure("normal_load", "load on the floor", "N", 1.0, around=20.0),
    _Measure("stiffness", "spring to the floor", "N/m", 1.0, around=20.0),
    _Measure("dashpot", "dashpot to the floor", "N s/m", 1.0, around=20.0),
    _Measure("track_radius", "radius of the track", "mm", 1e-3, around=10.0),
)
_FLOORS = (
    _Measure("normal_motion", "motion of the floor across, per motion along", "", 1.0, low=-1.0),
    _Measure("rotation", "rotation of the floor per motion along", "rad/m", 1.0, low=-100.0, high=100.0),
)
_LEVELS = (
    _Measure("resonance_amplitude", "level: resonance without bodies", "µm", 1e-6, around=20.0),
    _Measure("force", "level: force", "N", 1.0, around=20.0),
    _Measure("base_acceleration", "level: base acceleration", "m/s²", 1.0, around=20.0),
    _Measure("load_factor", "level: factor of the loads", "", 1.0, around=20.0),
)
_DAMPINGS = (
    _Measure("damping_ratio", "damping ratio of the structure", "%", 1e-2, around=10.0),
    _Measure("damping", "damping of the structure", "N s/m", 1.0, around=10.0),
)


def _control(measure: _Measure, name: str, label: str, value: float, changes: Any) -> Control:
    shown = value / measure.factor
    low, high = min(measure.low, shown), max(measure.high, shown)
    if measure.around is not None and shown > 0.0:
        low, high = (float(f"{end:.3g}") for end in (shown / measure.around, shown * measure.around))
    elif measure.around is not None:
        high = max(1.0, shown)
    log = measure.around is not None and shown > 0.0
    return Control(name, label, measure.unit, measure.factor, shown, low, high, log, changes)


def _listed(table: str, entries: Sequence[Any], measures: Sequence[_Measure], changes: Any) -> Iterator[Control]:
    """Yield one control for a key with one value in all entries, or one for each where they differ."""
    for measure in measures:
        values = [getattr(entry, measure.key) for entry in entries]
        if not values or None in values:
            continue
        key, label = measure.key, measure.label
        if len(set(values)) == 1:
            yield _control(measure, key, label, values[0], partial(changes, f"{table}.{key}"))
            continue
        for index, (entry, value) in enumerate(zip(entries, values, strict=True)):
            title, change = getattr(entry, "name", index + 1), partial(changes, f"{table}.{index}.{key}")
            yield _control(measure, f"{key}-{index}", f"{label} {title}", value, change)


def _starts(scene: Scene, planar: bool) -> Iterator[Control]:
    """Yield how bodies begin; those of one cavity have a position each."""
    half = 0.5e6 * min(cavity.gap for cavity in scene.cavity)
    play = 1e6 * min((cavity.play for cavity in scene.cavity if cavity.play), default=2e-6 * half)
    longest = max(max(damper.half_extent) for damper in scene.damper) if planar else 0.0
    most = 1e-3 * play / (2.0 * longest) if longest else 1.0
    begins = (
        _Measure("position", "position at the start", "µm", 1e-6, low=-half, high=half),
        _Measure("velocity", "velocity at the start", "m/s", 1.0, low=-1.0),
        _Measure("lift", "lift at the start", "µm", 1e-6, high=play),
        _Measure("lift_velocity", "lift velocity at the start", "m/s", 1.0, low=-1.0),
        _Measure("tilt", "tilt at the start", "mrad", 1e-3, low=-most, high=most),
        _Measure("tilt_rate", "tilt rate at the start", "rad/s", 1.0, low=-100.0, high=100.0),
    )
    bodies = [replace(body, position=at) for body, at in zip(scene.damper, scene.positions, strict=True)]
    yield from _listed("damper", bodies, begins if planar else begins[:2], _changes)


def _changes(path: str, scene: Scene, number: float) -> dict[str, Any]:
    return {path: number}


def _gap_changes(path: str, scene: Scene, number: float) -> dict[str, Any]:
    """Return the changes of a gap: bodies keep a given position as a fraction of the free travel."""
    values = {path: number}
    step = path.split(".")[1]
    gaps = {cavity.name: cavity.gap for k, cavity in enumerate(scene.cavity) if step in ("gap", str(k))}
    for index, damper in enumerate(scene.damper):
        if damper.cavity in gaps and damper.position:
            values[f"damper.{index}.position"] = damper.position * (number / gaps[damper.cavity])
    return values


def _bodies(scene: Scene) -> Iterator[Control]:
    """Yield the number of bodies in each cavity, where all are alike."""
    data = scene.to_dict()["damper"] if scene.damper else []
    alike = [{key: value for key, value in body.items() if key not in _OWN} for body in data]
    counts = {len(list(bodies)) for _, bodies in groupby(damper.cavity for damper in scene.damper)}
    homes = {damper.cavity for damper in scene.damper}
    if (
        not data
        or any(body != alike[0] for body in alike)
        or len(counts) != 1
        or homes != {cavity.name for cavity in scene.cavity}
    ):
        return
    count = counts.pop()
    label = "number of bodies" if len(homes) == 1 else "bodies in each cavity"
    yield Control("bodies", label, "", 1.0, count, 1, max(8, count), False, _body_changes, whole=True)


def _body_changes(scene: Scene, number: float) -> dict[str, Any]:
    """Return the changes to `number` equal bodies in each cavity, which begin spread over it."""
    count = int(number)
    if not 1 <= count <= MOST_BODIES:
        raise InputError(f"expected 1 to {MOST_BODIES}, not {number:g}")
    body = {key: value for key, value in scene.to_dict()["damper"][0].items() if key not in _OWN}
    return {"damper": [body | {"cavity": cavity.name} for cavity in scene.cavity for _ in range(count)]}


def _given(table: str, record: Any, measures: Sequence[_Measure]) -> Iterator[Control]:
    """Yield the control of the one of these keys that a table gives."""
    for measure in measures:
        value = getattr(record, measure.key)
        if value is not None:
            yield _control(measure, measure.key, measure.label, value, partial(_changes, f"{table}.{measure.key}"))


def _orientation(scene: Scene) -> Iterator[Control]:
    if scene.damper and scene.gravity.acceleration > 0.0 and scene.gravity.direction is None and not scene.speed:
        angle, setter = scene.gravity.orientation_deg, partial(_changes, "gravity.orientation_deg")
        low, high = min(-90.0, angle), max(90.0, angle)
        yield Control("orientation", "orientation of gravity", "°", 1.0, angle, low, high, False, setter)
