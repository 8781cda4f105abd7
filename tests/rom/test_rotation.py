"""Reduced models of structures that rotate: one basis from standstill to the greatest speed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from tests.tools.input_files import DAMPED_BLOCK
from tests.tools.reduction_errors import frequency_errors, full_receptance, static_stiffness_error
from vanedamp import Scene, simulate
from vanedamp.coupling.output_histories import histories
from vanedamp.files.toml_input import InputError, validate
from vanedamp.meshes.benchmarks import TaperedBlock, build
from vanedamp.modal.eigen import factorize, solve_modes, static_shape
from vanedamp.modal.elasticity import Material, Solid
from vanedamp.modal.rotating import UnstableError
from vanedamp.rom.bases.projection import ReductionError
from vanedamp.rom.interface import Interface, InterfaceCoordinate
from vanedamp.rom.recovery import hot_spots, with_stresses
from vanedamp.rom.reduced import ReducedModel, ReducedModelError
from vanedamp.rom.rotation import SpeedBases, reduce_rotating
from vanedamp.rom.truncation import massless, truncated
from vanedamp.studies.case.stages import assemble, interface, reduction, with_hot_spots
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import main

#: times the angular frequency of the first mode at standstill: it rises by half, and others turn into each other
FAST = 3.0


@pytest.fixture(scope="module")
def rotating(tmp_path_factory):
    """A clamped plate whose axis lies across it, oblique to its plane."""
    block = TaperedBlock(0.2, 0.05, 0.006, divisions=(8, 2, 1), hexahedra=True)
    solid = Solid(
        build(block, tmp_path_factory.mktemp("plate") / "plate.msh"), {"default": Material(2e11, 0.3, 8000.0)}
    )
    standing = solid.assemble({"root": "xyz"}, 0.002)
    speed = FAST * float(solve_modes(standing, 1).angular_frequencies[0])
    return solid.rotating(standing, [0.0, 0.6, 0.8], [-0.1, 0.0, 0.0], speed=speed)


@pytest.fixture(scope="module")
def greatest(rotating):
    """Greatest speed, rad/s."""
    return rotating.greatest


def tip(matrices, kind="average"):
    directions = {"z": (0, 0, 1), "y": (0, 1, 0)}
    return Interface.on_patches(
        matrices, [InterfaceCoordinate(name, "tip", direction, kind) for name, direction in directions.items()]
    )


@pytest.fixture(scope="module")
def bases(rotating):
    return SpeedBases(rotating, tip(rotating.standing), 10, factorize)


@pytest.fixture(scope="module")
def model(bases, greatest):
    return reduce_rotating(bases, greatest, keep_recovery=True)


@pytest.mark.parametrize("share", [0.35, 0.6, 1.0])
def test_frequencies_are_those_of_the_full_structure(rotating, model, greatest, share):
    """Within 0.01 %, and from above, as Ritz's are; the speed changes the first one by more than a tenth."""
    full = solve_modes(rotating.at(share * greatest), 6).frequencies_hz
    errors = frequency_errors(model.at_speed(share * greatest), full)
    assert errors.min() > -1e-8 and errors.max() < 1e-4
    if share == 1.0:
        assert full[0] > 1.1 * model.natural_frequencies_hz[0]


@pytest.mark.parametrize("kind", ["average", "full"])
def test_interface_is_statically_exact_at_the_speeds_of_the_basis(rotating, greatest, kind):
    interface = tip(rotating.standing, kind)
    model = reduce_rotating(SpeedBases(rotating, interface, 4, factorize), greatest)
    for speed in model.provenance["rotation"]["speeds"]:
        assert static_stiffness_error(model.at_speed(speed), rotating.at(speed), interface, factorize) < 1e-7


def test_receptance_between_the_speeds_of_the_basis(rotating, bases, model, greatest):
    """Off the resonances, where damping plays no part."""
    speed = 0.7 * greatest
    turning = model.at_speed(speed)
    grid = np.array([0.3, 0.8, 1.3]) * turning.natural_frequencies_hz[0]
    full = full_receptance(rotating.at(speed), bases.interface, grid, factorize)
    assert turning.receptance(grid).real == pytest.approx(full, rel=1e-4, abs=1e-4 * np.abs(full).max())


def test_the_estimate_is_the_error_between_the_speeds(rotating, model):
    estimate = model.provenance["rotation"]
    fulls = [(speed, solve_modes(rotating.at(speed), 1).frequencies_hz) for speed in estimate["checked"]]
    error = max(frequency_errors(model.at_speed(speed), full)[0] for speed, full in fulls)
    assert 0.5 * error < estimate["frequency"] < 2.0 * error
    assert estimate["met"] and estimate["sentence"].startswith("basis of the speeds 0, ")


