"""The structure's side of planar bodies: the motion of a cavity's surfaces, in planes of any direction."""

from dataclasses import replace

import gmsh
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.tools.input_files import CLUSTER, changed
from tests.tools.planar import run_planar
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.simulation import simulate
from vanedamp.coupling.system.assembly import assemble as assemble_scene
from vanedamp.coupling.system.line_system import line_system
from vanedamp.coupling.system.modal_basis import modal_basis
from vanedamp.files.toml_input import InputError, validate
from vanedamp.meshes.vane_cluster import SHIPPED
from vanedamp.modal import msh
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless
from vanedamp.studies.case.stages import assemble, interface, modal_analysis, reduction
from vanedamp.studies.case.tables import Case

#: 30 degrees about no axis of the mesh
INCLINED = Rotation.from_rotvec(np.radians(30.0) * np.array([0.48, 0.6, 0.64])).as_matrix()
ALIGNED = np.eye(3)
LENGTH, HEIGHT, GAP, PLAY = 0.06, 0.04, 2e-4, 3e-4
SIDES = {"left": (-1, 0.5), "right": (1, 0.5), "floor": (0, 0), "ceiling": (0, 1)}


def rigid_cavity(path, rotation=ALIGNED, offset=0.0, **changes):
    """A model that moves as a rigid body in a plane, with a cavity of four surfaces and one label for them all.

    Its coordinates are the motion of a point 0.1 m left of the floor's middle and 0.2 m above it, and the rotation.
    offset: of the floor's own middle from that of the walls, m.
    """
    along, across = rotation @ [0.0, 1.0, 0.0], rotation @ [0.0, 0.0, 1.0]
    rows, directions, places, arms = {}, {}, {}, {}

    def add(label, x, y):
        rows[label], rows[f"{label}.normal"] = [1.0, 0.0, -(y - 0.2)], [0.0, 1.0, x + 0.1]
        rows[f"{label}.rotation"] = [0.0, 0.0, 1.0]
        directions[label], directions[f"{label}.normal"] = along, across
        for name in (label, f"{label}.normal", f"{label}.rotation"):
            places[name] = rotation @ [1.0, 2.0 + x, 3.0 + y]
            arms[name] = 0.01 * name.endswith("rotation")

    add("all", 0.0, 0.0)
    for side, (x, y) in SIDES.items():
        shift = {"floor": offset, "ceiling": 0.013}.get(side, 0.0)
        add(side, x * (LENGTH + GAP) / 2 + shift, y * (HEIGHT + PLAY) + (0.004 if x else 0.0))
    others = {"positions": np.array(list(places.values())), "arms": np.array(list(arms.values()))}
    mass = np.diag([1.0, 1.0, 0.02])
    stiffness = mass * np.square(2 * np.pi * np.array([30.0, 70.0, 110.0]))
    model = ReducedModel.from_matrices(
        mass, stiffness, rows, damping_ratio=0.01, directions=directions, base_load=np.outer([1, 0, 0], along), **others
    )
    replace(model, **changes).save(path)
    return str(path)


def cavity_scene(file, surfaces, at="floor", **tables):
    """A block in a cavity whose surfaces have these labels."""
    data = {
        "structure": {"model": "rom", "file": file},
        "excitation": {"frequency": 29.0, "force": 20.0, "at": at},
        "cavity": [{"name": "c1", "gap": GAP, "play": PLAY} | surfaces],
        "damper": [
            {
                "cavity": "c1", "shape": "block", "length": LENGTH, "height": HEIGHT, "mass": 0.05, "friction": 0.3,
                "restitution": 0.6, "lift": 5e-5, "tilt": 5e-4,
            }
        ],
        "time": {"periods": 5, "transient": 0},
    }  # fmt: skip
    return validate(Scene, data | tables, "scene")


FOUR = {side: side for side in SIDES}


@pytest.mark.parametrize("rotation", [ALIGNED, INCLINED], ids=["aligned", "inclined"])
@pytest.mark.parametrize("offset", [0.0, 0.007])
def test_surfaces_of_a_rigid_cavity(tmp_path, rotation, offset):
    """Four patches, each with its own place, move the contacts of a block as one label for the whole cavity."""
    file = rigid_cavity(tmp_path / "rom.h5", rotation, offset)
    one, four = (assemble_scene(scene) for scene in (cavity_scene(file, {"floor": "all"}), cavity_scene(file, FOUR)))
    np.testing.assert_allclose(four.J, one.J, atol=1e-13)
    assert np.abs(one.J[:, :3]).max() > 0.1


