"""Scenes on which the automatic choice of a model is tried: three structures, and bodies drawn at random.

A rod and a beam with closed or small matrices have what a vane cluster has not: many modes of alike impedance below the
contact's frequency, which soft contacts feel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import eigh

from benchmarks.model_order.structures import _BEAM_ELEMENTS, _CLUSTER_MODES, beam_model, rod_model
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate
from vanedamp.rom.reduced import ReducedModel
from vanedamp.rom.truncation import massless

#: the scenes of the trial; nothing was settled on them, and other seeds give other scenes for that
SEED = 2028
_AMPLITUDE = 3e-5
# ranges of what is drawn: share of the first modal mass, of the peak without bodies, of the first frequency
_MASS, _GAP, _CONTACT, _RESTITUTION, _FRICTION = (0.005, 0.05), (0.2, 1.0), (3.0, 30.0), (0.5, 0.95), (0.1, 0.5)
#: gravity in the unit of the peak without bodies's acceleration: 9.81 m/s^2 on the cluster
_GRAVITY = 1e-3
#: a wide band, of the first frequency, and its points in addition to those at the damped peak
_WIDE, _POINTS = (0.83, 1.04), 8
#: places between the resonance with loose (0) and with fixed bodies (1), where the damped peak lies
PLACES = (0.2, 0.5, 0.8)


@dataclass(frozen=True)
class Trial:
    """A scene without its frequency: structure's name, scene, its frequencies (Hz), contact over first frequency.

    band: frequencies (Hz) for which a model is chosen, among them those at which its error is measured.
    """

    structure: str
    scene: Scene
    frequencies: tuple[float, ...]
    contact_ratio: float
    band: tuple[float, ...]

    @property
    def undamped(self) -> float:
        """Undamped peak, m."""
        peak = self.scene.excitation.resonance_amplitude
        assert peak is not None
        return peak


def trials(folder: Path, seed: int, counts: dict[str, int]) -> list[Trial]:
    """Return scenes of each structure ("cluster", "rod", "beam", "span"), whose reduced models are left in the folder.

    A second word after the structure: "pair", two bodies in the cavity; "cavities", one in each of two (the span's);
    "wide", a band far beyond the damped peak.
    """
    generator = np.random.default_rng(seed)
    drawn = []
    for name, count in counts.items():
        structure = name.split()[0]
        file = folder / f"auto_{structure}.h5"
        if not file.exists():
            _MODELS[structure]().save(file)
        drawn += [_trial(name, file, generator) for _ in range(count)]
    return drawn


def _cluster() -> ReducedModel:
    from benchmarks.model_order.structures import cluster_model

    return cluster_model(1, _CLUSTER_MODES)


_MODELS: dict[str, Callable[[], ReducedModel]] = {
    "cluster": _cluster, "rod": rod_model, "beam": beam_model, "span": partial(beam_model, _BEAM_ELEMENTS // 2)
}  # fmt: skip
#: response and floors
_LABELS = {
    "cluster": ("shroud", "c1_floor"), "rod": ("tip", "tip"), "beam": ("tip", "tip"),
    "span": ("tip", "tip", f"node {_BEAM_ELEMENTS // 2}"),
}  # fmt: skip


def _trial(name: str, file: Path, generator: np.random.Generator) -> Trial:
    model = ReducedModel.load(file)
    structure, _, kind = name.partition(" ")
    at, floor, *others = _LABELS[structure]
    first, rigid = float(model.natural_frequencies_hz[0]), massless(model, 1)
    modal, wall = (1.0 / float(rigid.row(label)[0] ** 2) for label in (at, floor))
    mass = modal * _spread(generator, _MASS)
    ratio = _spread(generator, _CONTACT)
    stiffness = (2.0 * math.pi * first * ratio) ** 2 / (1.0 / mass + 1.0 / wall)
    gap = _AMPLITUDE * _spread(generator, _GAP)
    body = {
        "cavity": "c1", "mass": mass, "friction": generator.uniform(*_FRICTION),
        "restitution": generator.uniform(*_RESTITUTION),
    }  # fmt: skip
    data: dict[str, Any] = {
        "structure": {"model": "rom", "file": str(file), "modes": "auto"},
        "excitation": {"frequency": first, "resonance_amplitude": _AMPLITUDE, "at": at},
        "gravity": {"acceleration": _GRAVITY * _AMPLITUDE * (2.0 * math.pi * first) ** 2},
        "cavity": [{"name": "c1", "gap": gap, "floor": floor}],
        "damper": [body],
        "contact": {"law": "compliant", "stiffness": stiffness, "residual": bool(generator.random() < 0.5)},
    }
    attached = mass / wall
    if kind == "pair":
        data["damper"] = [body | {"position": -0.25 * gap}, body | {"mass": 0.5 * mass, "position": 0.25 * gap}]
        attached *= 1.5
    if kind == "cavities":
        data["cavity"].append({"name": "c2", "gap": _AMPLITUDE * _spread(generator, _GAP), "floor": others[0]})
        second = modal * _spread(generator, _MASS)
        data["damper"].append(body | {"cavity": "c2", "mass": second})
        attached += second * float(rigid.row(others[0])[0] ** 2)
    fixed = first / math.sqrt(1.0 + attached)
    frequencies = tuple(first + place * (fixed - first) for place in PLACES)
    band = frequencies
    if kind == "wide":
        band = tuple(sorted([*frequencies, *(first * np.linspace(*_WIDE, _POINTS)).tolist()]))
    return Trial(name, validate(Scene, data, "scene"), frequencies, ratio, band)


def chain_trial(file: Path, seed: int) -> Trial:
    """Return a random chain of 5 to 18 masses, driven at one of its two lowest modes; its model is left in the file.

    tip: its last mass, where force and response are; floor: one in its outer half.
    """
    generator = np.random.default_rng(seed)
    n = int(generator.integers(5, 19))
    mass, spring = generator.uniform(0.5, 1.5, n), generator.uniform(0.5, 1.5, n) * n * n
    stiffness = np.diag(spring + np.r_[spring[1:], 0.0]) - np.diag(spring[1:], 1) - np.diag(spring[1:], -1)
    floor = int(generator.integers(n // 2, n))
    damping = _spread(generator, (2e-3, 2e-2))
    rows = {"tip": np.eye(n)[-1], "floor": np.eye(n)[floor]}
    ReducedModel.from_matrices(np.diag(mass), stiffness, rows, damping_ratio=damping).save(file)
    squares, shapes = eigh(stiffness, np.diag(mass))
    mode = int(generator.integers(0, 2))
    natural, wall = math.sqrt(squares[mode]) / (2.0 * math.pi), 1.0 / shapes[floor, mode] ** 2
    body = wall * _spread(generator, _MASS)
    ratio = _spread(generator, _CONTACT)
    contact = (2.0 * math.pi * natural * ratio) ** 2 / (1.0 / body + 1.0 / wall)
    amplitude = 1e-3 * abs(float(shapes[-1, mode] / shapes[floor, mode]))
    gap = 1e-3 * _spread(generator, _GAP)
    fixed = natural / math.sqrt(1.0 + body / wall)
    frequency = natural + generator.uniform(-0.3, 1.3) * (fixed - natural)
    data = {
        "structure": {"model": "rom", "file": str(file), "modes": "auto"},
        "excitation": {
            "frequency": frequency, "resonance_amplitude": amplitude, "resonance_near": natural, "at": "tip"
        },
        "gravity": {"acceleration": _GRAVITY * 1e-3 * (2.0 * math.pi * natural) ** 2},
        "cavity": [{"name": "c", "gap": gap, "floor": "floor"}],
        "damper": [
            {
                "cavity": "c", "mass": body, "friction": generator.uniform(*_FRICTION),
                "restitution": generator.uniform(*_RESTITUTION),
            }
        ],
        "contact": {"law": "compliant", "stiffness": contact, "residual": bool(generator.random() < 0.5)},
    }  # fmt: skip
    return Trial("chain", validate(Scene, data, "scene"), (frequency,), ratio, (frequency,))


def _spread(generator: np.random.Generator, limits: tuple[float, float]) -> float:
    """Draw a number uniform in the logarithm."""
    return float(np.exp(generator.uniform(*np.log(limits))))
