"""The scene: a structure, its cavities, the loose bodies in them and the excitation (SI units throughout)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import field
from functools import cache, partial
from pathlib import Path
from shutil import copyfile
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag
from pydantic.dataclasses import dataclass
from pydantic.json_schema import SkipJsonSchema

from vanedamp.coupling.scene.bodies import Cavity, Damper, FrictionDamper, spread
from vanedamp.coupling.scene.contact_laws.newton import Newton
from vanedamp.coupling.scene.elements.element import SceneElement
from vanedamp.coupling.scene.elements.stop import Stop
from vanedamp.coupling.scene.excitation import Excitation, Gravity
from vanedamp.coupling.scene.mistuning import DEVIATIONS
from vanedamp.coupling.scene.orbit import Orbit
from vanedamp.coupling.scene.paths import Range, assign, axis_values, namesake, number_at
from vanedamp.coupling.scene.ramp import Ramp
from vanedamp.coupling.scene.ranges import EnsembleTable, read
from vanedamp.coupling.scene.registration import ELEMENTS, Contact
from vanedamp.coupling.scene.ring_down import RingDownTable
from vanedamp.coupling.scene.rotation import Rotation, frequency_of
from vanedamp.coupling.scene.solver_options import Solver, options_of
from vanedamp.coupling.scene.structures import Initial, Prescribed, Ring, Rom, Structure
from vanedamp.coupling.scene.wear import Wear
from vanedamp.files.display import Displayed
from vanedamp.files.key_tables import documented
from vanedamp.files.open_record import OpenRecord
from vanedamp.files.store import replacing
from vanedamp.files.toml_input import STRICT, InputError, Real, Whole, nearest, read_toml, tables


@dataclass(frozen=True, config=STRICT)
class Time:
    """Excitation periods simulated, and those evaluated.

    With neither `periods` nor `transient` the transient is 1000 of 1500 periods, or longer where the structure's
    damping leaves more than `tolerance` of the steady response (system.transient); a run that is not steady then goes
    on, each time for as long as it has taken, and leaves out what was before. steady = "auto" drops it by a
    statistical rule and ends the run once the 95 % confidence interval of the mean amplitude is narrower than
    `tolerance` of it on either side.
    """

    periods: Annotated[Whole, Field(gt=0)] | None = None
    """excitation periods simulated (default: 1500, or more, up to 24000, until the response is steady)"""
    transient: Annotated[Whole, Field(ge=0)] | None = None
    """periods of these that are left out of the evaluation (default: two thirds); 0 evaluates from the start"""
    steady: Literal["auto"] | None = None
    """"auto" leaves out the transient by a statistical rule, and ends the run, within `periods`, once the mean
    amplitude is known"""
    tolerance: Annotated[Real, Field(gt=0, lt=1)] = 0.01
    """what is left of the transient, or half the 95 % confidence interval of the mean amplitude, relative to it [-]"""

    def __post_init__(self) -> None:
        if self.steady is not None and self.transient is not None:
            raise ValueError("give one of transient and steady")
        if self.transient is not None and self.transient >= self.simulated:
            raise ValueError(f"transient ({self.transient}) must be less than periods ({self.simulated})")

    @property
    def open(self) -> bool:
        """Whether the length of a run is left open: it suits the scene's damping (system.transient)."""
        return self.periods is None and self.transient is None

    @property
    def simulated(self) -> int:
        """Largest number of periods simulated: 1500 by default, where it is not open."""
        return 1500 if self.periods is None else self.periods

    @property
    def dropped(self) -> int:
        """Periods left out of the evaluation unless `steady` decides: two thirds by default."""
        return self.simulated * 2 // 3 if self.transient is None else self.transient


#: relative deviation allowed between a frequency and a waveform's with its own duration
_SAME_PERIOD = 1e-4
#: where a scene names files, relative to its own
_FILES = (
    ("structure", "file"), ("excitation", "pattern"), ("excitation", "waveform", "file"),
    *(("structure", "mistuning", name, "file") for name in DEVIATIONS),
)  # fmt: skip
#: paths of these keys
FILE_PATHS = tuple(map(".".join, _FILES))
#: fewest periods that tell Lyapunov exponents
LEAST_EXPONENTS = 32
#: keys of the [sweep] table that are no axes: their least values, and what they mean
_KEPT = {
    "sections": (1, "number of Poincare sections to keep of every point: those of its last periods"),
    "exponents": (LEAST_EXPONENTS, "number of periods after each run over which its Lyapunov exponents are found"),
}
_NO_AXIS = "a sweep needs a list, such as [1.0, 2.0], or a range {start = 1.0, stop = 2.0, num = 11}"


