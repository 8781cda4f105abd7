"""Texts of cases and of a scene that many tests vary."""

import math

from vanedamp.meshes.vane_cluster import SHIPPED

#: a clamped block of two by one by six elements
BLOCK = """
[mesh]
generator = "block"
length = 0.1
width = 0.02
thickness = 0.01
divisions = [6, 2, 1]
[material.default]
young = 2e11
poisson = 0.3
density = 8000.0
[support]
clamped = ["root"]
[modes]
count = 6
direction = [0, 0, 1]
[interface.tip]
facets = "tip"
direction = [0, 0, 1]
"""


def changed(text: str, *changes: tuple[str, str]) -> str:
    """The text with parts of it, each there once, replaced."""
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    return text


#: with damping, fatigue strength and a second interface
DAMPED_BLOCK = (
    changed(
        BLOCK,
        ("density = 8000.0", "density = 8000.0\ndamping_ratio = 0.01\nfatigue_strength = 4e8"),
        ("count = 6\ndirection = [0, 0, 1]", 'count = 4\ndirection = [0, 0, 1]\nat = "tip"'),
    )
    + """[interface.top]
facets = "top"
direction = [0, 0, 1]
"""
)

#: the shipped vane cluster
CLUSTER = f"""
[mesh]
file = "{SHIPPED}"
degree = 2
[material.default]
young = 2e11
poisson = 0.3
density = 8190.0
damping_ratio = 0.002
[support]
clamped = ["clamp"]
[modes]
count = 10
direction = [0, 1, 0]
[interface.c1]
facets = "c1_floor"
direction = [0, 1, 0]
"""
#: an oscillator with one body, and a sweep of four frequencies around its resonance
SCENE = """
[structure]
model = "rigid"
mass = 1.0
stiffness = 1e4
damping_ratio = 0.01
[excitation]
frequency = 15.9
resonance_amplitude = 1e-3
[[cavity]]
name = "c1"
gap = 2e-4
[[damper]]
cavity = "c1"
mass = 0.05
friction = 0.3
restitution = 0.6
[time]
periods = 90
transient = 80
[sweep]
"excitation.frequency" = {start = 15.4, stop = 16.2, num = 4}
"""


#: an oscillator like it as tables, in resonance, in a short run from its start; its natural frequency, Hz
RESONANCE = 100.0 / (2 * math.pi)
OSCILLATOR = {
    "structure": {"model": "rigid", "mass": 1.0, "stiffness": 1e4, "damping_ratio": 0.01},
    "excitation": {"frequency": RESONANCE, "resonance_amplitude": 1e-3},
    "cavity": [{"name": "c1", "gap": 2e-4}],
    "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.1, "restitution": 0.6}],
    "time": {"periods": 20, "transient": 0},
}


def rom_scene(file: str, at: str = "tip") -> str:
    """The scene on a reduced model, whose coordinate "tip" carries the cavity."""
    return changed(
        SCENE,
        ('"rigid"\nmass = 1.0\nstiffness = 1e4\ndamping_ratio = 0.01', f'"rom"\nfile = "{file}"'),
        ("frequency = 15.9", f'frequency = 15.9\nat = "{at}"'),
        ("gap", 'floor = "tip"\ngap'),
    )