def test_speeds_are_added_where_the_estimate_asks(rotating, greatest):
    """A basis of few modes at few speeds misses a tight tolerance; more speeds lower the error."""
    bases = SpeedBases(rotating, tip(rotating.standing), 2, factorize, quasi_static=1)
    loose = reduce_rotating(bases, greatest, tolerance=0.9).provenance["rotation"]
    tight = reduce_rotating(bases, greatest, tolerance=0.2 * loose["receptance"]).provenance["rotation"]
    assert len(tight["speeds"]) > len(loose["speeds"])
    assert tight["receptance"] < 0.2 * loose["receptance"] and tight["met"]
    assert all(
        low < middle < high for (low, high), middle in zip(pairwise(tight["speeds"]), tight["checked"], strict=True)
    )


def test_smaller_models_keep_what_the_speed_changes(rotating, model, greatest):
    """`truncated` drops fixed-interface modes by their frequency at standstill, and nothing else."""
    held = model.stiffness[-model.modes :, -model.modes :]
    assert np.diag(held) == pytest.approx(np.linalg.eigvalsh(held), rel=1e-8)
    fewer = truncated(model, 6)
    assert fewer.size == model.size - 4 and fewer.fixed_interface_modes == 6
    for share in (0.0, 0.5, 1.0):
        full = solve_modes(rotating.at(share * greatest), 3).frequencies_hz
        # at speed the bent plate's bending stretches it, of which the modes that are dropped have a part
        assert frequency_errors(fewer.at_speed(share * greatest), full).max() < (5e-3 if share else 1e-3)


def test_natural_modes_are_taken_at_the_speed(model, greatest):
    """A massless boundary is that of one speed: of the model at the speed it is right, and it has no other one."""
    turning = model.at_speed(greatest)
    small = massless(turning, 3)
    low = 0.2 * turning.natural_frequencies_hz[:1]
    assert small.receptance(low) == pytest.approx(turning.receptance(low), rel=1e-3)
    with pytest.raises(ReducedModelError, match="does not rotate"):
        massless(model, 3).at_speed(greatest)
    with pytest.raises(ReducedModelError, match="centrifugal_stiffness: free_modes and residual_flexibility"):
        ReducedModel.from_matrices(
            np.eye(2), np.eye(2), {"a": [1.0, 0.0]}, damping_ratio=0.0, centrifugal_stiffness=np.eye(2), free_modes=1
        )


def test_the_record_keeps_the_rotation(model, greatest, tmp_path):
    model.save(tmp_path / "rom.h5")
    again = ReducedModel.load(tmp_path / "rom.h5")
    assert again.greatest_speed == greatest
    assert np.array_equal(again.centrifugal_stiffness, model.centrifugal_stiffness)
    assert np.array_equal(again.higher_stiffness, model.higher_stiffness) and len(again.higher_stiffness) == 3
    assert np.array_equal(again.rotation_axis, [0.0, 0.6, 0.8]) and again.rotation_point[0] == -0.1
    assert again.provenance["rotation"]["speeds"] == pytest.approx([0.0, np.sqrt(0.5) * greatest, greatest])


def test_what_cannot_be_reduced_over_speeds(rotating, bases):
    with pytest.raises(ReductionError, match="greatest_speed: expected a speed above 0"):
        reduce_rotating(bases, 0.0)


def turning_block(folder, text="max_rpm = 60_000.0"):
    """A case of the damped block about an axis along y."""
    path = folder / "case.toml"
    path.write_text(DAMPED_BLOCK + f"[rotation]\naxis = [0, 1, 0]\npoint = [-0.05, 0.0, 0.0]\n{text}\n")
    return path


def test_a_case_is_reduced_for_all_of_its_speeds(tmp_path, capsys):
    """`vanedamp reduce` with as many modes as standstill and the greatest speed need, and stresses at both."""
    path = turning_block(tmp_path)
    command = ["reduce", str(path), "-o", str(tmp_path / "rom.h5"), "--modes", "auto", "--hot-spots", "1"]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert (
        "basis of the speeds 0, 4443, 6283 rad/s: estimated error at 3142, 5441" in said
        and "\nat 6283.19 rad/s: " in said
    )
    model = ReducedModel.load(tmp_path / "rom.h5")
    estimate = model.provenance["estimate"]
    assert estimate["met"] and model.modes == estimate["modes"] and "hot1.xx" in model.outputs
    matrices = assemble(Case.load(path)).rotating
    for speed in (0.0, 4000.0, model.greatest_speed):
        full = solve_modes(matrices.at(speed), 1).frequencies_hz  # one lies below 1.5 times the first
        assert frequency_errors(model.at_speed(speed), full).max() < 1e-4


def test_hot_spots_are_those_at_the_speed_of_the_case(tmp_path):
    structure = assemble(Case.load(turning_block(tmp_path, "speed = 5000.0")))
    model = reduction(structure, 6, keep_recovery=True)
    assert model.greatest_speed == 5000.0
    turning = model.at_speed(5000.0)
    spotted = with_hot_spots(structure, model)
    stress = structure.solid.von_mises(turning.recovery @ turning.natural[1][:, 0])
    away = np.linalg.norm(structure.solid.stress_points() - hot_spots(spotted)["hot1"]["coordinates"], axis=1)
    assert stress[away == 0.0].max() == pytest.approx(stress.max(), rel=1e-6)  # one of those equal by symmetry
    assert spotted.at_speed(5000.0).outputs == spotted.outputs


