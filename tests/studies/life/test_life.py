"""The life of a damper that is known in closed form, its bands, its record, and how it resumes."""

import copy
import json
import math
import tomllib

import numpy as np
import pytest
import tomli_w
from scipy.integrate import solve_ivp

from tests.studies.life.damper import GAP, HOURS, LOST, SCENE, Damper, gap_after
from tests.tools.processes import ROOT
from vanedamp.coupling.response.response import Status
from vanedamp.files.toml_input import InputError
from vanedamp.studies.cli import BAD_INPUT, main
from vanedamp.studies.jobs import engine
from vanedamp.studies.kinds.plot import plot
from vanedamp.studies.life import fast
from vanedamp.studies.life.life import life
from vanedamp.studies.life.record import LifeRecord
from vanedamp.studies.life.study import LifeStudy


def study(**changes):
    data = copy.deepcopy(SCENE)
    data["life"] |= changes
    return LifeStudy.of(data)


@pytest.fixture
def found(monkeypatch):
    """A function that runs a study with a damper, of some options, from one start."""
    monkeypatch.setattr("vanedamp.studies.life.life.worst_start", lambda *_: {"starts": 1})

    def run(case=None, **options):
        monkeypatch.setattr(fast, "simulate", damper := Damper(**options))
        return life(case or study()), damper

    return run


def test_gap_and_hours_in_closed_form(found):
    record, _ = found()
    assert record.gap[:, 0] == pytest.approx([gap_after(hours) for hours in record.time], rel=1e-3)
    lost, early, late = record.hours
    assert lost == pytest.approx(LOST, rel=2e-3)
    assert early <= lost <= late and late - early < 0.02 * LOST
    assert record.reduction == pytest.approx(1 - 0.3 * record.gap[:, 0] / GAP, abs=1e-9)
    # the floor wears by a tenth of a wall, and opens nothing
    assert record.depth[-1, 0] == pytest.approx(record.depth[-1, 1] / 10)
    assert record.gap[-1, 0] - GAP == pytest.approx(record.depth[-1, 1:].sum())
    assert f"Damps for {lost:.0f} h ({early:.0f} to {late:.0f} h)" in record.sentence
    assert record.time[-1] < 1.2 * LOST  # it ends where nothing is left to find out
    assert record.trouble == 0 and record.runs % 2 == 0


@pytest.mark.parametrize("scatter", [0.0, 0.02])
def test_a_limit_of_any_quantity_is_kept_for_so_long(found, scatter):
    """The sliding work grows by exp(t/T) from 5 W: to 12.5 W after T ln 2.5."""
    case = study(measure="wear_work_rate", limit=12.5)
    record, _ = found(case, scatter=scatter)
    assert record.hours[0] == pytest.approx(HOURS * math.log(2.5), rel=2e-3 + scatter)
    assert record.reference == 12.5 and record.reduction[0] == pytest.approx(1 - 5.0 / 12.5)
    assert record.reduction_band[0] == pytest.approx(1.96 * scatter * 5.0 / 12.5, rel=0.1)
    assert record.sentence.startswith("Keeps wear_work_rate below 12.5 W for ") and "then the margin" in record.sentence
    assert "margin of wear_work_rate, %" in plot(record).to_json()
    assert found(study(measure="wear_work_rate", limit=4.0, hours=10.0))[0].sentence.startswith(
        "Does not keep wear_work_rate below 4 W at any time in 10 h"
    )


@pytest.mark.parametrize("count", [6, 12])
def test_twice_the_steps_change_as_little_as_is_said(found, count):
    ends = [found(study(steps=steps, hours=900.0))[0] for steps in (count, 2 * count)]
    assert len(ends[0].time) == count + 1
    gaps, said = ([getattr(record, name)[-1, 0] for record in ends] for name in ("gap", "gap_band"))
    assert 0.0 < abs(gaps[0] - gaps[1]) < said[0]
    assert abs(gaps[0] - gap_after(900.0)) < said[0]
    assert said[1] == pytest.approx(said[0] / 4, rel=0.3)  # of the second order, over all steps


