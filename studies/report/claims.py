"""The claims of a study, in a file next to the results that support them."""

from __future__ import annotations

from dataclasses import dataclass, field

#: ending of the file
CLAIMS = ".claims.json"


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, our results, and a verdict: "shown", "partly" or "not shown"."""

    claim: str
    ours: str
    verdict: str
    why: str = ""
    figures: dict[str, float | str | bool | None] = field(default_factory=dict)


@dataclass(frozen=True)
class ClaimStudy:
    """A study of several results; sources: names of their files, in its own folder; not_ok: which points are not ok."""

    study: str
    title: str
    sources: list[str]
    claims: list[Claim]
    not_ok: str = ""