def test_stresses_at_a_speed_are_those_of_modal_superposition(tmp_path):
    """Of a scene that names its speed, against the finite elements' own modes and their stresses there."""
    speed = 5000.0
    structure = assemble(Case.load(turning_block(tmp_path, f"max_speed = {speed}")))
    reduced = with_hot_spots(structure, reduction(structure, 12, keep_recovery=True))
    replace(reduced, recovery=None, coordinates=None).save(tmp_path / "rom.h5")
    modes = solve_modes(structure.rotating.at(speed), 24)
    rows = modes.shapes @ interface(structure.case, structure.matrices).vectors
    place = np.argmin(
        np.linalg.norm(structure.solid.stress_points() - hot_spots(reduced)["hot1"]["coordinates"], axis=1)
    )
    stresses = np.array([structure.solid.stress_components(shape, [place])[:, 0] for shape in modes.shapes])
    full = ReducedModel.from_matrices(
        np.eye(len(modes)), np.diag(modes.angular_frequencies**2), dict(zip(reduced.interface, rows.T, strict=True)),
        damping_ratio=reduced.damping_ratio,
    )  # fmt: skip
    with_stresses(full, {"hot1": stresses.T}).save(tmp_path / "full.h5")
    driven = {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")}, "rotation": {"speed": speed},
        "excitation": {"frequency": 0.99 * modes.frequencies_hz[0], "force": 10.0, "at": "tip"},
        "time": {"periods": 12, "transient": 0},
    }  # fmt: skip
    turning = validate(Scene, driven, "scene")
    other = turning.replace({"structure.file": str(tmp_path / "full.h5")}).to_dict()
    del other["rotation"]
    own, known = (histories(each, ["hot1.xx"], 50).values for each in (turning, validate(Scene, other, "scene")))
    assert np.abs(known).max() > 1e6
    assert np.abs(own - known).max() < 0.01 * np.abs(known).max()
    standing = histories(turning.replace({"rotation.speed": 0.0}), ["hot1.xx"], 50).values
    assert np.abs(standing - known).max() > 0.1 * np.abs(known).max()
    # static stress of the rotation, as of the linear static solution
    (spot,) = simulate(turning).stress
    pulled = structure.solid.stress_components(
        static_shape(structure.rotating.standing, structure.rotating.load), [place]
    )[:, 0]
    assert spot.static - spot.mean == pytest.approx(speed**2 * pulled, rel=1e-6, abs=1e-6 * np.abs(known).max())
    assert spot.static[0] > 1e6


def test_a_scene_without_a_speed_is_warned(tmp_path):
    model = ReducedModel.from_matrices(
        np.eye(1), np.eye(1), {"tip": [1.0]}, damping_ratio=0.1, centrifugal_stiffness=np.eye(1), greatest_speed=3.0
    )
    model.save(tmp_path / "rom.h5")
    data = {
        "structure": {"model": "rom", "file": str(tmp_path / "rom.h5")}, "time": {"periods": 2, "transient": 0},
        "excitation": {"frequency": 0.1, "force": 1.0, "at": "tip"},
    }  # fmt: skip
    (told,) = simulate(validate(Scene, data, "scene")).warnings
    assert told.startswith(
        "rotation: missing, so that the structure stands still; its model is for speeds up to 3 rad/s"
    )
    assert simulate(validate(Scene, data | {"rotation": {"speed": 0.0}}, "scene")).warnings == ()


def test_the_report_shows_the_speeds_of_a_model(tmp_path, capsys):
    path = turning_block(tmp_path)
    assert main(["reduce", str(path), "-o", str(tmp_path / "rom.h5"), "--modes", "4"]) == 0
    assert main(["report", str(tmp_path / "rom.h5"), "-o", str(tmp_path / "report.html")]) == 0
    text = (tmp_path / "report.html").read_text()
    fastest = ReducedModel.load(tmp_path / "rom.h5")
    assert "It holds up to\n6283.19 rad/s (basis of the speeds 0, 4443, 6283 rad/s: " in text
    assert f"<td>{fastest.at_speed(fastest.greatest_speed).natural_frequencies_hz[0]:.2f}</td>" in text


def test_bad_cases_of_rotation_are_refused_in_one_line(tmp_path):
    def reduced(text, basis="craig-bampton"):
        return reduction(assemble(Case.load(turning_block(tmp_path, text))), 4, basis)

    with pytest.raises(InputError, match=r"^rotation: .* give max_speed \(rad/s\), max_rpm or a speed$"):
        reduced("")
    with pytest.raises(InputError, match=r"^basis: rubin is that of one speed; .* structure.natural = true$"):
        reduced("max_speed = 100.0", "rubin")
    with pytest.raises(UnstableError, match="is unstable"):
        reduced("max_speed = 1e7")
