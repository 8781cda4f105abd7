"""Case files: what they mean, and the one line that says what is wrong with them."""

import pytest

from tests.tools.input_files import BLOCK, CLUSTER, changed
from vanedamp.coupling.strength.material import Fatigue
from vanedamp.files.toml_input import InputError
from vanedamp.meshes.vane_cluster import SHIPPED
from vanedamp.studies.case.tables import Case

FREE_BLOCK = BLOCK.split("[support]")[0]
THREE = "expected three numbers, not all zero, such as"


def load(text, tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(text)
    return Case.load(path)


def test_reads_a_case(tmp_path):
    case = load(CLUSTER, tmp_path)
    assert case.mesh.file == str(SHIPPED)
    assert case.damping_ratio == 0.002
    assert case.fatigue_strength is None
    assert case.support.clamped == {"clamp": "xyz"}
    assert case.response_label == "c1"
    assert case.material["default"].density == 8190.0


def test_mesh_is_found_beside_the_case(tmp_path):
    (tmp_path / "part.msh").write_text("")
    case = load(changed(CLUSTER, (str(SHIPPED), "part.msh")), tmp_path)
    assert case.mesh.file == str(tmp_path / "part.msh")


def test_generators_take_their_parameters(tmp_path):
    case = load(FREE_BLOCK, tmp_path)
    assert case.mesh.divisions == (6, 2, 1)
    assert case.mesh.degree == 2
    cluster = load(changed(CLUSTER, (f'file = "{SHIPPED}"', 'generator = "vane_cluster"\nairfoils = 3')), tmp_path)
    assert cluster.mesh.airfoils == 3


@pytest.mark.parametrize(
    ("clamped", "expected"),
    [
        ('["a", "b"]', {"a": "xyz", "b": "xyz"}),
        ('{a = "y"}', {"a": "y"}),
        ('["a", {b = "xz"}]', {"a": "xyz", "b": "xz"}),
        ("[]", {}),
    ],
)
def test_supports(clamped, expected, tmp_path):
    case = load(changed(CLUSTER, ('["clamp"]', clamped)), tmp_path)
    assert case.support.clamped == expected


def test_damping_of_the_modes_overrides_the_material(tmp_path):
    assert load(changed(CLUSTER, ("count = 10", "damping_ratio = 0.01")), tmp_path).damping_ratio == 0.01
    assert load(changed(CLUSTER, ("damping_ratio = 0.002\n", "")), tmp_path).damping_ratio == 0.0


def test_least_fatigue_strength_counts(tmp_path):
    second = "[material.airfoils]\nyoung = 1e11\npoisson = 0.3\ndensity = 1000\nfatigue_strength = 3e8\n[support]"
    text = changed(CLUSTER, ("[support]", second), ("density = 8190.0", "density = 8190.0\nfatigue_strength = 4e8"))
    assert load(text, tmp_path).fatigue_strength == 3e8


FATIGUE = "[material.fatigue]\nexponent = 8.0\nknee = 1e7\ntensile_strength = 1e9\n[support]"
STRENGTH = ("density = 8190.0", "density = 8190.0\nfatigue_strength = 4e8")


def test_fatigue_data_of_all_materials_and_of_one(tmp_path):
    second = (
        "[material.airfoils]\nyoung = 1e11\npoisson = 0.3\ndensity = 1000.0\n"
        "[material.airfoils.fatigue]\nstrength = 3e8\n" + FATIGUE
    )
    case = load(changed(CLUSTER, ("[support]", second), STRENGTH), tmp_path)
    common = Fatigue(strength=4e8, exponent=8.0, knee=1e7, tensile_strength=1e9, mean_stress="goodman")
    assert case.fatigue("rim") == common
    assert case.fatigue("airfoils") == Fatigue(strength=3e8, mean_stress="none")
    assert case.fatigue_strength == 3e8 and list(case.material) == ["default", "airfoils"]


def test_a_fatigue_strength_is_fatigue_data(tmp_path):
    assert load(CLUSTER, tmp_path).fatigue("rim") is None
    assert load(changed(CLUSTER, STRENGTH), tmp_path).fatigue("rim") == Fatigue(strength=4e8, mean_stress="none")


def test_a_volume_group_may_be_called_fatigue(tmp_path):
    second = "[material.fatigue]\nyoung = 1e11\npoisson = 0.3\ndensity = 1000.0\nfatigue_strength = 1e8\n[support]"
    case = load(changed(CLUSTER, ("[support]", second)), tmp_path)
    assert case.material["fatigue"].young == 1e11 and case.fatigue("fatigue").strength == 1e8


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("8.0", "-8.0", "material.fatigue.exponent: should be greater than 0 (got -8.0)"),
        ("8.0", "51.0", "material.fatigue.exponent: should be less than or equal to 50 (got 51.0)"),
        ("exponent", "exponnent", "material.fatigue.exponnent: unknown key; did you mean 'exponent'?"),
        ("knee = 1e7\n", "", "material.fatigue: knee: missing; a curve of stress and life needs it with exponent"),
        ("1e9", "1e8", "material: default.fatigue.strength: expected at most the tensile strength 1e+08, not 4e+08"),
        ("1e9", '1e9\nmean_stress = "soderberg"', 'material.fatigue: yield_strength: missing; mean_stress = "soder'),
        (
            "tensile_strength = 1e9",
            'mean_stress = "gerber"',
            "material.fatigue: tensile_strength: missing; mean_stress",
        ),
        ("1e9", "1e9\nyield_strength = 2e9", "material.fatigue: yield_strength: expected at most the tensile strength"),
        ("1e9", "1e9\nafter_knee = 3.0", "material.fatigue: after_knee: expected at least the exponent 8, not 3"),
        ("1e9", "1e9\nscatter = 0.5", "material.fatigue.scatter: should be greater than or equal to 1 (got 0.5)"),
        ("1e9", "1e9\nyoung = 2e11", "material.fatigue: exponent: is fatigue data; head it [material.<group>.fatigue]"),
        ("material.fatigue", "material.rim", "material: rim: has fatigue data only; head them [material.rim.fatigue]"),
    ],
)
def test_bad_fatigue_data_are_rejected(old, new, message, tmp_path):
    with pytest.raises(InputError) as error:
        load(changed(CLUSTER, ("[support]", changed(FATIGUE, (old, new))), STRENGTH), tmp_path)
    assert str(error.value).startswith(f"{tmp_path / 'case.toml'}: {message}")


