"""Matrices in the files of other programs: a file for each format; `registry` chooses the reader by the ending."""

from __future__ import annotations

from vanedamp.files.errors import VanedampError


class MatrixFileError(VanedampError):
    """A file that holds no readable matrix; the message says where and why."""
