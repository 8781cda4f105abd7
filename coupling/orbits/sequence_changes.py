"""Changes of the event sequence along a branch: where they will be, and of what kind they are."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence

from vanedamp.coupling.orbits.passage import Passage, PassageStatus


def forecast(seen: Sequence[tuple[float, Passage]]) -> float | None:
    """Return the arclength at which the sequence of the last two passages of a branch will end, None if unknown.

    seen: arclengths, rising, and passages of one sequence. Quantities that vanish there are continued as straight
    lines: the speeds of crossings, the clearances of events that do not happen, the times between events.
    """
    if len(seen) < 2:
        return None
    (early, one), (late, two) = seen[-2:]
    before, after = _vanishing(one), _vanishing(two)
    found = [
        late + (late - early) * after[name] / (before[name] - after[name])
        for name in before.keys() & after.keys()
        if 0.0 <= after[name] < before[name]
    ]
    return min(found, default=None)


def _vanishing(passage: Passage) -> dict[str, float]:
    """Return the quantities of a passage that are positive and vanish where its sequence ends, by name."""
    crossings = passage.crossings
    found = {f"speed {place}": abs(crossing.speed) for place, crossing in enumerate(crossings)}
    for place, (one, other) in enumerate(itertools.pairwise(crossings)):
        found[f"order {place}"] = other.time - one.time
    if crossings:
        found["start"] = crossings[0].time
    share, name = passage.clearance
    if name:
        found[f"clearance {name}"] = share
    return found


def change(before: Passage, after: Passage | None) -> tuple[str, str]:
    """Return the kind of a special point where the sequence changes, and what happens there.

    "grazing" where an impact begins or ceases, "sequence" for any other change; after: None if that is not known.
    """
    if after is None:
        near = before.clearance[1]
        slow = min(before.crossings, key=lambda crossing: abs(crossing.speed), default=None)
        grazing = before.status is PassageStatus.GRAZING or "impact" in near
        name = near or ("" if slow is None else slow.name)
        return ("grazing" if grazing else "sequence"), f"the sequence of events ends, at {name or 'an unknown event'}"
    lost, new = Counter(before.sequence) - Counter(after.sequence), Counter(after.sequence) - Counter(before.sequence)
    words = [f"{name} begins" for name in new] + [f"{name} ceases" for name in lost]
    kind = "grazing" if any("impact" in name for name in (*lost, *new)) else "sequence"
    return kind, ", ".join(words) or "events change their order"
