"""Shapes and frequency responses survive the way to a file and back."""

import re

import numpy as np
import pytest

from vanedamp.files.formats.universal_datasets import curve_dataset, write_universal
from vanedamp.modal.correlation import MeasuredShapes
from vanedamp.modal.frf import Frf
from vanedamp.modal.measurements import MeasurementError, read_frf, read_shapes, write_frf, write_shapes


def shapes(kind=float, axes=True):
    rng = np.random.default_rng(0)
    points = np.repeat(rng.standard_normal((4, 3)), 3, axis=0)[1:]
    directions = np.tile(np.eye(3), (4, 1))[1:] if axes else rng.standard_normal((11, 3))
    values = rng.standard_normal((2, 11)) + (1j * rng.standard_normal((2, 11)) if kind is complex else 0.0)
    return MeasuredShapes(points, directions, values, [120.5, 1e3 / 3], [0.01, 0.02])


def ordered(measured):
    """Rows in an order of their own, to compare sets of points."""
    keys = np.round(np.column_stack([measured.points, measured.directions]), 5)
    order = np.lexsort(keys.T)
    return measured.points[order], measured.directions[order], measured.shapes[:, order]


@pytest.mark.parametrize("kind", [float, complex])
def test_shapes_through_csv(tmp_path, kind):
    given = shapes(kind, axes=False)
    write_shapes(given, tmp_path / "shapes.csv")
    again = read_shapes(tmp_path / "shapes.csv")
    assert np.array_equal(again.shapes, given.shapes)
    assert np.array_equal(again.points, given.points)
    assert again.directions == pytest.approx(given.directions, rel=1e-15)
    assert np.array_equal(again.frequencies_hz, given.frequencies_hz)


@pytest.mark.parametrize("kind", [float, complex])
def test_shapes_through_a_universal_file(tmp_path, kind):
    pytest.importorskip("pyuff")
    given = shapes(kind)
    write_shapes(given, tmp_path / "shapes.uff")
    again = read_shapes(tmp_path / "shapes.uff")
    for ours, theirs in zip(ordered(given), ordered(again), strict=True):
        assert theirs == pytest.approx(ours, rel=1e-5, abs=1e-12)  # the format holds six digits
    assert again.frequencies_hz == pytest.approx(given.frequencies_hz, rel=1e-5)
    assert again.damping_ratios == pytest.approx(given.damping_ratios, rel=1e-4)  # of an eigenvalue of six digits


@pytest.mark.parametrize("dataset", [2420, 18])
@pytest.mark.parametrize("kind", [0, 1])
def test_displacements_along_axes_of_their_nodes(tmp_path, dataset, kind):
    """A motion (1, 2, 3) of a point at (3, 4, 5), given along x' = z, y' = x, z' = y about (3, 0, 5), or radially."""
    pytest.importorskip("pyuff")
    write_shapes(MeasuredShapes([(3.0, 4.0, 5.0)] * 3, np.eye(3), [[1.0, 2.0, 3.0]], [100.0]), tmp_path / "global.uff")
    # the axis z' is y, on which the point lies 4 above the origin: its radius is zero, unless the origin moves to x = 2
    origin, values = ((3, 0, 5), (3.0, 1.0, 2.0)) if kind == 0 else ((2, 0, 5), (1.0, -3.0, 2.0))
    system = (
        "  2420\n         1\npart\n{label:10}{kind:10}         1\nlocal\n0. 0. 1.\n1. 0. 0.\n0. 1. 0.\n{x} {y} {z}\n"
    )
    if dataset == 18:  # the origin, a point on x', one in the plane of x' and z'
        system = "    18\n{label:10}{kind:10}         0         1         1\nlocal\n"
        system += "{x}. {y}. {z}. {x}. {y}. 9.\n{x}. 4. 6.\n"
    text = (tmp_path / "global.uff").read_text()
    head = "    -1\n" + system.format(label=7, kind=kind, **dict(zip("xyz", origin, strict=True))) + "    -1\n"
    node = re.search(r"^ +1 +0 +0 +0", text, re.MULTILINE)[0]
    numbers = "".join(f"{value:13.5e}" for value in (1.0, 2.0, 3.0))
    assert text.count(node) == 1 and text.count(numbers) == 1
    text = text.replace(node, f"{1:10}{0:10}{7:10}{0:10}").replace(
        numbers, "".join(f"{value:13.5e}" for value in values)
    )
    (tmp_path / "local.uff").write_text(head + text)
    again = read_shapes(tmp_path / "local.uff")
    assert again.points == pytest.approx(np.tile([3.0, 4.0, 5.0], (3, 1)))
    assert again.shapes @ again.directions == pytest.approx(np.array([[1.0, 2.0, 3.0]]), abs=1e-12)
    for old, new, told in (
        (f"{1:10}{0:10}{7:10}", f"{1:10}{0:10}{8:10}", "the coordinate system 8 is not given in the file"),
        (
            f"{1:10}{0:10}{7:10}",
            f"{1:10}{7:10}{7:10}",
            "node 1 is given in coordinate system 7; write global coordinates",
        ),
        (f"\n{7:10}{kind:10}", f"\n{7:10}{2:10}", "spherical"),
    ):
        assert (head + text).count(old) == 1
        (tmp_path / "bad.uff").write_text((head + text).replace(old, new))
        with pytest.raises(MeasurementError, match=rf"bad\.uff: .*{told}"):
            read_shapes(tmp_path / "bad.uff")


