"""What the cited work says of rotating blades and free bodies in them, and what the models show.

In words of our own. Amplitudes are relative to the undamped maximum X; frequencies are the excitation's, which follow
the speed along an engine order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from scipy.optimize import brentq

from paper.blade import Blade, beam_southwell, southwell
from paper.claims_systems import top
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rigid
from vanedamp.studies.demo.claims import Curves, claim, verdict
from vanedamp.studies.report.claims import Claim

Scenes = Mapping[str, Scene]
#: m/s^2
_GRAVITY = 9.81
#: relative distance from the linear curve below which a body is taken to stick
_STUCK = 1e-3


def values(scene: Scene, path: str) -> np.ndarray:
    """Return the values of an axis of a scene's sweep."""
    return np.asarray(scene.sweep_points()[0][path])


def rigid(scene: Scene) -> Rigid:
    """Return the rigid structure of a scene."""
    assert isinstance(scene.structure, Rigid)
    return scene.structure


def load_ratio(scene: Scene, friction: float) -> float:
    """Return the friction of the centrifugal load over the body's inertia at amplitude X, along an engine order.

    mu m W^2 r/(m (n W)^2 X) = mu r/(n^2 X): it does not depend on the speed W.
    """
    order, amplitude = scene.excitation.engine_order, scene.excitation.resonance_amplitude
    radius = scene.cavity[0].radius
    assert order is not None and amplitude is not None and radius is not None
    return friction * radius / (order**2 * amplitude)


def friction_only(scene: Scene, ratio: float) -> float:
    """Return the resonance amplitude, in X, under a load ratio with a body that friction drags and no wall reaches.

    The balance of energy over a period: 2 pi zeta (1 - a) = 4 lambda mu sqrt(1 - (pi lambda/(2 a))^2), lambda the load
    ratio and mu the mass ratio; the body slides all the time, with a velocity of straight lines, which holds for
    lambda/a < 1/sqrt(1 + pi^2/4) = 0.537. nan where it does not.
    """
    structure = rigid(scene)
    zeta, mass_ratio = structure.damping_ratio or 0.0, scene.damper[0].mass / structure.mass
    least = ratio * math.sqrt(1 + math.pi**2 / 4)

    def gain(a: float) -> float:
        slip = math.sqrt(1 - (math.pi * ratio / (2 * a)) ** 2)
        return 2 * math.pi * zeta * (1 - a) - 4 * ratio * mass_ratio * slip

    if least >= 1 or gain(least) < 0:
        return math.nan
    return float(brentq(gain, least, 1.0))


def rotating_body(curves: Curves, scenes: Scenes) -> list[Claim]:
    """Judge a free body on a floor across the centrifugal load, and on floors at an angle."""
    ratios = [load_ratio(scenes["open"], friction) for friction in values(scenes["open"], "damper.0.friction")]
    return [
        _gravity(curves, scenes),
        _sticking(curves, ratios),
        _friction(curves, scenes, ratios),
        _walls(curves, ratios),
        _orders(curves, scenes),
        _inclined(curves, scenes),
    ]


def _gravity(curves: Curves, scenes: Scenes) -> Claim:
    radius = scenes["gravity"].cavity[0].radius
    assert radius is not None
    pulls = {}
    for order in (60, 12):
        scene = scenes[f"order_{order}"]
        crossing = 2 * math.pi * curves[f"order_{order}"][0].peak(curves[f"order_{order}"][0].undamped).frequency
        assert scene.excitation.engine_order == order
        pulls[order] = (crossing / order) ** 2 * radius / _GRAVITY
    less, nominal, more = (top(curve) for curve in curves["gravity"])
    change = max(abs(less - nominal), abs(more - nominal)) / nominal
    return claim(
        "In a rotating blade the centrifugal load presses the body on its floor, and gravity does not count.",
        f"the load is {pulls[60]:.0f} times the weight where order 60 meets the resonance, {pulls[12]:.0f} times where "
        f"order 12 does; as much more or less load as the weight changes the top ({nominal:.3f}) by {change:.2%}",
        verdict(change < 0.01 and min(pulls.values()) > 100, change < 0.05),
        "The weight turns once a revolution in the blade's frame; this is the most that it can do to the load.",
        {"load_over_weight_order_60": pulls[60], "load_over_weight_order_12": pulls[12], "change_of_top": change},
    )


def _sticking(curves: Curves, ratios: list[float]) -> Claim:
    stuck = curves["open"][-1]
    apart = float(np.max(np.abs(stuck.mean / stuck.fixed - 1)))
    right, count = 0, 0
    for curve, ratio in zip(curves["open"], ratios, strict=True):
        # within a percent of its bound the friction is lost and won again
        clear = np.abs(curve.fixed / ratio - 1) > 0.01
        sticks = np.abs(curve.mean / curve.fixed - 1) < _STUCK
        right += int(np.sum((sticks == (curve.fixed < ratio))[clear]))
        count += int(clear.sum())
    return claim(
        "Friction under the centrifugal load holds the body from some load on; it then only adds its mass.",
        f"at {ratios[-1]:.3g} times the load that holds it at the resonance the curve is the fixed one to {apart:.2%}; "
        f"of all loads and frequencies, {right} of {count} points stick if and only if the amplitude of the fixed "
        "body lies below friction x radius / order^2",
        verdict(apart < 0.001 and right > 0.98 * count, apart < 0.01),
        "A body that sticks shifts the resonance by its mass and damps nothing.",
        {"distance_from_fixed": apart, "points_as_predicted": right / count, "points": count},
    )


