"""The values of `solver.method`, each a way to run a scene; coupling.scene.solver_options names their modules.

A method is a module, or any object, with the attributes of the protocol `Method`, loaded for a scene that names it.
Another package adds one by an entry point, whose name is the value of `solver.method`:

    [project.entry-points."vanedamp.methods"]
    leapfrog = "acme.leapfrog"
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

if TYPE_CHECKING:
    from vanedamp.coupling.response.evaluation import Run
    from vanedamp.coupling.response.records import Records
    from vanedamp.coupling.response.restart_state import RestartState
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.coupling.scene.solver_options import SolverOptions
    from vanedamp.coupling.system.system import System


class Variant(NamedTuple):
    """A method with some of its options, as a line of a chart of methods.

    label, colour, marker: of the line, as matplotlib has them; options: of the [solver] table, without the method;
    setting: the option that changes along the line, None for a single point; tolerance: whether it is a tolerance, not
    a number of steps.
    """

    label: str
    colour: str
    marker: str
    options: Mapping[str, Any] = {}
    setting: str | None = "steps_per_period"
    tolerance: bool = False


class Method(Protocol):
    """The contract of a method.

    It may also have RESTARTS = True: its runs leave a state that others can begin with. And WAVEFORMS = True: it takes
    an excitation that is no sum of the system's harmonics, whose loads (k, N), N, at angles omega t (k,) in [0, 2 pi),
    system.assembly.loads_of returns, instead of the system's. Other methods reject such an excitation.

    A method that takes planar bodies has PLANAR_LAWS: what it accepts there apart from rigid contacts of one
    restitution, "yields", springs; "two_phases", Poisson's law; "depends_on_speed". It may have RUBBING_WARNING, a
    sentence that every run of such bodies with friction carries, and run_warnings, which yields sentences that every
    run of a scene without open choices carries.

    COURSES = True: it writes down the course of the outputs that are asked for (response.records).

    SOFT_WALLS = True: rigid walls are springs in it, and results in which bodies are deep in them carry a warning.
    """

    Options: type[SolverOptions]
    VARIANTS: Sequence[Variant]

    def begin(self, scene: Scene, system: System, records: Records, events: bool, start: RestartState) -> Run:
        """Return a run of a scene at time zero; `scene.solver` is an instance of Options.

        system: of the scene; a method for bodies that only slide may take its rows (line_system). records: storage
        for all periods, to be filled (response.recorder); events: whether to keep a log of them. start: where the run
        begins, of the scene or of another run; response.restart.motion_of has its coordinates. Raises InputError for an
        impossible scene.
        """
