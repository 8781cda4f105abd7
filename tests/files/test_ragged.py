"""Parts of different lengths in one record: which variables there are, and that they are read as they were."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import pytest

from vanedamp.files.record import Array, NamedArrays, NumberUnit, Ragged, Record, RecordRows, joined


class Known(NamedTuple):
    unit: str
    dims: tuple[str, ...] = ()
    dtype: type = float


@dataclass(frozen=True)
class Mark:
    place: Annotated[float, NumberUnit("m")]
    note: str
    state: Annotated[np.ndarray, Array(("coordinate",))]


@dataclass(frozen=True, eq=False)
class Piece:
    kind: str
    count: int
    ends: Annotated[tuple[str, str], Array(("end",), dtype=object)]
    state: Annotated[np.ndarray, Array(("point", "coordinate"), "length")]
    growth: Annotated[np.ndarray, Array(("point",), dtype=complex)]
    known: Annotated[np.ndarray, Array(("point",), dtype=bool)]
    quantities: Annotated[
        Mapping[str, np.ndarray], NamedArrays(lambda: {"work": Known("J"), "share": Known("1", ("loss",))})
    ]
    marks: Annotated[tuple[Mark, ...], RecordRows("mark")]


@dataclass(frozen=True, eq=False, repr=False)
class Whole(Record):
    KIND: ClassVar[str] = "whole"
    pieces: Annotated[tuple[Piece, ...], Ragged("piece", "point", "x_")]
    others: Annotated[tuple[Piece, ...], Ragged("other", "point")] = ()

    def unit_in_file(self, declared):
        return {"length": "mm"}.get(declared, declared)


def piece(n, marks, **quantities):
    state, growth = np.arange(2.0 * n).reshape(n, 2), np.arange(n) + 1j
    some = tuple(Mark(0.5 * m, f"mark {m}", np.array([m, -1.0 * m])) for m in range(marks))
    return Piece(f"of {n}", n, ("a", "b"), state, growth, np.arange(n) > 0, quantities, some)


def same(one, other):
    assert (one.kind, one.count, one.ends, len(one.marks)) == (other.kind, other.count, other.ends, len(other.marks))
    for name in ("state", "growth", "known"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        assert getattr(one, name).dtype == getattr(other, name).dtype
    for mark, kept in zip(one.marks, other.marks, strict=True):
        assert (mark.place, mark.note) == (kept.place, kept.note)
        np.testing.assert_array_equal(mark.state, kept.state)


@pytest.mark.parametrize("marks", [(1, 0, 2), (0, 0, 0)])
def test_parts_are_read_as_they_were_written(marks, tmp_path):
    """One has no rows, as the last one may have, and none may have any marks."""
    parts = tuple(piece(n, m, work=np.ones(n), share=np.ones((n, 3))) for n, m in zip((3, 0, 2), marks, strict=True))
    Whole(parts, (piece(2, 1), piece(0, 0))).save(tmp_path / "whole.h5")
    read = Whole.load(tmp_path / "whole.h5")
    for one, other in zip((*parts, *read.others), (*read.pieces, piece(2, 1), piece(0, 0)), strict=True):
        same(one, other)
    assert [each.quantities["share"].shape for each in read.pieces] == [(3, 3), (0, 3), (2, 3)]
    variables = Whole(parts).variables()
    assert "other_of_point" not in variables and "other" not in str([one.dims for one in variables.values()])
    assert variables["x_state"].dims == ("x_point", "coordinate") and variables["x_state"].units == "mm"
    assert variables["piece_of_point"].values.tolist() == [0, 0, 0, 2, 2]
    assert variables["x_mark_piece"].values.tolist() == [0] * marks[0] + [2] * marks[2]
    assert variables["x_mark_place"].units == "m" and variables["x_mark_state"].dims == ("x_mark", "coordinate")
    assert variables["x_ends"].dims == ("piece", "end") and variables["x_work"].units == "J"


def test_arrays_that_some_parts_lack_are_unknown_there():
    found = joined([{"a": np.ones(2)}, {"b": np.array([["x"]], object)}], [2, 1])
    np.testing.assert_array_equal(found["a"], [1.0, 1.0, np.nan])
    assert found["b"].tolist() == [[""], [""], ["x"]]