def test_a_slider_meets_the_means(tmp_path):
    """A slider has no height: its walls are where their motion is known, as they are without planar bodies."""
    file = rigid_cavity(tmp_path / "rom.h5")
    slider = {"cavity": "c1", "mass": 0.05, "stiffness": 10.0}
    scene = cavity_scene(file, FOUR, damper=[slider])
    system, flat = assemble_scene(scene), line_system(assemble_scene(scene.replace({"damper.0.stiffness": None})))
    np.testing.assert_allclose(system.J[:2], flat.J[flat.friction_rows :], atol=1e-14)


@pytest.mark.parametrize("given", [{}, {"base_direction": [0.0, 3.0, 0.0]}], ids=["of the label", "its own"])
def test_gravity_and_base_across_an_inclined_cavity(tmp_path, given):
    """A block that touches nothing falls to the ceiling's side, and lags behind a base that moves across, too."""
    file = rigid_cavity(tmp_path / "rom.h5", INCLINED)
    model = ReducedModel.load(file)
    # along y of the space: unless it has its own, the label of the excitation gives the base's direction
    directions = np.array(model.directions)
    directions[model.interface.index("all")] = [1.0, 0.0, 0.0] if given else [0.0, 1.0, 0.0]
    replace(model, directions=directions, stiffness=1e12 * np.array(model.mass)).save(file)
    gravity, level, frequency = np.array([1.0, 2.0, 3.0]), 0.4, 2.0
    block = {
        "cavity": "c1", "shape": "block", "length": LENGTH, "height": HEIGHT, "mass": 0.05, "lift": 5.0,
    }  # fmt: skip
    base = {"frequency": frequency, "base_acceleration": level, "at": "all"}
    scene = cavity_scene(
        file, FOUR, excitation=base | given, damper=[block],
        gravity={"acceleration": 0.2, "direction": gravity.tolist()},
        cavity=[{"name": "c1", "gap": 20.0, "play": 10.0} | FOUR],
    )  # fmt: skip
    run = run_planar(scene, 1)
    n, time = run.system.mass.size - 3, 1 / frequency
    omega = 2 * np.pi * frequency
    # from rest, y'' = -a sin(omega t) of the base gives -a (t / omega - sin(omega t) / omega^2)
    moved = 0.2 * gravity / np.linalg.norm(gravity) * time**2 / 2 - level * np.array([0, 1, 0]) * time / omega
    along, across = INCLINED @ [0.0, 1.0, 0.0], INCLINED @ [0.0, 0.0, 1.0]
    # the structure follows its load within 1e-12 of an acceleration
    np.testing.assert_allclose(run.state.q[n:], [moved @ along, 5.0 + moved @ across, 0.0], atol=1e-9)
    assert across @ gravity > 0 and abs(across[1]) > 0.1


WITHOUT_PLACES = {"positions": None}


@pytest.mark.parametrize(
    ("changes", "surfaces", "message"),
    [
        ({}, {"floor": "all.rotation"}, r"cavity\[0\].floor: 'all.rotation' is a rotation \(rad\); name"),
        ({}, {"floor": "all", "ceiling": "roof"}, r"cavity\[0\].ceiling: no interface label 'roof'"),
        ({}, {"floor": "all", "rotation": 1.0}, r"cavity\[0\].rotation: the reduced model has 'all.rotation', which"),
        ({}, {"floor": "all", "normal_motion": 1.0}, r"cavity\[0\].normal_motion: the reduced model has 'all.normal'"),
        (WITHOUT_PLACES, FOUR, r"cavity\[0\].left: 'left' has a rotation, but 'left' or 'floor' lacks its place"),
    ],
)
def test_labels_that_do_not_fit_are_refused(tmp_path, changes, surfaces, message):
    file = rigid_cavity(tmp_path / "rom.h5", **changes)
    with pytest.raises(InputError, match=message) as refused:
        simulate(cavity_scene(file, surfaces))
    assert "\n" not in str(refused.value)


