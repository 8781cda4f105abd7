"""A process without the modules of optional groups (tests.tools.extras)."""

import sys

from tests.tools.extras import EXTRAS


class _Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in EXTRAS:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


sys.meta_path.insert(0, _Absent())