def test_steps_follow_the_tolerance(found):
    wide, narrow = (found(study(tolerance=tolerance, reach=0.9)) for tolerance in (1e-2, 1e-5))
    assert wide[1].calls < narrow[1].calls
    assert abs(narrow[0].gap[-1, 0] / gap_after(narrow[0].time[-1]) - 1) < 1e-5


def test_bands_of_scattering_runs_hold_the_hours(found):
    inside = []
    for seed in range(60):
        lost, early, late = found(scatter=0.05, seed=seed)[0].hours
        inside.append(early <= LOST <= (np.inf if late is None else late))
        assert early <= lost
    assert np.mean(inside) > 0.9


def test_a_damper_that_lasts_and_one_that_never_damps(found):
    record, _ = found(study(hours=500.0))
    assert record.hours == (None, None, None)
    assert record.sentence.startswith("Damps for all 500 h: the reduction is 70%")
    assert record.time[-1] == pytest.approx(500.0)
    never, _ = found(study(hours=500.0), share=0.6)
    assert never.hours[0] == 0.0 and "Does not damp by 50%" in never.sentence


def test_dwell_weighs_the_points_of_the_band(found, monkeypatch):
    """Of two frequencies only one wears: uniform dwell takes half of its rate, a list what it says."""
    damper = Damper()

    def one_wears(scene):
        response = damper(scene)
        if scene.frequency > 2410.0:
            response.wear = tuple(copy.copy(one) for one in response.wear)
            for one in response.wear:
                object.__setattr__(one, "volume_rate", 0.0)
            response.amplitude_mean_dynamic *= 0.5
        return response

    monkeypatch.setattr(fast, "simulate", one_wears)
    rates = [
        life(study(hours=1.0, dwell=dwell)).depth_rate[0, 1] for dwell in ("uniform", "peak", (1.0, 0.0), (1.0, 3.0))
    ]
    assert rates == pytest.approx([rates[1] / 2, GAP / HOURS / 2, rates[1], rates[1] / 4])


def _of_curve(monkeypatch, curve, num, **table):
    """The record of a life of an hour whose amplitude over the reference is a curve of the frequency, Hz."""
    damper = Damper()

    def simulated(scene):
        response = damper(scene)
        response.amplitude_mean_dynamic = case.reference * curve(scene.frequency)
        return response

    case = study(hours=1.0, band={"start": 2340.0, "stop": 2450.0, "num": num}, **table)
    monkeypatch.setattr("vanedamp.studies.life.life.worst_start", lambda *_: {"starts": 1})
    monkeypatch.setattr(fast, "simulate", simulated)
    return life(case)


@pytest.mark.parametrize("num", [12, 23, 45])
@pytest.mark.parametrize("jumps", [False, True], ids=["smooth", "jump"])
def test_the_worst_point_is_sought_between_those_of_the_band(monkeypatch, num, jumps):
    """Whatever the spacing, the band of the reduction holds that of the curve: a resonance, or one that drops."""

    def curve(frequency):
        if jumps and frequency > 2391.7:
            return 0.05
        return 0.4 / np.hypot(1.0, (frequency - 2393.7) / 4.0)

    worst = curve(2391.7 if jumps else 2393.7)
    record = _of_curve(monkeypatch, curve, num)
    off, told = 1.0 - worst - record.reduction[0], record.reduction_band[0]
    assert abs(off) <= told < 0.05
    assert record.amplitude.shape[1] == num
    # the time spent at the band's points is as before
    assert record.depth_rate[0, 1] == pytest.approx(GAP / HOURS / 2)


def test_lists_of_frequencies_and_means_are_taken_as_they_are(monkeypatch, found):
    record = _of_curve(monkeypatch, lambda frequency: 0.2 + 1e-3 * (frequency - 2340.0), 12, over_band="mean")
    assert record.runs == 12 * (1 + 3 * (len(record.time) - 1))
    listed = found(study(hours=1.0))[0]
    assert listed.runs == 2 * (1 + 3 * (len(listed.time) - 1))


