"""`vanedamp export`: a result in the file of another program."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vanedamp.studies.commands.support.arguments import output_file
from vanedamp.studies.commands.support.messages import print_warnings
from vanedamp.studies.commands.support.outputs import check_outputs
from vanedamp.studies.export.export import FORMATS, INPUT, OUTPUT, Option, format_of, write
from vanedamp.studies.export.record import read_record


def add_arguments(parser: ArgumentParser) -> None:
    """Take a result, the file whose ending names the format, and the options of all formats."""
    parser.add_argument("input", metavar="RESULT.h5", help="result of a command")
    formats = FORMATS.all().values()
    endings = "; ".join(f"{' or '.join(module.ENDINGS)}: {module.SUMMARY}" for module in formats)
    output_file("FILE", required=True)(parser)
    parser.epilog = f"The format follows the ending of FILE. {endings}."
    for option in _options():
        parser.add_argument(
            f"--{option.name.replace('_', '-')}", dest=option.name, type=option.type, nargs=option.count,
            metavar=option.metavar, help=option.help,
        )  # fmt: skip


def run(arguments: Namespace) -> None:
    """Write the file."""
    named = {option.name: option for option in _options()}
    options = {name: getattr(arguments, name) for name in named if getattr(arguments, name) is not None}
    endings = {name: option.endings for name, option in named.items() if option.role == OUTPUT}
    outputs = check_outputs(arguments, None, **endings)
    outputs.keep(options[name] for name, option in named.items() if option.role == INPUT and name in options)
    chosen = format_of(arguments.output)
    warnings = write(read_record(arguments.input), chosen, arguments.output, options)
    print_warnings(arguments.input, warnings)
    print(f"{arguments.output}: {chosen.SUMMARY}")


def _options() -> list[Option]:
    """Return the options of all formats, each once."""
    return list({option.name: option for module in FORMATS.all().values() for option in module.OPTIONS}.values())
