"""The stages from a case to a device: its reduced model, searches, confirmations, life, the device and its page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from vanedamp.coupling.quantities.stress import damage_per_hour
from vanedamp.coupling.scene.scene import Scene, relative
from vanedamp.coupling.scene.short_form import short_form
from vanedamp.coupling.strength.assessment import fatigue_of
from vanedamp.files.provenance import versions
from vanedamp.files.store import digest
from vanedamp.files.toml_input import InputError, plain, read_toml, tables
from vanedamp.files.toml_output import write_commented
from vanedamp.rom.recovery import hot_spots
from vanedamp.rom.reduced import ReducedModel
from vanedamp.studies.case.tables import Case, InterfaceTable
from vanedamp.studies.design.record import DesignRecord, measurement, sentence_of
from vanedamp.studies.design.scenes import LEVELS, PLAIN, Device, Devices, plain_model, words_of
from vanedamp.studies.design.tables import DesignFile
from vanedamp.studies.design.verdict import GREEN, LIFE, SPOTS, WORST, SpotFacts, held, overall
from vanedamp.studies.design.worst import SCREENED, Confirmation, confirm, runs_to_confirm, screened
from vanedamp.studies.file_kinds import KINDS
from vanedamp.studies.life.record import LifeRecord
from vanedamp.studies.optimisation.record import Optimisation
from vanedamp.studies.pipeline.stages import (
    Calibrate,
    Modal,
    OnScene,
    Reduce,
    Report,
    Stage,
    Tools,
    digests,
    software,
)
from vanedamp.studies.pipeline.tables import (
    CALIBRATION,
    MODES,
    REDUCED,
    RIGID_SCENE,
    TUNED_CASE,
    ReduceStage,
    StudyStage,
)
from vanedamp.studies.terminal import duration, progress

#: results in the folder of the study
DESIGN, PAGE = "design.h5", "design.html"
#: frequencies of the band at which the cost of runs is tried
_TRIED = 6
#: sweeps over the band by which a life is followed
_LIFE_STEPS = 30
#: designs of a search that are compared from all starts until a better one is not expected
_SCREENED = 3
#: amplitudes that are told apart, relative to the smaller one: of others the device with fewer bodies is chosen
_SAME = 0.02


@dataclass(frozen=True)
class ReduceForDesign(Reduce):
    """From a case to its reduced model with hot spots and the amplitude at the fatigue strength."""

    LEVEL = True
    CALIBRATION_KEYS = ("share", "hot_spot")

    def work(self, tools: Tools) -> str:
        """Reduce, and write the model without hot spots too, on which runs that need no stress are faster."""
        said = super().work(tools)
        plain_model(ReducedModel.load(self.outputs[0])).save(self.outputs[1])
        return said


@dataclass(frozen=True)
class DesignStage(Stage):
    """A stage of the study. rom: file of the reduced model; KEYS: tables of the study that it depends on, None: all."""

    study: DesignFile
    rom: Path
    KEYS: ClassVar[Sequence[str] | None] = ("envelope", "operation", "contact", "effort")

    def check(self, workers: int) -> Iterable[str | Path]:
        """Return the study's file."""
        return [self.file]

    def inputs(self) -> dict[str, Any]:
        """Return the study's tables and the results that it takes."""
        tables = read_toml(self.file)
        kept = {key: value for key, value in tables.items() if self.KEYS is None or key in self.KEYS}
        return {f"study {self.file.name}": kept} | digests(self.takes, self.file.parent) | software()

    def devices(self) -> Devices:
        """Return the devices on the reduced model. Raises InputError."""
        return Devices(self.study, self.rom, str(self.file))


@dataclass(frozen=True)
class Searches(DesignStage):
    """From the reduced model to a study of `vanedamp optimise` for each number of bodies."""

    def work(self, tools: Tools) -> str:
        """Write the studies."""
        devices = self.devices()
        for path, bodies in zip(self.outputs, self.study.envelope.bodies, strict=True):
            note = f"Mass and gap for {bodies} of the bodies of {self.file.name}, on the cheapest level of the model."
            write_commented(path, relative(devices.search(bodies), path), KINDS["study"], {"": note})
        band, effort = devices.frequencies, self.study.effort
        tools.note(
            f"{band[0]:.5g} to {band[-1]:.5g} Hz in {len(band)} steps; {devices.amplitude:.4g} m without bodies; "
            f"the rest takes about {duration(estimated(devices) / tools.workers)}"
        )
        return f"{len(self.outputs)} searches of {effort.evaluations} designs"


