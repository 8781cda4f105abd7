"""A law of motion stands once in the product: a second way to say it is a witness, in tests/reference."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
#: engines, whose kernels are compiled, and methods with steps in time, which are witnesses of them
OWN_LAWS = ("engine", "methods")
#: accelerations and their derivatives by numbers; the table that they read
SOLVED_FOR = {"system/flow.py", "derivatives/flow_derivative.py", "system/unit_laws.py"}


def _naming(*words: str) -> set[str]:
    """Return the files of the product, but engines and methods, that name some words."""
    folder = ROOT / "coupling"
    files = {path.relative_to(folder): path.read_text(encoding="utf-8") for path in folder.rglob("*.py")}
    return {
        path.as_posix()
        for path, text in files.items()
        if path.parts[0] not in OWN_LAWS and any(word in text for word in words)
    }


def test_forces_of_rows_at_rest_are_solved_for_in_one_place():
    assert _naming("wrenches(") == SOLVED_FOR


def test_accelerations_come_from_that_place_only():
    """Others ask a StateFlow: for derivatives, exponents, orbits, references without and with fixed bodies."""
    assert _naming(".oblique", ".carried") == {
        "system/flow.py",
        "derivatives/dynamics.py",
        "derivatives/flow_derivative.py",
    }
