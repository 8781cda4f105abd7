"""What a scene leaves open about its reduced model: `modes = "auto"`, and walls that yield by what modes lack."""

import json
import math

import numpy as np
import pytest

from benchmarks.model_order.structures import beam_model
from tests.tools.input_files import DAMPED_BLOCK
from tests.tools.small_structures import rod
from vanedamp.coupling.model_order.choices import choose
from vanedamp.coupling.model_order.confirmation import WORTH
from vanedamp.coupling.model_order.selection import select_model_order, select_model_orders
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.sweep.sweep import sweep
from vanedamp.coupling.system.assembly import assemble
from vanedamp.files.toml_input import InputError, validate
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.reduction import reduce
from vanedamp.studies.cli import main

#: fixed-interface modes of the rod; periods of a run for which a choice pays
MODES, LONG = 24, WORTH + 1


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """The rod in Craig-Bampton form."""
    interface = Interface.on_patches(rod(100), [InterfaceCoordinate("tip", "tip", (1, 0, 0))])
    model = reduce(rod(100, damping_ratio=0.01), interface, modes=MODES)
    path = tmp_path_factory.mktemp("rod") / "rom.h5"
    model.save(path)
    return str(path)


def scene(file, **changes):
    """A body between walls that are both the tip of the rod, driven near its first resonance."""
    data = {
        "structure": {"model": "rom", "file": file},
        "excitation": {"frequency": 0.24, "force": 0.05, "at": "tip"},
        "cavity": [{"name": "c", "gap": 0.5, "floor": "tip"}],
        "damper": [{"cavity": "c", "mass": 0.05}],
        "gravity": {"acceleration": 0.0},
        "time": {"periods": 30, "transient": 10},
    }
    for path, value in changes.items():
        table = data.setdefault(path.split("__")[0], {})
        if "__" in path:
            (table[0] if isinstance(table, list) else table)[path.split("__")[1]] = value
        else:
            data[path] = value
    return validate(Scene, data, "scene")


def springs(made):
    """(contacts,) stiffness of a scene's contacts, N/m."""
    system = assemble(made)
    return system.spring[: system.contacts]


def test_each_wall_yields_by_its_own_flexibility(tmp_path):
    """Two masses that share a spring, and a third coordinate; walls on two of them, one mode kept."""
    stiffness = np.array([[3.0, -1.0, 0.0], [-1.0, 4.0, -2.0], [0.0, -2.0, 9.0]])
    rows = {"left": [1.0, 0.0, 0.0], "right": [0.0, 0.0, 1.0]}
    model = ReducedModel.from_matrices(np.eye(3), stiffness, rows, damping_ratio=0.1)
    model.save(tmp_path / "rom.h5")
    made = scene(
        str(tmp_path / "rom.h5"), contact={"law": "massless"}, structure__natural=True, structure__modes=1,
        cavity__left="left", cavity__right="right", cavity__floor="left", excitation__at="left",
    )  # fmt: skip
    squares, shapes = np.linalg.eigh(stiffness)
    lost = np.diag(np.linalg.inv(stiffness) - np.outer(shapes[:, 0], shapes[:, 0]) / squares[0])
    assert 1 / springs(made) == pytest.approx(lost[[0, 2]], rel=1e-9)
    # one body cannot touch both walls at once, two can: what the walls have in common is told
    assert select_model_order(made).estimate is None
    pair = made.replace({"damper": [{"cavity": "c", "mass": 0.05}] * 2})
    common = -shapes[0, 0] * shapes[2, 0] / squares[0] + np.linalg.inv(stiffness)[0, 2]
    told = select_model_order(pair).estimate
    assert told["shared_flexibility"] == pytest.approx(abs(common) / np.sqrt(lost[0] * lost[2]), rel=1e-9)
    assert f"{100 * told['shared_flexibility']:.0f} % of their residual flexibility in common" in told["sentence"]


def test_massless_wall_yields_by_what_the_modes_lack(file):
    for modes in (1, 4, 16):
        made = scene(file, contact={"law": "massless"}, structure__natural=True, structure__modes=modes)
        # flexibility of the unit rod, 1, less that of its modes sqrt(2) sin(omega x) at the tip
        omegas = (np.arange(1, modes + 1) - 0.5) * np.pi
        assert springs(made) == pytest.approx(1 / (1 - np.sum(2 / omegas**2)), rel=1e-3)
        assert select_model_order(made) == (made, None)
    both = scene(
        file, contact={"law": "compliant", "stiffness": 7.0, "residual": True}, structure__natural=True,
        structure__modes=1,
    )  # fmt: skip
    assert 1 / springs(both) == pytest.approx(1 / 7.0 + 1 - 8 / np.pi**2, rel=1e-4)


