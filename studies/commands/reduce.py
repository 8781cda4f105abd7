"""`vanedamp reduce`: a reduced model at the interface of a structure or a ring, with an estimate of its error."""

from __future__ import annotations

import time
from argparse import Namespace
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vanedamp.files.toml_input import InputError
from vanedamp.rom.recovery import hot_spots
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.ring.ring_model import RingModel
from vanedamp.rom.ring.sector_ring import SectorRing
from vanedamp.studies.case.ring_stages import ring_reduction
from vanedamp.studies.case.stages import assemble, joint_doubts, reduction, reduction_warnings, unit_doubts
from vanedamp.studies.case.tables import Case
from vanedamp.studies.commands.support.messages import write_result
from vanedamp.studies.hot_spots import plus_minus, spot_lines
from vanedamp.studies.terminal import progress

#: defaults of the options that a case with [ring] does not take, and of the basis
_OF_STRUCTURES, _BASIS = (12, 0, False), "craig-bampton"
_LISTED = 8


def run(arguments: Namespace, case: Case) -> None:
    """Reduce the case."""
    started = time.perf_counter()
    if case.ring is not None:
        _reduce_ring(arguments, case, started)
        return
    structure = assemble(case)
    model = reduction(
        structure, arguments.modes, arguments.basis, arguments.tolerance, arguments.max_frequency, arguments.hot_spots,
        arguments.recovery,
    )  # fmt: skip
    rotation = model.provenance.get("rotation")
    result = {
        "frequency_hz": model.natural_frequencies_hz.tolist(),
        "modes": model.modes,
        "basis": arguments.basis,
        "interface": list(model.interface),
        "outputs": list(model.outputs),
        "hot_spots": hot_spots(model),
        "estimate": model.provenance["estimate"],
        "hot_spot_modes": model.provenance.get("hot_spot_modes"),
        "fatigue": model.provenance.get("fatigue"),
        "warnings": list(reduction_warnings(structure, model)),
        "wall_time_s": time.perf_counter() - started,
    }
    fastest = model.at_speed(model.greatest_speed)
    if rotation is not None:
        result["rotation"] = rotation | {"frequency_hz": fastest.natural_frequencies_hz.tolist()}
        if case.rotation is not None and case.rotation.gyroscopic:
            result["warnings"].append("rotation.gyroscopic: the reduced model leaves the gyroscopic coupling out")
    write_result(arguments, result, _summary(model, fastest), result["warnings"], output=model.save)


def _reduce_ring(arguments: Namespace, case: Case, started: float) -> None:
    """Reduce the ring of which the case is a sector."""
    if (arguments.modes, arguments.hot_spots, arguments.recovery) != _OF_STRUCTURES:
        raise InputError("--modes, --hot-spots, --recovery: not for a case with [ring]; it takes --families")
    basis = "modes" if arguments.basis == _BASIS else arguments.basis
    structure = assemble(case)
    with progress("nodal diameters") as report:
        ring = ring_reduction(structure, arguments.families, arguments.max_frequency, report, basis)
    frequencies, size = ring.frequencies_hz, ring.size
    result = {
        "sectors": ring.sectors,
        "basis": basis,
        "frequency_hz": frequencies.tolist(),
        "diameters": ring.diameters[: ring.modes].tolist() if isinstance(ring, RingModel) else None,
        "modes": ring.modes,
        "coordinates": size,
        "interface": list(ring.interface),
        "estimate": ring.provenance["estimate"],
        "greatest_speed": ring.greatest_speed if isinstance(ring, RingModel) else 0.0,
        "warnings": [*unit_doubts(structure, float(frequencies.min())), *joint_doubts(structure)],
        "wall_time_s": time.perf_counter() - started,
    }
    if case.rotation is not None and case.rotation.gyroscopic:
        result["warnings"].append("rotation.gyroscopic: the reduced ring leaves the gyroscopic coupling out")
    write_result(arguments, result, _ring_summary(ring), result["warnings"], output=ring.save)


def _ring_summary(ring: RingModel | SectorRing) -> Iterator[str]:
    """Yield sizes, the estimates of errors, and natural frequencies by nodal diameter."""
    estimate = ring.provenance["estimate"]
    yield f"{ring.sectors} sectors, {ring.size} coordinates; interface of each: {', '.join(ring.interface)}"
    yield f"{estimate['sentence']}, {_band(ring.frequencies_hz, estimate)}"
    if isinstance(ring, SectorRing):
        yield "frequencies, Hz: " + _listed(ring.frequencies_hz[:_LISTED], estimate)
        return
    if ring.greatest_speed:
        yield f"for speeds up to {ring.greatest_speed:.6g} rad/s; at standstill:"
    for number in range(ring.sectors // 2 + 1):
        frequencies = np.unique(ring.frequencies_hz[ring.diameters[: ring.modes] == number])
        yield f"nodal diameter {number}, Hz: " + _listed(frequencies, estimate)


def _summary(model: ReducedModel, fastest: ReducedModel) -> Iterator[str]:
    """Yield sizes, the estimates of errors, and natural frequencies: at rest, and at maximum speed."""
    estimate, rotation = model.provenance["estimate"], model.provenance.get("rotation")
    kind = "natural" if model.free_modes else "fixed-interface"
    yield f"{model.size} coordinates, {model.modes} of them {kind} modes; interface: {', '.join(model.interface)}"
    yield f"{estimate['sentence']}, {_band(model.natural_frequencies_hz, estimate)}"
    if rotation is not None:
        yield rotation["sentence"]
    yield "frequencies, Hz: " + _listed(model.natural_frequencies_hz[:_LISTED], estimate)
    yield from spot_lines(hot_spots(model))
    if (level := model.provenance.get("fatigue")) is not None:
        yield (
            f"amplitude at {level['share']:.0%} of the fatigue strength: {level['amplitude']:.4g} m of {level['at']}"
            f"{plus_minus(level['error'])}"
        )
    if rotation is not None:
        yield f"at {model.greatest_speed:.6g} rad/s: " + _listed(fastest.natural_frequencies_hz[:_LISTED], estimate)


def _band(frequencies_hz: np.ndarray, estimate: Mapping[str, Any]) -> str:
    top = estimate["frequencies_hz"][1]
    beyond = "; frequencies in brackets lie beyond and may be far too high" if frequencies_hz.max() > top else ""
    return f"up to {top:.4g} Hz{beyond}"


def _listed(frequencies_hz: np.ndarray, estimate: Mapping[str, Any]) -> str:
    """Return frequencies as text, those beyond the band of the estimated error in brackets."""
    top = estimate["frequencies_hz"][1]
    return ", ".join(f"{value:.6g}" if value <= top else f"({value:.6g})" for value in frequencies_hz)