def _several(axis: Any) -> Any:
    if isinstance(axis, np.ndarray):
        return axis.tolist()
    if type(axis) is int:  # of a key that is no axis, which the scene checks
        return axis
    if not isinstance(axis, Mapping | list | tuple | Range):
        raise ValueError(_NO_AXIS)
    return axis


def _form(axis: Any) -> str:
    return "count" if isinstance(axis, int) else "list" if isinstance(axis, list | tuple) else "range"


#: the values of one axis of a sweep, or a number of periods
Axis = Annotated[
    Annotated[Range, Tag("range")]
    | Annotated[tuple[Real | Whole | str, ...], Field(min_length=1), Tag("list")]
    | Annotated[SkipJsonSchema[Whole], Tag("count")],
    Discriminator(_form),
    BeforeValidator(_several),
]


def _describe_kept(schema: dict[str, Any]) -> None:
    """Add the keys that are no axes to the JSON Schema of the [sweep] table."""
    schema["properties"] = {
        key: {"type": "integer", "minimum": least, "description": text} for key, (least, text) in _KEPT.items()
    }


@dataclass(frozen=True, config=STRICT)
class Continuation:
    """How the runs of a sweep begin. Between linked runs the phase of the excitation goes on."""

    direction: Literal["independent", "up", "down"] = "independent"
    """where a run begins: "independent", at the scene's own initial state; "up", "down", at the last state of the run
    at the next lower or next higher value of `along`"""
    along: str | None = None
    """dotted path of an axis (default: the excitation frequency, or else the speed of rotation, or the only axis)"""


