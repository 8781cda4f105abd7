"""An assembly of numbers with derivatives, against differences of plain assemblies, by every number of every kind."""

from __future__ import annotations

import numpy as np
import pytest

from tests.tools.sensitive_scenes import KINDS, numbers_of, scene_of
from tests.tools.tiers import seeds
from vanedamp.coupling.scene.paths import with_numbers
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.scene.structures import Rom
from vanedamp.coupling.system.assembly import assemble
from vanedamp.coupling.system.system import System
from vanedamp.coupling.tangents.differences import NotSmooth, derivative
from vanedamp.coupling.tangents.dual import Dual, numbers
from vanedamp.files.toml_input import validate

#: fields of a system that its equations of motion have
FIELDS = (
    "stiffness", "damping", "load", "weight", "response", "table", "frequency", "period", "J", "rest", "friction",
    "limit", "restitution", "spring", "dashpot", "tangential", "elongation", "floor", "turn", "rise", "scale",
    "casing", "grip", "squares", "viscous",
)  # fmt: skip
#: error of the differences, relative to the largest of an array and of its derivative
CLOSE = 1e-9


def turning(scene: Scene, path: str, value: float, size: float) -> System:
    with numbers(1):
        return assemble(with_numbers(scene, scene.to_dict(), {path: Dual(value, [size])}))


def parts(system: System) -> dict[str, np.ndarray]:
    """Return values of the fields, complex ones as pairs; without the scale that sliders have for a mass."""
    massive = len(system.J.T) - len(system.tangential)
    named = {name: getattr(system, name) for name in FIELDS} | {"mass": system.mass[:massive]}
    return {name: reals(one.value if isinstance(one, Dual) else one) for name, one in named.items()}


def slopes(system: System) -> dict[str, np.ndarray]:
    massive = len(system.J.T) - len(system.tangential)
    named = {name: getattr(system, name) for name in FIELDS} | {"mass": system.mass[:massive]}
    return {
        name: reals(one.turns[..., 0].astype(np.result_type(one.value, one.turns)))
        if isinstance(one, Dual)
        else 0.0 * reals(one)
        for name, one in named.items()
    }


#: kinds whose records others have as well
REPEATED = ("crowd", "crowd jenkins", "planar poisson")


def reals(one) -> np.ndarray:
    found = np.atleast_1d(np.ascontiguousarray(one)).ravel()
    return found.view(float) if np.iscomplexobj(found) else found.astype(float)


@pytest.mark.parametrize(
    "seed", seeds(len(KINDS), fast=[k for k in range(len(KINDS)) if KINDS[k] not in REPEATED]), ids=KINDS
)
def test_tangents_are_differences(seed, tmp_path):
    kind, scene = scene_of(400 - 400 % len(KINDS) + seed, tmp_path)
    here, compared = parts(assemble(scene)), 0
    finite = {name: np.isfinite(one) for name, one in here.items()}
    most = {name: float(np.abs(one[finite[name]]).max(initial=0.0)) or 1.0 for name, one in here.items()}

    def flat(found: dict[str, np.ndarray]) -> np.ndarray:
        return np.concatenate([found[name][finite[name]] / most[name] for name in found])

    for path, (value, size) in numbers_of(scene, True).items():
        if isinstance(scene.structure, Rom) and path.startswith("structure."):
            continue  # its modes have differences
        found = turning(scene, path, value, size)
        assert np.array_equal(flat(parts(found)), flat(here)), (kind, path)

        def at(number: float, path: str = path) -> np.ndarray:
            return flat(parts(assemble(scene.replace({path: number}))))

        wanted, own = derivative(at, value, size, flat(here)) * size, flat(slopes(found))
        assert np.abs(own - wanted).max() <= CLOSE * max(1.0, np.abs(wanted).max()), (kind, path)
        compared += 1
    assert compared


@pytest.mark.parametrize(("path", "value"), [("damper.0.friction", 0.0), ("excitation.harmonic.0.amplitude", 0.0)])
def test_what_begins_at_zero_is_a_kink(path, value):
    data = {
        "structure": {"model": "rigid", "mass": 1.0, "stiffness": 4e4, "damping_ratio": 0.01},
        "excitation": {"frequency": 30.0, "force": 1.0, "harmonic": [{"order": 2, "amplitude": 0.5}]},
        "cavity": [{"name": "c", "gap": 1e-4}], "damper": [{"cavity": "c", "mass": 0.1, "friction": 0.1}],
    }  # fmt: skip
    scene = validate(Scene, data, "scene").replace({path: value})
    with pytest.raises(NotSmooth):
        turning(scene, path, value, 1.0)
