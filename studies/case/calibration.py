"""From measurements to a calibrated case: stiffness, then damping, rigid model and excitation."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy import sparse

from vanedamp.files.provenance import versions
from vanedamp.files.toml_input import InputError, nearest
from vanedamp.modal.frf import Frf, FrfError, Poles, identify, is_in_decibels
from vanedamp.modal.kept_solutions import Keep
from vanedamp.modal.measurements import read_frf, read_shapes
from vanedamp.modal.model_updating import Tuning, tune
from vanedamp.modal.rigid_model import RigidModel, rigid_model
from vanedamp.studies.case.calibration_record import CalibrationRecord
from vanedamp.studies.case.calibration_tables import CalibrationTable, DampingTable, TuneTable
from vanedamp.studies.case.checkpoint import CaseCheckpoint
from vanedamp.studies.case.stages import ModalAnalysis, assemble, base_inertia, modal_analysis
from vanedamp.studies.case.structure import Structure
from vanedamp.studies.case.tables import Case, MaterialTable
from vanedamp.studies.terminal import stage

# a pole farther from the computed mode than this fraction of its frequency belongs to another one
_NEAR = 0.1
# from these on, relative, a warning: distance of the pole from the computed mode, error of the fit
_OFF, _MISSED = 0.02, 0.1
#: arrays of a tuning, by their keys in the JSON results
_TUNING = {
    "target_hz": "target_hz", "before_hz": "before_hz", "after_hz": "after_hz", "mode_before": "modes_before",
    "mode_after": "modes_after", "mac_before": "mac_before", "mac_after": "mac_after", "sensitivity": "sensitivities",
}  # fmt: skip
# around the computed mode, relative: where a larger peak outside the band may be its own
_AROUND = 0.25


@dataclass(frozen=True, eq=False)
class MeasuredDamping:
    """The damping of the first bending in a measured response.

    file      of the measurement
    response  measured in the band and half its width around it
    band      Hz, where poles were fitted
    poles     of the fit; `pole` is the one of the first bending
    """

    file: str
    response: Frf
    band: tuple[float, float]
    poles: Poles
    pole: int

    @property
    def ratio(self) -> float:
        """The damping ratio."""
        return float(self.poles.damping_ratios[self.pole])

    @property
    def deviation(self) -> float:
        """Standard deviation of the damping ratio."""
        return float(self.poles.deviations[self.pole, 1])

    @property
    def frequency_hz(self) -> float:
        """Measured frequency of the mode."""
        return float(self.poles.frequencies_hz[self.pole])

    @property
    def fitted(self) -> np.ndarray:
        """The fit (k, n) of the response, complex; nan outside the band."""
        (low, high), lines = self.band, self.response.frequencies_hz
        fitted = np.full(self.response.values.shape, np.nan + 0j)
        fitted[:, (lines >= low) & (lines <= high) & (lines > 0.0)] = self.poles.fitted
        return fitted


@dataclass(frozen=True, eq=False)
class Calibration:
    """A case calibrated with its measurements.

    analysis  modes of the calibrated case
    rigid     the first bending at the response coordinate, with the calibrated damping ratio
    tuning    None where nothing was tuned
    damping   None where the damping ratio is the case's
    warnings  of the analysis, and of a response that differs from the first bending's
    """

    case: Case
    analysis: ModalAnalysis
    rigid: RigidModel
    tuning: Tuning | None
    damping: MeasuredDamping | None
    warnings: tuple[str, ...]
    wall_time_s: float

    @property
    def force(self) -> float | None:
        """N, at resonance gives the fatigue amplitude; None without a fatigue strength."""
        fatigue = self.analysis.fatigue
        return None if fatigue is None else self.rigid.resonance_force(fatigue.amplitude)

    @property
    def record(self) -> CalibrationRecord:
        """Content of the calibration file."""
        bending = self.analysis.first_bending
        assert bending is not None
        arrays: dict[str, Any] = {}
        if (tuning := self.tuning) is not None:
            arrays |= {
                "part": tuning.names, "factor": tuning.factors, "factor_deviation": tuning.deviations,
                "target_hz": tuning.target_hz, "before_hz": tuning.before_hz, "after_hz": tuning.after_hz,
                "mac_before": tuning.mac_before, "mac_after": tuning.mac_after, "sensitivity": tuning.sensitivities,
            }  # fmt: skip
        if (measured := self.damping) is not None:
            response = measured.response
            arrays |= {
                "label": response.labels, "line": response.frequencies_hz, "response": response.values,
                "fitted": measured.fitted,
            }  # fmt: skip
        return CalibrationRecord(
            frequencies_hz=self.analysis.modes.frequencies_hz, first_bending=bending, rigid=self.rigid,
            damping=self._damping(), excitation=self._excitation(), cavity=self.analysis.cavities,
            warnings=self.warnings, versions=versions(), provenance=self.analysis.structure.matrices.provenance,
            **arrays,
        )  # fmt: skip

    def save(self, path: str | Path) -> None:
        """Write the record to HDF5."""
        self.record.save(path)

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain data."""
        record = self.record
        data = record.plain()
        return {
            "status": "ok",
            "frequency_hz": record.frequencies_hz.tolist(),
            **{name: data[name] for name in ("first_bending", "rigid", "cavity", "damping", "excitation")},
            "tuning": None if self.tuning is None else _tuning_json(self.tuning, self.case),
            "warnings": list(self.warnings),
            "wall_time_s": self.wall_time_s,
        }

    def _damping(self) -> dict[str, Any]:
        damping: dict[str, Any] = {"ratio": self.rigid.damping_ratio, "source": "case"}
        if self.damping is not None:
            measured = self.damping
            damping |= {
                "source": "frf",
                "reading": measured.response.source,
                "deviation": measured.deviation,
                "frequency_hz": measured.frequency_hz,
                "misfit": measured.poles.misfit,
                "quantity": measured.response.quantity,
                "band": list(measured.band),
            }
        return damping

    def _excitation(self) -> dict[str, Any] | None:
        fatigue = self.analysis.fatigue
        if fatigue is None:
            return None
        spot = {
            "stress_per_amplitude": fatigue.share * fatigue.spot.strength / fatigue.amplitude,
            "strength": fatigue.spot.strength,
            "coordinates": list(fatigue.spot.coordinates),
            "group": fatigue.spot.group,
            "error": fatigue.spot.error,
            "singular": fatigue.spot.singular,
        }
        return {"share": fatigue.share, "amplitude": fatigue.amplitude, "force": self.force, "hot_spot": spot}


