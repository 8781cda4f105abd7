"""Other programs on the same scenes: SUNDIALS CVODE, heyoka, Exudyn and Siconos, each if it is installed.

A peer takes a scene, periods and its setting (a tolerance, or steps a period) and returns a PeerRun. What it cannot
express, or that it is not installed, it says by an InputError, which charts and tables pass on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import NamedTuple

import numpy as np

from benchmarks.methods.scenes import charted
from vanedamp.coupling.methods.time_stepping import TimeGrid, time_grid
from vanedamp.coupling.response.response import Status
from vanedamp.coupling.response.restart import motion_of, start_of
from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.assembly import Coordinates, assemble
from vanedamp.coupling.system.line_system import LineSystem, line_system
from vanedamp.files.toml_input import InputError

#: share of the free travel by which a body may overlap a wall, as for our methods
DEEPEST = 0.1


@dataclass(frozen=True)
class PeerRun:
    """The result of a peer.

    status: words of coupling.response.response.Status; peak (periods,): largest |x|, m; samples (k, 1 + b):
    displacement and slips at equidistant times, m; penetration relative to the free travel; seconds: CPU time of the
    steps, no set-up.
    """

    status: str
    peak: np.ndarray
    samples: np.ndarray
    penetration: float
    seconds: float


class Peer(NamedTuple):
    """A program: module of studies, what to import, how to get it, whether its setting is a tolerance (or steps).

    colour, marker: of its line in charts; planar: whether its set-up takes a planar body; compiled: whether its
    equations are, though its setting is a tolerance: its runs are as long as those by steps.
    """

    module: str
    needs: str
    remedy: str
    tolerance: bool
    colour: str
    marker: str
    planar: bool = False
    compiled: bool = False


PEERS = {
    "SUNDIALS CVODE": Peer("peer_cvode", "sksundae", "pip install vanedamp[peers]", True, "#111827", "P"),
    # its metadata asks for numpy 2, which Debian 12's dolfinx does not bear; it runs with numpy 1 as well
    "heyoka": Peer(
        "peer_heyoka", "heyoka", "pip install --no-deps heyoka cloudpickle certifi", True, "#c026d3", "H", compiled=True
    ),
    "Exudyn": Peer("peer_exudyn", "exudyn", "pip install vanedamp[peers]", False, "#64748b", "X"),
    "Siconos": Peer(
        "peer_siconos", "siconos.kernel", "apt install python3-siconos", False, "#dc2626", "h", planar=True
    ),
}


def styles() -> dict[str, tuple[str, str]]:
    """Return the colour and marker of every method and peer, by its label: the same in all charts."""
    ours = {label: (variant.colour, variant.marker) for label, (_, variant) in charted().items()}
    return ours | {name: (peer.colour, peer.marker) for name, peer in PEERS.items()}


def version(name: str) -> str | None:
    """Return the version of a peer, None where it is not installed."""
    try:
        return str(getattr(import_module(PEERS[name].needs), "__version__", "unknown"))
    except ImportError:
        return None


def settings_of_peers(steps: Sequence[float], tolerances: Sequence[float]) -> list[tuple[str, float]]:
    """Return every peer with each of its settings."""
    return [
        (name, float(setting)) for name, peer in PEERS.items() for setting in (tolerances if peer.tolerance else steps)
    ]


def run_peer(name: str, scene: Scene, periods: int, setting: float, samples: int = 0) -> PeerRun:
    """Run a scene over a number of periods, with samples of each.

    Raises InputError where the peer is not installed or cannot express the scene.
    """
    peer = PEERS[name]
    if scene.planar and not peer.planar:
        raise InputError(f"{name}: this set-up takes sliders without springs only")
    if version(name) is None:
        raise InputError(f"{name}: not installed; {peer.remedy}")
    run: Callable[[Scene, int, float, int], PeerRun] = import_module(f"benchmarks.methods.{peer.module}").run
    return run(scene, periods, setting, samples)


class Coupled(NamedTuple):
    """A scene as M q'' + C q' + K q = loads + J^T lambda, the steps of a period, and its state at time zero."""

    system: LineSystem
    times: TimeGrid
    motion: Coordinates


def one_restitution(name: str, scene: Scene) -> None:
    """Refuse, for a peer, a law whose restitution depends on the speed or is one of impulses. Raises InputError."""
    if scene.contact.depends_on_speed:
        raise InputError(
            f"{name}: contact.law {scene.contact.law} has another restitution at every speed; its contacts have one"
        )
    if scene.contact.two_phases:
        raise InputError(f"{name}: contact.law {scene.contact.law} has impacts of two phases; its contacts have one")


def coupled(scene: Scene, steps: int) -> Coupled:
    """Return the matrices of our own stepping methods, with the given number of steps a period."""
    whole = assemble(scene)
    system, motion = line_system(whole), motion_of(whole, start_of(scene, whole))
    travel, size = np.where(np.isinf(system.spring), system.play, np.inf), len(system.mass)
    times = time_grid(scene, whole, steps)._replace(travel=travel)
    return Coupled(system, times, Coordinates(motion.q[:size], motion.v[:size]))


def tracked(equations: Coupled, q: np.ndarray, samples: int, seconds: float) -> PeerRun:
    """Return the result of a run of equal steps. q: (periods * steps + 1, N) coordinates at the steps."""
    system, times, steps = equations.system, equations.times, len(equations.times.phase) - 1
    periods = (len(q) - 1) // steps
    x = q[:-1] @ system.response + np.tile(times.table[:-1, 0], periods)
    every = np.arange(0, periods * steps, steps // samples) if samples else np.zeros(0, int)
    slips = q[every] @ system.J[: system.bodies].T
    gaps = system.J @ q.T + system.rest[:, None]
    # no number is deeper than any
    deep = float(np.nan_to_num((-gaps / times.travel[:, None]).max(initial=0.0), nan=np.inf))
    status = Status.OK if deep <= DEEPEST else Status.PENETRATION
    if not np.isfinite(q).all():
        status = Status.DIVERGED
    return PeerRun(
        status.value, np.abs(x).reshape(periods, steps).max(axis=1), np.column_stack([x[every], slips]), deep, seconds
    )
