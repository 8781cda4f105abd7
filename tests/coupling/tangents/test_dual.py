"""Numbers with derivatives, against differences of what plain numpy makes of moved ones."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import pytest

from vanedamp.coupling.tangents import dual
from vanedamp.coupling.tangents.differences import NotSmooth
from vanedamp.coupling.tangents.dual import Dual, array, inverse, numbers, rect, solve, zeros
from vanedamp.coupling.tangents.opaque import opaque

RNG = np.random.default_rng(5)
A, DA = RNG.normal(size=(2, 3, 3))
B, DB = RNG.normal(size=(2, 3))
C = RNG.normal(size=3) + 1j * RNG.normal(size=3)
STEP = 1e-6

FORMULAS = {
    "matrix by vector": lambda a, b: a @ b, "vector by matrix": lambda a, b: b @ a,
    "scalar product": lambda a, b: b @ b,
    "matrices": lambda a, b: a @ a.T, "transposed": lambda a, b: a.T @ b, "columns": lambda a, b: a * b[:, None],
    "inverse": lambda a, b: inverse(a), "solution": lambda a, b: solve(a, b),
    "complex size": lambda a, b: abs(C @ solve(a + 1j * np.eye(3), b)), "outer": lambda a, b: np.outer(b, b),
    "diagonal": lambda a, b: np.diag(b), "norm": lambda a, b: np.linalg.norm(b),
    "cross": lambda a, b: np.cross(b, A[0]),
    "stacked": lambda a, b: np.vstack([a, b]), "joined": lambda a, b: np.concatenate([b, b]),
    "sum": lambda a, b: a.sum(axis=0),
    "beside": lambda a, b: np.hstack([a, a]), "chosen": lambda a, b: np.where(B > 0.0, b, 0.0),
}  # fmt: skip


@pytest.mark.parametrize("name", FORMULAS)
def test_formulas(name):
    formula = FORMULAS[name]
    found = formula(Dual(A, DA[..., None]), Dual(B, DB[..., None]))
    up, down = (formula(A + step * DA, B + step * DB) for step in (STEP, -STEP))
    assert found.value == pytest.approx(formula(A, B), rel=1e-13)
    assert found.turns[..., 0] == pytest.approx((up - down) / (2 * STEP), rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("name", ["sin", "cos", "sqrt", "radians"])
def test_functions_of_one_number(name):
    function = getattr(dual, name)
    found, own = function(Dual(0.7, [2.0])), getattr(math, name)
    assert (found.value, function(0.7)) == (own(0.7), own(0.7))
    assert found.turns[0] == pytest.approx(2.0 * (own(0.7 + STEP) - own(0.7 - STEP)) / (2 * STEP), rel=1e-8)


def test_a_phasor():
    found = rect(Dual(2.0, [1.0, 0.0]), Dual(0.3, [0.0, 1.0]))
    assert found.turns == pytest.approx(np.exp(0.3j) * np.array([1.0, 2.0j]), rel=1e-14)


def test_arrays_have_derivatives_where_they_are_wanted():
    assert isinstance(zeros(2), np.ndarray)
    with numbers(1):
        made = array([[1.0, Dual(2.0, [3.0])], [4.0, 5.0]])
        made[1] += Dual(1.0, [7.0])
        assert made.value.tolist() == [[1.0, 2.0], [5.0, 6.0]]
        assert made.turns[..., 0].tolist() == [[0.0, 3.0], [7.0, 7.0]]
    with pytest.raises(TypeError, match="no plain numbers"):
        np.zeros(2)[:] = Dual([1.0, 2.0], np.ones((2, 1)))
    with pytest.raises(TypeError):
        math.sin(Dual(1.0, [1.0]))


def test_a_decision_between_what_turns_apart_is_a_kink():
    one = Dual(0.0, [1.0])
    assert max(one, 0.0) is one
    with numbers(1):
        with pytest.raises(NotSmooth):
            max(one, 0.0)
        with pytest.raises(NotSmooth):
            bool(one)
        assert max(one, one) is one


class _Pair(NamedTuple):
    first: float
    rest: tuple[float, str]


def test_functions_of_plain_numbers_have_differences():
    def function(pair: _Pair, scale: float) -> dict[str, object]:
        return {"a": math.exp(pair.first) * scale, "b": (np.array([pair.rest[0] ** 2, math.inf]), pair.rest[1])}

    with numbers(2):
        found = opaque(function, _Pair(Dual(0.5, [1.0, 0.0]), (Dual(3.0, [0.0, 2.0]), "kept")), 2.0)
    assert found["a"].turns == pytest.approx([2.0 * math.exp(0.5), 0.0], rel=1e-12)
    (squares, word) = found["b"]
    assert squares.turns[0] == pytest.approx([0.0, 12.0], rel=1e-12)
    assert squares.value.tolist() == [9.0, math.inf]
    assert word == "kept"


def test_what_a_function_returns_as_it_was_given_keeps_its_derivatives():
    calls = []

    def function(pair: _Pair) -> _Pair:
        calls.append(pair)
        return pair

    given = _Pair(Dual(0.5, [1.0, 0.0]), (3.0, "kept"))
    with numbers(2):
        assert opaque(function, given) is given
    assert len(calls) == 1 and calls[0].first == 0.5