def calibrate(case: Case, checkpoint: str | Path | None = None) -> Calibration:
    """Tune the stiffness to frequencies and take the damping from a response, if these are given, then calibrate.

    checkpoint: a file to which evaluations of the tuning are written and from which an interrupted call resumes; the
    caller removes it after the result is saved (files.checkpoint_file.clear).
    Raises InputError for a case without an interface or a first bending, and the errors of the modal package for data
    that it cannot reproduce.
    """
    started = time.perf_counter()
    if case.response_label is None:
        raise InputError("interface: missing; a rigid model needs one [interface.<label>] table to be seen at")
    table = case.calibration or CalibrationTable()
    structure, tuning = assemble(case), None
    if table.tune is not None:
        # tables for later steps may change before the tuning resumes
        tuned = replace(case, calibration=CalibrationTable(tune=table.tune))
        with CaseCheckpoint(checkpoint, "calibrate", tuned, structure.matrices) as memo:
            tuning = _tuned(structure, table.tune, memo.next)
        structure = assemble(tuned_case(case, dict(zip(tuning.names, tuning.factors.tolist(), strict=True)), structure))
    analysis = modal_analysis(structure)
    if analysis.first_bending is None or analysis.functional is None:
        raise InputError("; ".join(analysis.warnings))
    damping, ratio, warnings = None, case.damping_ratio, analysis.warnings
    if tuning is not None:
        warnings += tuple(f"calibration.tune: {warning}" for warning in tuning.warnings)
    frequency = float(analysis.modes.frequencies_hz[analysis.first_bending])
    if table.damping is not None:
        damping, doubts = _damping(table.damping, frequency)
        ratio = damping.ratio
        warnings += tuple(f"calibration.damping: {doubt}" for doubt in doubts)
    inertia = base_inertia(structure.case, structure.matrices, case.response_label)
    rigid = rigid_model(
        analysis.modes, analysis.first_bending, analysis.functional, case.response_label, ratio, inertia
    )
    return Calibration(structure.case, analysis, rigid, tuning, damping, warnings, time.perf_counter() - started)


def tuned_case(case: Case, factors: dict[str, float], structure: Structure) -> Case:
    """Return the case with Young's moduli and support stiffnesses times their factors."""
    material: dict[str, MaterialTable] = dict(case.material)
    elastic = dict(case.support.elastic)
    parts = parts_by_name(case, structure.solid.domain.volumes)
    for name, factor in factors.items():
        for part in parts[name]:
            kind, group = part.split(".", 1)
            if kind == "support":
                springs = elastic[group]
                x, y, z = (factor * value for value in springs.stiffness)
                elastic[group] = replace(
                    springs,
                    stiffness=(x, y, z),
                    normal=factor * springs.normal,
                    tangential=factor * springs.tangential,
                )
            else:
                table = material.get(group, case.material.get("default"))
                assert table is not None
                young_at = tuple((temperature, factor * young) for temperature, young in table.young_at)
                material[group] = replace(table, young=factor * table.young, young_at=young_at)
    return replace(case, material=material, support=replace(case.support, elastic=elastic))