def test_resumes_between_the_points_of_a_band(monkeypatch, tmp_path):
    monkeypatch.setattr("vanedamp.studies.life.life.worst_start", lambda *_: {"starts": 1})
    case, kept = study(hours=1.0, band={"start": 2400.0, "stop": 2420.0, "num": 3}), tmp_path / "life.h5.partial"
    monkeypatch.setattr(fast, "simulate", whole := Damper())
    runs = life(case).runs
    assert runs == whole.calls > 3 * 4
    for fail in (2, 5, 11):
        monkeypatch.setattr(fast, "simulate", stopped := Damper(fail=fail))
        with pytest.raises(KeyboardInterrupt):
            life(case, checkpoint=kept)
        monkeypatch.setattr(fast, "simulate", rest := Damper())
        assert life(case, checkpoint=kept).runs == runs == stopped.calls - 1 + rest.calls
        kept.unlink()


def test_failed_runs_damp_nothing_and_are_reported(found):
    record, _ = found(study(hours=10.0), status=Status.DIVERGED)
    assert record.trouble == record.runs and record.reduction == pytest.approx(0.0)
    unsure, _ = found(study(hours=10.0), status=Status.UNCERTAIN)
    assert unsure.trouble == unsure.runs and unsure.reduction[0] == pytest.approx(0.7)


def test_runs_that_failed_say_nothing_of_their_frequencies(monkeypatch):
    damper = Damper()

    def one_fails(scene):
        response = damper(scene)
        response.status = Status.EVENT_BUDGET if scene.frequency > 2410.0 else response.status
        return response

    monkeypatch.setattr(fast, "simulate", one_fails)
    record = life(study(hours=10.0))
    assert 2 * record.trouble == record.runs and np.isnan(record.amplitude[:, 1]).all()
    assert record.reduction[0] == pytest.approx(0.7) and record.depth_rate[0, 1] == pytest.approx(GAP / HOURS / 2)


def test_resumes_after_an_interrupt_at_any_run(monkeypatch, tmp_path):
    case, kept = study(), tmp_path / "life.h5.partial"
    monkeypatch.setattr(fast, "simulate", Damper())
    whole = life(case)
    for fail in (1, 2, 7, 20):
        monkeypatch.setattr(fast, "simulate", stopped := Damper(fail=fail))
        with pytest.raises(KeyboardInterrupt):
            life(case, checkpoint=kept)
        monkeypatch.setattr(fast, "simulate", rest := Damper())
        record = life(case, checkpoint=kept)
        assert stopped.calls - 1 + rest.calls == whole.runs
        for name, one in (("whole.h5", whole), ("resumed.h5", record)):
            one.save(tmp_path / name)
        assert (tmp_path / "resumed.h5").read_bytes() == (tmp_path / "whole.h5").read_bytes()
        kept.unlink()
    monkeypatch.setattr(fast, "simulate", Damper(fail=9))
    with pytest.raises(KeyboardInterrupt):
        life(case, checkpoint=kept)
    with pytest.raises(InputError, match="checkpoint of another study"):
        life(study(threshold=0.4), checkpoint=kept)


