"""The error of matrix files."""

from __future__ import annotations

from vanedamp.files.errors import VanedampError


class MatrixFileError(VanedampError):
    """A file that holds no readable matrix; the message says where and why."""