@stage("tuning to the measured frequencies")
def _tuned(structure: Structure, table: TuneTable, keep: Keep) -> Tuning:
    """Return the tuning of the stiffness. Raises InputError for unknown names in `vary`, and for overlapping parts."""
    parts = parts_by_name(structure.case, structure.solid.domain.volumes)
    seen: set[str] = set()
    for name in table.vary:
        if name not in parts:
            raise InputError(f"calibration.tune.vary: no part '{name}'; {nearest(name, list(parts))}")
        if seen & set(parts[name]):
            raise InputError(f"calibration.tune.vary: '{name}' holds a part that another name holds, too; name it once")
        seen |= set(parts[name])
    stiffness = structure.solid.stiffness_parts()
    varied = {name: sparse.csr_array(sum(stiffness[part] for part in parts[name])) for name in table.vary}
    measured = None if table.shapes is None else read_shapes(table.shapes)
    return tune(structure.matrices, varied, table.frequencies, measured, table.modes, starts=table.starts, keep=keep)


@stage("damping of the measured response")
def _damping(table: DampingTable, frequency: float) -> tuple[MeasuredDamping, list[str]]:
    """Return the damping of the mode nearest to a computed frequency, Hz, and anything odd about it."""
    frf = read_frf(table.frf, table.quantity, table.columns, table.unit, table.conjugate)
    low, high = band = table.band or (0.95 * frequency, 1.05 * frequency)
    poles = _poles(frf, band, table.modes, frequency)
    around = frf.band(low - (high - low) / 2.0, high + (high - low) / 2.0)
    damping = MeasuredDamping(table.frf, around, band, poles, poles.nearest(frequency))
    if abs(damping.frequency_hz / frequency - 1.0) > _NEAR:
        raise InputError(
            f"calibration.damping: the nearest pole of the response lies at {damping.frequency_hz:.6g} Hz, the first "
            f"bending at {frequency:.6g} Hz; check the band, or tune the frequencies first"
        )
    return damping, list(_doubts(frf, band, poles.misfit, damping.frequency_hz, frequency))


def _poles(frf: Frf, band: tuple[float, float], count: int, frequency: float) -> Poles:
    """Return the modes of the band. If the fit fails, the error names the response's peak and the computed mode."""
    try:
        inside = frf.band(*band)
        poles = identify(inside, count)
        if is_in_decibels(inside, poles):
            raise FrfError("columns: the magnitudes fit a mode far better as decibels; give them linear")
        return poles
    except FrfError as error:
        peak = frf.peak_hz()
        raise InputError(
            f"calibration.damping: {error} (the response is largest at {peak:.6g} Hz, the first bending lies at "
            f"{frequency:.6g} Hz)"
        ) from error


def _doubts(frf: Frf, band: tuple[float, float], misfit: float, measured: float, computed: float) -> Iterator[str]:
    """Yield anomalies of the mode measured in a band of a response."""
    if abs(measured / computed - 1.0) > _OFF:
        yield (
            f"the response's mode lies at {measured:.6g} Hz, {measured / computed - 1.0:+.1%} off the computed first "
            f"bending ({computed:.6g} Hz); tune the stiffness to measured frequencies"
        )
    if misfit > _MISSED:
        yield (
            f"the fit misses the response by {misfit:.0%} of it; check quantity and columns, narrow the band, or ask "
            "for more modes"
        )
    peak = frf.peak_hz((1.0 - _AROUND) * computed, (1.0 + _AROUND) * computed)
    if not band[0] <= peak <= band[1]:
        yield (
            f"the response is larger at {peak:.6g} Hz, outside the band {band[0]:.6g} to {band[1]:.6g} Hz; check that "
            "the band holds the first bending"
        )


def _tuning_json(tuning: Tuning, case: Case) -> dict[str, Any]:
    return {
        "factor": dict(zip(tuning.names, tuning.factors.tolist(), strict=True)),
        "deviation": dict(zip(tuning.names, tuning.deviations.tolist(), strict=True)),
        "young": {name: table.young for name, table in case.material.items()},
        "support": {name: asdict(table) for name, table in case.support.elastic.items()},
        **{key: getattr(tuning, name).tolist() for key, name in _TUNING.items()},
        "evaluations": tuning.evaluations,
    }


def parts_by_name(case: Case, volumes: Iterable[str]) -> dict[str, list[str]]:
    """Return every permitted name of `vary`, with its parts of Solid.stiffness_parts."""
    groups = list(volumes)
    names = {f"material.{group}": [f"material.{group}"] for group in groups}
    default_groups = [f"material.{group}" for group in groups if group not in case.material]
    if "default" in case.material and default_groups:
        names["material.default"] = default_groups
    return names | {f"support.{group}": [f"support.{group}"] for group in case.support.elastic}
