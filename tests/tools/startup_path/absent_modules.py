"""Processes that cannot import some modules, whose names, with commas between them, the environment holds."""

import os
import sys

VARIABLE = "VANEDAMP_ABSENT_MODULES"


class _Absent:
    def __init__(self, names):
        self._names = names

    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in self._names:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


def install() -> None:
    """Refuse the modules from now on."""
    if names := os.environ.get(VARIABLE):
        sys.meta_path.insert(0, _Absent(set(names.split(","))))