@dataclass(frozen=True)
class Confirm(DesignStage):
    """From a search to its best device over all that is uncertain."""

    def work(self, tools: Tools) -> str:
        """Run it."""
        from vanedamp.studies.jobs.engine import compile_engine

        devices, pool = self.devices(), tools.pool()
        candidates = tried(Optimisation.load(self.takes[1]))
        compile_engine([devices.at(candidates[0][0], level, level is None) for level in (LEVELS[0], None)], pool)
        with progress(f"{self.name}, all starts") as report:
            device = screened(devices, candidates, pool, report)
        with progress(self.name) as report:
            result = confirm(devices, device, pool, report, {"versions": versions()})
        result.save(self.outputs[0])
        return f"{words_of(device)}: at worst {result.ratio:.0%} left, {result.at['start']}"


@dataclass(frozen=True)
class Choose(DesignStage):
    """From the confirmed devices to the one to build, the scenes of its results, and the study of its life."""

    KEYS = ("envelope", "operation", "contact", "wear", "effort", "requirements")

    def work(self, tools: Tools) -> str:
        """Write the files."""
        best, devices = ranked([Confirmation.load(path) for path in self.takes[1:]])[0], self.devices()
        scenes = {WORST: (best.worst_scene, "The largest amplitude"), SPOTS: (best.spot_scene, "The largest stress")}
        for path in self.outputs:
            if path.name in scenes:
                scene, what = scenes[path.name]
                data = (
                    short_form(Scene.of(dict(scene), path)) if scene else devices.tables(best.chosen, None, stress=True)
                )
                note = f"{what} of the device: {words_of(best.chosen)}."
                write_commented(path, relative(data, path), KINDS["scene"], {"": note})
            else:
                limits = self.study.requirements
                ratios = [limits.amplitude_ratio, limits.amplitude and limits.amplitude / devices.amplitude]
                keeps = 1.0 - min((ratio for ratio in ratios if ratio), default=0.99)
                data = devices.life(best.chosen, best.level, max(keeps, 0.01))
                note = f"Wear of {words_of(best.chosen)}, and the damage of the vane meanwhile."
                write_commented(path, relative(data, path), KINDS["life"], {"": note})
        return words_of(best.chosen)


@dataclass(frozen=True)
class Decide(DesignStage):
    """From confirmations and life to the device with its grade."""

    KEYS = None

    def inputs(self) -> dict[str, Any]:
        """Return the case's files, too, whose hashes are in the result."""
        case = self.file.parent / self.study.case
        return super().inputs() | digests([case, *Case.load(case).files], self.file.parent)

    def work(self, tools: Tools) -> str:
        """Decide."""
        files = {path.name: path for path in self.takes}
        life = LifeRecord.load(files[LIFE]) if LIFE in files else None
        confirmed = ranked([Confirmation.load(path) for name, path in files.items() if name.startswith("confirm_")])
        record = decided(self.study, self.file, self.devices(), confirmed, life)
        record.save(self.outputs[0])
        return record.sentence


def tried(found: Optimisation) -> list[tuple[Device, float]]:
    """Return the devices that a search has tried within the tolerances, if any, with their largest amplitudes, m."""
    names, robust = list(found.robust.design.values), found.history_robust == found.history_robust.max()
    devices: dict[Device, float] = {}
    for values, amplitude in zip(found.history_design[robust], found.history_amplitude[robust], strict=True):
        numbers = dict(zip(names, values.tolist(), strict=True))
        device = Device(found.robust.design.bodies, numbers["damper.mass"], numbers["cavity.gap"])
        devices[device] = float(amplitude) * found.reference
    return list(devices.items())


def ranked(confirmed: Sequence[Confirmation]) -> list[Confirmation]:
    """Return devices by their largest amplitude that is to be expected; of equal ones fewer bodies come first."""
    least = min(one.expected for one in confirmed)
    return sorted(confirmed, key=lambda one: (max(one.expected, (1.0 + _SAME) * least), one.chosen.bodies))