def test_massless_contact_is_a_collision_in_closed_form(tmp_path):
    """A body meets an undamped mode through the boundary's spring: two masses and a spring while they touch."""
    interface = Interface.on_patches(rod(100), [InterfaceCoordinate("tip", "tip", (1, 0, 0))])
    path = tmp_path / "rom.h5"
    reduce(rod(100), interface, "macneal", modes=1).save(path)
    made = scene(
        str(path),
        contact={"law": "massless"},
        excitation__force=0.0,
        damper__velocity=1e-3,
        damper__position=0.249,
        time={"periods": 2},
    )
    response = simulate(made, events=True)
    assert response.status == "ok"
    omega, mass, body = np.pi / 2, 0.5, 0.05
    stiffness = 1 / (1 - 8 / np.pi**2)
    matrix = np.array(
        [[(mass * omega**2 + stiffness) / mass, -stiffness / mass], [-stiffness / body, stiffness / body]]
    )
    squares, shapes = np.linalg.eig(matrix)
    start = np.linalg.solve(shapes, [0.0, 1e-3])
    times = np.linspace(0, 3, 300001)[1:]
    waves = start[:, None] * np.sin(np.sqrt(squares)[:, None] * times) / np.sqrt(squares)[:, None]
    gap = np.diff(shapes @ waves, axis=0)[0]
    end = np.argmax(gap < 0)
    speeds = shapes @ (start[:, None] * np.cos(np.sqrt(squares)[:, None] * times[end]))
    impact, detach = (next(e for e in response.event_list if e.kind == kind) for kind in ("impact", "detach"))
    assert detach.time - impact.time == pytest.approx(times[end], abs=2e-5)
    assert impact.relative_velocity_after == pytest.approx((speeds[1] - speeds[0]).item(), rel=1e-4)
    assert response.energy["impact"] == 0.0
    assert response.energy_residual < 1e-9


def test_auto_chooses_and_says_so(file):
    law = {"law": "compliant", "stiffness": 50.0}
    many = {"periods": LONG}
    made = scene(
        file, contact=law, structure__modes="auto", structure__tolerance=0.05, damper__restitution=0.7, time=many
    )
    settled, estimate = select_model_order(made)
    assert settled.structure.natural
    assert 1 < settled.structure.modes <= MODES
    assert estimate["modes"] == settled.structure.modes
    assert estimate["error"] <= 0.05
    assert estimate["sentence"].startswith(f"{settled.structure.modes} modes")
    assert ": estimated error" in estimate["sentence"]
    assert estimate["attached"] == settled.structure.attached
    assert select_model_order(settled).scene == settled
    response = simulate(made)
    assert response.estimate == estimate
    assert response.to_json()["estimate"]["sentence"] == estimate["sentence"]
    stricter = select_model_order(made.replace({"structure.tolerance": 0.02})).scene
    assert stricter.structure.modes >= settled.structure.modes
    newton = select_model_order(scene(file, structure__modes="auto", structure__tolerance=0.05)).estimate
    assert "Newton's impacts do not converge" in newton["sentence"]


def test_few_periods_take_the_whole_model(file):
    """A choice takes longer than such a run: all coordinates, at once and with the reason; the answer is theirs."""
    law = {"law": "compliant", "stiffness": 50.0}
    made = scene(file, contact=law, structure__modes="auto", damper__restitution=0.7)
    found = simulate(made)
    assert found.estimate["modes"] == MODES + 1 and found.estimate["difference"] is None
    assert f"{MODES + 1} modes, the whole model, as 30 periods are run" in found.estimate["sentence"]
    own = simulate(made.replace({"structure.modes": MODES + 1, "structure.natural": True}))
    np.testing.assert_array_equal(found.peak, own.peak)
    assert found.amplitude_mean == pytest.approx(simulate(made.replace({"structure.modes": None})).amplitude_mean)
    # contacts of a massless boundary need flexibility that a mode lacks
    massless = select_model_order(made.replace({"contact": {"law": "massless"}, "damper.0.restitution": 1.0}))
    assert massless.estimate["modes"] == MODES


