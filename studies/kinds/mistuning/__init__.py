"""Amplification of a mistuned ring."""

from __future__ import annotations

from collections.abc import Iterator

from vanedamp.rom.ring.study import MistuningStudy
from vanedamp.studies.facts import Fact, Found

NAME = "mistuning"
ABOUT = "amplification of a mistuned ring"
COMMANDS = ("ring",)
RECORD = "vanedamp.MistuningStudy"


def facts(record: Found) -> Iterator[Fact]:
    """Yield its main results."""
    study = MistuningStudy.load(record.path).to_json()
    yield Fact("draws", study["seeds"])
    for row in study["orders"]:
        top, median = row["amplification"]["largest"], row["quantiles"][0]["value"]
        yield Fact(f"order {row['order']}", f"amplification up to {top:.4g}, median {median:.4g}")