def test_fatigue_data_without_any_strength_are_rejected(tmp_path):
    with pytest.raises(InputError, match=r"material: default.fatigue.strength: missing; give it, or the material's"):
        load(changed(CLUSTER, ("[support]", FATIGUE)), tmp_path)


@pytest.mark.parametrize(
    ("interfaces", "at", "expected"),
    [
        (["c1"], None, "c1"),
        (["c1", "shroud"], None, "shroud"),
        (["c1", "shroud"], "c1", "c1"),
        ([], None, None),
    ],
)
def test_response_of_the_rigid_model(interfaces, at, expected, tmp_path):
    head = CLUSTER.split("[interface")[0]
    tables = "".join(f'[interface.{name}]\nfacets = "f"\ndirection = [0, 1, 0]\n' for name in interfaces)
    text = head.replace("count = 10", f'at = "{at}"' if at else "") + tables
    assert load(text, tmp_path).response_label == expected


def test_open_choice_of_the_response_is_refused(tmp_path):
    case = load(CLUSTER + '[interface.c2]\nfacets = "f"\ndirection = [0, 1, 0]\n', tmp_path)
    with pytest.raises(InputError, match=r"^modes.at: name the interface of the rigid model, one of c1, c2"):
        _ = case.response_label


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("density = 8190.0", "density = -1.0", "material.default.density: should be greater than 0"),
        ("poisson = 0.3", "poisson = 0.5", "material.default.poisson: should be less than 0.5"),
        ("poisson = 0.3", "poisson = -1.0", "material.default.poisson: should be greater than -1"),
        ("young = 2e11", 'young = "stiff"', "material.default.young: should be a valid number"),
        ("young = 2e11", "young = inf", "material.default.young: should be a finite number"),
        ("young = 2e11", "yuong = 2e11", "material.default.yuong: unknown key; did you mean 'young'?"),
        ("young = 2e11\n", "", "material.default.young: missing; it is required here"),
        ("damping_ratio = 0.002", "damping_ratio = 1.0", "material.default.damping_ratio: should be less than 1"),
        ("[modes]", "[mode]", "mode: unknown key; did you mean 'modes'?"),
        ("count = 10", "count = 0", "modes.count: should be greater than or equal to 1"),
        ("count = 10", "count = 10.5", "modes.count: should be a valid integer"),
        ("count = 10", "count = 1\nmax_frequency = 1.0", "modes: give one of count and max_frequency"),
        ("count = 10", "min_frequency = 1.0", "modes: min_frequency: expected a max_frequency above it"),
        ("count = 10", "min_frequency = 5.0\nmax_frequency = 5.0", "modes: min_frequency: expected a max_frequency"),
        ("count = 10", 'at = "shroud"', "modes.at: no interface 'shroud'; known: c1"),
        (
            '"c1_floor"',
            '"c1_floor"\nkind = "mean"',
            "interface.c1.kind: should be 'average', 'rigid', 'node', 'full', 'patch', 'cavity' or 'pair'",
        ),
        ('facets = "c1_floor"\n', "", "interface.c1.facets: missing"),
        ('c1_floor"\ndirection = [0, 1, 0]', 'c1_floor"\ndirection = [0, 0, 0]', f"interface.c1.direction: {THREE}"),
        ('c1_floor"\ndirection = [0, 1, 0]', 'c1_floor"\ndirection = 3', f"interface.c1.direction: {THREE}"),
        ('facets = "c1_floor"', "facets = []", "interface.c1.facets: expected a group, such as"),
        ('facets = "c1_floor"', "facets = 3", "interface.c1.facets: expected a group, such as"),
        (
            'facets = "c1_floor"',
            'facets = "c1_floor"\nnormal = "c1_floor"',
            'interface.c1: normal: kind = "average" moves along its direction only; take kind = "patch"',
        ),
        (
            'facets = "c1_floor"',
            'facets = "c1_floor"\nkind = "patch"\nmotion = "rotation"',
            'interface.c1: motion: kind = "patch" has the rotation in the plane besides; leave it out',
        ),
        ("count = 10\ndirection = [0, 1, 0]", "count = 10\ndirection = [0, 1]", f"modes.direction: {THREE}"),
        ('["clamp"]', '"clamp"', "support.clamped: expected a list of facet groups"),
        ('["clamp"]', '{clamp = "w"}', "support.clamped: clamp: expected components out of 'xyz', not 'w'"),
        ("degree = 2", "degree = 4", "mesh.degree: should be less than or equal to 3"),
        ("degree = 2", "spam = 2", "mesh.spam: unknown key; known: degree, file"),
        ("degree = 2", "span = 2", 'mesh.span: belongs to generator = "vane_cluster", not to a file'),
        (f'file = "{SHIPPED}"\n', "", "mesh: give one of file and generator"),
        (str(SHIPPED), "nowhere.msh", "mesh.file: no such file"),
        ("degree = 2", "degree = ", "not valid TOML"),
    ],
)
def test_bad_input_is_one_line_with_the_key(old, new, message, tmp_path):
    with pytest.raises(InputError) as refused:
        load(changed(CLUSTER, (old, new)), tmp_path)
    text = str(refused.value)
    assert text.startswith(f"{tmp_path / 'case.toml'}: {message}")
    assert "\n" not in text


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"block"', '"blok"', "mesh.generator: must be one of 'vane_cluster', 'block', 'sector'"),
        ('"block"', "[1]", "mesh.generator: must be one of 'vane_cluster', 'block', 'sector'"),
        ("thickness = 0.01", "thikness = 0.01", "mesh.thikness: unknown key; did you mean 'thickness'?"),
        ("thickness = 0.01", "thickness = -0.01", "mesh: thickness: expected a positive number of metres"),
        ("thickness = 0.01", 'thickness = "3"', "mesh.thickness: should be a valid number (got '3')"),
        ("thickness = 0.01\n", "", "mesh.thickness: missing"),
        ("[6, 2, 1]", "[6, 2, 1.5]", "mesh.divisions[2]: should be a valid integer"),
        ("[6, 2, 1]", "[6, 2, 1]\norder = true", "mesh.order: should be a valid integer (got True)"),
        (
            "[6, 2, 1]",
            "[6, 2, 1]\nspan = 2",
            'mesh.span: belongs to generator = "vane_cluster", not to generator',
        ),
        ("length = 0.1", "length = 1e300", "mesh.length: expected a number up to 1e+40 in SI units (got 1e+300)"),
    ],
)
def test_bad_generator_parameters(old, new, message, tmp_path):
    with pytest.raises(InputError) as refused:
        load(changed(FREE_BLOCK, (old, new)), tmp_path)
    assert str(refused.value).startswith(f"{tmp_path / 'case.toml'}: {message}")


