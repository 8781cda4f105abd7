"""What is wrong with a parameter of a mesh."""


class ParameterError(ValueError):
    """A parameter of a mesh that is out of its range or does not fit the others; the message starts with its name."""
