"""How much a response depends on its collisions: short runs of a model of few modes with other pulses.

A body in a narrow cavity goes with its walls whatever its collisions are like; one that rattles does not. The runs show
which it is, at the price of some hundred periods of the cheapest model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from vanedamp.coupling.methods.registry import respond
from vanedamp.coupling.scene.contact_laws.compliant import Compliant
from vanedamp.coupling.scene.scene import Scene, Time
from vanedamp.coupling.scene.solver_options import options_of
from vanedamp.coupling.scene.structures import Rom
from vanedamp.rom.contact_pulse import Pulse, WallContact

# of the impulse and of the duration; a softer spring takes its square root longer
_LESS, _LONGER = 0.8, 2.0
_PERIODS, _TRANSIENT = 450, 150
_PLASTIC = 0.05


def sensitivity(
    scene: Scene,
    frequencies: Sequence[float],
    collision: WallContact,
    wall: float,
    pulse: Pulse,
    modes: int,
    undamped: float,
) -> float:
    """Return the change of the mean amplitude over the undamped one (m), for a relative change of all pulses.

    The largest over the frequencies (Hz), with `modes` natural modes, as few as the motion there takes. wall: the first
    mode's entry of the wall's functional; pulse: of the collision on the whole model.
    """
    reduced = 1.0 / (wall**2 + 1.0 / collision.mass)
    growth = min(max(abs(pulse.transform) / reduced, 1.0 + _PLASTIC), 2.0)  # 1 + restitution
    spring = reduced * (math.pi / pulse.duration) ** 2
    weaker = max(_LESS * growth, 1.0 + _PLASTIC / 2)
    worst = 0.0
    for frequency in frequencies:
        driven = replace(
            scene,
            excitation=replace(
                scene.excitation, frequency=frequency, engine_order=None, resonance_near=scene.resonance_range
            ),
        )
        as_it_is = _amplitude(driven, modes, growth - 1.0, spring)
        less = abs(_amplitude(driven, modes, weaker - 1.0, spring) - as_it_is) / (1.0 - weaker / growth)
        # a pulse acts in its middle, so that twice the duration is half of it late
        late = math.pi * frequency * pulse.duration * (_LONGER - 1.0)
        later = abs(_amplitude(driven, modes, growth - 1.0, spring / _LONGER**2) - as_it_is) / late
        worst = max(worst, less, later) if math.isfinite(less + later) else math.inf
    return worst / undamped


def _amplitude(scene: Scene, modes: int, restitution: float, spring: float) -> float:
    structure = scene.structure
    assert isinstance(structure, Rom)
    simple = replace(
        scene,
        structure=replace(structure, modes=modes, natural=True, attached=False),
        contact=Compliant(spring),
        damper=tuple(replace(damper, restitution=restitution) for damper in scene.damper),
        time=Time(_PERIODS, _TRANSIENT),
        solver=options_of({}),
        sweep={},
    )
    return respond(simple).amplitude_mean_dynamic
