"""The command `vanedamp`: mesh, modal, calibrate, matrices, reduce, import, run, sweep, optimise, paper, report ..."""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from vanedamp.files.errors import VanedampError
from vanedamp.studies.interrupts import swallowed_interrupts_again

BAD_INPUT = 2
_INTERRUPTED = 130
#: hot spots are 2 % of the structure's size apart, and each is six outputs of the model
_MOST_SPOTS = 1000
#: packages that come with the system, and how to get them
_SYSTEM = ("dolfinx", "petsc4py", "slepc4py", "ufl", "basix", "ffcx", "mpi4py")
_FINITE_ELEMENTS = "apt install python3-dolfinx, or conda's environment.yml (CONTRIBUTING.md)"
#: names of packages that are not those of their modules
_ON_PYPI = {"vtkmodules": "vtk", "yaml": "pyyaml"}


class _Parser(argparse.ArgumentParser):
    """One line for a wrong command line, too."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message}; see {self.prog} --help\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line. Returns the exit status: 0; 2 for bad input, or for files, memory or packages that are not
    to be had, told in one line on standard error; 130 when interrupted.

    Under mpirun the first rank runs it, and the others help with the factorisations.
    """
    try:
        with swallowed_interrupts_again():
            if not _under_mpi():
                return _main(argv)
            from vanedamp.modal.petsc import ranks

            with ranks() as first:
                return _main(argv) if first else 0
    except KeyboardInterrupt:
        print("vanedamp: interrupted", file=sys.stderr)
        return _INTERRUPTED


def _main(argv: Sequence[str] | None) -> int:
    arguments = _parser().parse_args(argv)
    try:
        from vanedamp.studies.commands import all as commands  # what each command needs is loaded when it is wanted

        getattr(commands, "import_model" if arguments.command == "import" else arguments.command)(arguments)
        sys.stdout.flush()
    except BrokenPipeError:  # nobody reads on
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ValueError, OSError, ImportError, MemoryError) as error:
        told = _told(error, getattr(arguments, "input", None))
        if told is None:
            raise
        return _refuse(told)
    return 0


def _told(error: Exception, file: str | None) -> str | None:
    """What to say about bad input (in a file) and about what the machine lacks; None for a fault of the program."""
    if isinstance(error, OSError):
        where = error.filename or "standard output, or another file"
        return f"{where}: {error.strerror}" if error.strerror else str(error)
    if isinstance(error, MemoryError):
        return f"not enough memory ({error or 'none left'}); make it smaller: the mesh, the model or the sweep"
    if isinstance(error, ImportError):
        package = (error.name or "").split(".")[0]
        remedy = _FINITE_ELEMENTS if package in _SYSTEM else f"pip install {_ON_PYPI.get(package, package)}"
        return None if package in ("", "vanedamp") else f"needs {package}, which cannot be loaded ({error}): {remedy}"
    # bad input has error classes of our own; any other ValueError is a fault of the program
    return _located(str(error), file) if isinstance(error, VanedampError) else None


def _refuse(message: str) -> int:
    print("vanedamp: " + " ".join(message.split()), file=sys.stderr)
    return BAD_INPUT


def _located(message: str, file: str | None) -> str:
    """The message with the input file in front, unless it says so itself."""
    return message if file is None or message.startswith(f"{file}:") else f"{file}: {message}"