@pytest.mark.parametrize("name", ["frf.csv", "frf.uff"])
def test_responses_round_trip(tmp_path, name):
    if name.endswith("uff"):
        pytest.importorskip("pyuff")
    frequencies = np.linspace(100.0, 200.0, 50)
    values = 1e-6 / (150.0**2 - frequencies**2 + 3j * frequencies) * np.array([[1.0], [-0.5j]])
    given = Frf(frequencies, values, "mobility")
    write_frf(given, tmp_path / name)
    again = read_frf(tmp_path / name, "mobility")
    assert again.quantity == "mobility"
    assert np.array_equal(again.frequencies_hz, frequencies)
    assert np.array_equal(again.values, values)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no rows of numbers"),
        ("0,0,0,0,0,1,1\n", "expected the header x,y,z"),
        ("x,y,z,dx,dy,dz,1\n0,0,0,0,0\n", "line 1: 7 names for 5 columns"),
        ("x,y,z,dx,dy,dz,1\n0,0,0,0,0,a,1\n", r"line 2: dz: expected a finite number \(got 'a'\)"),
        ("x,y,z,dx,dy,dz,1\n0,0,0,0,0,0,1\n", "directions: row 0 has no length"),
    ],
)
def test_bad_shapes_are_told(tmp_path, text, message):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(MeasurementError, match=message) as told:
        read_shapes(tmp_path / "bad.csv")
    assert str(tmp_path / "bad.csv") in str(told.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2\n3,4\n", "expected the columns frequency, real part"),
        ("f,re,im\n1,2,3\n2,x,4\n", r"line 3: re: expected a finite number \(got 'x'\)"),
        ("2,2,3\n1,-1,4\n", "frequencies_hz: expected at least two, ascending"),
        ("", "holds no rows"),
    ],
)
def test_bad_responses_are_told(tmp_path, text, message):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(MeasurementError, match=message):
        read_frf(tmp_path / "bad.csv")


def test_comments_and_blank_lines_count_as_lines(tmp_path):
    """The line that an error names is that of the file; a comment may stand behind blanks."""
    (tmp_path / "shapes.csv").write_text("# one\nx,y,z,dx,dy,dz,100\n\n  # two\n0,0,0,1,0,0,1\n0,0,0,1,0\n")
    with pytest.raises(MeasurementError, match="line 6: 5 columns; line 5 has 7"):
        read_shapes(tmp_path / "shapes.csv")
    (tmp_path / "frf.csv").write_text("f,re,im\n  # behind blanks\n1,2,3\n2,3,4\n")
    assert read_frf(tmp_path / "frf.csv").values.tolist() == [[2 + 3j, 3 + 4j]]


