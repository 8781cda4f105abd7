"""Tolerances of the engines stand in tables, each with a comment that tells what it is relative to."""

import ast
from pathlib import Path

import pytest

import vanedamp.coupling

COUPLING = Path(vanedamp.coupling.__file__).parent
LAYERS = ("engine/line", "engine/plane", "numerics")
USERS = (*LAYERS, "engine")
#: smaller numbers keep doubles from underflow
UNDERFLOW = 1e-100
#: coefficients of polynomials; a restart, whose overlap is no tolerance of the engine
OTHERS = {"exponentials.py", "restart.py"}


def sources(layer):
    """The modules of a layer but its table."""
    files = [path for path in (COUPLING / layer).glob("*.py") if path.name != "tolerances.py"]
    return {path: path.read_text(encoding="utf-8") for path in files}


@pytest.mark.parametrize("layer", LAYERS)
def test_no_tolerance_stands_outside_its_table(layer):
    found = [
        f"{path.name}:{node.lineno} {node.value}"
        for path, text in sources(layer).items()
        if path.name not in OTHERS
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Constant) and isinstance(node.value, float) and UNDERFLOW < abs(node.value) < 1e-5
    ]
    assert not found


@pytest.mark.parametrize("layer", LAYERS)
def test_every_tolerance_has_a_reason_and_is_used(layer):
    text = (COUPLING / layer / "tolerances.py").read_text(encoding="utf-8")
    lines = text.splitlines()
    users = "".join("".join(sources(other).values()) for other in USERS)
    constants = [node for node in ast.parse(text).body if isinstance(node, ast.Assign)]
    assert constants
    for node in constants:
        assert lines[node.lineno - 2].startswith("#: "), lines[node.lineno - 1]
        names = [name.id for name in ast.walk(node) if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)]
        for name in names:
            assert name in users, f"nobody uses {name}"
