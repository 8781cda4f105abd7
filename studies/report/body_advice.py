"""What the report says about the shape of the bodies: the advice of a run or a sweep, or how to come by it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

_SLIDERS = (
    'The bodies are sliders, which only move along their cavities. Of bodies with corners, shape = "auto" with their '
    "length and height tells whether that is enough."
)


def body_note(notes: Mapping[str, Any], sliders: bool) -> str | None:
    """Return a sentence on the bodies. notes: with the advice, as data or as text; sliders: whether bodies are such."""
    advice = notes.get("advice")
    if advice is None:
        return _SLIDERS if sliders else None
    sentence: str = (json.loads(advice) if isinstance(advice, str) else advice)["sentence"]
    return f"Bodies run as {sentence}."


def body_note_of_run(measures: Mapping[str, Any]) -> str | None:
    """Return the sentence on the bodies of a run with these figures."""
    return body_note(measures, "attached_mass_fraction" in measures and "tilt_max" not in measures)