def _friction(curves: Curves, scenes: Scenes, ratios: list[float]) -> Claim:
    tops = [top(curve) for curve in curves["open"]]
    closed = [friction_only(scenes["open"], ratio) for ratio in ratios]
    errors = [abs(have / want - 1) for have, want in zip(tops, closed, strict=True) if not math.isnan(want)]
    best = int(np.argmin(tops))
    return claim(
        "Below that load the body slides, and friction damps the blade: there is a best load.",
        "tops under loads of "
        + ", ".join(f"{ratio:.3g}: {height:.3f}" for ratio, height in zip(ratios, tops, strict=True))
        + f" of the one that holds it at the resonance; best {ratios[best]:.2g}; balance of energy of a body that "
        f"slides all the time: within {max(errors):.1%} ({len(errors)} loads)",
        verdict(tops[best] < 0.5 and 0 < best < len(tops) - 1 and max(errors) < 0.05, tops[best] < 0.8),
        "",
        {f"load_{ratio:.3g}": height for ratio, height in zip(ratios, tops, strict=True)}
        | {"largest_error": max(errors), "best_load": ratios[best]},
    )


def _walls(curves: Curves, ratios: list[float]) -> Claim:
    free, walled = [[top(curve) for curve in curves[name]] for name in ("open", "walls")]
    impacts = [float(curve.impacts.max()) for curve in curves["walls"]]
    hit = [index for index, count in enumerate(impacts) if count > 0]
    better = sum(walled[index] < free[index] for index in hit)
    best = int(np.argmin(walled))
    started = np.array([curve.mean.max() for curve in curves["starts"]])
    count = len(started) * len(curves["starts"][0].mean)
    return claim(
        "Impacts on the walls of the cavity damp as well as friction, where the body still moves.",
        "tops with walls (and without): "
        + ", ".join(f"{r:.3g}: {w:.3f} ({f:.3f})" for r, w, f in zip(ratios, walled, free, strict=True))
        + f"; impacts up to a load of {ratios[hit[-1]] if hit else 0:.3g}; in {count} runs near the peak, released "
        f"from 0 to 1 X, means of {started.max():.3f} at most",
        verdict(better == len(hit) > 0, better > 0),
        "Walls help a light load, which lets the body fly; a heavy one stops it before it reaches them.",
        {f"walls_{ratio:.3g}": height for ratio, height in zip(ratios, walled, strict=True)}
        | {"last_load_with_impacts": ratios[hit[-1]] if hit else 0.0, "best": walled[best], "best_load": ratios[best]}
        | {"starts_highest": float(started.max())},
    )


def _orders(curves: Curves, scenes: Scenes) -> Claim:
    names = sorted((name for name in curves if name.startswith("order_")), key=lambda name: int(name[6:]))
    ratios = {name[6:]: load_ratio(scenes[name], scenes[name].damper[0].friction) for name in names}
    tops = {name[6:]: top(curves[name][0]) for name in names}
    damped = [order for order, height in tops.items() if height < 0.5]
    return claim(
        "Free bodies in the cavities of rotating blades damp them.",
        f"friction {scenes[names[0]].damper[0].friction:g}; tops (load) by engine order: "
        + ", ".join(f"{order}: {tops[order]:.3f} ({ratios[order]:.2g})" for order in tops),
        verdict(len(damped) == len(tops), bool(damped)),
        "The load over the body's inertia is friction x radius / (order^2 x amplitude) at every speed: a floor across "
        "the load lets the body go on high orders or in strong vibration only. On low orders it is a mass.",
        {f"order_{order}": height for order, height in tops.items()}
        | {f"load_of_order_{order}": ratio for order, ratio in ratios.items()},
    )


def _inclined(curves: Curves, scenes: Scenes) -> Claim:
    angles = values(scenes["inclined"], "cavity.c1.centrifugal_deg")
    apart = [float(np.max(np.abs(curve.harmonic / curve.fixed - 1))) for curve in curves["inclined"]]
    scene = scenes["inclined"]
    leaves = load_ratio(scene, math.sin(math.radians(float(angles[0]))))
    return claim(
        "High centrifugal loads make ordinary impact dampers inactive.",
        f"order {scene.excitation.engine_order:g}, floors at "
        + ", ".join(f"{angle:g}" for angle in angles)
        + " degrees: the harmonic is that of the fixed body to "
        + ", ".join(f"{value:.2%}" for value in apart)
        + f"; the wall would have to vibrate with {leaves:.0f} X to throw the body off",
        verdict(max(apart) < 0.01, min(apart) < 0.01),
        "The load pulls the body to one wall, and the wall pushes it along.",
        {f"distance_from_fixed_{angle:g}_deg": value for angle, value in zip(angles, apart, strict=True)}
        | {"amplitude_that_throws_it": leaves},
    )


