"""CONTRIBUTING.md: its map has every folder, its paragraphs stand once, and a word has one meaning."""

import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
TEXT = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
MAP = TEXT.partition("## How the code is laid out\n")[2].partition("One picture of the parts")[0]


def folders():
    """The folders of the repository that hold files of it."""
    if shutil.which("git") is None:
        pytest.skip("needs git")
    done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip("no checkout")
    files = [Path(name) for name in done.stdout.rstrip("\0").split("\0")]
    found = {str(parent) for path in files for parent in path.parents} - {"."}
    found -= {folder for folder in found if folder.startswith("studies/kinds/")}  # one for every kind
    return found - {f"tests/{folder}" for folder in found}  # tests of a folder have its name


def test_the_map_has_every_folder():
    listed = re.findall(r"^    ([\w./]+)/  ", MAP, re.MULTILINE)
    assert len(listed) == len(set(listed))
    assert set(listed) == folders()


def test_files_of_the_map_are_there():
    entries = re.findall(r"^    ([\w./]+)/  ((?:.*\n(?:                   .*\n)*))", MAP, re.MULTILINE)
    named = [(folder, name) for folder, text in entries for name in re.findall(r"\b\w+\.py\b", text)]
    assert len(named) > 15
    for folder, name in named:
        assert (ROOT / folder / name).is_file() or any(ROOT.glob(f"*/{name}")), f"{folder}: {name}"


def test_no_line_stands_twice():
    lines = [line.strip() for line in TEXT.splitlines() if len(line.strip()) > 40]
    assert [line for line, times in Counter(lines).items() if times > 1] == []


def test_the_glossary_has_a_word_once():
    rows = re.findall(r"^\| (.+?) \| .+ \|$", TEXT.partition("## Words\n")[2].partition("\n## ")[0], re.MULTILINE)
    words = [word for row in rows[1:] for word in row.split(", ")]
    assert len(words) > 30 and len(words) == len(set(words))
