"""Python runs this at its start where the folder is on PYTHONPATH: so commands and workers are perturbed, too."""

import last_bits_imports

last_bits_imports.install()
