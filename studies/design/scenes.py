"""Scenes of devices on the reduced model of a case: levels of the model hierarchy, studies of searches and of lives."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.strength.spots import Spots, spots_of
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.linear_response import linear_peaks
from vanedamp.coupling.system.resonance import chosen_resonance
from vanedamp.coupling.system.transient import settled_after
from vanedamp.files.toml_input import InputError, plain, tables
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.design.tables import DesignFile
from vanedamp.studies.model_scene import contact_stiffness, on_model

#: ends of the default band over the resonances with the heaviest bodies fixed and without bodies, and points per width
_BAND, _PER_WIDTH = (0.985, 1.01), 1.5
_FEWEST, _MOST = 15, 60
#: range of that resonance, over its frequency
_NEAR = (0.99, 1.01)
#: damping ratio by which the band is spaced where the model has none
_DAMPING = 1e-3
#: periods that are evaluated, and longest transient
_EVALUATED, _LONGEST = 200, 100_000
#: file of the model without hot spots, in the folder of the model
PLAIN = "rom_plain.h5"
#: levels of the model hierarchy below the whole model, by natural modes
LEVELS = (1, 3)
#: paths of what is uncertain of a device
UNCERTAIN = {
    "friction": "damper.friction", "restitution": "damper.restitution", "orientation_deg": "gravity.orientation_deg",
    "gap": "cavity.gap", "mass": "damper.mass",
}  # fmt: skip


class Device(NamedTuple):
    """Number of bodies, mass of each, kg, and gap, m."""

    bodies: int
    mass: float
    gap: float


def words_of(device: Device) -> str:
    """Return a device in words."""
    count = "1 body" if device.bodies == 1 else f"{device.bodies} bodies"
    each = "" if device.bodies == 1 else " each"
    return f"{count} of {1e3 * device.mass:.4g} g{each} with a gap of {1e6 * device.gap:.3g} um"


class Devices:
    """The devices of a study on its reduced model.

    frequency: Hz, of the resonance without bodies; amplitude: m, there; mass: kg, modal; frequencies: (f,) Hz of the
    band; cavities: tables of those that may hold bodies, without gaps.
    """

    def __init__(self, study: DesignFile, rom: Path, source: str) -> None:
        """Take a study, and the file of the case's reduced model. source: the study's file, which errors name.

        Raises InputError for an envelope that does not fit the model.
        """
        self.study, self.rom, self.source = study, rom, source
        self._model = ReducedModel.load(rom)
        structure, location, cavities, near = on_model(self._model, rom)
        fatigue = self._model.provenance.get("fatigue")
        if fatigue is not None:
            location["at"], near = fatigue["at"], [fatigue["frequency_hz"]] * 2
        excitation = location | {"frequency": near[0], "resonance_near": near} | self._level(study, fatigue)
        self._data: dict[str, Any] = {"structure": structure, "excitation": excitation}
        self.cavities = self._chosen(cavities)
        envelope, self._time = study.envelope, {"periods": 2, "transient": 1}
        middle = Device(envelope.bodies[0], envelope.mass[1] / envelope.bodies[0], envelope.gap[0])
        resonance = chosen_resonance(self.at(middle, LEVELS[0]))
        self.frequency, self.mass = resonance.frequency, resonance.mass
        excitation["resonance_near"] = [share * resonance.frequency for share in _NEAR]
        stiffness = contact_stiffness(self._model, self.cavities, resonance, envelope.mass[1] / envelope.bodies[0])
        compliant = {"law": "compliant", "stiffness": stiffness}
        self._data["contact"] = compliant if study.contact is None else plain(tables(study.contact))
        self.frequencies = self._band()
        self._data["excitation"]["frequency"] = float(self.frequencies[0])
        scene = self.at(middle, LEVELS[0])
        dropped = max(
            settled_after(scene.replace({"excitation.frequency": float(end)}), range(1, _LONGEST))
            for end in self.frequencies[[0, -1]]
        )
        self._time = {"periods": dropped + _EVALUATED, "transient": dropped}
        for level in (LEVELS[0], None):
            self._check(middle, level)
        self._check_requirements(spots_of(self.at(middle, None, stress=True)))
        self.amplitude = float(linear_peaks(scene, *map(float, self.frequencies[[0, -1]]))[0].amplitude)

    def _check(self, device: Device, level: int | None) -> None:
        """Raise InputError, naming the study, for a device that its model or its cavities do not take."""
        try:
            scene = self.at(device, level)
            assemble(scene if self.study.wear is None else scene.replace({"wear": plain(tables(self.study.wear))}))
        except InputError as error:
            raise InputError(f"{self.source}: envelope: {error}") from None

    def _check_requirements(self, spots: Spots | None) -> None:
        """Raise InputError for requirements of results that are not computed."""
        must = self.study.requirements
        if must.utilisation is not None and (spots is None or None in spots.materials):
            raise InputError(
                f"{self.source}: requirements.utilisation: no stress over a strength is computed; give "
                "effort.hot_spots, and the case a material.fatigue_strength"
            )
        lives = spots is not None and spots.have_lives
        if must.hours is not None and not lives and self.study.wear is None:
            raise InputError(
                f"{self.source}: requirements.hours: no life is computed; give [wear], or effort.hot_spots and the "
                "case [material.fatigue] with exponent and knee"
            )

    def _chosen(self, cavities: list[dict[str, Any]]) -> list[dict[str, Any]]:
        """Return the cavities that may hold bodies, without their gaps."""
        known = {cavity["name"]: {key: cavity[key] for key in cavity if key != "gap"} for cavity in cavities}
        for name in self.study.envelope.cavities:
            if name not in known:
                raise InputError(
                    f"{self.source}: envelope.cavities: no cavity '{name}'; the case has {', '.join(known)}"
                )
        return [known[name] for name in self.study.envelope.cavities or known]

    def _level(self, study: DesignFile, fatigue: dict[str, Any] | None) -> dict[str, float]:
        """Return the level of the excitation, with the amplitude at the case's fatigue strength if it is known."""
        level = study.operation.level
        if level and "fatigue_fraction" not in level:
            return level
        if fatigue is None:
            raise InputError(
                f"{self.source}: operation: a level is missing; give force, base_acceleration or "
                "resonance_amplitude, or the case a material.fatigue_strength"
            )
        given = level.get("fatigue_fraction", fatigue["share"])
        return {"resonance_amplitude": fatigue["amplitude"] * given / fatigue["share"]}

    def _band(self) -> np.ndarray:
        """Return the frequencies of the band: the study's, or those from the fixed resonance to the free one."""
        given = self.study.operation.band
        if given is not None:
            return np.linspace(given.start, given.stop, given.num)
        share = self.study.envelope.mass[1] / self.mass
        low, high = _BAND[0] * self.frequency / math.sqrt(1.0 + share), _BAND[1] * self.frequency
        width = 2.0 * (self._model.damping_ratio or _DAMPING) * self.frequency
        count = int(np.clip(math.ceil(_PER_WIDTH * (high - low) / width), _FEWEST, _MOST))
        return np.linspace(low, high, count)

    def tables(self, device: Device, level: int | None, stress: bool = False) -> dict[str, Any]:
        """Return the tables of a scene with a device, in the middle of what is uncertain.

        level: number of natural modes; None: the whole reduced model; stress: with hot spots, which take longer.
        """
        envelope, middle = self.study.envelope, {name: sum(span) / 2 for name, span in self.uncertain.items()}
        body: dict[str, Any] = {"mass": device.mass} | {name: middle[name] for name in ("friction", "restitution")}
        if envelope.normal_load is not None:
            body["normal_load"] = envelope.normal_load
        cavity: dict[str, Any] = {"gap": device.gap}
        if envelope.length is not None and level is None:
            body |= {"shape": "block", "length": envelope.length, "height": envelope.height}
            cavity["play"] = envelope.play or device.gap
        names = [entry["name"] for entry in self.cavities]
        order = sorted(index % len(names) for index in range(device.bodies))
        modes: dict[str, Any] = {} if level is None else {"modes": level, "natural": True}
        modes["file"] = str(self.rom if stress else self.rom.with_name(PLAIN))
        return {
            **self._data,
            "structure": self._data["structure"] | modes,
            "gravity": {"acceleration": 9.81, "orientation_deg": middle["orientation_deg"]},
            "cavity": [entry | cavity for entry in self.cavities],
            "damper": [{"cavity": names[index], **body} for index in order],
            "time": dict(self._time),
        }

    def at(self, device: Device, level: int | None, stress: bool = False) -> Scene:
        """Return such a scene. Raises InputError, naming the study, for a device that does not fit the model."""
        return Scene.of(self.tables(device, level, stress), self.source)

    @property
    def uncertain(self) -> dict[str, tuple[float, float]]:
        """Ranges of what is uncertain of every device, by the names of UNCERTAIN."""
        return self.study.envelope.uncertain

    def ranges(self, device: Device) -> dict[str, tuple[float, float]]:
        """Return the ranges of what is uncertain of a device, by paths, tolerances included; without single numbers."""
        envelope = self.study.envelope
        off, relative = envelope.gap_tolerance, envelope.mass_tolerance
        spans = self.uncertain | {
            "gap": (device.gap - off, device.gap + off),
            "mass": (device.mass * (1.0 - relative), device.mass * (1.0 + relative)),
        }
        return {UNCERTAIN[name]: (low, high) for name, (low, high) in spans.items() if low < high}

    def search(self, bodies: int) -> dict[str, Any]:
        """Return the tables of the study that seeks mass and gap for a number of bodies (`vanedamp optimise`)."""
        envelope, effort = self.study.envelope, self.study.effort
        mass = [end / bodies for end in envelope.mass]
        data = self.tables(Device(bodies, sum(mass) / 2, sum(envelope.gap) / 2), LEVELS[0])
        excitation = data["excitation"]
        if "base_acceleration" in excitation:  # of a search the level that gives the same resonance
            excitation = {key: value for key, value in excitation.items() if not key.startswith("base_")}
            data["excitation"] = excitation | {"resonance_amplitude": self.amplitude}
        halves: dict[str, Any] = {UNCERTAIN[name]: (high - low) / 2 for name, (low, high) in self.uncertain.items()}
        halves["cavity.gap"] = envelope.gap_tolerance
        halves["damper.mass"] = {"relative": envelope.mass_tolerance}
        given = {path: half for path, half in halves.items() if half and half != {"relative": 0.0}}
        return data | {
            "optimise": {
                "band": self.frequencies.tolist(), "measure": "amplitude_max", "samples": effort.samples,
                "evaluations": effort.evaluations, "gradient_steps": 0, "seed": effort.seed,
                "variables": {"damper.mass": mass, "cavity.gap": list(envelope.gap)}, "tolerances": given,
                "map": {"along": 2},
            }
        }  # fmt: skip

    def life(self, device: Device, level: int | None, keeps: float) -> dict[str, Any]:
        """Return the tables of the study of a device's life; keeps: reduction that must remain."""
        stress = self.study.effort.hot_spots > 0  # of the whole model
        assert self.study.wear is not None
        return self.tables(device, None if stress else level, stress) | {
            "wear": plain(tables(self.study.wear)),
            "life": {
                "hours": self.study.hours, "band": self.frequencies.tolist(), "dwell": self.dwell.tolist(),
                "measure": "amplitude_max", "threshold": keeps, "tolerance": 0.05, "reach": 0.3,
            }
        }  # fmt: skip

    @property
    def dwell(self) -> np.ndarray:
        """Fractions (f,) of the time at the frequencies of the band."""
        weights = np.zeros(len(self.frequencies))
        for frequency, hours in self.study.operation.spectrum or [(f, 1.0) for f in self.frequencies.tolist()]:
            weights[np.argmin(np.abs(self.frequencies - frequency))] += hours
        return weights / weights.sum()


def plain_model(model: ReducedModel) -> ReducedModel:
    """Return a reduced model without its hot spots."""
    provenance = {key: value for key, value in model.provenance.items() if key != "hot_spots"}
    return replace(model, outputs=(), output_rows=None, output_residual=None, recovery=None, provenance=provenance)