def campbell(blade: Blade) -> list[Claim]:
    """Judge how the natural frequencies of a blade go with the speed, and its reduced model."""
    return [_stiffening(blade), _softening(blade), _crossings(blade), _reduced(blade)]


def _stiffening(blade: Blade) -> Claim:
    turns = blade.revolutions
    fits = {name: southwell(turns, blade.frequencies(blade.flapwise, name)) for name in blade.names}
    rises = {name: blade.frequencies(blade.flapwise, name)[[0, -1]] for name in blade.names}
    relative = {name: float(last / first - 1) for name, (first, last) in rises.items()}
    bending = [name for name in blade.names if name.startswith("bending")]
    others = [name for name in blade.names if name not in bending]
    error = max(fit[2] for fit in fits.values())
    beam = {name: beam_southwell(index + 1, blade.hub) for index, name in enumerate(bending[:3])}
    away = max(abs(fits[name][1] / want - 1) for name, want in beam.items())
    return claim(
        "The centrifugal load stiffens a blade: bending frequencies rise with the speed, torsion and edgewise bending "
        "less so.",
        f"from 0 to {60 * turns[-1]:.0f} rpm: "
        + ", ".join(f"{name} {first:.1f} to {last:.1f} Hz" for name, (first, last) in rises.items())
        + f"; f^2 = f0^2 + B n^2 holds within {error:.2%}, flapwise with B = "
        + ", ".join(f"{fits[name][1]:.3f}" for name in beam)
        + " (slender beam: "
        + ", ".join(f"{value:.3f}" for value in beam.values())
        + ")",
        verdict(
            min(relative[name] for name in bending) > max(relative[name] for name in others) and error < 0.01,
            relative[bending[0]] > 0.1,
        ),
        "",
        {f"rise {name}": value for name, value in relative.items()}
        | {f"southwell {name}": fit[1] for name, fit in fits.items()}
        | {"southwell_error": error, "distance_from_beam": away},
    )


def _softening(blade: Blade) -> Claim:
    turns = blade.revolutions
    flap, lag = (blade.frequencies(diagram, "bending 1") for diagram in (blade.flapwise, blade.lagwise))
    expected = np.sqrt(flap**2 - turns**2)
    error = float(np.abs(lag / expected - 1).max())
    return claim(
        "In the plane of rotation the blade is softer: f^2 is less by the square of the speed.",
        f"first bending at {60 * turns[-1]:.0f} rpm {flap[-1]:.2f} Hz flapwise and {lag[-1]:.2f} Hz in the plane; "
        f"expected {expected[-1]:.2f} Hz, within {error:.3%} at all speeds",
        verdict(error < 0.005, error < 0.02),
        "",
        {"flapwise_hz": float(flap[-1]), "lagwise_hz": float(lag[-1]), "largest_error": error},
    )


def _crossings(blade: Blade) -> Claim:
    diagram, bending = blade.flapwise, blade.names.index("bending 1")
    still, slope, _ = southwell(blade.revolutions, blade.frequencies(diagram, "bending 1"))
    found = {c.order: c for c in diagram.crossings if diagram.modes[bending] == c.mode}
    expected = {order: 60 * still / math.sqrt(order**2 - slope) for order in found if order**2 > slope}
    error = max(abs(found[order].rpm / want - 1) for order, want in expected.items())
    return claim(
        "Engine orders meet the resonances at single speeds; the first one never meets a bending that stiffens faster.",
        f"{len(diagram.crossings)} crossings of orders {diagram.orders[0]:g} to {diagram.orders[-1]:g} with "
        f"{len(diagram.modes)} modes; first bending: "
        + ", ".join(f"order {order:g} at {crossing.rpm:.0f} rpm" for order, crossing in sorted(found.items()))
        + f"; n = f0/sqrt(k^2 - B) within {error:.2%}",
        verdict(1.0 not in found and slope > 1.0 and error < 0.01 and len(expected) == len(found)),
        "",
        {"crossings": len(diagram.crossings), "largest_error": error}
        | {f"rpm_of_order_{order:g}": crossing.rpm for order, crossing in sorted(found.items())},
    )


def _reduced(blade: Blade) -> Claim:
    error = float(np.abs(blade.reduced / blade.full - 1).max())
    first = float(np.abs(blade.reduced[:, 0] / blade.full[:, 0] - 1).max())
    return claim(
        "One reduced model holds at all speeds.",
        f"{blade.full.shape[1]} frequencies at {len(blade.full)} speeds agree with the finite elements within "
        f"{error:.1e}, the first within {first:.1e}",
        verdict(error < 1e-4, first < 1e-4),
        "",
        {"largest_error": error, "largest_error_first": first},
    )
