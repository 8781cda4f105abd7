"""Units as headers of measured columns write them: products and powers of symbols, or decibels of such a unit."""

from __future__ import annotations

import ast
import math
import re
from functools import cache
from typing import NamedTuple

_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6}
_PREFIXED = ("m", "N", "s", "g", "Hz", "rad")
#: symbols in SI, with the powers of kg, m, s and cycles: an angle is a number of cycles, so that rad/s is a frequency
_SYMBOLS: dict[str, tuple[float, tuple[int, ...]]] = {
    "kg": (1.0, (1, 0, 0, 0)), "m": (1.0, (0, 1, 0, 0)), "inch": (0.0254, (0, 1, 0, 0)), "ft": (0.3048, (0, 1, 0, 0)),
    "s": (1.0, (0, 0, 1, 0)), "min": (60.0, (0, 0, 1, 0)), "N": (1.0, (1, 1, -2, 0)),
    "lbf": (4.4482216152605, (1, 1, -2, 0)), "g": (9.80665, (0, 1, -2, 0)), "Hz": (1.0, (0, 0, -1, 1)),
    "rpm": (1 / 60, (0, 0, -1, 1)), "rad": (0.5 / math.pi, (0, 0, 0, 1)), "deg": (1 / 360, (0, 0, 0, 1)),
}  # fmt: skip
_SAME = {
    "hz": "Hz", "khz": "kHz", "sec": "s", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad",
    "cpm": "rpm",
}  # fmt: skip
_RAISED = str.maketrans("⁻⁰¹²³⁴", "-01234")
_DECIBELS = re.compile(r"[(\[]?\s*db\b[\s,]*(?:\(?\s*re(?:f\b|l\b)?\.?:?\s*(?P<of>.+?))?\s*[)\]]?", re.I)
_LEVEL = re.compile(r"(?P<size>\d[\d.]*(?:[eE][-+]?\d+)?)?\s*(?P<unit>.+)")
#: quantities of measured columns, by the powers of their units
QUANTITIES: dict[tuple[int, ...], str] = {
    (0, 0, -1, 1): "frequency", (0, 0, 1, 0): "time", (0, 0, 0, 1): "phase", (0, 1, 0, 0): "displacement",
    (0, 1, -1, 0): "velocity", (0, 1, -2, 0): "acceleration", (1, 1, -2, 0): "force", (-1, 0, 2, 0): "receptance",
    (-1, 0, 1, 0): "mobility", (-1, 0, 0, 0): "accelerance",
}  # fmt: skip


class LabUnit(NamedTuple):
    """A unit; quantity: one of QUANTITIES, "" for decibels without a reference; factor: in SI, of a phase in rad, of
    decibels the factor of their reference."""

    text: str
    quantity: str
    factor: float
    decibels: bool = False


@cache
def unit(text: str) -> LabUnit | None:
    """Return the unit that a text is; None for none of QUANTITIES."""
    text = text.strip()
    if level := _DECIBELS.fullmatch(text):
        if level["of"] is None:
            return LabUnit(text, "", 1.0, True)
        size = _LEVEL.fullmatch(level["of"])
        base = unit(size["unit"]) if size else None
        return base and base._replace(text=text, factor=float(size["size"] or 1.0) * base.factor, decibels=True)  # type: ignore[index]
    plain = text.translate(_RAISED).replace("µ", "u").replace("μ", "u").replace("°", "deg")
    plain = re.sub(r"[·×]", "*", plain).replace("^", "**")
    plain = re.sub(r"(?<=[A-Za-z])(?=-?\d)", "**", plain)
    plain = re.sub(r"\s*([*/()])\s*", r"\1", re.sub(r"\bin\b", "inch", plain)).replace(" ", "*")
    try:
        factor, powers = _product(ast.parse(plain, mode="eval").body)
    except (SyntaxError, ValueError, KeyError, RecursionError, MemoryError):
        return None
    quantity = QUANTITIES.get(powers)
    return quantity and LabUnit(text, quantity, factor * (2 * math.pi if quantity == "phase" else 1.0))  # type: ignore


def _product(node: ast.expr) -> tuple[float, tuple[int, ...]]:
    """Return factor and powers of an expression. Raises ValueError or KeyError for one that is no unit."""
    match node:
        case ast.Name(name):
            name = _SAME.get(name, _SAME.get(name.lower(), name))
            if name not in _SYMBOLS and name[1:] in _PREFIXED:
                factor, powers = _SYMBOLS[name[1:]]
                return _PREFIXES[name[0]] * factor, powers
            return _SYMBOLS[name]
        case ast.Constant(1):
            return 1.0, (0, 0, 0, 0)
        case ast.BinOp(left, ast.Mult() | ast.Div() as by, right):
            (first, ours), (second, theirs) = _product(left), _product(right)
            sign = 1 if isinstance(by, ast.Mult) else -1
            return first * second**sign, tuple(a + sign * b for a, b in zip(ours, theirs, strict=True))
        case ast.BinOp(left, ast.Pow(), ast.Constant(int(power)) | ast.UnaryOp(ast.USub(), ast.Constant(int(power)))):
            if power > 4:
                raise ValueError(power)
            power = -power if isinstance(node.right, ast.UnaryOp) else power
            factor, powers = _product(left)
            return factor**power, tuple(power * a for a in powers)
    raise ValueError(node)
