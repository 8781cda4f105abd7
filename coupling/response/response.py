"""The result of a run: amplitudes, classification, energies, events and samples (SI units)."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from enum import StrEnum
from typing import Annotated, Any, ClassVar

import numpy as np

from vanedamp.coupling.quantities.quantity import Quantity, QuantityRecord, labels, table
from vanedamp.coupling.quantities.sums import OF_MOTION
from vanedamp.coupling.response.contact_strength import ContactStrength
from vanedamp.coupling.response.contact_work import ContactFriction, ContactWear, ContactWork
from vanedamp.coupling.response.restart_state import RestartState
from vanedamp.coupling.response.sector_response import SectorResponse
from vanedamp.coupling.response.spot_stress import SpotStress
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.display import Plotted
from vanedamp.files.record import Array, Named, NumberUnit, Own, Record, RecordRows, Within, declared, empty
from vanedamp.files.store import Variable, frozen
from vanedamp.files.toml_input import validate
from vanedamp.rom.recovery import COMPONENTS

#: attributes of a file that are tables
_NESTED = ("stress", "strength", "sectors")


#: quantities that runs lack, and why
_CURVE = "a run has one frequency; the curve of a sweep has peaks"
NOT_IN_RUNS = {"undamped_top": _CURVE, "fixed_top": _CURVE}


class Status(StrEnum):
    """How a run ended. Without `ok` the results cover only the periods that were completed."""

    OK = "ok"
    """all periods done, or steady to the required tolerance"""
    EVENT_BUDGET = "event_budget"
    """`solver.max_events` events without reaching the end"""
    ACCURACY_LOST = "accuracy_lost"
    """round-off has let a body through a wall"""
    UNDECIDED = "undecided_contact"
    """the complementarity problem of the contacts found no solution"""
    ILL_CONDITIONED = "ill_conditioned"
    """while some contacts are closed, modes are critically damped to round-off or masses and stiffnesses so far apart
    that doubles cannot resolve the motion, or one vibrates a million times within a period and the search for the next
    event does not end; change a damping, a mass or a stiffness"""
    PENETRATION = "penetration"
    """a body is deeper in a wall than `solver.penetration` allows: an impact was missed, or the steps are too long"""
    DIVERGED = "diverged"
    """the motion grew beyond all bounds; amplitudes and energies are nan"""
    TILTED = "tilt_too_large"
    """bodies tilt so far that the error of small tilts exceeds `solver.linearisation`"""
    ENERGY = "energy_not_balanced"
    """the energy imbalance exceeds the method's bound, or impacts or contacts have generated energy: do not use the
    results"""
    NOT_STEADY = "not_steady"
    """no end of the transient in sight, or `time.transient` is too short for it; the figures are those of the periods
    evaluated"""
    UNCERTAIN = "confidence_not_reached"
    """the mean's confidence interval is still too wide"""


@dataclass(frozen=True)
class Event:
    """One event. Speeds are relative to the wall or body met; of planar bodies and at stops, of the gap."""

    time: Annotated[float, NumberUnit("s")]
    """time"""
    kind: str
    """what happened: "impact"; "stick" and "slip" on the floor or of a friction damper; "rest" at a wall or a
    neighbour, and "detach" from it"""
    damper: int
    """index of the body, from 0; for a stop, a friction damper or another element of the structure its own index"""
    side: str
    """"left", "right" (walls), "body" (the next body to the right), "floor", "ceiling"; "casing" for a friction damper,
    "stop" for a stop; of other elements the name of their table"""
    relative_velocity_before: Annotated[float, NumberUnit("m/s")]
    """relative speed before"""
    relative_velocity_after: Annotated[float, NumberUnit("m/s")]
    """relative speed after"""
    impulse: Annotated[float, NumberUnit("N s")]
    """impulse along the normal"""
    corner: int = -1
    """corner of a body, from 0 (of a block 0 to 3) counterclockwise from the lower left one; of a joint with two
    directions, whose contacts share its normal force, 0 along and 1 sideways; -1: none"""
    tangential_impulse: Annotated[float, NumberUnit("N s")] = 0.0
    """impulse of friction"""
    loss: Annotated[float, NumberUnit("J")] = 0.0
    """energy that the impulses of an impact take, without the completion of a chatter"""


