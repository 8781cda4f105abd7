"""Which places are hot spots: by stress over strength, of all modes, upon the static stress; what is said of them."""

import json

import numpy as np
import pytest

from tests.tools.input_files import DAMPED_BLOCK, changed
from tests.tools.two_cubes_mesh import write_boxes
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.files.toml_input import InputError, validate
from vanedamp.modal.eigen import solve_modes
from vanedamp.rom.recovery import hot_spots
from vanedamp.studies.case.hot_spots import chosen_places, with_hot_spots
from vanedamp.studies.case.stages import assemble, modal_analysis, reduction, reduction_warnings
from vanedamp.studies.case.tables import Case
from vanedamp.studies.cli import main

LINE = np.column_stack([np.arange(5.0), np.zeros((5, 2))])


def test_each_spot_serves_the_lowest_mode_that_is_not_shown():
    use = np.array([[1.0, 0.2, 0.0, 0.0, 0.0], [0.95, 1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 3.0, 2.9]])
    picked, shown = chosen_places(use, LINE, 2, 0.5)
    assert picked == [(0, 0), (3, 2)] and shown == pytest.approx([1.0, 0.95, 1.0])  # the second is shown well enough
    picked, shown = chosen_places(use, LINE, 1, 0.5)
    assert picked == [(0, 0)] and shown == pytest.approx([1.0, 0.95, 0.0])
    # with no mode left the first one's next place, at the distance
    assert [place for place, _ in chosen_places(use, LINE, 3, 0.5)[0]] == [0, 3, 1]


def test_spots_keep_their_distance():
    use = np.array([[1.0, 0.9, 0.8, 0.7, 0.6]])
    assert [place for place, _ in chosen_places(use, LINE, 3, 2.0)[0]] == [0, 2, 4]
    with pytest.raises(InputError, match="3 are all that lie 2 m apart"):
        chosen_places(use, LINE, 4, 2.0)


BOXES = """
[mesh]
file = "boxes.msh"
[material.near]
young = 2e11
poisson = 0.3
density = 8000.0
damping_ratio = 0.01
{near}
[material.far]
young = 2e11
poisson = 0.3
density = 8000.0
fatigue_strength = 1e8
[support]
clamped = ["clamp"]
[modes]
count = 3
direction = [0, 0, 1]
[interface.tip]
facets = "tip"
direction = [0, 0, 1]
"""


def boxes(folder, near):
    """Two cubes in a row, the strength of the one at the clamp as given; stress there is several times that beyond."""
    facets = {"clamp": [(0, 1, 1)], "tip": [(4, 1, 1)]}
    write_boxes(folder / "boxes.msh", {"near": [1], "far": [2]}, facets)
    (folder / "case.toml").write_text(BOXES.format(near=near))
    return assemble(Case.load(folder / "case.toml"))


@pytest.mark.parametrize("near", ["fatigue_strength = 1e10", "fatigue = {strength = 1e10}"])
def test_the_weaker_material_has_the_hot_spot(tmp_path, near):
    """By stress alone it would be at the clamp, with a hundredth of the utilisation."""
    structure = boxes(tmp_path, near)
    assert not [warning for warning in modal_analysis(structure).warnings if warning.startswith("material: ")]
    spot = hot_spots(with_hot_spots(structure, reduction(structure, 4, keep_recovery=True)))["hot1"]
    assert spot["group"] == "far" and spot["fatigue"]["strength"] == 1e8
    shape = solve_modes(structure.matrices, 1).shapes[0]
    stress = structure.solid.von_mises(shape)
    strength = np.where(
        structure.solid.stress_points()[:, 0] < 1.0, 1e10, 1e8
    )  # the face between counts to the far one
    worst = structure.solid.stress_points()[np.argmax(stress / strength)]
    assert structure.solid.stress_points()[np.argmax(stress)][0] == 0.0
    assert worst[0] == spot["coordinates"][0] == 1.0


def test_a_group_without_strength_is_said(tmp_path):
    structure = boxes(tmp_path, "")
    (said,) = [warning for warning in modal_analysis(structure).warnings if warning.startswith("material: ")]
    assert "near: no fatigue_strength; the least of all, 1e+08 Pa, counts there" in said


@pytest.fixture(scope="module")
def structure(tmp_path_factory):
    """The damped block, three elements wide."""
    path = tmp_path_factory.mktemp("block") / "case.toml"
    path.write_text(changed(DAMPED_BLOCK, ("divisions = [6, 2, 1]", "divisions = [12, 3, 2]")))
    return assemble(Case.load(path))


@pytest.fixture(scope="module")
def reduced(structure):
    return reduction(structure, 12, keep_recovery=True)


def test_modes_have_their_largest_stress_at_hot_spots(structure, reduced):
    """That of the whole mesh's own modes, of as many as there are spots."""
    model = with_hot_spots(structure, reduced, 3)
    facts, points = hot_spots(model).values(), structure.solid.stress_points()
    places = [int(np.argmin(np.linalg.norm(points - spot["coordinates"], axis=1))) for spot in facts]
    for shape in solve_modes(structure.matrices, 3).shapes:
        stress = structure.solid.von_mises(shape)
        assert stress[places].max() > 0.89 * stress.max()
    apart = np.linalg.norm(points[places][:, None] - points[places], axis=2)[np.triu_indices(3, 1)]
    assert apart.min() >= 0.005  # 5 % of the length