@documented
@dataclass(frozen=True, config=STRICT, repr=False)
class Scene(OpenRecord, Displayed):
    """Everything one run needs. Change a scene by making another: `scene.replace({"cavity.c1.gap": 1e-5})`."""

    structure: Structure
    """what vibrates"""
    excitation: Excitation
    """what moves it"""
    cavity: tuple[Cavity, ...] = ()
    """cavities of the structure"""
    damper: tuple[Damper, ...] = ()
    """loose bodies in the cavities"""
    friction_damper: tuple[FrictionDamper, ...] = ()
    """friction dampers between structure and casing"""
    stop: tuple[Stop, ...] = ()
    """stops that the structure hits"""
    initial: Initial = field(default_factory=Initial)
    """state of a rigid structure at time zero (default: at rest)"""
    gravity: Gravity = field(default_factory=Gravity)
    """gravity, which presses and pulls the bodies"""
    rotation: Rotation | None = None
    """speed of the frame that everything turns with (default: standstill)"""
    contact: Contact = field(default_factory=Newton)
    """law of impacts and contacts at walls, stops and between bodies"""
    wear: Wear | None = None
    """wear of contacts (default: not counted)"""
    time: Time = field(default_factory=Time)
    """how long a run is, and what of it is evaluated"""
    solver: Solver = field(default_factory=partial(options_of, {}))
    """method of time integration, and its options"""
    continuation: Continuation = field(default_factory=Continuation)
    """how the runs of a sweep begin"""
    sweep: Annotated[dict[str, Axis], Field(json_schema_extra=_describe_kept)] = field(default_factory=dict)
    """axes of a sweep, by dotted paths such as "cavity.c1.gap": a list or a range {start, stop, num} of values"""
    ranges: dict[str, tuple[Real, Real]] = field(default_factory=dict)
    """numbers that run as an ensemble, by dotted paths such as "damper.0.friction": [lowest, highest]; a file may also
    give the range in the place of the number, `friction = [0.2, 0.5]`, whose middle is then the number"""
    ensemble: EnsembleTable | None = None
    """how numbers that are ranges are sampled"""
    orbit: Orbit | None = None
    """periodic motion that `vanedamp orbits` finds and follows"""
    ramp: Ramp | None = None
    """run-up or run-down of `vanedamp ramp`"""
    ring_down: RingDownTable | None = None
    """free motion of `vanedamp ringdown`"""

    def __post_init__(self) -> None:
        names = [cavity.name for cavity in self.cavity]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"cavity: the name '{name}' is used twice; names must differ")
        for index, damper in enumerate(self.damper):
            if damper.cavity not in names:
                raise ValueError(
                    f"damper[{index}].cavity: no cavity '{damper.cavity}'; {nearest(damper.cavity, names)}"
                )
            self._check_load(index, damper)
            try:
                self.contact.element(damper.restitution, damper.mass)
            except InputError as error:
                raise ValueError(f"damper[{index}].{error}") from None
        for cavity in self.cavity:
            self._check_row(cavity)
        if self.planar:
            self._check_plane()
        if self.wear is not None and self.contact.parallel:
            raise ValueError(
                f'wear: each spring of law = "{self.contact.law}" counts as an impact; take law = "compliant" with a '
                "stiffness"
            )
        self._check_wear_pairs()
        if self.excitation.engine_order is not None and not self.speed:
            raise ValueError("excitation.engine_order: its frequency follows the speed; give [rotation] a speed or rpm")
        self._check_rotation()
        self._check_structure()
        self._check_ring()
        self._check_elements()
        in_files = dict[str, str]()
        for path, axis in self.sweep.items():
            if (other := in_files.setdefault(path.replace(".", "_"), path)) != path:
                raise ValueError(f"sweep.{path}: files have _ for dots, which makes it {other}; rename the cavity")
            if path in _KEPT and not (isinstance(axis, int) and axis >= _KEPT[path][0]):
                raise ValueError(f"sweep.{path}: expected a whole number of periods, at least {_KEPT[path][0]}")
            if isinstance(axis, int) and path not in _KEPT:
                raise ValueError(f"sweep.{path}: {_NO_AXIS}")
        if self.ranges:
            self._check_ranges()
        if len(self.axes) + len(self.ranges) > 1:
            self._check_twins()

    @property
    def speed(self) -> float:
        """Speed of rotation, rad/s."""
        return 0.0 if self.rotation is None else self.rotation.omega

    @property
    def frequency(self) -> float:
        """Frequency of the excitation, Hz: its own, that of its engine order, or of its waveform. Raises InputError."""
        signal = self.excitation.waveform
        if signal is not None and signal.timed:
            given = self.excitation.frequency
            if given is not None and not abs(given * signal.duration - 1.0) <= _SAME_PERIOD:
                raise InputError(
                    f'excitation.frequency: shape "{signal.shape}" lasts {signal.duration:.6g} s, a period of '
                    f"{1 / signal.duration:.6g} Hz, not {given:.6g}; leave the frequency out"
                )
            return 1.0 / signal.duration
        if self.excitation.engine_order is not None:
            return frequency_of(self.excitation.engine_order, self.speed)
        assert self.excitation.frequency is not None
        return self.excitation.frequency

    @property
    def resonance_range(self) -> tuple[float, float]:
        """Lowest and highest frequency, Hz, near which the resonance of resonance_amplitude is sought."""
        near = self.excitation.resonance_near or self.frequency
        return near if isinstance(near, tuple) else (near, near)

    @property
    def planar(self) -> bool:
        """Whether it needs the engine for planar bodies: a body planar or on a spring, or impacts of two phases.

        So do neighbours with springs in parallel, which the engine for sliders takes to begin at once.
        """
        rubs = any(element.rubs for _, _, element in self.elements)
        rows = self.contact.parallel and len({damper.cavity for damper in self.damper}) < len(self.damper)
        return rubs or rows or self.contact.two_phases or any(damper.planar for damper in self.damper)

    @property
    def elements(self) -> Iterator[tuple[str, int, SceneElement]]:
        """Table, number in it, and record of every element: stops, and those that other code adds."""
        tables = self.element_tables.items()
        return ((table, number, entry) for table, entries in tables for number, entry in enumerate(entries))

    @property
    def element_tables(self) -> dict[str, tuple[SceneElement, ...]]:
        """The lists of tables of elements by their names."""
        return {"stop": self.stop} | (self.added or {})

    @property
    def repeats(self) -> bool:
        """Whether labels and tables are still to be repeated over the sectors of a ring (system.sectors.unrolled)."""
        if not isinstance(self.structure, Ring):
            return False
        tables: tuple[Any, ...] = (*self.cavity, *self.friction_damper, *(one for _, _, one in self.elements))
        return (
            "@" not in str(self.excitation.at)
            or self.excitation.travelling is not None
            or any(entry.sectors is not None for entry in tables)
        )

    def cavity_of(self, damper: Damper) -> int:
        """Return the number of a body's cavity."""
        return [cavity.name for cavity in self.cavity].index(damper.cavity)

    def bodies_in(self, cavity: Cavity) -> list[int]:
        """Return the numbers of the bodies in a cavity, from left to right."""
        return [number for number, damper in enumerate(self.damper) if damper.cavity == cavity.name]

    @property
    def positions(self) -> list[float]:
        """Positions of the bodies at time zero relative to their cavities, m: those given, the others spread."""
        positions = [0.0] * len(self.damper)
        for cavity in self.cavity:
            row = self.bodies_in(cavity)
            for number, position in zip(row, spread([self.damper[n].position for n in row], cavity.gap), strict=True):
                positions[number] = position
        return positions

    @property
    def yields(self) -> bool:
        """Whether contacts are springs: by the contact law, or by elements."""
        return not self.contact.rigid or any(element.yields for _, _, element in self.elements)

    @classmethod
    def keys_added(cls) -> Mapping[str, Any]:
        """Return the tables of elements that are no fields."""
        names = [name for name in ELEMENTS.names() if name not in cls.__dataclass_fields__]
        return {name: _list_of(ELEMENTS.part(name)) for name in names}

    def _check_plane(self) -> None:
        """Raise ValueError where a scene with planar bodies lacks or has something that they cannot do with."""
        for index, damper in enumerate(self.damper):
            number = self.cavity_of(damper)
            if damper.form.planar and self.cavity[number].play is None:
                raise ValueError(
                    f'cavity[{number}].play: missing; damper[{index}] with shape = "{damper.shape}" needs the free '
                    "travel across the cavity"
                )
        shapes = [damper.shape for damper in self.damper]
        if "auto" in shapes and not {"slider", "auto"}.issuperset(shapes):
            raise ValueError(
                f'damper[{shapes.index("auto")}].shape: "auto" compares blocks with sliders, and needs sliders or '
                '"auto" beside it; say which body each is'
            )
        for index, damper in enumerate(self.damper):
            if "auto" in shapes and damper.sprung:
                raise ValueError(
                    f'damper[{index}].stiffness, dashpot, track_radius: beside shape = "auto" bodies have no springs; '
                    "say which body each is"
                )
        if "auto" in shapes and not self.contact.rigid:
            raise ValueError(
                f'contact.law: "{self.contact.law}" beside shape = "auto", which is for rigid contacts; say which body '
                "each is"
            )

    def _check_load(self, index: int, damper: Damper) -> None:
        # a planar body has a ceiling to fall on
        if damper.form.planar or damper.normal_load is not None or damper.friction == 0:
            return
        if self.speed:
            number = self.cavity_of(damper)
            angle = self.cavity[number].centrifugal_deg
            if math.cos(math.radians(angle)) < -1e-12:
                raise ValueError(
                    f"damper[{index}]: the centrifugal load lifts the body off the floor at "
                    f"cavity[{number}].centrifugal_deg = {angle:g}; give normal_load or turn it to -90..90"
                )
        elif (
            self.gravity.direction is None
            and math.cos(math.radians(self.gravity.orientation_deg)) < -1e-12
            and self.gravity.acceleration > 0
        ):
            raise ValueError(
                f"damper[{index}]: gravity lifts the body off the floor at gravity.orientation_deg = "
                f"{self.gravity.orientation_deg:g}; give normal_load or turn it to -90..90"
            )

    def _check_rotation(self) -> None:
        """Raise ValueError where the place of a cavity in rotation is missing, or given twice."""
        for index, cavity in enumerate(self.cavity):
            if isinstance(self.structure, Rom):
                for key in ("radius", "centrifugal_deg"):
                    if getattr(cavity, key):
                        raise ValueError(
                            f"cavity[{index}].{key}: a reduced model has the places and directions of its cavities; "
                            "leave it out"
                        )
                continue
            loads = [self.damper[number].normal_load for number in self.bodies_in(cavity)]
            if self.speed and cavity.radius is None and (None in loads or (loads and cavity.centrifugal_deg)):
                raise ValueError(
                    f"cavity[{index}].radius: missing; [rotation] turns its bodies: give the distance from the axis to "
                    "the body's centre, m"
                )

    def _check_row(self, cavity: Cavity) -> None:
        given = ((number, self.damper[number].position) for number in self.bodies_in(cavity))
        row = [(number, position) for number, position in given if position is not None]
        for index, position in row:
            if abs(position) > cavity.gap / 2:
                raise ValueError(
                    f"damper[{index}].position: {position:g} lies outside cavity '{cavity.name}'; "
                    f"its free travel is -{cavity.gap / 2:g} to {cavity.gap / 2:g}"
                )
        for (_, left), (index, right) in itertools.pairwise(row):
            if right < left:
                raise ValueError(
                    f"damper[{index}].position: overlaps the body before it in cavity '{cavity.name}'; "
                    "bodies stand in file order from left to right"
                )

    def _check_structure(self) -> None:
        if isinstance(self.structure, Rom):
            if self.excitation.at is None:
                raise ValueError("excitation.at: name the interface label of force and response on the reduced model")
            for index, cavity in enumerate(self.cavity):
                if cavity.labels()[2] is None:
                    raise ValueError(f"cavity[{index}].floor: name an interface label of the reduced model")
            if self.initial != Initial():
                raise ValueError("initial: an initial state is for rigid structures; a reduced model starts at rest")
        elif self.gravity.direction is not None:
            raise ValueError(
                "gravity.direction: a direction in space is for a reduced model, whose interface has directions; "
                "give orientation_deg"
            )
        elif self.excitation.distributed:
            key = "load" if self.excitation.load else "pattern"
            remedy = "leave it out" if isinstance(self.structure, Prescribed) else "give force"
            raise ValueError(
                f"excitation.{key}: interface labels are a reduced model's; this structure has no points: {remedy}"
            )
        elif self.excitation.base_direction is not None:
            raise ValueError(
                "excitation.base_direction: a direction in space is for a reduced model, whose interface has "
                "directions; the base of this structure moves along its one axis"
            )
        elif self.contact.takes_residual_flexibility:
            raise ValueError(
                'contact: the residual flexibility is that of a reduced model; take structure.model = "rom"'
            )
        if isinstance(self.structure, Prescribed):
            excitation = self.excitation
            if excitation.base_acceleration:
                raise ValueError(
                    "excitation.base_acceleration: a prescribed motion is that of the base; leave it out, "
                    "structure.displacement_amplitude sets the level"
                )
            if excitation.force or excitation.resonance_amplitude:
                raise ValueError(
                    "excitation: a prescribed motion takes only frequency and harmonics; structure sets the amplitude"
                )
            if excitation.signal is not None:
                raise ValueError("excitation.waveform: a prescribed motion takes a sum of sines; give harmonics")
            if self.friction_damper:
                raise ValueError("friction_damper: a prescribed motion feels no force; remove it")
            if self.initial != Initial():
                raise ValueError("initial: a prescribed motion has no initial state; remove the table")

    def _check_ring(self) -> None:
        """Raise ValueError for something of a ring on another structure, and for a wave that is not of sines."""
        excitation, ring = self.excitation, isinstance(self.structure, Ring)
        tables: dict[str, tuple[Any, ...]] = {"cavity": self.cavity, "friction_damper": self.friction_damper}
        tables |= self.element_tables
        for table, entries in tables.items():
            for number, entry in enumerate(entries):
                if entry.sectors is not None and not ring:
                    raise ValueError(
                        f'{table}[{number}].sectors: this structure is no ring; take structure.model = "ring", or '
                        "leave it out"
                    )
        if excitation.wave is not None and (not ring or excitation.base_acceleration):
            whose = "a base moves all sectors alike" if ring else 'is around a ring, structure.model = "ring"'
            raise ValueError(f"excitation.wave: {whose}; leave it out")
        if ring and excitation.travelling is not None and excitation.waveform is not None:
            raise ValueError("excitation.waveform: a wave around a ring takes sines; give harmonic")

    def _check_wear_pairs(self) -> None:
        """Raise ValueError for contacts with rates of their own that the scene has not."""
        counts = {"casing": len(self.friction_damper)} | {name: len(of) for name, of in self.element_tables.items()}
        for number, pair in enumerate(() if self.wear is None else self.wear.pair):
            owners = {"casing": "friction dampers", "stop": "stops", "joint": "joints"}.get(pair.side or "", "bodies")
            count = counts.get(pair.side or "", len(self.damper))
            if pair.side is None:
                count = max(count, *counts.values())
            if pair.damper is not None and pair.damper >= count:
                raise ValueError(
                    f"wear.pair[{number}].damper: there are only {count} {owners}, counted from 0 (got {pair.damper})"
                )

    def _check_ranges(self) -> None:
        """Raise ValueError for a range that is none, or of no number of the scene."""
        for path, (low, high) in self.ranges.items():
            if not low < high:
                raise ValueError(f"ranges.{path}: expected [lowest, highest], not [{low:g}, {high:g}]")
            if low <= 0.0 and self.sampled.distribution == "log-uniform":
                raise ValueError(
                    f'ranges.{path}: distribution = "log-uniform" takes a range above zero, not [{low:g}, {high:g}]'
                )
            try:
                self.number(path)
            except InputError as error:
                raise ValueError(f"ranges.{str(error).removeprefix('scene: ')}") from None

    def _check_twins(self) -> None:
        """Raise ValueError where two axes or ranges are of one value: the later would hide the earlier."""
        data, axes, ranges = self.to_dict(), list(self.axes), list(self.ranges)
        for number, path in enumerate(axes):
            if (other := namesake(data, path, ranges)) is not None:
                same = "" if other == path else f" (ranges.{other})"
                raise ValueError(f"sweep.{path}: is a range as well{same}; it can be one of them")
            if (other := namesake(data, path, axes[:number])) is not None:
                raise ValueError(f"sweep.{path}: names the same value as {other}; leave one of them out")
        for number, path in enumerate(ranges):
            if (other := namesake(data, path, ranges[:number])) is not None:
                raise ValueError(f"ranges.{path}: names the same number as {other}; leave one of them out")

    def _check_elements(self) -> None:
        """Raise ValueError for an element that the structure, or something else in the scene, does not fit."""
        for table, number, element in self.elements:
            try:
                element.check(self)
            except ValueError as error:
                raise ValueError(f"{table}[{number}].{error}") from None
            given = [key for key, label in element.labels().items() if label is not None]
            if given and not isinstance(self.structure, Rom):
                raise ValueError(
                    f"{table}[{number}].{given[-1]}: interface labels are a reduced model's; the one mode of this "
                    "structure has no points: leave it out"
                )
            if element.on_structure and isinstance(self.structure, Prescribed):
                raise ValueError(f"{table}: a prescribed motion feels no force; remove it")

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read the scene in a TOML file; the files that it names are taken relative to it. Raises InputError."""
        return cls.of(read_toml(path), path)

    @classmethod
    def of(cls, data: dict[str, Any], path: str | Path) -> Self:
        """Return the scene in the tables of a TOML file that lies at `path`."""
        for table, key in _named_files(data):
            table[key] = str(Path(path).parent / table[key])
        return read(cls, data, str(path))

    def save(self, path: str | Path) -> None:
        """Write the TOML file that `load` reads; files in its folder, such as a reduced model's, are relative to it.

        A reduced model in memory is written to the same folder, as NAME_rom.h5.
        """
        from vanedamp.files.toml_output import toml
        from vanedamp.rom import in_memory

        data = self.to_dict()
        if isinstance(self.structure, Rom) and in_memory.is_temporary(self.structure.file):
            rom = Path(path).with_name(f"{Path(path).stem}_rom.h5")
            with replacing(rom) as temporary:
                copyfile(self.structure.file, temporary)
            data["structure"]["file"] = str(rom)
        with replacing(path) as temporary:
            temporary.write_text(toml(relative(data, path)), encoding="utf-8")

    @property
    def files(self) -> list[str]:
        """The files that the scene and its sweep name."""
        named = [table[key] for table, key in _named_files(self.to_dict())]
        swept = [self.axes.get(path, ()) for path in FILE_PATHS]
        return named + [str(file) for files in swept if not isinstance(files, Range) for file in files]

    @property
    def axes(self) -> dict[str, Range | tuple[Any, ...]]:
        """Axes of its sweep, by their paths."""
        return {path: axis for path, axis in self.sweep.items() if not isinstance(axis, int)}

    @property
    def kept(self) -> dict[str, int]:
        """Keys of the [sweep] table that are no axes: "sections" and "exponents"."""
        return {path: axis for path, axis in self.sweep.items() if isinstance(axis, int)}

    @property
    def sampled(self) -> EnsembleTable:
        """How numbers that are ranges are sampled."""
        return self.ensemble or EnsembleTable()

    @property
    def points(self) -> int:
        """Points of the grid of its sweep."""
        return math.prod(axis.num if isinstance(axis, Range) else len(axis) for axis in self.axes.values())

    @property
    def moved(self) -> bool:
        """Whether something moves the structure or the bodies, here or in an axis of the sweep."""
        given = self.excitation.force, self.excitation.base_acceleration, self.excitation.resonance_amplitude
        swept = {path.split(".")[0] for path in self.axes if path != "excitation.frequency"}
        return (
            isinstance(self.structure, Prescribed)
            or any(value is not None for value in given)
            or self.excitation.distributed
            or self.initial != Initial()
            or any(body.velocity or (body.sprung and at) for body, at in zip(self.damper, self.positions, strict=True))
            or (bool(self.speed) and any(cavity.centrifugal_deg for cavity in self.cavity))
            or (bool(self.speed) and isinstance(self.structure, Rom))
            or self.gravity.orientation_deg != 0.0
            or self.gravity.direction is not None
            or not swept.isdisjoint({"structure", "excitation", "initial", "damper", "gravity", "rotation"})
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain nested data as in the file, without values that are None."""
        return tables(self)

    def number(self, path: str, data: dict[str, Any] | None = None) -> float:
        """Return the number at a dotted path, of positions where the bodies begin. Raises InputError for none.

        data: its plain data, where they are known: positions are set there.
        """
        data = self.to_dict() if data is None else data
        for body, position in zip(data.get("damper", ()), self.positions, strict=True):
            body["position"] = position
        return number_at(data, path)

    def replace(self, values: Mapping[str, Any]) -> Scene:
        """Return another scene with some values changed, by their dotted paths ("cavity.c1.gap", "damper.0.mass").

        A path that names a list without index ("damper.mass") changes every entry. [low, high] in the place of a number
        makes it a range. Raises InputError.
        """
        data = self.to_dict()
        data["ranges"] = {path: ends for path, ends in data["ranges"].items() if namesake(data, path, values) is None}
        for path, value in values.items():
            assign(data, path, value)
        return read(Scene, data, "scene")

    def sweep_points(self) -> tuple[dict[str, np.ndarray], Iterator[dict[str, Any]]]:
        """Return the grid of the [sweep] table: axes by path, points of their product with the last axis fastest."""
        axes = {path: axis_values(values) for path, values in self.axes.items()}
        points = (dict(zip(axes, values, strict=True)) for values in itertools.product(*axes.values()))
        return {path: np.asarray(values) for path, values in axes.items()}, points


