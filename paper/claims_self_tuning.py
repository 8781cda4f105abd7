"""What the cited work says of the self-tuning impact damper, and what the model shows.

Duffy, Bagley and Mehmed (2000), a NASA memorandum, and US 6,827,551, in words of our own, and what a designer would ask
beside: other blades, starts, errors of the track, other orders. Order-tuned absorbers: Den Hartog (1956), Mechanical
Vibrations, section 6.7. Amplitudes are relative to the undamped maximum X; frequencies are the excitation's, which
follow the speed.
"""

from __future__ import annotations

import math

import numpy as np

from paper.claims_rotation import Scenes, rigid, values
from paper.claims_systems import means_of, top
from vanedamp.coupling.scene.scene import Scene
from vanedamp.studies.demo.claims import Curves, claim, verdict
from vanedamp.studies.demo.curve import DampedCurve
from vanedamp.studies.report.claims import Claim

#: amplitude below which a response counts as suppressed, of X
_SUPPRESSED = 0.05
#: mass ratio up to which a body counts as small
_SMALL = 0.005001


def tuned_order(radius: float, track_radius: float, share: float = 1.0) -> float:
    """Return the engine order of a body on a track; share of its mass that moves: 1 point, 2/3 disc, 5/7 ball."""
    return math.sqrt(share * (radius - track_radius) / track_radius)


def resonance_on_track(order: float, tuned: float, mass_ratio: float, stiffening: float = 0.0) -> float:
    """Return the resonance along an engine order over that at standstill, with a point on a track and no walls.

    The blade feels a mass mu/(1 - (n/N)^2) for an order n and a track of order N: below N the resonance comes down,
    above it goes up. stiffening: Southwell's coefficient. inf where there is none, for 1 < (n/N)^2 < 1 + mu about.
    """
    felt = 1 + mass_ratio / (1 - (order / tuned) ** 2) - stiffening / order**2 if order != tuned else -math.inf
    return 1 / math.sqrt(felt) if felt > 0 else math.inf


def self_tuning(curves: Curves, scenes: Scenes) -> list[Claim]:
    """Judge a body on a track, between walls, along the engine order that it is tuned to and others."""
    return [
        _follows(curves, scenes),
        _blades(curves),
        _impacts(curves, scenes),
        _starts(curves, scenes),
        _rolling(curves, scenes),
        _mass(curves, scenes),
        _detuned(curves, scenes),
        _one_order(curves),
    ]


def _nominal(scene: Scene) -> int:
    """Return the place of the scene's own gap in the sweep of gaps."""
    gaps = values(scene, "cavity.c1.gap")
    return int(np.argmin(np.abs(gaps - scene.cavity[0].gap)))


def _band(curve: DampedCurve) -> float:
    """Return the highest of all means, with their confidence."""
    return float((curve.mean + curve.confidence).max())


def _follows(curves: Curves, scenes: Scenes) -> Claim:
    tuned = curves["tuned"][_nominal(scenes["tuned"])]
    left = _band(tuned)
    flat = top(curves["held"][0])
    return claim(
        "The body's frequency goes with the speed, so that it stays tuned to its engine order at all speeds.",
        f"from {tuned.frequency[0]:.0f} to {tuned.frequency[-1]:.0f} Hz along the order at most {left:.4f} is left, "
        f"from rest; on a flat floor {flat:.3f}, where friction holds the body",
        verdict(left < _SUPPRESSED, left < 0.5),
        "",
        {"highest": left, "flat_floor": flat},
    )


def _blades(curves: Curves) -> Claim:
    gap = curves["track_low"][0], curves["track_high"][0]
    track = [_band(curve) for curve in gap]
    spring = {name: _band(curves[name][0]) for name in ("spring_low", "spring", "spring_high")}
    return claim(
        "A tuned mass of fixed frequency suits one frequency only; the self-tuning one suits every blade.",
        f"blades of frequencies 10 % lower and higher: {track[0]:.4f} and {track[1]:.4f} left with the track; with a "
        f"spring and the best dashpot for the nominal blade {spring['spring_low']:.3f} and "
        f"{spring['spring_high']:.3f} (nominal {spring['spring']:.3f})",
        verdict(max(track) < _SUPPRESSED and min(spring["spring_low"], spring["spring_high"]) > 5 * max(track)),
        "",
        {"track_low": track[0], "track_high": track[1]} | spring,
    )