def two_masses(tmp_path, ratio, **changes):
    """A body at rest in the middle of its cavity, out of reach of the walls or not, below the first resonance."""
    stiffness = np.array([[3.0, -1.0], [-1.0, 1.0]])
    squares, shapes = np.linalg.eigh(stiffness)
    first = float(np.sqrt(squares[0]) / (2 * np.pi))
    ReducedModel.from_matrices(np.eye(2), stiffness, {"tip": [0.0, 1.0]}, damping_ratio=0.002).save(tmp_path / "two.h5")
    made = scene(
        str(tmp_path / "two.h5"), structure__modes="auto", structure__tolerance=0.03, damper__restitution=0.7,
        damper__mass=0.02 / shapes[1, 0] ** 2, contact={"law": "compliant", "stiffness": 20.0}, time={"periods": LONG},
        excitation={"frequency": ratio * first, "resonance_amplitude": 1.0, "resonance_near": first, "at": "tip"},
    )  # fmt: skip
    return made.replace(changes)


@pytest.mark.parametrize(("ratio", "apart"), [(0.955, True), (0.97, True), (0.9, False)])
def test_steady_states_that_differ_take_the_whole_model_and_warn(tmp_path, ratio, apart):
    """Below the onset a body rests in the middle, where the response is the linear one, or flies from wall to wall."""
    made = two_masses(tmp_path, ratio)
    chosen = choose(made)
    short = made.replace({"structure.modes": None, "time": {"periods": 1500}})
    speed = 2 * np.pi * made.frequency * made.cavity[0].gap
    rest, flying = (simulate(short.replace({"damper.0.velocity": value})) for value in (0.0, speed))
    model, first = ReducedModel.load(made.structure.file), made.frequency / ratio
    linear, resonant = np.abs(model.frf([made.frequency, first], "tip", "tip"))
    assert rest.amplitude_mean == pytest.approx(linear / resonant, rel=1e-3) and not rest.impacts_per_period
    difference = flying.amplitude_mean - rest.amplitude_mean
    assert (difference > 0.03) == apart == chosen.estimate["several_states"]
    assert chosen.estimate["states_apart"] == pytest.approx(difference if apart else 0.0, rel=0.02)
    assert [warning[:43] for warning in chosen.warnings] == [
        "structure.modes: steady states differ by " + f"{100 * difference:.2g}"[:2]
    ] * apart
    if apart:
        assert chosen.estimate["modes"] == 2 and "has several steady states" in chosen.estimate["sentence"]


def test_results_warn_of_steady_states_that_differ(tmp_path):
    """In runs and in sweeps, whose points fly in one state and rest in the other."""
    made = two_masses(tmp_path, 0.97)
    warning = choose(made).warnings[0]
    assert warning.startswith("structure.modes: steady states differ")
    assert simulate(made).to_json()["warnings"] == [warning]
    swept = sweep(
        made.replace({"time.periods": 1500, "sweep": {"damper.0.velocity": np.linspace(0.0, 0.4, 15).tolist()}})
    )
    assert np.ptp(swept.amplitude_mean) > 0.03
    assert swept.to_json()["warnings"][0].startswith("structure.modes: steady states differ")


def test_sweep_has_one_model(file):
    made = scene(file, contact={"law": "compliant", "stiffness": 50.0}, structure__modes="auto",
                 sweep={"excitation.frequency": [0.2, 0.3]}, time={"periods": 4, "transient": 0})  # fmt: skip
    result = sweep(made)
    assert set(result.status) == {"ok"}
    assert json.loads(json.dumps(result.to_json()["estimate"]))["modes"] >= 1


