"""Python runs this at its start where the folder is on PYTHONPATH: options of the tests reach commands and workers."""

import absent_modules
import last_bits_imports
import slow_clock

absent_modules.install()
last_bits_imports.install()
slow_clock.install()