def test_differing_damping_ratios_need_a_decision(tmp_path):
    second = "[material.airfoils]\nyoung = 1e11\npoisson = 0.3\ndensity = 1\ndamping_ratio = 0.1\n[support]"
    with pytest.raises(InputError, match=r"material: the damping ratios differ; .*\[modes\] damping_ratio"):
        load(changed(CLUSTER, ("[support]", second)), tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('["clamp"]', '["clmp"]', "support.clamped: no facet group 'clmp' in the mesh; it has c1_floor, clamp"),
        ('"c1_floor"', '"c9"', "interface.c1.facets: no facet group 'c9' in the mesh; it has c1_floor, clamp"),
        ('"c1_floor"', '["c1_floor", "c9"]', "interface.c1.facets: no facet group 'c9' in the mesh; it has"),
        ('"c1_floor"', '["c1_floor", "rim"]', "interface.c1.facets: groups of several kinds (edge, facet), whose"),
        ('c1_floor"\ndirection = [0, 1, 0]', 'c1_floor"\ndirection = "up"', "interface.c1.direction: no facet group"),
        ('"c1_floor"', '"c1_floor"\nkind = "patch"\nnormal = "rim"', "interface.c1.normal: no facet group 'rim' in"),
        (
            "[material.default]",
            "[material.disk]",
            "material.disk: no volume group 'disk' in the mesh; it has airfoils,",
        ),
    ],
)
def test_unknown_groups_list_those_that_exist(old, new, message, tmp_path):
    case = load(changed(CLUSTER, (old, new)), tmp_path)
    with pytest.raises(InputError) as refused:
        case.check_groups(["clamp", "c1_floor"], ["airfoils"], {"edge": ["rim"]})
    assert str(refused.value).startswith(message)