def test_a_wide_band_sees_the_collisions_of_the_narrow_one(tmp_path):
    """At the ends and in the middle of the band the walls are out of reach, at the resonance they are not."""
    model = beam_model()
    model.save(tmp_path / "beam.h5")
    first, law = float(model.natural_frequencies_hz[0]), {"law": "compliant", "stiffness": 300.0}
    made = scene(str(tmp_path / "beam.h5"), contact=law, structure__modes="auto", damper__restitution=0.7,
                 damper__mass=0.01, cavity__gap=0.6, excitation__force=None,
                 excitation__resonance_amplitude=1.0, time={"periods": LONG})  # fmt: skip
    found = []
    for band in ([0.97, 0.985, 1.0], [0.83, 0.86, 0.89, 0.92, 0.975, 0.99, 1.02, 1.05]):
        swept = [made.replace({"excitation.frequency": share * first}) for share in band]
        found.append(select_model_orders(swept)[0].estimate)
    narrow, wide = ([size["collision"] for size in estimate["ladder"][:-1]] for estimate in found)
    assert narrow[0] > 0.1
    np.testing.assert_allclose(wide, narrow, rtol=1e-2)
    # what runs confirm on top of the estimate may differ by modes: these motions are chaotic
    assert all(estimate["modes"] > 1 for estimate in found)


def test_gaps_of_a_sweep_are_tried_apart(file):
    """A first gap out of reach does not hide the collisions of a second one."""
    law = {"law": "compliant", "stiffness": 50.0}
    made = scene(file, contact=law, structure__modes="auto", structure__tolerance=0.05, damper__restitution=0.7,
                 excitation__force=None, excitation__resonance_amplitude=0.6, excitation__frequency=0.247,
                 time={"periods": LONG})  # fmt: skip
    alone = select_model_order(made).estimate["modes"]
    both = select_model_orders([made.replace({"cavity.c.gap": gap}) for gap in (50.0, 0.5)])[0].estimate["modes"]
    assert both >= alone > 1


def test_what_does_not_fit(file):
    with pytest.raises(InputError, match="attachment modes go with natural = true"):
        scene(file, structure__attached=True, structure__modes=3)
    with pytest.raises(InputError, match="give stiffness"):
        scene(file, contact={"law": "compliant"})
    with pytest.raises(InputError, match="massless contact loses nothing"):
        scene(file, contact={"law": "massless"}, damper__restitution=0.5)
    with pytest.raises(InputError, match="lacks no flexibility at the walls"):
        simulate(scene(file, contact={"law": "massless"}))
    rigid = {"structure": {"model": "rigid", "mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.1}}
    with pytest.raises(InputError, match="residual flexibility is that of a reduced model"):
        validate(Scene, rigid | {"excitation": {"frequency": 1.0}, "contact": {"law": "massless"}}, "scene")


def test_command_chooses_modes_and_bases(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.toml").write_text(DAMPED_BLOCK)
    counts = {}
    for basis in ("craig-bampton", "rubin", "macneal", "truncated"):
        tolerance = "0.3" if basis == "truncated" else "1e-3"
        arguments = ["reduce", "case.toml", "--modes", "auto", "--basis", basis, "--tolerance", tolerance]
        assert main([*arguments, "-o", "rom.h5", "--json", "-"]) == 0
        result = json.loads(capsys.readouterr().out)
        estimate = result["estimate"]
        assert estimate["met"]
        assert estimate["error"] <= float(tolerance)
        assert result["modes"] == estimate["modes"]
        assert math.isfinite(estimate["rigid"])
        counts[basis] = result["modes"]
    assert counts["rubin"] <= counts["macneal"]
    assert main(["reduce", "case.toml", "--modes", "2"]) == 0
    assert "2 modes: estimated error" in capsys.readouterr().out
    assert main(["reduce", "case.toml", "--basis", "guyan"]) == 2
    assert "basis: expected one of" in capsys.readouterr().err


def test_the_error_is_estimated_beyond_the_mode_of_interest(tmp_path, monkeypatch, capsys):
    """The bending about the stiff axis lies above the other one; it, not the first mode, is what the case is about."""
    monkeypatch.chdir(tmp_path)
    for axis, mode in (("[0, 0, 1]", 0), ("[0, 1, 0]", 1)):
        (tmp_path / "case.toml").write_text(DAMPED_BLOCK.replace("direction = [0, 0, 1]", f"direction = {axis}"))
        assert main(["modal", "case.toml", "--json", "-"]) == 0
        modes = json.loads(capsys.readouterr().out)
        assert (modes["first_bending"], modes["first_bending_number"]) == (mode, mode + 1)
        assert main(["reduce", "case.toml", "--json", "-"]) == 0
        reached = json.loads(capsys.readouterr().out)["estimate"]["frequencies_hz"][1]
        assert reached == pytest.approx(1.5 * modes["frequency_hz"][mode], rel=1e-3)
