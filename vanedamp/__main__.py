"""`python -m vanedamp` is the command `vanedamp`."""

import sys

from vanedamp.studies.cli import main

if __name__ == "__main__":
    sys.exit(main())