def test_a_run_beside_the_hot_spots_mode_is_warned(structure, reduced, tmp_path):
    """One spot is that of the first mode; a later one that it does not show is named."""
    model = with_hot_spots(structure, reduced)
    shown = np.array(model.provenance["hot_spot_modes"]["shown"])
    hidden = int(np.argmin(shown[:6]))
    assert shown[0] == 1.0 and shown[hidden] < 0.9
    model.save(tmp_path / "rom.h5")
    scene = {"structure": {"model": "rom", "file": str(tmp_path / "rom.h5")}, "time": {"periods": 2, "transient": 0}}
    for mode, words in ((0, []), (hidden, [f"of mode {hidden + 1} "])):
        excitation = {"frequency": float(model.natural_frequencies_hz[mode]), "force": 1.0, "at": "tip"}
        response = simulate(validate(Scene, scene | {"excitation": excitation}, "scene"))
        warnings = [warning for warning in response.warnings if warning.startswith("hot spots: ")]
        assert len(warnings) == len(words) and all(word in said for word, said in zip(words, warnings, strict=True))


def test_excluded_places_have_no_hot_spots(structure, reduced, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(
        changed(DAMPED_BLOCK, ("divisions = [6, 2, 1]", "divisions = [12, 3, 2]"))
        + "[hot_spots]\nexclude = { root = 0.02 }\ndistance = 0.03\n"
    )
    case = Case.load(path)
    apart = type(structure)(case, structure.solid, structure.matrices)
    model = with_hot_spots(apart, reduced, 3)
    places = np.array([spot["coordinates"] for spot in hot_spots(model).values()])
    assert places[:, 0].min() > 0.02
    assert np.linalg.norm(places[:, None] - places, axis=2)[np.triu_indices(3, 1)].min() >= 0.03
    held, free = (modal_analysis(one).fatigue for one in (structure, apart))
    assert held.spot.singular == "a clamped support" and free.spot.singular == ""
    assert free.spot.coordinates[0] > 0.02 and free.amplitude > held.amplitude
    with pytest.raises(InputError, match=r"hot_spots.exclude: no facet group 'rot'"):
        path.write_text(path.read_text().replace("{ root", "{ rot"))
        assemble(Case.load(path))


def test_a_mean_stress_moves_the_hot_spot(tmp_path):
    """Of Goodman's line: where the static stress nearly exhausts the material, little amplitude is permitted."""
    path = tmp_path / "case.toml"
    text = DAMPED_BLOCK + "[rotation]\naxis = [0, 1, 0]\npoint = [-0.05, 0.0, 0.0]\nspeed = 3000.0\n"
    path.write_text(text + "[material.fatigue]\ntensile_strength = 4.2e8\n")
    structure = assemble(Case.load(path))
    model = with_hot_spots(structure, reduction(structure, 4, keep_recovery=True))
    solid = structure.solid
    pulled = 3000.0**2 * solid.static_stresses()["rotation"]
    # the block is pulled along x
    left = np.maximum(1.0 - np.maximum(pulled[0], 0.0) / 4.2e8, 1e-3)
    at = model.at_speed(3000.0)
    stress = solid.von_mises(at.recovery @ at.natural[1][:, 0])
    assert left.min() < 0.6
    spot = hot_spots(model)["hot1"]["coordinates"]
    place = np.argmin(np.linalg.norm(solid.stress_points() - spot, axis=1))
    assert (stress / left)[place] > 0.95 * (stress / left).max()


def test_a_coordinate_that_a_mode_does_not_move_divides_nothing(tmp_path, capsys):
    """Along the block the bending mode moves the tip by what the mesh lacks of symmetry; across it by all."""
    text = changed(
        DAMPED_BLOCK,
        ("divisions = [6, 2, 1]", "element_size = 0.008"),
        ('facets = "tip"\ndirection = [0, 0, 1]', 'facets = "tip"\ndirection = [1, 0, 0]'),
    )
    (tmp_path / "case.toml").write_text(text)
    assert main(["modal", str(tmp_path / "case.toml"), "--json", str(tmp_path / "modal.json")]) == 0
    level = json.loads((tmp_path / "modal.json").read_text())["fatigue"]
    assert level["moved"] < 0.01
    said = capsys.readouterr()
    assert "of the structure's largest displacement, which the mesh decides" in said.err
    structure = assemble(Case.load(tmp_path / "case.toml"))
    model = with_hot_spots(structure, reduction(structure, 4, keep_recovery=True))
    spot = hot_spots(model)["hot1"]["per_amplitude"]
    # 6 (EI / W) / l^2 of a clamped beam: curvature 3.52 of the tip's displacement over l^2
    assert spot["at"] == "top" or spot["von_mises"] < 1e13
    assert any("which the mesh decides" in warning for warning in reduction_warnings(structure, model))
