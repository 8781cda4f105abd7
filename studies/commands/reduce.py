"""`vanedamp reduce`: a reduced model at the case's interface, with an estimate of its error."""

from __future__ import annotations

import time
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from functools import partial
from typing import TYPE_CHECKING

from vanedamp.studies.commands.support.arguments import add_input, add_json, add_output, count, hertz, ratio

if TYPE_CHECKING:
    from vanedamp.rom.reduced import ReducedModel

ORDER = 50
SUMMARY = "reduced model at the case's interface"
#: hot spots are 2 % of the structure's size apart, and each is six outputs of the model
_MOST_SPOTS = 1000


def add_arguments(parser: ArgumentParser) -> None:
    """Take a case, the result files, the basis and its size."""
    add_input(parser, "CASE.toml")
    add_output(parser, "ROM.h5")
    add_json(parser)
    parser.add_argument(
        "--modes", type=_modes, default=12, metavar="N|auto",
        help="modes to keep, or as few as the tolerance needs (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--basis", default="craig-bampton", metavar="BASIS",
        help="craig-bampton (default), rubin, macneal, massless or truncated",
    )  # fmt: skip
    parser.add_argument(
        "--tolerance", type=ratio, default=0.01, metavar="R", help="error of --modes auto (default: %(default)s)"
    )
    parser.add_argument(
        "--max-frequency", type=hertz, metavar="HZ",
        help="up to which the error is estimated (default: 1.5 times the first bending)",
    )  # fmt: skip
    parser.add_argument(
        "--hot-spots", type=_spots, default=0, metavar="N",
        help="keep the stresses at the N most stressed places of the first mode as outputs",
    )  # fmt: skip
    parser.add_argument(
        "--recovery", action="store_true",
        help="keep the basis, so that `vanedamp export` can show responses on the mesh",
    )  # fmt: skip


def run(arguments: Namespace) -> None:
    """Reduce the case."""
    from vanedamp.rom.reduction import check_basis
    from vanedamp.studies.case.tables import Case, check_interface
    from vanedamp.studies.commands.support.messages import print_warnings, write_result
    from vanedamp.studies.commands.support.outputs import RECORD, check_outputs

    outputs = check_outputs(arguments, output=RECORD)
    check_basis(arguments.basis)
    case = Case.load(arguments.input)
    outputs.keep(case.files)
    check_interface(case)
    from vanedamp.studies.case.stages import assemble, reduced_case, unit_doubts

    started = time.perf_counter()
    structure = assemble(case)
    model = reduced_case(
        structure, arguments.modes, arguments.basis, arguments.tolerance, arguments.max_frequency, arguments.hot_spots,
        arguments.recovery,
    )  # fmt: skip
    estimate, rotation = model.provenance["estimate"], model.provenance.get("rotation")
    result = {
        "frequency_hz": model.natural_frequencies_hz.tolist(),
        "modes": model.modes,
        "basis": arguments.basis,
        "interface": list(model.interface),
        "outputs": list(model.outputs),
        "estimate": estimate,
        "warnings": list(unit_doubts(structure, float(model.natural_frequencies_hz[model.rigid_modes]))),
        "wall_time_s": time.perf_counter() - started,
    }
    fastest = model.at_speed(model.greatest_speed)
    if rotation is not None:
        result["rotation"] = rotation | {"frequency_hz": fastest.natural_frequencies_hz.tolist()}
        if case.rotation is not None and case.rotation.gyroscopic:
            result["warnings"].append("rotation.gyroscopic: the reduced model leaves the gyroscopic coupling out")
    files = partial(model.save, arguments.output) if arguments.output else None
    write_result(arguments.json, result, files)
    print_warnings(arguments.input, result["warnings"])
    if arguments.json != "-":
        kind = "natural" if model.free_modes else "fixed-interface"
        print(f"{model.size} coordinates, {model.modes} of them {kind} modes; interface: {', '.join(model.interface)}")
        print(f"{estimate['sentence']}, up to {estimate['frequencies_hz'][1]:.4g} Hz")
        if rotation is not None:
            print(rotation["sentence"])
        print("frequencies, Hz: " + _listed(model))
        if rotation is not None:
            print(f"at {model.greatest_speed:.6g} rad/s: " + _listed(fastest))


def _listed(model: ReducedModel) -> str:
    return ", ".join(f"{frequency:.6g}" for frequency in model.natural_frequencies_hz[:8])


def _modes(text: str) -> int | None:
    return None if text == "auto" else count(text)


def _spots(text: str) -> int:
    if count(text) > _MOST_SPOTS:
        raise ArgumentTypeError(f"expected at most {_MOST_SPOTS}, not {text}")
    return int(text)