def test_an_unknown_direction_across_is_refused(tmp_path):
    """Where gravity needs it: a body would fall nowhere."""
    file = rigid_cavity(tmp_path / "rom.h5")
    model = ReducedModel.load(file)
    directions = np.array(model.directions)
    directions[model.interface.index("all.normal")] = 0.0
    replace(model, directions=directions).save(file)
    with pytest.raises(InputError, match=r"cavity\[0\].floor: the reduced model knows no direction of 'all.normal'"):
        simulate(cavity_scene(file, {"floor": "all"}, gravity={"direction": [0, 0, -1]}))
    assert simulate(cavity_scene(file, {"floor": "all"})).status == "ok"


def test_one_label_needs_no_places(tmp_path):
    file = rigid_cavity(tmp_path / "rom.h5", **WITHOUT_PLACES)
    assert simulate(cavity_scene(file, {"floor": "all"})).status == "ok"


HEAD = changed(CLUSTER, ("degree = 2", "degree = 1"), ("count = 10", 'count = 3\nat = "c1"')).split("[interface")[0]
GROUPS = '["c1_left", "c1_right", "c1_floor", "c1_roof"]'
CAVITY = f'[interface.c1]\nfacets = {GROUPS}\nkind = "cavity"\ndirection = "c1_left"\nnormal = "c1_floor"\n'
PATCHES = "".join(
    f'[interface.{label}]\nfacets = "c1_{group}"\nkind = "patch"\ndirection = "c1_left"\nnormal = "c1_floor"\n'
    for label, group in (("c1", "floor"), ("left", "left"), ("right", "right"), ("ceiling", "roof"))
)


def cluster_case(folder, tables, rotation=None):
    """The case of the shipped cluster with interface tables, turned in space by a rotation (3, 3)."""
    text = HEAD + tables
    if rotation is not None:
        file = folder / "turned.msh"
        with msh.session("turned"):
            gmsh.merge(str(SHIPPED))
            gmsh.model.mesh.affineTransform(np.hstack([rotation, np.zeros((3, 1))]).ravel().tolist())
            msh.write(file)
        bending = (rotation @ [0.0, 1.0, 0.0]).tolist()
        text = changed(text, (str(SHIPPED), str(file)), ("direction = [0, 1, 0]", f"direction = {bending}"))
    (folder / "case.toml").write_text(text)
    return Case.load(folder / "case.toml")


def cluster_scene(file, surfaces, down=(0.0, 0.0, -1.0), **excitation):
    """A block in the cavity of the cluster at its first frequency, 14 mm wide and 5 mm high."""
    gap, play = 4e-5, 2e-4
    block = {
        "cavity": "c1", "shape": "block", "length": 0.014 - gap, "height": 0.005 - play, "mass": 0.003,
        "friction": 0.4, "restitution": 0.7, "lift": 8e-5, "tilt": 2e-3, "velocity": 0.3,
    }  # fmt: skip
    drive = excitation or {"resonance_amplitude": 4e-5}
    data = {
        "structure": {"model": "rom", "file": str(file)},
        "excitation": {"frequency": 3300.0, "at": "c1"} | drive,
        "gravity": {"direction": list(down)},
        "cavity": [{"name": "c1", "gap": gap, "play": play} | surfaces],
        "damper": [block],
        "time": {"periods": 60, "transient": 0},
    }  # fmt: skip
    return validate(Scene, data, "scene")


@pytest.fixture(scope="module")
def cluster_files(tmp_path_factory):
    """Reduced models of the cluster: as it is, inclined, and with a patch for each surface."""
    folder = tmp_path_factory.mktemp("cluster")
    for name, tables, rotation in (
        ("aligned", CAVITY, None), ("inclined", CAVITY, INCLINED), ("patches", PATCHES, None)
    ):  # fmt: skip
        case = cluster_case(folder, tables, rotation)
        reduction(assemble(case), 6).save(folder / f"{name}.h5")
    return folder


def first_impacts(response, count=5):
    """Bodies, sides and corners, times and impulses of the first impacts."""
    impacts = [event for event in response.event_list if event.kind == "impact"][:count]
    met = [(event.damper, event.side, event.corner) for event in impacts]
    return met, [event.time for event in impacts], [event.impulse for event in impacts]