@pytest.mark.parametrize(
    ("table", "axes", "across", "along"),
    [
        ("stiffness = 1e12", (1e12, 1e12, 1e12), 0.0, 0.0),
        ("stiffness = [1e12, 0, 3e11]", (1e12, 0.0, 3e11), 0.0, 0.0),
        ("normal = 1e12\ntangential = 5e11", (0.0, 0.0, 0.0), 1e12, 5e11),
    ],
)
def test_elastic_supports(table, axes, across, along, tmp_path):
    case = load(changed(CLUSTER, ('clamped = ["clamp"]', f"[support.elastic.clamp]\n{table}")), tmp_path)
    springs = case.support.elastic["clamp"]
    assert (springs.stiffness, springs.normal, springs.tangential) == (axes, across, along)


@pytest.mark.parametrize(
    ("support", "message"),
    [
        ("[support.elastic.clamp]\nstiffness = 0.0", "stiffness: expected N/m"),
        ("[support.elastic.clamp]\nstiffness = [1.0, -1.0, 0.0]", "support.elastic.clamp.stiffness"),
        ('[support.elastic.clamp]\nstiffness = "stiff"', "support.elastic.clamp.stiffness"),
        ("[support.elastic.clamp]\nstifness = 1.0", "stifness"),
        ('clamped = ["clamp"]\n[support.elastic.clamp]\nnormal = 1.0', "elastic.clamp: the group is clamped"),
    ],
)
def test_refuses_elastic_supports(support, message, tmp_path):
    with pytest.raises(InputError, match=message):
        load(changed(CLUSTER, ('clamped = ["clamp"]', support)).replace("[support]\n[", "["), tmp_path)
