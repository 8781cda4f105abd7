"""A small case that many tests vary: a clamped block of two by one by six elements."""

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
    """The text of a case with parts of it, each there once, replaced."""
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
