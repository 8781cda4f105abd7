"""Where the scenes of the paper's figures are: here, but for those that the demonstration shows as well."""

from __future__ import annotations

from pathlib import Path

from vanedamp.studies.demo import figure_file

FOLDER = Path(__file__).with_name("scenes")


def scene_file(name: str) -> Path:
    """Return the file of a figure's scenes."""
    mine = FOLDER / f"{name}.toml"
    return mine if mine.is_file() else figure_file.FOLDER / mine.name
