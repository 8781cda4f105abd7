"""The pages on rings: numbers of the example, output of the command, the program."""

import re
import shutil

import numpy as np
import pytest

from tests.docs.test_examples import DOCS, program, run
from tests.tools.processes import ROOT
from vanedamp.studies.cli import main

PAGE = (DOCS / "nodal_diameters.md").read_text(encoding="utf-8")
SECTORS, MASS, STIFFNESS = 8, 0.1, 1e5


def row(title):
    """The numbers of a row of the page's tables."""
    (line,) = re.findall(rf"^\| {re.escape(title)} \| (.*) \|$", PAGE, re.MULTILINE)
    return line.split(" | ")


def chain(coupling, deviations=0.0):
    """Matrix of the example, over the mass."""
    turn = np.roll(np.eye(SECTORS), 1, axis=0)
    own = (STIFFNESS * (1.0 + deviations) + 2 * coupling) * np.eye(SECTORS)
    return (own - coupling * (turn + turn.T)) / MASS


def test_frequencies_and_orders_of_the_example(capsys):
    full = np.sqrt(np.linalg.eigvalsh(chain(2e4))) / (2 * np.pi)
    expected = [float(value) for value in row("frequency, Hz")]
    assert full == pytest.approx(np.repeat(expected, [1, 2, 2, 2, 1]), abs=6e-4)
    exec(program("nodal_diameters.md", "aliased"), {})
    aliased = [int(diameter) for diameter in capsys.readouterr().out.split()]
    for diameter, orders in enumerate(row("engine orders up to 16")):
        assert [int(order) for order in orders.split(", ")] == [r for r in range(1, 17) if aliased[r - 1] == diameter]
    for order in (3, 5, 11):
        assert f"{60 * full[5] / order:.2f}" in PAGE
    for order in (2, 4):
        assert f"order {order} has {order * full[5] / 3:.1f} Hz" in PAGE


def test_amplification_of_the_example():
    wave = np.exp(-2j * np.pi * 3 * np.arange(SECTORS) / SECTORS)
    low = np.sqrt(STIFFNESS / MASS)
    for index, coupling in enumerate(float(value) for value in row("coupling kc, N/m")):
        omega = np.linspace(0.98 * low, 1.02 * np.sqrt((STIFFNESS + 4 * coupling) / MASS), 4001)[:, None]

        def top(deviations, coupling=coupling, omega=omega):
            squares, shapes = np.linalg.eigh(chain(coupling, deviations))
            modal = (shapes.T @ wave) / (squares - omega**2 + 2e-3j * omega * np.sqrt(squares))
            return np.abs(modal @ shapes.T).max()

        tuned = top(np.zeros(SECTORS))
        factors = [top(0.02 * np.random.default_rng(seed).standard_normal(SECTORS)) / tuned for seed in range(100)]
        assert float(row("median amplification")[index]) == pytest.approx(np.median(factors), abs=6e-3)
        assert float(row("largest of 100")[index]) == pytest.approx(max(factors), abs=6e-3)
        assert max(factors) < (1 + np.sqrt(SECTORS)) / 2


def test_page_shows_what_the_command_prints(capsys):
    assert main(["ring", str(ROOT / "docs" / "examples" / "ring.toml")]) == 0
    printed = capsys.readouterr().out.splitlines()
    page = (DOCS / "howto" / "ring.md").read_text(encoding="utf-8")
    block = page.partition("    natural frequencies in Hz")[2].partition("- **Give")[0]
    shown = ("    natural frequencies in Hz" + block).rstrip().splitlines()
    assert len(shown) == 10
    assert {line[4:] for line in shown} - {"..."} <= set(printed)


@pytest.mark.slow
def test_program_of_the_page(tmp_path):
    (tmp_path / "docs" / "examples").mkdir(parents=True)
    shutil.copy(ROOT / "docs" / "examples" / "ring.toml", tmp_path / "docs" / "examples")
    printed = run(program("ring.md", "Interference"), tmp_path)
    assert "diameter 2, family 3 22.0" in printed
