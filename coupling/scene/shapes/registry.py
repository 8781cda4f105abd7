"""The shapes that `damper.shape` may name: ours, and those that other code registers.

An installed package adds one, a class derived from Shape, without a call, in its pyproject.toml:

    [project.entry-points."vanedamp.shapes"]
    hexagon = "acme.hexagon:Hexagon"
"""

from __future__ import annotations

from vanedamp.files.extensions import Registry

_SHAPES = "vanedamp.coupling.scene.shapes"
#: the values of `damper.shape`
SHAPES = Registry(
    "shape",
    {
        "slider": f"{_SHAPES}.slider:Slider",
        "block": f"{_SHAPES}.block:Block",
        "disc": f"{_SHAPES}.disc:Disc",
        "auto": f"{_SHAPES}.slider:Open",
    },
    "vanedamp.shapes",
    ("extended", "corners", "points"),
)
#: adds a shape, by its name and class
register = SHAPES.register
