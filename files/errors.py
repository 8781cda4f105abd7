"""The base of all errors about input."""

import re

#: no quantity is larger, in any units, and none that must not be zero is smaller than its inverse: their products and
#: squares are numbers, too
LARGEST = 1e40
#: characters of a word, and of a message: no name of a file is longer
_WORD, _MESSAGE = 500, 4000


class VanedampError(ValueError):
    """Bad input: a file, an argument or a combination of them that cannot be used.

    Base of all error classes of this project. The message is one line: the fault, its place, and the remedy.
    Any other exception is a fault of the program.
    """

    def __str__(self) -> str:
        return shortened(super().__str__())


def shortened(message: str) -> str:
    """Return a message with its long words, such as a key of a damaged file, cut in the middle, and not too long."""
    text = re.sub(rf"\S{{{_WORD},}}", lambda match: _cut(match[0], _WORD), message)
    return _cut(text, _MESSAGE)


def _cut(text: str, length: int) -> str:
    return text if len(text) <= length else f"{text[: length // 2]}...{text[-length // 2 :]}"
