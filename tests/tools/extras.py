"""Modules that the product imports from optional groups of pyproject.toml, and processes that do not have them."""

from tests.tools.processes import environment, startup
from tests.tools.startup_path.absent_modules import VARIABLE

#: of the wheel of dolfinx; apt's packages have them one by one
FINITE_ELEMENTS = ("dolfinx", "dolfinx_solver", "petsc4py", "slepc4py", "mpi4py", "ufl", "basix", "ffcx")
#: groups by modules
EXTRAS = dict.fromkeys(FINITE_ELEMENTS, "fem") | {
    "cffi": "fem", "xarray": "notebook", "h5netcdf": "notebook", "dash": "explore", "flask": "explore",
    "werkzeug": "explore", "pyuff": "exchange", "meshlane": "exchange", "pyyeti": "nastran", "pandas": "nastran",
    "tomli_w": "dev", "emcee": None,
}  # fmt: skip


def bare() -> dict[str, str]:
    """Variables of processes, and of their workers, that cannot import the modules."""
    return environment(**startup(), **{VARIABLE: ",".join(EXTRAS)})
