"""Layouts of fields: the variables and attributes that each has in files, and that they are read as they were."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import pytest
from scipy.sparse import csr_array

import vanedamp as vd
from vanedamp.files.record import Array, Named, NumberUnit, Paths, Record, RecordRows, SparseMatrix, Within, empty
from vanedamp.files.store import StoreError, load, load_any, save
from vanedamp.rom.ring.identification import Identified

DENSE = np.array([[2.0, 0.0, 1.0], [0.0, 0.0, 0.0], [4.0, 3.0, 0.0]])


@dataclass(frozen=True)
class Hit:
    time: Annotated[float, NumberUnit("s")]
    side: str = ""
    loss: Annotated[float, NumberUnit("J")] = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class Inner(Record):
    height: Annotated[np.ndarray, Array(("time",), "m")]
    closed: Annotated[np.ndarray, Array(("time",), dtype=bool)]
    bodies: int


@dataclass(frozen=True, eq=False, repr=False)
class Outer(Record):
    KIND: ClassVar[str] = "outer"
    IN_JSON = ("inner", "axes", "speed", "hits")
    matrix: Annotated[Any, SparseMatrix("kg")]
    axes: Annotated[
        Mapping[str, np.ndarray], Paths(lambda path: path.replace(".", "_"), lambda path: f"unit of {path}")
    ]
    drawn: Annotated[Mapping[str, np.ndarray], Paths(str.upper, lambda _: "m", "sample", "number")]
    inner: Annotated[Inner | None, Within(("height", "bodies"))] = None
    hits: Annotated[tuple[Hit, ...], RecordRows("hit")] = ()
    speed: Annotated[float | None, Named("at_speed")] = None
    ends: Annotated[tuple[float, float] | None, Array(("end",), attribute=True)] = None
    response: Annotated[np.ndarray, Array(("line", "body"), "of its quantity")] = field(default_factory=empty)

    def labels(self):
        return {"number": list(self.drawn), "line": np.arange(2)}

    def unit_in_file(self, declared):
        return "m/N" if declared == "of its quantity" else declared


INNER = Inner([1.0, 2.0], [True, False], 3)
WHOLE = Outer(
    csr_array(DENSE), {"a.b": np.array([1, 2]), "c": np.array(["x"], object)}, {"n": np.array([0.5, 1.5])}, INNER,
    (Hit(1.0), Hit(2.0, "left", 0.1)), 7.0, (1.0, 2.0), [[1.0, 2.0], [3.0, 4.0]],
)  # fmt: skip


def test_files_have_what_the_layouts_say():
    found = {name: (tuple(one.dims), one.units) for name, one in WHOLE.variables().items()}
    assert found == {
        "matrix": (("matrix_entry",), "kg"), "matrix_column": (("matrix_entry",), "1"),
        "matrix_row_start": (("row_edge",), "1"), "a_b": (("a_b",), "unit of a.b"), "c": (("c",), "unit of c"),
        "sample_N": (("sample",), "m"), "height": (("time",), "m"), "closed": (("time",), "1"),
        "hit_time": (("hit",), "s"), "hit_side": (("hit",), "1"), "hit_loss": (("hit",), "J"),
        "response": (("line", "body"), "m/N"), "number": (("number",), "1"), "line": (("line",), "1"),
    }  # fmt: skip
    assert WHOLE.attributes() == {"axes": ["a.b", "c"], "bodies": 3, "at_speed": 7.0, "ends": [1.0, 2.0]}
    assert WHOLE.to_json() == {
        "height": [1.0, 2.0], "bodies": 3, "axes": {"a.b": [1, 2], "c": ["x"]}, "at_speed": 7.0,
        "hits": [{"time": 1.0, "side": "", "loss": 0.0}, {"time": 2.0, "side": "left", "loss": 0.1}],
    }  # fmt: skip


def test_all_is_read_as_it_was(tmp_path):
    WHOLE.save(tmp_path / "whole.h5")
    read = Outer.load(tmp_path / "whole.h5")
    np.testing.assert_array_equal(read.matrix.toarray(), DENSE)
    assert [*read.axes] == ["a.b", "c"] and read.axes["a.b"].dtype.kind == "i" and read.axes["c"][0] == "x"
    assert read.drawn["n"].tolist() == [0.5, 1.5] and read.hits == WHOLE.hits
    assert (read.speed, read.ends, read.inner.bodies) == (7.0, (1.0, 2.0), 3)
    assert read.inner.closed.tolist() == [True, False] and read.inner.closed.dtype == bool


def test_what_is_not_there_is_not_written(tmp_path):
    bare = replace(WHOLE, inner=None, hits=(Hit(1.0), Hit(2.0)), speed=None, ends=None, response=np.zeros((0, 2)))
    assert bare.variables().keys() & {"height", "closed", "hit_side", "hit_loss", "response"} == set()
    assert bare.attributes().keys() == {"axes"}
    bare.save(tmp_path / "bare.h5")
    read = Outer.load(tmp_path / "bare.h5")
    assert (read.inner, read.speed, read.ends, read.hits, read.response.size) == (None, None, None, bare.hits, 0)
    replace(bare, hits=()).save(tmp_path / "none.h5")
    assert Outer.load(tmp_path / "none.h5").hits == ()


def test_matrices_are_read_back_with_their_patches(tmp_path):
    given = vd.SystemMatrices(
        np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), np.eye(6), np.zeros((2, 3)), [5, 3],
        {"one": vd.Patch([1], [2.0], [0.0, 0.0, 1.0]), "all": vd.Patch([0, 1], [1.0, 1.0])}, 0.01, {"mesh": "made"},
    )  # fmt: skip
    given.save(tmp_path / "matrices.h5")
    read = vd.SystemMatrices.load(tmp_path / "matrices.h5")
    np.testing.assert_array_equal(read.stiffness.toarray(), np.diag(np.arange(1.0, 7.0)))
    assert read.fixed.tolist() == [3, 5] and read.vertices is None and read.provenance == {"mesh": "made"}
    assert {name: (p.nodes.tolist(), p.weights.tolist(), p.normal.tolist()) for name, p in read.patches.items()} == {
        "one": ([1], [2.0], [0.0, 0.0, 1.0]), "all": ([0, 1], [1.0, 1.0], [0.0, 0.0, 0.0]),
    }  # fmt: skip
    assert read.to_json() == {"coordinates": [[0.0] * 3] * 2, "fixed": [3, 5], "damping_ratio": 0.01}
    values, attributes = load(tmp_path / "matrices.h5", "system-matrices")
    del values["patch_offset"]
    with pytest.raises(StoreError, match="patch_offset"):
        vd.SystemMatrices.of(values, attributes)


def test_numbers_along_a_dimension_keep_their_type():
    assert Identified(np.zeros(3), np.zeros(3), 0.0).variables()["sector"].values.dtype == np.int64


def test_events_of_earlier_files_have_an_unknown_loss(tmp_path):
    """Of bodies in the plane, files had corners before they had losses; those of sliders have neither."""
    run = vd.Response.load(Path(__file__).parent / "written" / "response.h5")
    events = run.event_list
    assert len(events) == 20 and {(event.corner, event.loss) for event in events} == {(-1, 0.0)}
    replace(run, event_list=[replace(event, corner=2) for event in events]).save(tmp_path / "run.h5")
    kind, variables, attributes = load_any(tmp_path / "run.h5")
    assert variables.keys() >= {"event_corner", "event_tangential_impulse", "event_loss"}
    assert vd.Response.load(tmp_path / "run.h5").event_list == tuple(replace(event, corner=2) for event in events)
    del variables["event_loss"]
    save(tmp_path / "earlier.h5", kind, variables, attributes)
    earlier = vd.Response.load(tmp_path / "earlier.h5").event_list
    assert np.isnan([event.loss for event in earlier]).all() and {event.corner for event in earlier} == {2}
