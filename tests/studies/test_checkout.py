"""The commands `bench` and `paper`: their work lies in a checkout, not in the installed package."""

import subprocess
import sys
from pathlib import Path

import pytest

from vanedamp.studies import checkout
from vanedamp.studies.cli import BAD_INPUT, main

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.parametrize(("command", "package"), [("bench", "benchmarks"), ("paper", "paper")])
def test_without_a_checkout_one_line_says_where_they_are(command, package, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(checkout, "_ROOT", tmp_path)
    for arguments in (["--help"], ["-o", str(tmp_path / "out")]):
        assert main([command, *arguments]) == BAD_INPUT
        assert capsys.readouterr().err == (
            f"vanedamp: this command needs the folder {package}/ of the project's repository, which is not installed "
            "with the package; run it in a checkout (there: pip install -e .)\n"
        )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["bench", "paper"])
def test_in_a_checkout_they_run_from_anywhere(command, tmp_path):
    """Beside a package of the same name, as other projects leave theirs among the installed ones."""
    for package in ("benchmarks", "paper"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").write_text("raise RuntimeError('another package')\n")
    code = f"import sys; sys.path.append({str(ROOT)!r}); from vanedamp.studies.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, command, "--help"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert f"vanedamp {command} [-h]" in done.stdout


@pytest.mark.parametrize(("command", "folder"), [(["bench", "limits", "--quick"], "benchmarks"), (["paper"], "paper")])
def test_results_do_not_go_among_the_sources(command, folder, monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    assert main([*command, "-o", folder]) == BAD_INPUT
    assert capsys.readouterr().err == (
        f"vanedamp: --output {folder}: holds the source of this command; name another folder\n"
    )


def test_help_lists_them_without_a_checkout(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(checkout, "_ROOT", tmp_path)
    with pytest.raises(SystemExit) as stopped:
        main(["--help"])
    assert stopped.value.code == 0
    printed = capsys.readouterr().out
    assert "the paper's figures as studies" in printed and "how fast and how exact" in printed
