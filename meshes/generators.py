"""The meshes by parameters that a case may name, and what builds each: a new one is a line of both."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from vanedamp.meshes import benchmarks, sector, vane_cluster

Generated = Annotated[
    vane_cluster.VaneCluster | benchmarks.TaperedBlock | sector.Sector, Field(discriminator="generator")
]
_BUILD: dict[type, Callable[[Any, str | os.PathLike[str]], Path]] = {
    vane_cluster.VaneCluster: vane_cluster.build,
    benchmarks.TaperedBlock: benchmarks.build,
    sector.Sector: sector.build,
}


def build(parameters: Generated, path: str | os.PathLike[str]) -> Path:
    """Write the mesh. Raises the errors of its own `build`."""
    return _BUILD[type(parameters)](parameters, path)