def test_command_record_report_and_chart(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(fast, "simulate", Damper())
    monkeypatch.setattr(engine, "compile_engine", lambda *_: None)
    path, out = tmp_path / "life.toml", tmp_path / "life.h5"
    path.write_text(tomli_w.dumps(SCENE))
    assert main(["life", str(path), "-o", str(out), "--workers", "1", "--json", str(tmp_path / "life.json")]) == 0
    told = capsys.readouterr().out
    record = LifeRecord.load(out)
    assert record.sentence in told and "reduction, %" in told
    assert not list(tmp_path.glob("*.partial"))
    data = json.loads((tmp_path / "life.json").read_text())
    assert data["wall_time_s"] > 0 and f"{record.runs} runs in" in told
    assert [data["starts"][name]["starts"] for name in ("new", "end")] == [3, 3] and data["starts"] == record.starts
    assert "as new, from the worst of 3 starts" in told and "at the end, from the worst of 3 starts" in told
    assert data["hours"] == pytest.approx(list(record.hours))
    assert [one["side"] for one in data["contacts"]] == ["floor", "left", "right"]
    assert main(["info", str(out)]) == 0
    assert record.sentence in capsys.readouterr().out
    assert main(["report", str(out), "-o", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text()
    assert record.sentence in page and "left of body 0" in page
    figure = plot(str(out))
    curves = {trace.name: trace for trace in figure.data if trace.name}
    assert np.allclose(curves["reduction"].y, 100 * record.reduction)


def test_the_body_loses_its_share(found):
    data = copy.deepcopy(SCENE)
    data["wear"] |= {"width": 0.01, "length": 0.005, "height": 0.005}
    record, _ = found(LifeStudy.of(data))
    volume = record.depth[-1] * 5e-5
    assert record.lost[-1, 0] == pytest.approx(0.5 * volume.sum() / (0.01 * 0.005 * 0.005))


SIZE = {"width": 0.01, "length": 0.005, "height": 0.005}
VOLUME = 0.01 * 0.005 * 0.005


def worn_on_the_floor(monkeypatch, rate, **table):
    """The life of a body whose floor takes a volume per hour by its mass, m^3/h, and opens nothing."""
    damper, data = Damper(), copy.deepcopy(SCENE)

    def simulated(scene):
        response = damper(scene)
        for one in response.wear:
            volume = rate(scene.damper[0].mass) if one.side == "floor" else 0.0
            object.__setattr__(one, "volume_rate", volume)
        return response

    monkeypatch.setattr("vanedamp.studies.life.life.worst_start", lambda *_: {"starts": 1})
    monkeypatch.setattr(fast, "simulate", simulated)
    data["wear"] |= SIZE
    data["life"] |= table
    return life(LifeStudy.of(data))


def test_the_loss_of_mass_is_controlled_as_gaps_are(monkeypatch):
    """A body that wears in proportion to its mass: what is left falls exponentially."""
    mass = SCENE["damper"][0]["mass"]
    record = worn_on_the_floor(monkeypatch, lambda now: 2 * VOLUME / HOURS * now / mass, hours=HOURS, tolerance=0.01)
    assert record.lost[:, 0] == pytest.approx(1 - np.exp(-record.time / HOURS), abs=2e-3)
    assert record.time[-1] == pytest.approx(HOURS) and record.worn_away is None


@pytest.mark.parametrize("steps", [None, 7])
def test_a_body_that_is_worn_away_ends_the_life(monkeypatch, tmp_path, steps):
    record = worn_on_the_floor(monkeypatch, lambda _: 2 * VOLUME / 300.0, hours=1000.0, steps=steps)
    assert record.worn_away == pytest.approx(300.0, rel=1e-9)
    assert record.sentence.startswith("Body 0 is worn away after 300 h: the reduction is 70% as new and 70% at")
    assert record.time[-1] < 300.0 and record.lost[-1, 0] < 1.0
    record.save(tmp_path / "life.h5")
    assert LifeRecord.load(tmp_path / "life.h5").worn_away == record.worn_away == record.to_json()["worn_away"]


@pytest.mark.parametrize(
    ("table", "change", "said"),
    [
        ("wear", {"rate": -1e-14}, "wear.rate"),
        ("wear", {"rate": None, "coefficient": 1e-4}, "hardness: missing"),
        ("wear", {"rate": None, "hardness": 2e9}, "coefficient: missing"),
        ("wear", {"coefficient": 1e-4, "hardness": 2e9}, "give one of rate"),
        ("wear", {"rate": None, "coefficient": -1e-4, "hardness": 2e9}, "wear.coefficient"),
        ("wear", {"rate": None, "impact_rate": None}, "nothing wears"),
        ("wear", {"impact_exponent": 0.0}, "wear.impact_exponent"),
        ("wear", {"share": 1.5}, "wear.share"),
        ("wear", {"pair": [{"rate": 1e-14}]}, "damper, side: both missing"),
        ("wear", {"pair": [{"side": "flor", "rate": 1e-14}]}, "side"),
        ("life", {"threshold": 1.0}, "life.threshold"),
        ("life", {"threshold": -0.1}, "life.threshold"),
        ("life", {"hours": 0.0}, "life.hours"),
        ("life", {"measure": "wear_work_rate"}, "limit: missing; wear_work_rate needs one"),
        ("life", {"measure": "wear_work", "limit": 1.0}, "life.measure: unknown quantity 'wear_work'; there are"),
        ("life", {"measure": "utilisation", "limit": 1.0}, "life.measure: runs of this scene have no utilisation"),
        ("life", {"dwell": [1.0]}, "1 weights for 2 points"),
        ("life", {"dwell": [0.0, 0.0]}, "all weights are 0"),
        ("life", {"band": None}, "life.band: missing"),
        ("structure", {"model": "prescribed"}, "structure"),
        ("solver", {"method": "moreau"}, "exact"),
        ("wear", {"pair": [{"damper": 1, "rate": 1e-14}]}, "wear.pair[0].damper: there are only 1 bodies"),
        ("wear", {"pair": [{"damper": 0, "side": "stop", "rate": 1e-14}]}, "there are only 0 stops"),
        (None, {"sweep": {"damper.0.mass": [0.001]}}, "sweep: a life runs at the points of its band"),
        (None, {"ensemble": {"samples": 8}}, "ensemble: samples ranges, of which a life has none"),
        (None, {"wear": None}, "wear: missing"),
        (None, {"life": None}, "life"),
    ],
)
def test_bad_input_is_one_line(tmp_path, capsys, table, change, said):
    data = copy.deepcopy(SCENE)
    if table == "structure":
        data["structure"] = {"model": "prescribed", "displacement_amplitude": 1e-5}
        data["excitation"] = {"frequency": 2412.0}
    else:
        part = data if table is None else data.setdefault(table, {})
        for key, value in change.items():
            if value is None:
                part.pop(key, None)
            else:
                part[key] = value
    path = tmp_path / "life.toml"
    path.write_text(tomli_w.dumps(data))
    assert main(["life", str(path)]) == BAD_INPUT
    told = capsys.readouterr()
    assert told.err.count("\n") == 1 and said in told.err and not told.out


def test_a_patch_that_is_not_known_is_asked_for(monkeypatch, tmp_path):
    data = copy.deepcopy(SCENE)
    del data["wear"]["area"]

    class Bare(Damper):
        def __call__(self, scene):
            response = super().__call__(scene)
            for one in response.wear:
                object.__setattr__(one, "area", None)
            return response

    monkeypatch.setattr(fast, "simulate", Bare())
    kept = tmp_path / "life.h5.partial"
    with pytest.raises(InputError, match=r"wear.width: the patch of damper 0 at left is not known; give wear.width"):
        life(LifeStudy.of(data), checkpoint=kept)
    assert not kept.exists()  # it would block the corrected study


# the engine

RESTITUTION, LIGHT = 0.7, 1e-7


def impact_speed(gap, amplitude, omega):
    """Relative speed of both impacts per period of a light body between walls that move by a sine (Theurich and Krack).

    Its path is a triangle of the amplitude theta G, G half the gap: it meets walls at 4 omega theta G/(pi (1 + e)).
    """
    rho = 2 / np.pi * (1 - RESTITUTION) / (1 + RESTITUTION)
    half = gap / 2
    theta = (1 + np.sqrt((1 + rho**2) * (amplitude / half) ** 2 - rho**2)) / (1 + rho**2)
    return 4 * omega * theta * half / (np.pi * (1 + RESTITUTION))


AMPLITUDE, FREQUENCY, NEW, PATCH = 1e-5, 100.0, 3.2e-5, 1e-6
OMEGA, STIFFNESS, RATIO = 2 * np.pi * FREQUENCY, (4 * np.pi * FREQUENCY) ** 2, 0.05


class Regime:
    """A light body in the 1:1 regime, on a structure that it does not move: its gap opens by 10 nm/h as new."""

    def __init__(self, exponent):
        self.exponent, self.rate = exponent, 1.0
        self.rate = 1e-8 / self.opening(NEW)

    def opening(self, gap):
        """Growth of the gap, m/h: two impacts per period."""
        energy = 0.5 * LIGHT * impact_speed(gap, AMPLITUDE, OMEGA) ** 2
        return 2 * FREQUENCY * 3600 * self.rate / PATCH * energy**self.exponent

    def study(self, **table):
        force = AMPLITUDE * abs(STIFFNESS - OMEGA**2 + 2j * RATIO * np.sqrt(STIFFNESS) * OMEGA)
        return LifeStudy.of({
            "structure": {"model": "rigid", "mass": 1.0, "stiffness": STIFFNESS, "damping_ratio": RATIO},
            "excitation": {"frequency": FREQUENCY, "force": float(force)}, "gravity": {"acceleration": 0.0},
            "cavity": [{"name": "c", "gap": NEW}],
            "damper": [{"cavity": "c", "mass": LIGHT, "restitution": RESTITUTION, "velocity": 0.01}],
            "wear": {"impact_rate": self.rate, "impact_exponent": self.exponent, "area": PATCH},
            "time": {"periods": 200, "transient": 160},
            "life": {"band": [FREQUENCY], "hours": 2000.0, "tolerance": 1e-3, "reach": 0.5} | table,
        })  # fmt: skip

    def exact(self, hours):
        """Gap, m, by its own differential equation."""
        solved = solve_ivp(lambda _, y: self.opening(y), (0.0, 2000.0), [NEW], rtol=1e-10, atol=1e-16, t_eval=hours)
        return solved.y[0]


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_a_gap_whose_impacts_follow_the_1_to_1_regime(exponent):
    regime = Regime(exponent)
    record = life(regime.study())
    exact = regime.exact(record.time)
    assert record.gap[-1, 0] > 1.4 * NEW
    off = np.abs(record.gap[:, 0] - exact)
    assert np.all(off <= record.gap_band[:, 0] + 1e-6 * exact)  # the light body moves the structure by 1e-7
    assert record.gap_band[-1, 0] < 2e-3 * exact[-1]
    assert record.hours[0] == 0.0  # so light a body damps nothing


def test_twice_the_steps_of_the_1_to_1_regime_change_as_little_as_is_said():
    regime = Regime(1.5)
    coarse, fine = (life(regime.study(steps=steps)) for steps in (3, 6))
    exact = regime.exact([2000.0])[0]
    assert abs(coarse.gap[-1, 0] - fine.gap[-1, 0]) < coarse.gap_band[-1, 0]
    assert abs(fine.gap[-1, 0] - exact) < fine.gap_band[-1, 0] < coarse.gap_band[-1, 0] / 2.5


@pytest.mark.slow
def test_the_single_block_of_the_paper_wears_in_and_two_damp_best_as_new():
    """docs/wear.md, at the worst points of its band, and beyond the resonance without bodies."""
    records = []
    for name in ("life_single", "life"):
        data = tomllib.loads((ROOT / "docs" / "examples" / f"{name}.toml").read_text())
        data["life"] |= {"band": [2375.0, 2380.0, 2385.0, 2390.0, 2415.0], "hours": 400.0}
        records.append(life(LifeStudy.of(data)))
    single, double = (record.reduction for record in records)
    assert single[0] < 0.6 and single[-1] > single[0] + 0.15
    assert double[0] > 0.8 and abs(double[-1] - double[0]) < 0.05
    # as new the walls of the single one wear at twice the rate
    walls = [record.depth_rate[0, record.faces["left of body 0"]].mean() for record in records]
    assert walls[0] > 1.5 * walls[1]