def _impacts(curves: Curves, scenes: Scenes) -> Claim:
    gaps = values(scenes["tuned"], "cavity.c1.gap") / scenes["tuned"].excitation.resonance_amplitude
    tuned = [top(curve) for curve in curves["tuned"]]
    free = [top(curve) for curve in curves["flat"]]
    narrow = [index for index, curve in enumerate(curves["tuned"]) if curve.impacts.max() > 1]
    limited = max((tuned[index] for index in narrow), default=0.0)
    return claim(
        "Walls limit the body's motion, and their impacts damp where the amplitude outgrows the tuning.",
        "tops (those of a body on a flat floor without friction) by gap in X: "
        + ", ".join(f"{g:g}: {t:.3f} ({f:.3f})" for g, t, f in zip(gaps, tuned, free, strict=True)),
        verdict(bool(narrow) and limited < 0.5, bool(narrow) and limited < 0.9),
        "The body must move by 2 zeta/mu of X to take the exciting force. Walls that leave less make it an impact "
        "damper, no better than one on a flat floor; walls that leave more are not met.",
        {f"gap_{gap:g}": height for gap, height in zip(gaps, tuned, strict=True)}
        | {f"flat_{gap:g}": height for gap, height in zip(gaps, free, strict=True)},
    )


def _starts(curves: Curves, scenes: Scenes) -> Claim:
    scene = scenes["starts"]
    gaps = values(scene, "cavity.c1.gap") / scene.excitation.resonance_amplitude
    means, wide = np.split(means_of(curves["starts"]), len(gaps)), gaps >= 1
    share, worst = np.transpose([
        (np.mean(steady > _SUPPRESSED), steady.max()) for steady in (each[np.isfinite(each)] for each in means)
    ])[:, wide]  # fmt: skip
    up, down = np.reshape([_band(curve) for curve in curves["both_ways"]], (2, -1))
    return claim(
        "The damper works whatever the blade did before.",
        f"released from 0 to 1 X near the resonance, {means[0].size} runs a gap; gap: share that "
        "ends in impacts, highest mean; and with speed that rises and falls by small steps: "
        + ", ".join(
            f"{g:g}: {s:.0%}, {w:.3f}; {u:.3f} and {d:.3f}"
            for g, s, w, u, d in zip(gaps[wide], share, worst, up, down, strict=True)
        ),
        verdict(max(worst.max(), up.max(), down.max()) < _SUPPRESSED, share.max() < 1),
        "The tuned state and one of impacts are both steady: a release that throws the body against the walls can "
        "keep it there, with an amplitude like that of an impact damper; between near walls a rising speed brings it.",
        {f"impacts_{gap:g}": value for gap, value in zip(gaps[wide], share, strict=True)}
        | {f"worst_{gap:g}": value for gap, value in zip(gaps[wide], worst, strict=True)}
        | {f"up_{gap:g}": value for gap, value in zip(gaps[wide], up, strict=True)}
        | {f"down_{gap:g}": value for gap, value in zip(gaps[wide], down, strict=True)},
    )


def _rolling(curves: Curves, scenes: Scenes) -> Claim:
    frictions = values(scenes["sliding"], "damper.0.friction")
    sliding = [top(curve) for curve in curves["sliding"]]
    rolling = curves["rolling"][0]
    left = _band(rolling)
    return claim(
        "A body that rolls stays active under the load, where friction would hold one that slides.",
        "a point that slides on the track, tops by friction: "
        + ", ".join(f"{mu:g}: {height:.3f}" for mu, height in zip(frictions, sliding, strict=True))
        + f"; a disc that rolls with friction {scenes['rolling'].damper[0].friction:g}: {left:.4f}",
        verdict(left < _SUPPRESSED and sliding[-1] > 0.9, left < sliding[-1] / 2),
        "Friction holds a sliding body up to amplitudes of friction x radius / order^2: it must be a ball.",
        {f"sliding_{mu:g}": height for mu, height in zip(frictions, sliding, strict=True)} | {"rolling": left},
    )


