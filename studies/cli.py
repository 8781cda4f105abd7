"""The command `vanedamp`: it finds its commands (studies.commands), runs one, and reports errors in one line."""

# PYTHON_ARGCOMPLETE_OK

from __future__ import annotations

import argparse
import contextlib
import gc
import io
import os
import re
import signal
import sys
import threading
import warnings
from collections.abc import Sequence
from typing import NoReturn

from vanedamp.files.errors import VanedampError, shortened
from vanedamp.files.machine import PackageError, not_loaded, out_of_memory
from vanedamp.studies.commands import COMMANDS
from vanedamp.studies.interrupts import swallowed_interrupts_again, terminate_as_interrupt
from vanedamp.studies.terminal import stages_shown

BAD_INPUT = 2
_INTERRUPTED, _TERMINATED = 130, 143
#: of a run; the process then ends with the status of bad input
_NO_MEMORY = -1


class _Version(argparse.Action):
    """Print the version; looked up only here, since this takes time."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(f"vanedamp {version('vanedamp')}")
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """A parser that reports a wrong command line in one line, with the closest valid word."""

    def error(self, message: str) -> NoReturn:
        from vanedamp.files.toml_input import nearest  # heavy, as is all that is not for --help

        if choice := re.search(r"(invalid choice: '?([^',\s]*)'?).*\(choose from (.*)\)", message):
            choices = re.findall(r"[^',\s]+", choice[3])
            message = f"{message[: choice.end(1)]}; {nearest(choice[2], choices)}"
        elif option := re.search(r"unrecognized arguments: (?:[^-]\S* )*(--?\w[\w-]*)", message):
            choices = [name for action in self._actions for name in action.option_strings]
            message += f"; {nearest(option[1], choices)}"
        self.exit(BAD_INPUT, f"{self.prog}: {shortened(message)}; see {self.prog} --help\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line. Returns the exit status: 0; 2 for bad input, or for unavailable files, memory or packages,
    with one line on standard error; 130 when interrupted, 143 when terminated.

    argv: the words after the command's name; None: this process's, whose end is not interrupted any more.
    Under mpirun the first rank runs it, and the others help with the factorisations.
    """
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stdout is None:  # the next opened file would take its descriptor and receive what libraries print
        return _refuse("standard output is closed; send it to a file, or to /dev/null")
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    if argv is None and isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # characters that its encoding does not have
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
    finally:
        _drop_unwritten()
    if status == _NO_MEMORY:
        if argv is None:  # libraries want memory to end, too: OpenBLAS waits for it for ever
            os._exit(BAD_INPUT)
        return BAD_INPUT
    return status


def _complete() -> None:
    """Complete the command line in COMP_LINE for a shell, and exit; return without argcomplete."""
    try:
        import argcomplete
    except ImportError:
        return
    named = set(os.environ.get("COMP_LINE", "").split()) & COMMANDS.own().keys()
    parser, command = _parsers(min(named, default=None))
    for action in command._actions:
        endings = re.findall(r"\.(\w+)", str(action.metavar))
        if endings and not action.choices:
            action.completer = argcomplete.FilesCompleter(endings)  # type: ignore[attr-defined]
    argcomplete.autocomplete(parser)


def _drop_unwritten() -> None:
    """Drop output that cannot be written, such as to a full disk: at exit, the interpreter would try again and
    change the exit status."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _leave() -> None:
    """Prepare the end of the process with interrupts blocked: one at this point would end it without a message."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
    gc.freeze()  # garbage collection would take most of the time until exit after an interrupt
    exec("")  # CPython remembers an interrupt within the last exec, such as of a dataclass, and would end by the signal


def _on_first_rank(words: Sequence[str]) -> int:
    """Run the command line, under mpirun on the first rank only."""
    if not _under_mpi():
        return _run(words)
    try:
        from vanedamp.modal.petsc import ranks
    except PackageError as error:
        return _refuse(str(error))
    with ranks() as first:
        return _run(words) if first else 0


def _run(words: Sequence[str]) -> int:
    input_file = None
    try:
        with warnings.catch_warnings(), swallowed_interrupts_again():
            if not sys.warnoptions:  # of numbers that overflow before the line that rejects them
                warnings.simplefilter("ignore", RuntimeWarning)
            parser, command = _parsers(words[0] if words else None)
            try:
                arguments, unknown = parser.parse_known_args(words)
                if unknown:
                    command.error(f"unrecognized arguments: {' '.join(unknown)}")
            except SystemExit:
                sys.stdout.flush()  # of --help
                raise
            input_file = getattr(arguments, "input", None)
            with stages_shown():
                arguments.run(arguments)
            sys.stdout.flush()
    except BrokenPipeError:  # the reader has closed the pipe
        return 1
    except Exception as error:
        message = _message(error, input_file)
        if message is None:
            raise
        _refuse(message)
        return BAD_INPUT if _lacking(error) is None else _NO_MEMORY
    return 0


def _lacking(error: Exception) -> str | None:
    """Describe the allocation that failed; input that needs too much memory has its own error."""
    return None if isinstance(error, VanedampError) else out_of_memory(error)


def _message(error: Exception, file: str | None) -> str | None:
    """Describe an error of the input (in a file) or a lack of resources; None for a bug in the program."""
    if (lacking := _lacking(error)) is not None:
        return (
            f"not enough memory ({lacking}): free some, raise its limit (ulimit -v), or make the mesh, the model or "
            "the sweep smaller"
        )
    if isinstance(error, OSError):
        where = error.filename or "standard output, or another file"
        return f"{where}: {error.strerror}" if error.strerror else str(error)
    if isinstance(error, ImportError):
        return not_loaded(error)
    if isinstance(error, UnicodeEncodeError) and error.encoding == "utf-8":
        return "the name of a file is not in UTF-8, in which it would be written; rename it, or set LC_ALL=C.UTF-8"
    if not isinstance(error, VanedampError):  # bad input has error classes of our own
        return None
    message = str(error)
    return message if file is None or message.startswith(f"{file}:") else f"{file}: {message}"


def _refuse(message: str) -> int:
    with contextlib.suppress(OSError):  # nowhere to say it
        print("vanedamp: " + shortened(" ".join(message.split())), file=sys.stderr)
    return BAD_INPUT


def _under_mpi() -> bool:
    """Return whether a launcher of Open MPI, MPICH or Intel MPI started several ranks."""
    return any(int(os.environ.get(name, 1)) > 1 for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE"))


def _parsers(name: str | None) -> tuple[_Parser, _Parser]:
    """Return the parser of the command line, with arguments of the named command only, and that command's parser."""
    commands = COMMANDS.own()
    if name not in commands:  # --help, a command of another package, or none at all
        commands = COMMANDS.all()
    parser = _Parser(
        prog="vanedamp", description="Vibration damping of vane clusters by loose bodies in cavities: from a mesh to "
        "forced responses with impacts."
    )  # fmt: skip
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    named, subparsers = parser, parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for command_name, command in commands.items():
        summary = command.SUMMARY
        child = subparsers.add_parser(command_name, help=summary, description=summary[0].upper() + summary[1:] + ".")
        if command_name == name:
            command.add_arguments(child)
            child.set_defaults(run=command.run)
            named = child
    return parser, named
