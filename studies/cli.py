"""The command `vanedamp`: it finds its commands (studies.commands), runs one, and reports errors in one line."""

from __future__ import annotations

import argparse
import gc
import os
import signal
import sys
import threading
import warnings
from collections.abc import Sequence
from typing import NoReturn

from vanedamp.files.errors import VanedampError, shortened
from vanedamp.studies.commands import COMMANDS
from vanedamp.studies.interrupts import swallowed_interrupts_again, terminate_as_interrupt
from vanedamp.studies.terminal import stages_shown

BAD_INPUT = 2
_INTERRUPTED, _TERMINATED = 130, 143
#: packages of the finite elements, and how to get them
_SYSTEM = ("dolfinx", "petsc4py", "slepc4py", "ufl", "basix", "ffcx", "mpi4py", "cffi")
_FINITE_ELEMENTS = (
    "pip install 'vanedamp[fem]' (Linux on x86-64, Python 3.12 or newer), apt install python3-dolfinx, or "
    "conda's environment.yml (CONTRIBUTING.md)"
)
#: names of packages that differ from their modules'
_ON_PYPI = {"vtkmodules": "vtk", "yaml": "pyyaml"}


class _Version(argparse.Action):
    """Print the version, which takes a while to look up."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(f"vanedamp {version('vanedamp')}")
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """A parser that rejects a wrong command line in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {shortened(message)}; see {self.prog} --help\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line. Returns the exit status: 0; 2 for bad input, or for files, memory or packages that are not
    to be had, with one line on standard error; 130 when interrupted, 143 when terminated.

    argv: the words after the command's name; None: this process's, whose end is not interrupted any more.
    Under mpirun the first rank runs it, and the others help with the factorisations.
    """
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stdout is None:  # a file that is opened would take its place, and what libraries print
        return _refuse("standard output is closed; send it to a file, or to /dev/null")
    terminated = terminate_as_interrupt() if argv is None else []
    try:
        status = _on_first_rank(sys.argv[1:] if argv is None else argv)
        if argv is None:
            _leave()
    except KeyboardInterrupt:
        if argv is None:
            _leave()
        print("vanedamp: terminated" if terminated else "vanedamp: interrupted", file=sys.stderr)
        status = _TERMINATED if terminated else _INTERRUPTED
    return status


def _leave() -> None:
    """Prepare the end of the process, without interrupts: one there would end it without a line."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    gc.freeze()  # collecting what the end of the process frees takes longer than all else after an interrupt
    exec("")  # CPython remembers an interrupt within the last exec, such as of a dataclass, and would end by the signal


def _on_first_rank(words: Sequence[str]) -> int:
    """Run the command line, under mpirun on the first rank only."""
    if not _under_mpi():
        return _run(words)
    from vanedamp.modal.petsc import ranks

    with ranks() as first:
        return _run(words) if first else 0


def _run(words: Sequence[str]) -> int:
    input_file = None
    try:
        with warnings.catch_warnings(), swallowed_interrupts_again():
            if not sys.warnoptions:  # of numbers that overflow before the line that rejects them
                warnings.simplefilter("ignore", RuntimeWarning)
            arguments = _parser(words[0] if words else None).parse_args(words)
            input_file = getattr(arguments, "input", None)
            with stages_shown():
                arguments.run(arguments)
            sys.stdout.flush()
    except BrokenPipeError:  # the reader has closed the pipe
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (ValueError, OSError, ImportError, MemoryError) as error:
        message = _message(error, input_file)
        if message is None:
            raise
        return _refuse(message)
    return 0


def _message(error: Exception, file: str | None) -> str | None:
    """Describe the error of the input (in a file) or the machine's deficiency; None for a fault of the program."""
    if isinstance(error, OSError):
        where = error.filename or "standard output, or another file"
        return f"{where}: {error.strerror}" if error.strerror else str(error)
    if isinstance(error, MemoryError):
        return f"not enough memory ({error or 'none left'}); make it smaller: the mesh, the model or the sweep"
    if isinstance(error, ImportError):
        package = (error.name or "").split(".")[0]
        remedy = _FINITE_ELEMENTS if package in _SYSTEM else f"pip install {_ON_PYPI.get(package, package)}"
        return None if package in ("", "vanedamp") else f"needs {package}, which cannot be loaded ({error}): {remedy}"
    if not isinstance(error, VanedampError):  # bad input has error classes of our own
        return None
    message = str(error)
    return message if file is None or message.startswith(f"{file}:") else f"{file}: {message}"


def _refuse(message: str) -> int:
    print("vanedamp: " + shortened(" ".join(message.split())), file=sys.stderr)
    return BAD_INPUT


def _under_mpi() -> bool:
    """Say whether a launcher of Open MPI, MPICH or Intel MPI started several ranks."""
    return any(int(os.environ.get(name, 1)) > 1 for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE"))


def _parser(name: str | None) -> argparse.ArgumentParser:
    """Return the parser of the command line, with the arguments of the named command only."""
    commands = COMMANDS.own()
    if name not in commands:  # --help, a command of another package, or none at all
        commands = COMMANDS.all()
    parser = _Parser(
        prog="vanedamp", description="Vibration damping of vane clusters by loose bodies in cavities: from a mesh to "
        "forced responses with impacts."
    )  # fmt: skip
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    places = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for other, command in commands.items():
        summary = command.SUMMARY
        place = places.add_parser(other, help=summary, description=summary[0].upper() + summary[1:] + ".")
        if other == name:
            command.add_arguments(place)
            place.set_defaults(run=command.run)
    return parser
