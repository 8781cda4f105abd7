"""The base of all errors about input."""


class VanedampError(ValueError):
    """Bad input: a file, an argument or a combination of them that cannot be used.

    Every error class of this project derives from it. The message is one line: what, where, and what would be right.
    Any other exception is a fault of the program.
    """
