"""Tables of quantities, from the code: `{quantities}`, what each is; `{quantities-by-kind}`, which results have it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx

from docs._ext.toml_keys import table_node, with_literals
from vanedamp.coupling.quantities.quantity import FAMILIES, Quantity, family

#: results with quantities, and where it is said what they lack, and why, by what a quantity needs or its dimension
KINDS = {
    "run": "vanedamp.coupling.response.response:NOT_IN_RUNS",
    "sweep": "vanedamp.coupling.sweep.row:NOT_IN_SWEEPS",
    "ensemble": "vanedamp.coupling.ensembles.record:NOT_IN_ENSEMBLES",
    "orbit, branch": "vanedamp.coupling.orbits.orbit_quantities:NOT_IN_ORBITS",
    "border": "vanedamp.coupling.orbits.orbit_quantities:NOT_IN_BORDERS",
    "ramp": "vanedamp.coupling.transients.no_meaning:NOT_IN_RAMPS",
    "ring-down": "vanedamp.coupling.transients.no_meaning:NOT_IN_RING_DOWNS",
    "derivative": "vanedamp.coupling.sensitivity.sensitivity_record:NOT_IN_DERIVATIVES",
}


def lacks(kind: str) -> Mapping[str, str]:
    """Return what a kind of result lacks, and why."""
    module, name = KINDS[kind].split(":")
    found: Mapping[str, str] = getattr(import_module(module), name)
    return found


def reason(one: Quantity, kind: str) -> str | None:
    """Return why a kind of result does not have a quantity; None: it has."""
    return one.lacking(lacks(kind))


class Quantities(Directive):
    """`{quantities}`: all quantities, family by family."""

    def run(self) -> list[nodes.Node]:
        rows = [
            [[nodes.literal("", one.name)], [nodes.Text(", ".join(one.dims))],
             [nodes.Text("" if one.unit == "1" else one.unit)], with_literals(one.about)]
            for one in _in_order()
        ]  # fmt: skip
        return [table_node(("Quantity", "Dimensions", "Unit", "Meaning"), rows, (25, 15, 10, 50))]


class ByKind(Directive):
    """`{quantities-by-kind}`: which results have which quantities; a number says why one has not."""

    def run(self) -> list[nodes.Node]:
        reasons = dict[str, int]()
        rows = []
        for one in _in_order():
            cells = [[nodes.literal("", one.name)]]
            for kind in KINDS:
                why = reason(one, kind)
                number = None if why is None else reasons.setdefault(why, len(reasons) + 1)
                cells.append([nodes.Text("yes" if number is None else f"({number})")])
            rows.append(cells)
        listed = nodes.enumerated_list(enumtype="arabic", prefix="(", suffix=")")
        listed += [nodes.list_item("", nodes.paragraph("", "", *with_literals(why))) for why in reasons]
        widths = (28, *(72 // len(KINDS) for _ in KINDS))
        return [table_node(("Quantity", *KINDS), rows, widths), listed]


def _in_order() -> Iterator[Quantity]:
    for name in FAMILIES.all():
        yield from family(name)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_directive("quantities", Quantities)
    app.add_directive("quantities-by-kind", ByKind)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