def test_universal_files_hold_axes_alone(tmp_path):
    with pytest.raises(MeasurementError, match="write CSV instead"):
        write_shapes(shapes(axes=False), tmp_path / "shapes.unv")
    with pytest.raises(MeasurementError, match="no such file"):
        read_shapes(tmp_path / "none.csv")


def polar(folder, header, degrees, scale=1.0):
    """A resonance at 150 Hz as magnitude and phase, and its values."""
    frequencies = np.linspace(100.0, 200.0, 201)
    values = scale / (150.0**2 - frequencies**2 + 3j * frequencies)
    angle = np.angle(values, deg=degrees)
    columns = np.column_stack([frequencies, np.abs(values), angle]).tolist()
    rows = "".join(f"{f!r},{size!r},{turn!r}\n" for f, size, turn in columns)
    (folder / "polar.csv").write_text(header + rows)
    return values


@pytest.mark.parametrize(
    ("header", "columns", "degrees"),
    [
        ("Frequency (Hz),Magnitude (m/N),Phase (deg)\n", None, True),
        ("f,|H|,phase [rad]\n", None, False),
        # beyond two pi a phase is in degrees
        ("f,mag,phase\n", None, True),
        ("", "magnitude-degrees", True),
        ("f,mag,phase\n", "magnitude-radians", False),
    ],
)
def test_magnitude_and_phase(tmp_path, header, columns, degrees):
    values = polar(tmp_path, header, degrees)
    read = read_frf(tmp_path / "polar.csv", columns=columns).values[0]
    assert read == pytest.approx(values, rel=1e-12)


@pytest.mark.parametrize(
    ("header", "columns", "degrees", "told"),
    [
        ("", None, True, "columns: a response's first column keeps its sign, its second one looks like a phase"),
        ("f,one,two\n", None, False, "columns: a response's first column keeps its sign"),
        ("f,mag,phase\n", None, False, "columns: 'phase': in degrees or radians"),
        ("f,mag (dB),phase (deg)\n", None, True, "decibels of what"),
        ("", "polar", True, "columns: expected one of real-imaginary, magnitude-degrees, magnitude-radians"),
    ],
)
def test_columns_that_may_be_magnitude_and_phase_are_refused(tmp_path, header, columns, degrees, told):
    polar(tmp_path, header, degrees)
    with pytest.raises(MeasurementError, match=told) as refused:
        read_frf(tmp_path / "polar.csv", columns=columns)
    assert str(refused.value).startswith(str(tmp_path / "polar.csv"))


def test_a_negative_magnitude_is_refused(tmp_path):
    (tmp_path / "polar.csv").write_text("1,-60,0\n2,-40,90\n3,-60,180\n")
    with pytest.raises(MeasurementError, match="a magnitude is negative; for decibels give unit"):
        read_frf(tmp_path / "polar.csv", columns="magnitude-degrees")
    with pytest.raises(MeasurementError, match="keeps its sign"):
        read_frf(tmp_path / "polar.csv")
    assert read_frf(tmp_path / "polar.csv", columns="real-imaginary").values[0, 0] == -60.0


#: one receptance of a mode at 150 Hz, as accelerance where a spelling says so
LINES = np.array([148.0, 149.5, 150.0, 150.5, 152.5])
SPELT = 1e-2 / (150.0**2 - LINES**2 + 3j * LINES)
ACCELERANCE = -((2 * np.pi * LINES) ** 2) * SPELT


def spelt(columns, header="", separator=",", mark=".", ends="\n", digits=12):
    """A file of columns: real ones are numbers, complex ones re+imi."""
    words = [
        [f"{v.real:.{digits}e}{v.imag:+.{digits}e}i" if np.iscomplexobj(c) else f"{v:.{digits}e}" for v in c]
        for c in columns
    ]
    rows = [separator.join(row).replace(".", mark) for row in zip(*words, strict=True)]
    return header + ends.join(rows) + ends


