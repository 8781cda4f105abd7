"""Printed lines on hot spots of a reduced model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from vanedamp.modal.algebra import MOVES, von_mises
from vanedamp.rom.recovery import SHOWN, shown_modes

#: unit of the stress of a cause, and factor from Pa to this unit
_UNITS = {"rotation": ("Pa s^2/rad^2", 1.0)}
_MPA = ("MPa", 1e-6)
#: estimated relative error of a stress above which commands warn
DOUBTFUL = 0.3
#: name of the amplitude at the fatigue strength in warnings
_LEVEL = "the amplitude at the fatigue strength"


def spot_lines(spots: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield a line for each hot spot (rom.recovery.hot_spots): place, stress of its mode and the first, static ones."""
    for name, facts in spots.items():
        line = name
        if "coordinates" in facts:
            line += _place(facts["coordinates"])
        line += f" in {facts['group']}" if facts.get("group") else ""
        texts = []
        mode, first = facts.get("mode", {}), facts.get("per_amplitude")
        if mode.get("number", 1) != 1:
            word = f"mode {mode['number']} ({mode['frequency_hz']:.6g} Hz)"
            texts.append(_of_amplitude(word, mode) if "at" in mode else f"{word}, which moves no interface coordinate")
        if first:
            texts.append(_of_amplitude("first mode", first))
        for cause, values in facts.get("static", {}).items():
            unit, factor = _UNITS.get(cause, _MPA)
            stress, doubt = von_mises(np.array(values)), facts.get("static_error", {}).get(cause)
            error = plus_minus(doubt / stress if doubt is not None and stress else None)
            texts.append(f"{cause} {stress * factor:.4g} {unit}{error}")
        yield line + (": von Mises stress of " + ", ".join(texts) if texts else "")


def spot_warnings(provenance: Mapping[str, Any]) -> Iterator[str]:
    """Yield warnings on the stresses of a reduced model, from its provenance."""
    level = provenance.get("fatigue")
    spots = {name: facts for name, facts in provenance.get("hot_spots", {}).items() if isinstance(facts, Mapping)}
    yield from _doubts(({} if level is None else {_LEVEL: level}) | spots)
    yield from _unmoved(level)
    covered = provenance.get("estimate", {}).get("frequencies_hz", [0.0, 0.0])[1]
    hidden = [
        f"mode {number} ({frequency:.6g} Hz; {shown:.0%})"
        for number, (frequency, shown) in enumerate(shown_modes(provenance), 1)
        if shown < SHOWN and frequency <= covered
    ]
    if hidden:
        yield (
            f"hot spots: do not show the largest stress over strength of {', '.join(hidden)}; for scenes that excite "
            "these ask for more --hot-spots"
        )


def level_warnings(level: Mapping[str, Any] | None) -> Iterator[str]:
    """Yield warnings on the amplitude at the fatigue strength (studies.case.stages.FatigueLevel); none without one."""
    if level is not None:
        yield from _doubts({_LEVEL: level})
        yield from _unmoved(level)


def plus_minus(error: float | None) -> str:
    """Return the text of an estimated relative error, to follow its number; empty if there is no estimate."""
    return "" if error is None else f" (+- {100.0 * error:.2g} % by the mesh)"


def _doubts(spots: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield warnings of singular stresses, and of stresses that this mesh does not resolve."""
    singular = [f"{name} beside {facts['singular']}" for name, facts in spots.items() if facts.get("singular")]
    if singular:
        yield (
            f"stress: {', '.join(singular)}, where it grows without limit as the mesh is refined; model the fillet, or "
            "leave the place out (in the case: hot_spots.exclude, calibration.hot_spot)"
        )
    doubtful = [
        f"{name}{_place(facts['coordinates'])} by {facts['error']:.0%}"
        for name, facts in spots.items()
        if facts.get("error", 0.0) > DOUBTFUL
    ]
    if doubtful:
        yield f"stress: the mesh leaves open {', '.join(doubtful)}; refine it there (docs/mesh_convergence.md)"


def _unmoved(level: Mapping[str, Any] | None) -> Iterator[str]:
    """Yield a warning of a coordinate that its mode hardly moves, so that the value depends on the mesh."""
    if level is not None and (moved := level.get("moved", 1.0)) < MOVES:
        yield (
            f"{_LEVEL}: its coordinate moves by {moved:.1g} of the structure's largest displacement, which the mesh "
            "decides; name another interface coordinate in modes.at"
        )


def _place(coordinates: Sequence[float]) -> str:
    return " at ({:.4g}, {:.4g}, {:.4g}) m".format(*coordinates)


def _of_amplitude(mode: str, of: Mapping[str, Any]) -> str:
    return f"{mode} {of['von_mises'] * 1e-12:.4g} MPa{plus_minus(of.get('error'))} per um of {of['at']}"


def strength_lines(strengths: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    """Yield a line for each hot spot with the strength of a motion that occurs occasionally (strength.assessment)."""
    for name, strength in strengths.items():
        line = f"{name}: {strength['amplitude'] / 1e6:.4g} MPa, utilisation {strength['utilisation']:.3g}"
        for kind, of in (("life_starts", "starts"), ("life_repeats", "times")):
            if kind in strength:
                line += f", damage {strength['damage']:.3g}: median life {strength[kind]['50%']:.3g} {of}"
                break
        yield line