@pytest.mark.parametrize("drive", [{"resonance_amplitude": 4e-5}, {"base_acceleration": 200.0}])
def test_an_inclined_cluster_moves_as_the_aligned_one(cluster_files, drive):
    """Directions by the names of facet groups turn with the mesh; so do gravity and the base."""
    found = []
    for name, rotation in (("aligned", ALIGNED), ("inclined", INCLINED)):
        scene = cluster_scene(cluster_files / f"{name}.h5", {"floor": "c1"}, rotation @ [0.1, 0.5, -1.0], **drive)
        response = simulate(scene, events=True)
        assert response.energy_residual < 1e-10
        found.append(first_impacts(response))
    (met, times, impulses), inclined = found
    assert len(met) == 5
    assert inclined[0] == met
    # the models agree to round-off, 1e-13; an impact lets differences grow up to a hundred times
    np.testing.assert_allclose(inclined[1], times, rtol=1e-5)
    np.testing.assert_allclose(inclined[2], impulses, rtol=1e-3)


def test_a_block_in_the_cluster(cluster_files):
    """Patches of its own surfaces or one label for the cavity: nearly the same contacts, and energies balance."""
    patches = {"left": "left", "right": "right", "floor": "c1", "ceiling": "ceiling"}
    whole = cluster_scene(cluster_files / "aligned.h5", {"floor": "c1"})
    own = cluster_scene(cluster_files / "patches.h5", patches)
    for scene in (whole, own):
        response = simulate(scene)
        assert response.status in ("ok", "not_steady")
        assert response.energy_residual < 1e-10
        assert response.impacts_per_period > 1
        assert 1e-3 < response.tilt_max[0] < 2e-2
    # the cavity strains by some percent of its motion in the first mode
    first, second = (assemble_scene(scene).J[:, 0] for scene in (whole, own))
    np.testing.assert_allclose(np.abs(second), np.abs(first), atol=0.05 * np.abs(first).max())


def test_a_rigid_model_of_the_mode(tmp_path):
    """One natural mode of the reduced model is the rigid model with the motion that the modal analysis tells."""
    case = cluster_case(tmp_path, CAVITY)
    structure = assemble(case)
    analysis = modal_analysis(structure)
    motion, rigid = analysis.cavities["c1"], analysis.rigid
    assert motion.along == pytest.approx(1.0, rel=1e-12)
    vectors = interface(case, structure.matrices).vectors
    shape = analysis.modes.shapes[analysis.first_bending]
    along, normal, turn = vectors.T @ shape
    assert (motion.normal_motion, motion.rotation) == pytest.approx((normal / along, turn / along), rel=1e-12)
    assert abs(motion.rotation) > 1.0 and abs(motion.normal_motion) > 0.01
    assert analysis.to_json()["cavity"]["c1"]["rotation"] == motion.rotation
    reduction(structure, 6).save(tmp_path / "rom.h5")
    scene = cluster_scene(tmp_path / "rom.h5", {"floor": "c1"})
    scene = scene.replace({"structure.modes": 1, "structure.natural": True, "gravity": {"acceleration": 9.81}})
    told = {
        "model": "rigid", "mass": rigid.mass, "stiffness": rigid.stiffness, "damping_ratio": rigid.damping_ratio
    }  # fmt: skip
    cavity = {"normal_motion": motion.normal_motion, "rotation": motion.rotation, "floor": None}
    other = scene.replace(
        {"structure": told, "excitation.at": None} | {f"cavity.c1.{key}": value for key, value in cavity.items()}
    )
    one, two = (first_impacts(simulate(case, events=True)) for case in (scene, other))
    assert len(one[0]) == 5
    assert two[0] == one[0]
    # the reduced model has the mode within 1e-8 or so; an impact lets differences grow up to a hundred times
    np.testing.assert_allclose(two[1], one[1], rtol=1e-4)
    # without its rotation and motion across the cavity is another one
    other = other.replace({"cavity.c1.rotation": 0.0, "cavity.c1.normal_motion": 0.0})
    assert np.abs(np.array(first_impacts(simulate(other, events=True))[1]) / one[1] - 1).max() > 1e-3