def _mass(curves: Curves, scenes: Scenes) -> Claim:
    scene = scenes["mass"]
    structure = rigid(scene)
    shares = values(scene, "damper.0.mass") / structure.mass
    gaps = values(scene, "cavity.c1.gap") / (scene.excitation.resonance_amplitude or math.nan)
    need = 4 * (structure.damping_ratio or 0.0) / shares  # from wall to wall, in X
    tops = np.reshape([top(curve) for curve in curves["mass"]], (len(gaps), -1))
    small = shares <= _SMALL
    return claim(
        "A small mass is enough.",
        "; ".join(
            f"gap {gap:g} X: " + ", ".join(f"{s:.2%} {t:.3f}" for s, t in zip(shares, row, strict=True))
            for gap, row in zip(gaps, tops, strict=True)
        )
        + "; travel that the exciting force needs, in X: "
        + ", ".join(f"{n:.2g}" for n in need),
        verdict(tops[:, small].max() < _SUPPRESSED, tops[:, small].min() < _SUPPRESSED),
        "The travel goes with damping ratio over mass, and a start from rest takes up to twice of it. Walls nearer "
        "than that make the body an impact damper, and a light one is a weak one.",
        {
            f"gap_{g:g}_mass_{100 * s:g}": t
            for g, row in zip(gaps, tops, strict=True)
            for s, t in zip(shares, row, strict=True)
        }
        | {f"travel_{100 * share:g}": value for share, value in zip(shares, need, strict=True)},
    )


def _detuned(curves: Curves, scenes: Scenes) -> Claim:
    scene = scenes["radius"]
    structure, radius, order = rigid(scene), scene.cavity[0].radius, scene.excitation.engine_order
    assert radius is not None and order is not None
    tracks = values(scene, "damper.0.track_radius")
    off = tracks / scene.damper[0].track_radius - 1
    orders = [tuned_order(radius, float(track)) for track in tracks]
    share = scene.damper[0].mass / structure.mass
    still, stiffening = (
        math.sqrt(structure.stiffness / structure.mass),
        structure.centrifugal_stiffness / structure.mass,
    )
    expected = [still / (2 * math.pi) * resonance_on_track(order, tuned, share, stiffening) for tuned in orders]
    swept = curves["radius"][0].frequency
    tops = [top(curve) for curve in curves["radius"]]
    near = {abs(round(100 * o)): t for o, t in zip(off, tops, strict=True) if o}
    worst = {
        percent: max(t for o, t in zip(off, tops, strict=True) if abs(round(100 * o)) == percent) for percent in near
    }
    return claim(
        "The track need not be exact.",
        f"{swept[0]:.0f} to {swept[-1]:.0f} Hz; tops by the error of its radius (resonance near, without walls, Hz): "
        + ", ".join(
            f"{o:+.0%}: {t:.3f} ({f'{f:.0f}' if swept[0] / 2 < f < 2 * swept[-1] else 'none'})"
            for o, t, f in zip(off, tops, expected, strict=True)
        ),
        verdict(worst[5] < _SUPPRESSED, worst[2] < _SUPPRESSED or worst[5] < 0.5),
        "A steeper or flatter track leaves a resonance at another speed, lower or higher by more than its error; walls "
        "limit it. From the order on up to mu/2 too low there is none at any speed.",
        {f"radius_{100 * o:+.0f}": height for o, height in zip(off, tops, strict=True)},
    )


def _one_order(curves: Curves) -> Claim:
    tops = {order: top(curves[f"order_{order}"][0]) for order in (11, 13)}
    return claim(
        "Each track serves its own engine order.",
        f"the track of order 12 under order 11: {tops[11]:.3f}; under order 13: {tops[13]:.3f}",
        verdict(min(tops.values()) > 2 * _SUPPRESSED, max(tops.values()) > 2 * _SUPPRESSED),
        "Off its order it is a mass, added below and taken away above, which moves the resonance; walls limit it.",
        {f"order_{order}": height for order, height in tops.items()},
    )
