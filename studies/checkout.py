"""Commands of a checkout: the packages `benchmarks` and `paper` are next to `vanedamp` there, and are not installed."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

from vanedamp.files.errors import VanedampError

#: folder that holds the package vanedamp: the root of the repository, or a folder of installed packages
_ROOT = Path(__file__).parents[2]


class CheckoutError(VanedampError):
    """A checkout command is called without a checkout, or would write results into the source."""


class CheckoutCommand(NamedTuple):
    """A command whose arguments and work are in the module `command` of a package at the root of the repository.

    NAME, SUMMARY, ORDER: as studies.commands says. The methods raise CheckoutError where there is no checkout.
    """

    NAME: str
    SUMMARY: str
    ORDER: int
    package: str

    def add_arguments(self, parser: ArgumentParser) -> None:
        """Declare the arguments."""
        self._module().add_arguments(parser)

    def run(self, arguments: Namespace) -> None:
        """Run it. Raises CheckoutError if the output folder is that of the package."""
        if Path(arguments.output).resolve() == (_ROOT / self.package).resolve():
            raise CheckoutError(f"--output {arguments.output}: holds the source of this command; name another folder")
        self._module().run(arguments)

    def _module(self) -> ModuleType:
        if not ((_ROOT / "pyproject.toml").is_file() and (_ROOT / self.package / "command.py").is_file()):
            raise CheckoutError(
                f"this command needs the folder {self.package}/ of the project's repository, which is not installed "
                "with the package; run it in a checkout (there: pip install -e .)"
            )
        if sys.path[0] != str(_ROOT):  # other packages may have the same name
            sys.path.insert(0, str(_ROOT))
        return import_module(f"{self.package}.command")