def _written(contacts: Sequence[tuple[int, str, int]]) -> dict[str, Variable]:
    """Return contacts as variables of a file."""
    columns = zip(("damper", "side", "corner"), (int, object, int), zip(*contacts, strict=True), strict=True)
    return {f"contact_{name}": Variable(np.array(column, dtype), ("contact",)) for name, dtype, column in columns}


def _contacts(values: Mapping[str, Any]) -> tuple[tuple[int, str, int], ...]:
    """Return the contacts in the variables of a file."""
    return tuple(zip(*(values[f"contact_{name}"].tolist() for name in ("damper", "side", "corner")), strict=True))


_OfBodies = Annotated[np.ndarray, Array(("time", "damper"), "m")]
_Angles = Annotated[np.ndarray, Array(("time", "damper"), "rad")]


@dataclass(frozen=True, eq=False, repr=False)
class PlanarSamples(Record):
    """Samples of planar bodies at the times of Response.time; lift, tilt and floor_across: nan for sliders."""

    body_lift: _OfBodies
    """height of each body's centre above its height flat on its floor"""
    body_tilt: _Angles
    """tilt of bodies relative to their cavities, counterclockwise"""
    floor_along: _OfBodies
    """displacement of the floor under a body along it, with a prescribed motion of the base"""
    floor_across: _OfBodies
    """the same across it"""
    floor_rotation: _Angles
    """rotation of the floor"""
    contact_gap: Annotated[np.ndarray, Array(("time", "contact"), "m")]
    """gap of each contact"""
    contact_closed: Annotated[np.ndarray, Array(("time", "contact"), dtype=bool)]
    """whether it is closed; of methods with time steps, whether it carried force in the step before"""
    contacts: Annotated[tuple[tuple[int, str, int], ...], Own(_written, _contacts)]
    """body, side and corner of each contact, as of an Event: `contact_damper`, `contact_side`, `contact_corner`"""

    def cut(self, rows: Any) -> PlanarSamples:
        """Return the samples at some of the times, as numpy indexes them."""
        return replace(self, **{name: getattr(self, name)[rows] for name in declared(type(self)) if name != "contacts"})