def estimated(devices: Devices) -> float:
    """Return the processor time of searches, confirmations and life, s, by a trial of their runs."""
    from vanedamp.studies.jobs.trial import mean_cost

    effort, points, total = devices.study.effort, len(devices.frequencies), 0.0
    envelope, over_band = devices.study.envelope, devices.frequencies[:: max(points // _TRIED, 1)].tolist()
    for bodies in envelope.bodies:
        device = Device(bodies, sum(envelope.mass) / 2 / bodies, math.sqrt(math.prod(envelope.gap)))
        scenes = {
            key: [devices.at(device, *key).replace({"excitation.frequency": f}) for f in over_band]
            for key in ((LEVELS[0], False), (None, False), (None, True))
        }
        # most often the whole model decides
        cheap, confirmed, stressed = map(mean_cost, scenes.values())
        searched = effort.evaluations * (2 + effort.samples) + 10
        total += points * (cheap * searched + stressed * 3) + confirmed * (runs_to_confirm(devices) + effort.starts)
        total += cheap * 3 * points * SCREENED * _SCREENED
        if devices.study.wear is not None and bodies == envelope.bodies[0]:
            total += stressed * _LIFE_STEPS * points
    return total


def decided(
    study: DesignFile, source: Path, devices: Devices, confirmed: Sequence[Confirmation], life: LifeRecord | None
) -> DesignRecord:
    """Return the result of a study."""
    best, *others = confirmed
    values = held(study, best, life, spot_facts(devices.rom))
    grade = overall(values)
    by_number = dict(best.by_number())
    failing = [value for value in values if value.grade == grade and grade != GREEN]
    case = source.parent / study.case
    files = [source, case, *map(Path, Case.load(case).files)]
    return DesignRecord(
        study=plain(tables(study)),
        device=best.device,
        cavities=tuple(body["cavity"] for body in devices.tables(best.chosen, LEVELS[0])["damper"]),
        grade=grade,
        values=tuple(value.to_json() for value in values),
        others=tuple(_lost(best, other) for other in others),
        levels=best.levels, level=best.level, at=best.at, by_number=by_number,
        frequency=best.frequency, undamped=best.undamped, fixed=best.fixed, worst=best.worst, reference=best.reference,
        runs=sum(one.runs for one in confirmed), failed=best.failed, unsure=best.unsure,
        assumed=tuple(_assumed(study, devices, life)), neglected=tuple(_neglected(study, best, life)),
        measure=measurement(by_number, best.amplitude, study),
        hashes={file.name: digest(file) for file in files},
        sentence=sentence_of(best.chosen, grade, best.ratio, best.at, failing),
        modes=MODES,
        provenance={"versions": versions()},
    )  # fmt: skip


def spot_facts(rom: Path) -> dict[str, SpotFacts]:
    """Return error by the mesh and steepest exponent of damage of the hot spots of a reduced model."""
    facts = {}
    for name, spot in hot_spots(ReducedModel.load(rom)).items():
        material = fatigue_of(spot)
        exponents = () if material is None or material.exponent is None else material.exponents
        of = spot.get("per_amplitude") or spot.get("mode") or {}
        facts[name] = SpotFacts(of.get("error"), max((one for one in exponents if one < 1e3), default=None))
    return facts


def _lost(best: Confirmation, other: Confirmation) -> dict[str, Any]:
    """Return another device, and why it lost."""
    difference = other.expected / best.expected - 1.0 if math.isfinite(other.expected) else math.inf
    why = f"largest amplitude to be expected {difference:+.0%}"
    if math.isinf(difference):
        why = "largest amplitude to be expected is not known"
    elif abs(difference) <= _SAME:
        why = f"as good within {_SAME:.0%}, with more bodies"
    if other.failed:
        why += f"; {other.failed} runs without a result"
    return {
        "device": dict(other.device),
        "ratio": other.ratio,
        "expected": other.expected / other.reference,
        "why": why,
    }


def _assumed(study: DesignFile, devices: Devices, life: LifeRecord | None) -> Iterator[str]:
    envelope, operation = study.envelope, study.operation
    for name, (low, high) in envelope.uncertain.items():
        yield f"{name.removesuffix('_deg')} {low:g} to {high:g}{' degrees' if name.endswith('deg') else ''}" + (
            f", measured: {envelope.pair}" if envelope.pair and name != "orientation_deg" else ""
        )
    yield f"gap within {1e6 * envelope.gap_tolerance:.3g} um, mass within {100 * envelope.mass_tolerance:.2g} %"
    yield "all bodies have the same friction and restitution in a draw"
    level = " ".join(f"{name} {value:g}" for name, value in operation.level.items()) or "the case's fatigue fraction"
    yield f"excitation: {level}, {1e6 * devices.amplitude:.4g} um without bodies"
    yield "operation: " + ("the hours of the spectrum" if operation.spectrum else "the same time at all frequencies")
    contact = devices.at(Device(1, envelope.mass[0], envelope.gap[0]), LEVELS[0]).contact
    yield f"contacts: {contact.law}" + (
        "" if study.contact is not None else ", with the static stiffness of the walls of the reduced model"
    )
    if life is not None:
        yield "wear with friction, restitution and orientation in the middle of their ranges"


def _neglected(study: DesignFile, best: Confirmation, life: LifeRecord | None) -> Iterator[str]:
    if not best.spots:
        yield "stress of the vane (give effort.hot_spots)"
    elif not any(damage_per_hour.name in spot for spot in best.spots.values()):
        yield "life of the vane (give the case [material.fatigue] with exponent and knee)"
    if study.envelope.length is None:
        yield "bodies tilt and lift (give length and height of a body)"
    if life is None:
        yield "wear of the damper (give a [wear] table)"
    if not best.frequency[0] < best.at["frequency"] < best.frequency[-1]:
        yield "frequencies beyond the band, at whose end the largest amplitude lies"
    yield "differences between the vanes of a ring"
    yield "temperature of the bodies, lubrication, dirt in the cavity"


def _check_cavities(interface: Mapping[str, InterfaceTable], study: DesignFile, source: Path) -> None:
    """Raise InputError, before anything runs, where bodies would silently be at the response."""
    named = any(label.endswith("_floor") or table.planar for label, table in interface.items())
    if len(interface) > 1 and not named and not study.envelope.cavities:
        raise InputError(
            f"{source}: envelope.cavities: the case has no cavity, such as [interface.c1_floor]; "
            'cavities = ["c1"] puts the bodies where the response is'
        )


def design_stages(study: DesignFile, source: Path, folder: Path) -> Iterator[Stage]:
    """Yield the stages of a study with results in a folder, each after the stages that it depends on."""
    case, tuned = (source.parent / study.case).resolve(), tuple[Path, ...]()
    loaded = Case.load(case)
    _check_cavities(loaded.interface, study, source)
    calibration = loaded.calibration
    source, folder = source.resolve(), folder.resolve()
    if calibration is not None and (calibration.tune or calibration.damping):
        files = tuple(folder / name for name in (CALIBRATION, TUNED_CASE, RIGID_SCENE))
        yield Calibrate("calibrate", case, files, ())
        case, tuned = files[1], files[1:2]
    yield Modal("modal", case, (folder / MODES,), tuned)
    rom = folder / REDUCED
    yield ReduceForDesign(
        "reduce",
        case,
        (rom, rom.with_name(PLAIN)),
        tuned,
        ReduceStage(study.effort.modes, hot_spots=study.effort.hot_spots),
    )
    counts = study.envelope.bodies
    searches = [folder / f"search_{count}.toml" for count in counts]
    yield Searches("searches", source, tuple(searches), (rom,), study, rom)
    confirmed = []
    for count, file in zip(counts, searches, strict=True):
        optimum, confirmation = file.with_suffix(".h5"), folder / f"confirm_{count}.h5"
        yield OnScene(f"search {count}", file, (optimum,), (file, rom), "optimise", StudyStage(study=file.name), {})
        yield Confirm(f"confirm {count}", source, (confirmation,), (rom, optimum), study, rom)
        confirmed.append(confirmation)
    wears = study.wear is not None
    life = folder / "life.toml"
    chosen = (folder / WORST, folder / SPOTS, *([life] if wears else []))
    yield Choose("choose", source, chosen, (rom, *confirmed), study, rom)
    lives = []
    if wears:
        lives = [folder / LIFE]
        yield OnScene("life", life, tuple(lives), (life, rom), "life", StudyStage(study=life.name), {})
    yield Decide("decide", source, (folder / DESIGN,), (rom, *confirmed, *lives), study, rom)
    yield Report("page", source, (folder / PAGE,), (folder / DESIGN,), (), f"Damper for {case.stem}")
