"""`python -m vanedamp` is the command `vanedamp`."""

# PYTHON_ARGCOMPLETE_OK
import sys

from vanedamp.studies.cli import main

if __name__ == "__main__":
    sys.exit(main())
