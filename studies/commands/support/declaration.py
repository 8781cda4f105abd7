"""Declaration of a command: arguments, inputs, outputs, and its function, which is loaded last,

so that errors of the user are reported before heavy packages are imported, and `--help` loads none of them.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from vanedamp.files.errors import VanedampError

#: an argument: a function that declares it to a parser
Argument = Callable[[ArgumentParser], object]


def argument(*names: str, **options: Any) -> Argument:
    """Return an argument of one command, as `ArgumentParser.add_argument` takes it."""
    return lambda parser: parser.add_argument(*names, **options)


@dataclass(frozen=True)
class Function:
    """A function or class module:name below studies.commands, which is imported when it is called."""

    place: str
    below: str = "commands"

    def load(self) -> Callable[..., Any]:
        """Return the function."""
        module, _, name = self.place.partition(":")
        loaded: Callable[..., Any] = getattr(import_module(f"vanedamp.studies.{self.below}.{module}"), name)
        return loaded

    def __call__(self, *arguments: Any) -> Any:
        """Call it."""
        return self.load()(*arguments)


@dataclass(frozen=True)
class Command:
    """A command of our own.

    NAME, SUMMARY, ORDER  as for all commands (`studies.commands`)
    arguments             in the order of --help
    writes                files of options, each with the endings that they may have: checked before anything is read;
                          None: the work checks
    checkpoint            whether the result has a checkpoint, from which `--resume` continues
    reads                 a function of the arguments that loads and checks the input, before the work is loaded
    takes                 kinds of its input files, by their names in `studies.file_kinds`
    module                its function `run` takes the arguments and what `reads` returns; "": the module NAME
    job                   instead of it the class of a job, module:name below studies.jobs
    """

    NAME: str
    SUMMARY: str
    ORDER: int
    arguments: Sequence[Argument]
    writes: Mapping[str, tuple[str, ...]] | None = field(default_factory=dict)
    checkpoint: bool = False
    reads: Callable[[Namespace], Any] | None = None
    module: str = ""
    job: str = ""
    takes: tuple[str, ...] = ()

    @property
    def work(self) -> Function:
        """The function that does the work, or the class of its job."""
        return Function(self.job, "jobs") if self.job else Function(f"{self.module or self.NAME}:run")

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Declare the arguments."""
        for add in self.arguments:
            add(parser)

    def run(self, arguments: Namespace) -> None:
        """Check the files, read the input, and do the work. Raises InputError.

        The arguments get `outputs`, the files that are written, and `checkpoint`, one of them or None.
        """
        if self.writes is not None:
            Function("support.outputs:prepare")(arguments, self.writes, self.checkpoint)
        try:
            inputs = () if self.reads is None else (self.reads(arguments),)
            if self.job:
                Function("support.jobs:run")(arguments, self.work.load(), *inputs)
            else:
                self.work(arguments, *inputs)
        except VanedampError:
            self._refuse_other_kinds(arguments)
            raise

    def _refuse_other_kinds(self, arguments: Namespace) -> None:
        """Raise InputError for an input file that another command takes."""
        from vanedamp.files.toml_input import InputError
        from vanedamp.studies.file_kinds import another_kind, expected

        paths = [getattr(arguments, name, None) for name in ("input", "pipeline")]
        for path in filter(None, (*paths, *getattr(arguments, "inputs", ()))) if self.takes else ():
            if kind := another_kind(path, self.takes):
                raise InputError(f"{path}: {kind}; `vanedamp {self.NAME}` takes {expected(self.takes)}") from None