PARTS, POLAR = (LINES, SPELT.real, SPELT.imag), (LINES, np.abs(SPELT), np.angle(SPELT, deg=True))
DECIBELS = 20 * np.log10(np.abs(SPELT))
SPELLINGS = {
    "plain": (spelt(PARTS), {}),
    "semicolons, decimal commas": (spelt(PARTS, "Frequenz [Hz];Realteil [m/N];Imaginärteil [m/N]\n", ";", ","), {}),
    "tabs, lines of remarks, units below": (
        spelt((PARTS[0] / 1e3, *PARTS[1:]), "Test 7\nDate\tof\ttest\nFreq\tReal\tImag\nkHz\tm/N\tm/N\n", "\t"), {},
    ),
    "blanks, decimal commas": (spelt(PARTS, "Frequency (Hz) Real (m/N) Imag (m/N)\n", " ", ","), {}),
    "numpy": (spelt(PARTS, "# saved by numpy\n# f (Hz) real imag\n", " "), {}),
    "rad/s": (spelt((2 * np.pi * LINES, *PARTS[1:]), "omega (rad/s),re,im\n"), {}),
    "degrees": (spelt(POLAR, "Frequency (Hz),|H| (m/N),Phase (°)\n"), {}),
    "radians": (spelt((*POLAR[:2], np.angle(SPELT)), "f;Betrag / m/N;Phase / rad\n", ";"), {}),
    "decibels": (spelt((LINES, DECIBELS + 120, POLAR[2]), "f [Hz],Mag [dB re 1e-6 m/N],Phase [deg]\n"), {}),
    "decibels by the key": (
        spelt((LINES, DECIBELS, POLAR[2]), "f,mag (dB),phase (deg)\n"), {"unit": "dB re 1 m/N"},
    ),
    "complex, i": (spelt((LINES, SPELT), "f,H\n"), {}),
    "complex, decimal commas": (spelt((LINES, SPELT), "f;H [m/N]\n", ";", ","), {}),
    "complex, python": (spelt((LINES, SPELT), separator="\t").replace("i", "j)").replace("\t", "\t("), {}),
    "complex, blanks": (spelt((LINES, SPELT), "f H\n", " ").replace("i\n", " i\n"), {}),
    "j before the number": (re.sub(r"([-+])([^-+]*e...)i", r"\1j\2", spelt((LINES, SPELT), "f\tH\n", "\t")), {}),
    "g/N": (spelt((LINES, ACCELERANCE.real / 9.80665, ACCELERANCE.imag / 9.80665), "f,Re (g/N),Im (g/N)\n"), {}),
    "(m/s^2)/N": (spelt((LINES, ACCELERANCE), "f,H ((m/s^2)/N)\n"), {}),
    "mobility": (spelt((LINES, 2j * np.pi * LINES * SPELT * 1e3), "f,H [(mm/s)/N]\n"), {}),
    "µm/N": (spelt((LINES, SPELT.real * 1e6, SPELT.imag * 1e6), "f,Re [µm/N],Im [µm/N]\n"), {}),
    "exp(-iwt)": (spelt((LINES, SPELT.conj()), "f,H [m/N]\n"), {"conjugate": True}),
    "CRLF": (spelt(PARTS, "f,re,im\r\n", ends="\r\n"), {}),
    "separators at the ends": (spelt(PARTS, "f;re;im;\n", ";", ends=";\n"), {}),
}  # fmt: skip


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("name", SPELLINGS)
def test_spellings_of_one_response_are_the_same_numbers(tmp_path, name, encoding):
    text, options = SPELLINGS[name]
    (tmp_path / "frf.csv").write_bytes(text.encode(encoding))
    read = read_frf(tmp_path / "frf.csv", **options)
    assert read.frequencies_hz == pytest.approx(LINES, rel=1e-11)
    power = {"receptance": 0, "mobility": 1, "accelerance": 2}[read.quantity]
    assert read.values[0] / (2j * np.pi * LINES) ** power == pytest.approx(SPELT, rel=1e-10)
    assert power == 2 * (name in ("g/N", "(m/s^2)/N")) + (name == "mobility")
    assert read.source.startswith("frf.csv: ") and read.quantity in read.source


