"""Which bodies do not move relative to their cavities over a window without impacts and friction loss."""

from __future__ import annotations

from vanedamp.coupling.numerics.compiler.jit import strict

#: gap to a wall, over the free travel, below which a body rests on it; changes of slips and speeds relative to their
#: scales that count as zero
_CLOSED, _STILL = 1e-3, 1e-6


@strict
def at_rest(measured, section, first, done):
    """Return whether all bodies are at rest in their cavities at the sections from first to done.

    The window has no impacts, and friction took no energy. A body that friction holds is at rest then: it would lose
    energy if it slid; a disc, though, rolls. Others must stay at all sections, and a reason to stay: a
    wall or a body at rest on which they lie, or a floor that does not move along the cavity. A section does not
    suffice: at a resonance the motion turns round at the start of every period.
    """
    b, held, load = len(measured.along), measured.held, measured.load
    for body in range(b):
        loaded = False
        for h in range(len(load)):
            loaded = loaded or load[h, measured.along[body]] != 0.0
        held[body] = (measured.holds[body] > 0.0 and not measured.rolls[body]) or (
            _keeps_place(measured, section, first, done, body) and measured.fixed[body] and not loaded
        )
    for _ in range(b):  # from the walls inwards
        for unit in range(len(measured.lies)):
            one, other = measured.body[unit], measured.other[unit]
            if not measured.lies[unit] or not _closed(measured, section, first, done, unit):
                continue
            if one >= 0 and (other < 0 or held[other]) and _keeps_place(measured, section, first, done, one):
                held[one] = True
            if other >= 0 and (one < 0 or held[one]) and _keeps_place(measured, section, first, done, other):
                held[other] = True
    stands = True
    for body in range(b):
        stands = stands and held[body]
    return stands


@strict
def _keeps_place(measured, section, first, done, body):
    """Whether a body has no speed and the same slip at all sections."""
    b = len(measured.along)
    slip, speed, scale = 3 + body, 3 + b + body, measured.scale
    low, high, fastest = section[first, slip], section[first, slip], 0.0
    for i in range(first, done + 1):
        low, high = min(low, section[i, slip]), max(high, section[i, slip])
        fastest = max(fastest, abs(section[i, speed]))
    return fastest <= _STILL * (scale[1] + scale[speed]) and high - low <= _STILL * scale[slip]


@strict
def _closed(measured, section, first, done, unit):
    """Whether the gap of a contact is closed at all sections, to a fraction of its free travel."""
    for i in range(first, done + 1):
        gap = measured.rest[unit]
        for body in range(len(measured.along)):
            gap += measured.J[unit, measured.along[body]] * section[i, 3 + body]
        if not gap <= _CLOSED * measured.play[unit]:
            return False
    return True
