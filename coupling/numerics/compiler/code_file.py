"""Machine code of compiled functions on disk: damaged code is compiled again.

numba replaces its files one by one, the index before the code, and does not force them to the disk. After a loss of
power they may be empty or cut, hold zeros instead of code, or an index may name the code of another version. numba
runs what it finds.
"""

from __future__ import annotations

import hashlib
import pickle
from typing import Any

from numba.core.caching import IndexDataCacheFile
from numba.core.serialize import dumps


class CodeFile(IndexDataCacheFile):
    """numba's files of a function, an index and its code, with a digest of the code and of its sources."""

    def load(self, key: Any) -> Any:
        """Return the code kept for a key; None without, or none that can be trusted."""
        try:
            digest, code = super().load(key)
            return pickle.loads(code) if digest == self._digest(key, code) else None
        except Exception:  # whatever a damaged file leads to
            return None

    def save(self, key: Any, data: Any) -> None:
        """Keep code, instead of what cannot be read. Raises OSError, such as for a full disk."""
        code = dumps(data)
        super().save(key, (self._digest(key, code), code))

    def _digest(self, key: Any, code: bytes) -> bytes:
        return hashlib.sha256(f"{self._source_stamp} {key!r} ".encode() + code).digest()

    def _load_index(self) -> dict[Any, Any]:
        """Return the names of the data files by key; none for an index that cannot be read.

        It may be damaged, or name records that another version of this package had.
        """
        try:
            return dict(super()._load_index())
        except Exception:
            return {}
