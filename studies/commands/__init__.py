"""The commands of the command line: each file of this folder is one, and other packages add theirs.

A command is a module with

    SUMMARY                 what it does, in a line of --help without a full stop
    add_arguments(parser)   declare its arguments (an argparse.ArgumentParser)
    run(arguments)          do it; raise InputError for bad input
    NAME                    if it is not the file's
    ORDER                   place in --help: the steps of the pipeline count up

Import what is heavy inside `run`: `vanedamp --help` loads all commands. What several commands need is in `support/`.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Protocol

from vanedamp.files.extensions import ExtensionPoint


class Command(Protocol):
    """The contract of a command."""

    SUMMARY: str

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Declare the arguments."""

    def run(self, arguments: Namespace) -> None:
        """Check, compute, write, print. Raises InputError."""


COMMANDS = ExtensionPoint(
    "command", "vanedamp.studies.commands", "vanedamp.commands", ("SUMMARY", "add_arguments", "run")
)
