"""What is wrong with a parameter of a mesh."""


class ParameterError(ValueError):
    """A parameter of a mesh that is out of its range or does not fit the others; the message starts with its name."""


#: a machine with 100 GB of memory factorises as many; most models have some ten thousand
MOST_ELEMENTS = 5_000_000
#: tetrahedra of gmsh in a volume of the cube of their size: 7.2 in the shipped cluster
_PER_CUBE = 7.0


def check_elements(count: float, name: str) -> None:
    """Raise ParameterError for more elements than a machine can take."""
    if count > MOST_ELEMENTS:
        raise ParameterError(f"{name}: about {count:.2g} elements; at most {MOST_ELEMENTS:.2g}")


def check_size(size: float, volume: float) -> None:
    """Raise ParameterError for an element size (m) so small that a volume (m^3) has too many elements."""
    count = _PER_CUBE * volume / size / size / size
    if count > MOST_ELEMENTS:
        least = (_PER_CUBE * volume / MOST_ELEMENTS) ** (1 / 3)
        raise ParameterError(
            f"element_size: {size:g} m makes about {count:.2g} elements; at most {MOST_ELEMENTS:.2g}, of {least:.2g} m"
        )
