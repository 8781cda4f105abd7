"""The commands of the command line: `declarations` lists ours, and other packages add theirs.

A command is a module, or an object, with

    SUMMARY                 what it does, in a line of --help without a full stop
    add_arguments(parser)   declare its arguments (an argparse.ArgumentParser)
    run(arguments)          check, compute, write, print; raise InputError for bad input
    NAME                    if it is not the file's
    ORDER                   place in --help: the steps of the pipeline count up

Our own are of `support.declaration.Command`: arguments, input, output, and the name of the function that runs. Each
has a file in this folder, which is imported when the command runs. `support/` has code for several commands.
"""

from __future__ import annotations

from vanedamp.files.extensions import ExtensionPoint

COMMANDS = ExtensionPoint(
    "command", "vanedamp.studies.commands.declarations", "vanedamp.commands", ("SUMMARY", "add_arguments", "run")
)