def test_directions_are_the_names_of_responses(tmp_path):
    scales = {"X": 1.0, "Y": -2.0, "Z": 0.5j}
    columns = [part(scale * SPELT) for part in (np.real, np.imag) for scale in scales.values()]
    for header, given in (
        ("f,X real,Y real,Z real,X imag,Y imag,Z imag\n", (LINES, *columns)),
        ("Frequency (Hz),X,Y,Z\n", (LINES, *(scale * SPELT for scale in scales.values()))),
    ):
        (tmp_path / "frf.csv").write_text(spelt(given, header))
        read = read_frf(tmp_path / "frf.csv")
        assert read.labels == ("X", "Y", "Z")
        assert read.values == pytest.approx(np.outer(list(scales.values()), SPELT), rel=1e-10)


@pytest.mark.parametrize(
    ("text", "options", "told"),
    [
        (spelt((LINES, SPELT.conj())), {}, r"looks like exp\(-iwt\): the phase rises .*; give conjugate = true"),
        (spelt((LINES, SPELT)), {"conjugate": True}, "the phase falls .*; give conjugate = false"),
        (spelt(PARTS, "omega,re,im\n"), {}, r"'omega': no unit; write one such as 'omega \[Hz\]'"),
        (spelt(PARTS, "f [cpx],re,im\n"), {}, "unknown unit 'cpx'"),
        (spelt(PARTS, "f,Re [EU/N],Im [EU/N]\n"), {}, "got EU/N, EU/N; expected one unit per force, such as g/N"),
        (spelt(PARTS, "f,Re [g],Im [g]\n"), {}, "got g; expected one unit per force"),
        (spelt(PARTS, "f,Re [g/N],Im [m/N]\n"), {}, "expected one unit per force"),
        (spelt(PARTS, "f,Re [g/N],Im [g/N]\n"), {"quantity": "mobility"}, "quantity: expected .* mobility; got .* g/N"),
        (spelt(PARTS, "f,Re [g/N],Im [g/N]\n"), {"unit": "m/N"}, "got g/N, unit = 'm/N'"),
        (spelt(PARTS, "f,re,im\n"), {"unit": "dB re 1 m/N"}, "real-imaginary has no decibels"),
        (spelt(PARTS, "f,re,im\n", ",", ","), {}, "line 1: 3 names for 6 columns of numbers below"),
        (spelt(PARTS, "f;re;im\n", ";").replace(".", ",", 4), {}, "lines .*: commas and points in numbers"),
        ("f,re,im\n1,2,3\n2,nan,4\n", {}, "line 3: re: expected a finite number"),
        ("f,re\n1,2\n2,4\n", {}, "no other part of 're'"),
    ],
)
def test_responses_of_two_readings_are_refused(tmp_path, text, options, told):
    (tmp_path / "frf.csv").write_text(text)
    with pytest.raises(MeasurementError, match=told) as refused:
        read_frf(tmp_path / "frf.csv", **options)
    assert str(refused.value).startswith(str(tmp_path / "frf.csv")) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("labels", "kind", "given", "factor"),
    [
        (("(1/N)*(m/s2)", "NONE"), 12, None, 1.0),
        (("(1/N)*(m/s2)", "N"), 0, None, 1.0),
        (("g", "N"), 12, None, 9.80665),
        (("EU", "N"), 12, "g/N", 9.80665),
        (("EU", "N"), 12, None, "unit '.*EU.*' of data type 12: expected displacement"),
        (("m", "N"), 12, None, "unit .* of data type 12"),
        (("NONE", "NONE"), 0, None, "unit 'missing' of data type 0"),
    ],
)
def test_units_of_universal_files(tmp_path, labels, kind, given, factor):
    pytest.importorskip("pyuff")
    per = {"ordinate_axis_units_lab": labels[0], "orddenom_axis_units_lab": labels[1], "binary": 1}
    sets = [curve_dataset("tip", LINES, ACCELERANCE, 4, 18, kind, 13, **per)]
    write_universal(sets, tmp_path / "frf.uff")
    if isinstance(factor, str):
        with pytest.raises(MeasurementError, match=factor):
            read_frf(tmp_path / "frf.uff", unit=given)
    else:
        read = read_frf(tmp_path / "frf.uff", unit=given)
        assert read.quantity == "accelerance" and read.values[0] == pytest.approx(factor * ACCELERANCE)