def _under_mpi() -> bool:
    """Whether a launcher of Open MPI, MPICH or Intel MPI started several ranks."""
    return any(int(os.environ.get(name, 1)) > 1 for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE"))


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="vanedamp", description="Vibration damping of vane clusters by loose bodies in cavities: from a mesh to "
        "forced responses with impacts."
    )  # fmt: skip
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def command(name: str, summary: str, source: str | None, output: str, required: bool = False) -> _Parser:
        made: _Parser = commands.add_parser(name, help=summary, description=summary[0].upper() + summary[1:] + ".")
        if source is not None:
            made.add_argument("input", metavar=source, help="input file, SI units")
        made.add_argument("-o", "--output", metavar=output, required=required, help="result file")
        return made

    def with_json(made: _Parser) -> _Parser:
        made.add_argument(
            "--json", metavar="FILE", help="the result for machines; - writes it to standard output and nothing else"
        )
        return made

    command("mesh", "write the mesh of a case that names a generator", "CASE.toml", "MESH.msh", required=True)

    modal = with_json(
        command(
            "modal", "natural frequencies, effective masses, rigid model of the first bending", "CASE.toml", "MODES.h5"
        )
    )
    modal.add_argument("--vtk", metavar="FILE.vtu", help="the mode shapes for ParaView (.vtu or .vtk)")

    with_json(
        command(
            "calibrate",
            "tune to measurements; rigid model, damping ratio and excitation",
            "CASE.toml",
            "CALIBRATION.h5",
        )
    )

    command(
        "matrices", "stiffness, mass, nodes and sets for other codes (Matrix Market, CSV)", "CASE.toml", "DIR",
        required=True,
    )  # fmt: skip

    reduce = with_json(command("reduce", "reduced model at the case's interface", "CASE.toml", "ROM.h5"))
    reduce.add_argument(
        "--modes", type=_modes, default=12, metavar="N|auto",
        help="modes to keep, or as few as the tolerance needs (default: %(default)s)",
    )  # fmt: skip
    reduce.add_argument(
        "--basis", default="craig-bampton", metavar="BASIS",
        help="craig-bampton (default), rubin, macneal, massless or truncated",
    )  # fmt: skip
    reduce.add_argument(
        "--tolerance", type=_ratio, default=0.01, metavar="R", help="error of --modes auto (default: %(default)s)"
    )
    reduce.add_argument(
        "--max-frequency", type=_hertz, metavar="HZ",
        help="up to which the error is estimated (default: 1.5 times the first natural frequency)",
    )  # fmt: skip

    reduce.add_argument(
        "--hot-spots", type=_spots, default=0, metavar="N",
        help="keep the stresses at the N most stressed places of the first mode as outputs",
    )  # fmt: skip

    with_json(
        command("import", "reduced model of another code: dense matrices with a meaning", "EXTERNAL.toml", "ROM.h5")
    )

    run = with_json(command("run", "one scene at one excitation frequency", "SCENE.toml", "RESPONSE.h5"))
    run.add_argument("--events", action="store_true", help="keep the list of events")
    run.add_argument("--samples", type=_count, default=0, metavar="N", help="keep N samples of every period")

    sweep = with_json(command("sweep", "a run at every point of the scene's [sweep] grid", "SCENE.toml", "SWEEP.h5"))
    sweep.add_argument("--workers", type=_some, metavar="N", help="processes (default: one for every core)")
    sweep.add_argument(
        "--resume", action="store_true",
        help="go on where the sweep was killed, or fail; without it, it goes on if it can and begins if it must",
    )  # fmt: skip

    optimise = with_json(
        command("optimise", "mass, gap and number of bodies that reduce most", "STUDY.toml", "OPTIMUM.h5")
    )
    optimise.add_argument("--workers", type=_some, metavar="N", help="processes (default: one for every core)")

    report = command("report", "one HTML page of results", None, "REPORT.html", required=True)
    report.add_argument(
        "inputs",
        nargs="+",
        metavar="DIR|FILE",
        help="results of modal, reduce, run and sweep (.h5), studies (.claims.json)",
    )

    paper = command("paper", "the paper's figures as studies, each claim with a verdict", None, "DIR", required=True)
    paper.add_argument("studies", nargs="*", metavar="STUDY", help="fig9 ... systems (default: all; docs/paper.md)")
    paper.add_argument("--workers", type=_some, metavar="N", help="processes (default: one for every core)")
    paper.add_argument("--resume", action="store_true", help="take over what the folder has of the same scenes")

    demo = command("demo", "the whole pipeline on the shipped mesh", None, "DIR")
    demo.set_defaults(output="out")
    demo.add_argument("--workers", type=_some, metavar="N", help="processes (default: one for every core)")

    bench = command("bench", "how fast and how exact the methods are, measured here", None, "DIR", required=True)
    bench.add_argument(
        "study", choices=("engine", "modal", "sweep", "ladder", "work-precision", "stability"),
        help="engine: the exact engine against a hand-written loop and solve_ivp; modal: time and memory of ten modes "
        "beside scipy's solvers; sweep: time and memory of sweeps of up to 100 000 scenes; ladder: contact laws and "
        "numbers of modes of reduced models, and their choice; work-precision: speed against accuracy of all methods; "
        "stability: where methods fail",
    )  # fmt: skip
    bench.add_argument("--quick", action="store_true", help="seconds instead of minutes, and rougher figures")
    return parser


def _count(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"expected a count, not {text!r}")
    return int(text)


def _spots(text: str) -> int:
    if _count(text) > _MOST_SPOTS:
        raise argparse.ArgumentTypeError(f"expected at most {_MOST_SPOTS}, not {text}")
    return int(text)


def _modes(text: str) -> int | None:
    return None if text == "auto" else _count(text)


def _ratio(text: str) -> float:
    return _number(text, "a number between 0 and 1", lambda value: 0.0 < value < 1.0)


def _hertz(text: str) -> float:
    return _number(text, "a frequency in Hz", lambda value: 0.0 < value < math.inf)


def _number(text: str, expected: str, fits: Callable[[float], bool]) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not fits(value):
        raise argparse.ArgumentTypeError(f"expected {expected}, not {text!r}")
    return value


def _some(text: str) -> int:
    if _count(text) == 0:
        raise argparse.ArgumentTypeError("expected at least 1")
    return int(text)