def test_residual_flexibility_at_a_corner(cluster_files):
    """A point of a patch yields by what its own row lacks of the static flexibility, with all it shares."""
    model = ReducedModel.load(cluster_files / "patches.h5")
    basis = modal_basis(massless(model, 2))
    row = model.row("c1.normal") + 0.007 * model.row("c1.rotation")
    squares, shapes = model.natural
    lacking = (((row @ shapes) ** 2) / squares)[2:].sum()
    assert basis.flexibility({"c1.normal": 1.0, "c1.rotation": 0.007}) == pytest.approx(lacking, rel=1e-9)
    assert basis.flexibility({"c1.normal": 1.0}) < lacking
    assert modal_basis(model).flexibility({"c1.normal": 1.0}) == 0.0


def test_a_slider_on_patches_that_yield(cluster_files):
    """The compliant law takes the residual flexibility of a patch's motion along: a shorter contact without it."""
    patches = {"left": "left", "right": "right", "floor": "c1"}
    slider = {"cavity": "c1", "mass": 0.003, "restitution": 1.0, "velocity": 0.3}
    scene = cluster_scene(cluster_files / "patches.h5", patches).replace(
        {"damper": [slider], "structure.modes": 2, "structure.natural": True, "time.periods": 20}
    )
    springs = []
    for residual in (False, True):
        law = {"law": "compliant", "stiffness": 1e8, "residual": residual}
        yielding = scene.replace({"contact": law})
        assert simulate(yielding).energy_residual < 1e-10
        springs.append(assemble_scene(yielding).spring[-2:])
    model = ReducedModel.load(cluster_files / "patches.h5")
    own = np.diag(massless(model, 2).residual_flexibility)
    lacking = [own[model.interface.index(label)] for label in ("left", "right")]
    np.testing.assert_allclose(1 / springs[1] - 1 / springs[0], lacking, rtol=1e-9)


@pytest.mark.parametrize(
    ("surfaces", "message"),
    [
        ({"floor": "ceiling"}, r"cavity\[0\].floor: the facets of 'ceiling' look along \[0, 0, -1\], which is 180"),
        ({"left": "left", "right": "right"}, r"cavity\[0\].floor: the facets of 'left' look along \[0, 1, 0\], which"),
        ({"floor": "c1", "ceiling": "left"}, r"cavity\[0\].ceiling: the facets of 'left' look along \[0, 1, 0\]"),
    ],
)
def test_surfaces_at_the_wrong_place_are_refused(cluster_files, surfaces, message):
    scene = cluster_scene(cluster_files / "patches.h5", surfaces)
    with pytest.raises(InputError, match=message):
        simulate(scene)
    # a slider moves along only
    slider = {"cavity": "c1", "mass": 0.003}
    assert simulate(scene.replace({"damper": [slider], "time.periods": 2})).status == "ok"


def test_a_ceiling_with_a_direction_of_its_own_is_refused(tmp_path):
    tables = '[interface.c1]\nfacets = "c1_floor"\nkind = "patch"\ndirection = "c1_left"\n'
    tables += '[interface.ceiling]\nfacets = "c1_roof"\nkind = "patch"\ndirection = "c1_left"\n'
    reduction(assemble(cluster_case(tmp_path, tables)), 1).save(tmp_path / "rom.h5")
    scene = cluster_scene(tmp_path / "rom.h5", {"floor": "c1", "ceiling": "ceiling"})
    with pytest.raises(InputError, match=r"cavity\[0\].ceiling: across the cavity 'ceiling' points at 180 degrees"):
        simulate(scene)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (f'facets = {GROUPS}\nkind = "cavity"\ndirection = "c1_left"', "interface.c1.normal: missing; give the"),
        ('facets = "c1_left"\nkind = "patch"\ndirection = "normal"', "c1: the direction across is at 0 degrees to"),
        (f'facets = {GROUPS}\nkind = "patch"\ndirection = "c1_left"\nnormal = "c1_floor"', "c1: .* faces several ways"),
        ('facets = "c1_flor"\nkind = "patch"\ndirection = "c1_left"', "interface.c1.facets: no facet group 'c1_flor'"),
    ],
)
def test_tables_that_make_no_plane_are_refused(tmp_path, table, message):
    with pytest.raises(Exception, match=message) as refused:
        assemble(cluster_case(tmp_path, f"[interface.c1]\n{table}\n"))
    assert "\n" not in str(refused.value)