@dataclass(frozen=True, eq=False, repr=False)
class Response(QuantityRecord, Record, Plotted):
    """The response of a structure with loose bodies. Amplitudes and energies refer to the evaluated periods.

    All quantities that it has are attributes of it, too (docs/reference/results.md); None: it has none.
    """

    KIND: ClassVar[str] = "response"
    IN_JSON = (
        "status",
        "frequency",
        "events",
        "classification",
        "energy",
        "wall_time_s",
        "periods",
        "transient",
        "counters",
        "warnings",
    )
    status: Status
    """how the run ended"""
    frequency: float
    """frequency of the excitation [Hz]"""
    quantities: Annotated[Mapping[str, Any], Own()]
    """quantities by name, of sums over the evaluated periods; None: not known"""
    events: int
    """entries of `event_list` over the whole run, listed or not: contacts that hit, stick, slip, detach or come to rest
    (methods other than "exact": impacts); `solver.max_events` bounds `counters.changes`, or the impacts of methods with
    steps"""
    classification: str
    """"periodic-k", "non-periodic", "no-contact" or "stuck" (evaluation.class_name)"""
    energy: dict[str, float]
    """over the evaluated time: work of the `excitation`; `viscous`, `friction`, `impact` and `contact` loss; change of
    what is `stored` [J]"""
    wall_time_s: float
    """time that the run took [s]"""
    periods: int
    """periods simulated"""
    transient: int
    """periods of these that are left out"""
    counters: dict[str, int]
    """counts of what the method did, by name"""
    peak: Annotated[np.ndarray, Array(("full_period",), "m")]
    """largest displacement of each period, without its sign"""
    section: Annotated[np.ndarray, Array(("period", "state"), "m, m/s")]
    """displacement and velocity at the start of each period; one more than periods"""
    slip: Annotated[np.ndarray, Array(("period", "damper"), "m")]
    """displacements of the bodies relative to their cavities at the start of each period"""
    slip_velocity: Annotated[np.ndarray, Array(("period", "damper"), "m/s")]
    """velocities of the bodies relative to their cavities there"""
    event_list: Annotated[Sequence[Event], RecordRows("event")] = ()
    """events, empty if they were not asked for"""
    time: Annotated[np.ndarray, Array(("time",), "s")] = field(default_factory=empty)
    """of the samples, empty if none were asked for"""
    displacement: Annotated[np.ndarray, Array(("time",), "m")] = field(default_factory=empty)
    """displacement at `excitation.at`"""
    body_displacement: Annotated[np.ndarray, Array(("time", "damper"), "m")] = field(
        default_factory=lambda: np.zeros((0, 0))
    )
    """displacements of the bodies relative to their cavities"""
    estimate: dict[str, Any] | None = None
    """estimate of the error of a reduced model whose number of modes was chosen automatically"""
    final: Annotated[RestartState | None, Own()] = None
    """the state at the end, with which another run can begin; None for a run that ended within a period, or whose
    method leaves none"""
    warnings: Annotated[tuple[str, ...], Array(("warning",), dtype=object, attribute=True)] = ()
    """to be read before the figures are used"""
    moved_start: dict[str, Any] | None = None
    """of a second run, whose bodies begin about 1e-9 of their gap aside: status, mean amplitude and its confidence, as
    `amplitude_mean_dynamic`, and whether it `agrees`; None if it was not asked for, and without impacts of bodies"""
    in_plane: Annotated[PlanarSamples | None, Within()] = None
    """samples of bodies in the plane; None without any"""
    advice: dict[str, Any] | None = None
    """advice on the bodies whose shape was chosen automatically"""
    coordinates: Annotated[np.ndarray | None, Array(("time", "mode"), "kg^0.5 m")] = None
    """samples of a reduced model's mass-normalised modal coordinates; None without"""
    contact_work: Annotated[tuple[ContactWork, ...] | None, Own()] = None
    """work of friction and impacts of each contact; without `[wear]` None"""
    wear: tuple[ContactWear, ...] | None = None
    """wear of each contact, at the mean rates of the evaluated periods; without `[wear]` None"""
    contact_friction: tuple[ContactFriction, ...] | None = None
    """friction of each contact that rubs, of scenes with `[[joint]]`; None for others, and for methods with steps"""
    stress: Annotated[tuple[SpotStress, ...] | None, Own()] = None
    """stress at the hot spots of a reduced model; None without any [Pa]"""
    sectors: Annotated[SectorResponse | None, Own()] = None
    """response of each sector of a ring; None for other structures"""
    contacts: Annotated[tuple[ContactStrength, ...] | None, Named("contact_strength")] = None
    """largest forces and pressures of the impacts of each contact; without a rounded `[contact.pair]` None"""
    lyapunov: dict[str, Any] | None = None
    """Lyapunov exponents of the motion after the run (vanedamp.lyapunov), if they were asked for [1/s]"""
    scene: Annotated[Scene | None, Own()] = None
    """that was run, as given; None: not known"""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    """versions and further data of the caller (JSON-able)"""

    def __getattr__(self, name: str) -> Any:
        """Return a quantity: of those that are kept, or from the parts that it needs."""
        if not name.startswith("_") and name not in self.quantities and name in table():
            one = table()[name]
            return one.of(self.__dict__) if one.exists(self.__dict__) else None
        return super().__getattr__(name)

    @property
    def _plain(self) -> dict[str, Any]:
        """The quantities with a number for the whole run, for each body, or by names, that it has."""
        known = {
            name: getattr(self, name)
            for name, one in table().items()
            if not one.dims or (len(one.dims) == 1 and (one.dims == ("damper",) or labels(one.dims[0])))
        }
        return {name: value for name, value in known.items() if value is not None or name in self.quantities}

    def shown(self) -> dict[str, Any]:
        """Return the values that are printed, by name."""
        left_out = ("quantities", "scene", "provenance")
        values = {name: value for name, value in super().shown().items() if name not in left_out}
        first = {name: values.pop(name) for name in ("status", "frequency")}
        return first | self._plain | values

    def printed_units(self) -> dict[str, str]:
        """Return the units of the results that have one, by name."""
        return units()

    def to_json(self, events: bool = False) -> dict[str, Any]:
        """Return the result as plain data, with the list of events if wanted."""
        data = super().to_json()
        data = {name: data.pop(name) for name in ("status", "frequency", *self._plain)} | data
        if not events:
            return data
        planar = () if self.tilt_max is not None else ("corner", "tangential_impulse", "loss")
        listed = [{k: v for k, v in asdict(event).items() if k not in planar} for event in self.event_list]
        return data | {"event_list": listed}

    def derived(self) -> dict[str, Any]:
        """Return data of some runs only."""
        names = ("moved_start", "estimate", "advice", "wear", "contact_friction", "contacts", "lyapunov")
        data = {name: value for name, value in self.plain(names).items() if value is not None}
        data |= {name: _listed(table()[name], value) for name, value in self._plain.items()}
        if self.stress is not None:
            data["stress"] = {spot.name: spot.to_json() for spot in self.stress}
            data["strength"] = {spot.name: dict(spot.strength) for spot in self.stress if spot.strength}
        return data if self.sectors is None else data | {"sectors": self.sectors.to_json()}

    def save(self, path: str | os.PathLike[str], provenance: Mapping[str, Any] | None = None) -> None:  # type: ignore[override]
        """Write HDF5 that xarray opens: per-period series, samples and events, with the scene. Raises StoreError."""
        super().save(path, attributes={"provenance": self._made() | dict(provenance or {})})

    def _made(self) -> dict[str, Any]:
        return ({} if self.scene is None else {"scene": self.scene.to_dict()}) | dict(self.provenance)

    def labels(self) -> dict[str, Any]:
        """Return the numbers of periods, and the names along dimensions that have some."""
        named = {"hot_spot": [spot.name for spot in self.stress], "stress_component": COMPONENTS} if self.stress else {}
        return {"period": np.arange(len(self.section)), **named}

    def variables(self) -> dict[str, Variable]:
        """Return the variables of a file, with the quantities of its hot spots or sectors."""
        return super().variables() | {
            name: Variable(value, one.dims, one.unit)
            for name, one in table().items()
            if one.dims[:1] in (("hot_spot",), ("sector",), ("joint",)) and (value := getattr(self, name)) is not None
        }

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a file."""
        facts = {name: value for name, value in self.derived().items() if name in _NESTED}
        facts |= {name: value for name, value in self._plain.items() if value is not None}
        return super().attributes() | facts | {"provenance": self._made(), "warnings": list(self.warnings)}

    @classmethod
    def of(cls, values: Mapping[str, Any], attributes: Mapping[str, Any], path: str = "") -> Response:
        """Return the response in a file: all but `final` and `contact_work`."""
        earlier = dict[str, Any]()
        if "event_corner" in values and "event_loss" not in values:
            earlier["event_loss"] = np.full(len(values["event_corner"]), np.nan)
        given = cls.given(earlier | dict(values), attributes, path)
        scene = given["provenance"].pop("scene", None)
        nested = {name: json.loads(attributes[name]) for name in _NESTED if name in attributes}
        names = [name for name, one in table().items() if not one.exists(cls.__dataclass_fields__)]
        quantities = {name: None for name in names if table()[name].exists(OF_MOTION)} | {
            name: float(value) if np.ndim(value := attributes[name]) == 0 else frozen(value)
            for name in names
            if name in attributes
        }
        return cls(
            quantities=quantities,
            stress=tuple(SpotStress.of(name, facts, nested.get("strength", {}).get(name, {}))
                         for name, facts in nested["stress"].items()) if "stress" in nested else None,
            sectors=SectorResponse.of(values, nested["sectors"]) if "sectors" in nested else None,
            scene=None if scene is None else validate(Scene, scene, path), **given,
        )  # fmt: skip


def units() -> dict[str, str]:
    """Return the units of the results of a run that have one, by name."""
    own = {name: one.unit for name, one in table().items() if one.unit != "1"}
    return {"frequency": "Hz", "wall_time_s": "s"} | own


def _listed(one: Quantity, value: Any) -> Any:
    """Return a quantity as plain data: by name along a dimension that has some."""
    if np.ndim(value) == 0:
        return value
    plain = [None if np.isnan(number) else number for number in np.asarray(value).tolist()]
    return dict(zip(labels(one.dims[0]), plain, strict=True)) if labels(one.dims[0]) else plain