def _named_files(data: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    """Yield the tables of a scene that name a file, each with its key."""
    for keys in _FILES:
        table: Any = data
        for step in keys[:-1]:
            table = table.get(step) if isinstance(table, dict) else None
        if isinstance(table, dict) and isinstance(table.get(keys[-1]), str):
            yield table, keys[-1]


def relative(data: dict[str, Any], path: str | Path | None) -> dict[str, Any]:
    """Name the files of a scene as one that lies at `path` does: those in its folder or below relative to it.

    Without a path they have their whole path.
    """
    folder = None if path is None else Path(path).resolve().parent
    for table, key in _named_files(data):
        file = Path(table[key]).resolve()
        table[key] = str(file.relative_to(folder) if folder and file.is_relative_to(folder) else file)
    return data


def loaded(scene: Scene | str | Path) -> Scene:
    """Return a scene, or the one in a TOML file. Raises InputError for anything else."""
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, str | Path):
        return Scene.load(scene)
    raise InputError(f"scene: expected a Scene or its TOML file, not {type(scene).__name__}")


@cache
def _list_of(part: Any) -> Any:
    """Return the type of a list of tables of an element, the same each time: what validates it is built once."""
    about = (part.__doc__ or part.__name__).partition("\n")[0].rstrip(".")
    return Annotated[tuple.__class_getitem__((part, ...)), Field(description=about)]
