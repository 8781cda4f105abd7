"""`vanedamp contact`: numbers of a contact from geometry and materials."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path

from vanedamp.coupling.contacts.numbers import UNITS, ContactNumbers
from vanedamp.coupling.contacts.pairs import PAIRS
from vanedamp.coupling.strength.contact_numbers import contact
from vanedamp.files.store import replacing
from vanedamp.files.toml_input import InputError
from vanedamp.studies.commands.support.messages import write_result

#: columns that are printed, and number of their rows
_SHOWN = ("speed", "force", "duration", "pressure", "stiffness_force", "stiffness_duration", "restitution_thornton")
_EVERY = 4


def run(arguments: Namespace) -> None:
    """Print the numbers."""
    speeds = None if arguments.speeds is None else tuple(arguments.speeds)
    if speeds is not None and not speeds[0] < speeds[1]:
        raise InputError(f"--speeds: expected the lower one first, not {speeds[0]:g} {speeds[1]:g}")
    contacts = contact(arguments.input, speeds=speeds, preload=arguments.preload)
    if (arguments.output or arguments.picture) and not contacts[0].columns:
        raise InputError(f"{arguments.input}: a flat face has no table over the speed; leave -o and --picture out")
    write_result(
        arguments, {"contacts": [numbers.to_json() for numbers in contacts]},
        (line for numbers in contacts for line in (*_lines(numbers), "")),
        output=lambda path: _write_table(Path(path), contacts), picture=lambda path: _draw(Path(path), contacts),
    )  # fmt: skip


def _lines(numbers: ContactNumbers) -> Iterator[str]:
    yield f"{numbers.name}: reduced mass {numbers.mass:.6g} kg"
    if numbers.yield_speed is not None and numbers.yield_pressure is not None:
        yield (
            f"first yield at {numbers.yield_speed:.4g} m/s: {numbers.yield_force:.4g} N, "
            f"{numbers.yield_pressure / 1e6:.4g} MPa"
        )
    if numbers.preload is not None:
        yield f"tangent stiffness at {numbers.preload['force']:g} N: {numbers.preload['stiffness']:.4g} N/m"
    if numbers.patch is not None:
        yield "flat face: " + ", ".join(
            f"{name.replace('_', ' ')} {value:.4g} {'N/m' if name == 'stiffness' else 'm/N'}"
            for name, value in numbers.patch.items()
        )
    shown = [name for name in _SHOWN if name in numbers.columns]
    if shown:
        yield "".join(f"{name.replace('stiffness', 'k'):>22}" for name in shown)
        yield "".join(f"{UNITS.get(name, ''):>22}" for name in shown)
    for row in range(0, len(numbers.columns.get("speed", ())), _EVERY):
        yield "".join(f"{numbers.columns[name][row]:22.4g}" for name in shown)
    for model in numbers.models:
        yield f"restitution by {model.name} ({model.source}): from {model.lowest:.4g} m/s, {model.range}"
    for pair in PAIRS:
        yield (
            f"measured, {pair.pair}: friction {_range(pair.friction)}, restitution {_range(pair.restitution)} at "
            f"{_range(pair.speeds)} m/s ({pair.source})"
        )


def _range(ends: tuple[float, float]) -> str:
    return f"{ends[0]:g}" if ends[0] == ends[1] else f"{ends[0]:g} to {ends[1]:g}"


def _write_table(path: Path, contacts: tuple[ContactNumbers, ...]) -> None:
    """Write the columns of all contacts as CSV, with units in the heading."""
    names = list(contacts[0].columns)
    heading = ",".join(["contact", *(f"{name} [{UNITS.get(name, '-')}]" for name in names)])
    rows = [
        ",".join([numbers.name, *(f"{numbers.columns[name][row]:.9g}" for name in names)])
        for numbers in contacts
        for row in range(len(numbers.columns["speed"]))
    ]
    with replacing(path) as temporary:
        temporary.write_text("\n".join([heading, *rows, ""]), encoding="utf-8")


def _draw(path: Path, contacts: tuple[ContactNumbers, ...]) -> None:
    """Draw restitution, or without a yield strength duration, and force over the speed."""
    from vanedamp.studies.figures import BLUE, GOLD, GREEN, RED, draw_grid, save, subplots

    figure, (left, right) = subplots(1, 2, size=(10.0, 4.0))
    for numbers, style in zip(contacts, ("-", "--", ":", "-.") * len(contacts), strict=False):
        columns, speed = numbers.columns, numbers.columns["speed"]
        left.loglog(speed, columns["force"], style, color=BLUE, label=numbers.name)
        for model, colour in zip(numbers.models, (RED, GREEN), strict=False):
            right.semilogx(
                speed, columns[f"restitution_{model.name}"], style, color=colour, label=f"{numbers.name}, {model.name}"
            )
        if not numbers.models:
            right.loglog(speed, columns["duration"], style, color=GOLD, label=numbers.name)
        if numbers.yield_speed is not None:
            for axes in (left, right):
                axes.axvline(numbers.yield_speed, color=GOLD, linestyle=style, linewidth=0.8)
    left.set(xlabel="speed of approach, m/s", ylabel="largest force, N")
    right.set(xlabel="speed of approach, m/s", ylabel="restitution" if contacts[0].models else "duration, s")
    if contacts[0].models:
        right.set_ylim(0.0, 1.05)
    for axes in (left, right):
        axes.legend(frameon=False)
    draw_grid(left, right)
    save(figure, path)
