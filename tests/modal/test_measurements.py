"""Shapes and frequency responses survive the way to a file and back."""

import numpy as np
import pytest

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
        ("", "expected the header x,y,z"),
        ("x,y,z,dx,dy,dz,1\n0,0,0,0,0\n", "line 2 has 5 columns"),
        ("x,y,z,dx,dy,dz,1\n0,0,0,0,0,a,1\n", "line 2: expected numbers"),
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
        ("f,re,im\n1,2,3\n2,x,4\n", "expected rows of numbers"),
        ("2,2,3\n1,1,4\n", "frequencies_hz: expected at least two, ascending"),
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
    with pytest.raises(MeasurementError, match="line 6 has 5 columns, the header has 7"):
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
        ("f,mag (dB),phase (deg)\n", None, True, "expected linear magnitudes, not decibels"),
        ("", "polar", True, "columns: expected one of real-imaginary, magnitude-degrees, magnitude-radians"),
    ],
)
def test_columns_that_may_be_magnitude_and_phase_are_refused(tmp_path, header, columns, degrees, told):
    polar(tmp_path, header, degrees)
    with pytest.raises(MeasurementError, match=told) as refused:
        read_frf(tmp_path / "polar.csv", columns=columns)
    assert str(refused.value).startswith(str(tmp_path / "polar.csv"))


def test_a_negative_magnitude_is_refused(tmp_path):
    (tmp_path / "polar.csv").write_text("1,-60,0\n2,-40,-90\n3,-60,-180\n")
    with pytest.raises(MeasurementError, match="a magnitude is negative; expected linear magnitudes, not decibels"):
        read_frf(tmp_path / "polar.csv", columns="magnitude-degrees")
    with pytest.raises(MeasurementError, match="keeps its sign"):
        read_frf(tmp_path / "polar.csv")
    assert read_frf(tmp_path / "polar.csv", columns="real-imaginary").values[0, 0] == -60.0
