"""Laws of the keys of all input files: a record rejects what a key's schema rejects, in one line with the key's name.

The records and their keys are found, beginning with the kinds of files; nothing is listed here.
"""

import dataclasses
import typing
from functools import cache

import pytest
from jsonschema import Draft202012Validator

from vanedamp.files.reference import schema
from vanedamp.files.toml_input import InputError, validate
from vanedamp.studies.file_kinds import KINDS

#: values of every type that TOML has, and numbers beyond any bound
PROBES = [0, "spam", "", True, -1e300, -1.5, -1, 0.5, 1.5, 10**12, 1e300, [], [-1.0], ["spam"], [[]], {}, {"spam": 1}]
#: keys, of which a record requires one
COMPLETED = {
    "CoordinateTable": {"coordinate": 0}, "Envelope": {"friction": [0, 1], "restitution": [0, 1]},
    "Excitation": {"frequency": 1.0}, "Life": {"band": [1.0]},
    "MatricesTable": {"damping_ratio": 0.01}, "Optimise": {"band": [1.0]}, "Ramp": {"to": 2.0, "rate": 1.0},
    "Sought": {"min": 0.0},
}  # fmt: skip


def parts(annotation):
    """The types in an annotation."""
    yield annotation
    for argument in typing.get_args(annotation):
        yield from parts(argument)


@cache
def records():
    """The records of input files, by name: those of the kinds, and those that their fields name."""
    found, left = {}, [kind.record for kind in KINDS.values()]
    while left:
        record = left.pop()
        hints = typing.get_type_hints(record, include_extras=True)
        if record.__name__ in found:
            continue
        found[record.__name__] = record
        left += [
            each
            for field in dataclasses.fields(record)
            for each in parts(hints[field.name])
            if isinstance(each, type) and hasattr(each, "__pydantic_config__")
        ]
    return found


@cache
def of(name):
    """A record's schema with its definitions, and plain values of its required keys."""
    made = schema(records()[name])
    top = made | made.get("$defs", {}).get(made.get("$ref", "").rpartition("/")[2], {})
    return top, {key: sample(top["properties"][key], top) for key in top.get("required", ())} | COMPLETED.get(name, {})


def sample(entry, top):
    """A value that a schema takes."""
    if "$ref" in entry:
        return of(entry["$ref"].rpartition("/")[2])[1]
    if options := entry.get("anyOf") or entry.get("oneOf"):
        return sample(options[0], top)
    kind = entry.get("type")
    if kind == "array":
        entries = entry.get("prefixItems") or [entry.get("items", {"type": "number"})] * max(
            entry.get("minItems", 1), 1
        )
        return [sample(each, top) for each in entries]
    if kind == "object":
        return {"spam": sample(entry["additionalProperties"], top)}
    return next(
        probe
        for probe in (*entry.get("enum", ()), entry.get("const", "spam"), 1, 2, 0.3, True)
        if accepts(entry, top, probe)
    )


def accepts(entry, top, value):
    """Whether a key's schema takes a value."""
    return Draft202012Validator(entry | {"$defs": top.get("$defs", {})}).is_valid(value)


def message(name, data):
    """What a record says of some data; None if it takes them."""
    try:
        validate(records()[name], data, "file")
    except InputError as error:
        return str(error)
    return None


def keys(name):
    """A record's keys, without those of a record that it derives from, and their schemas."""
    bases = [base.__name__ for base in records()[name].__mro__[1:] if base.__name__ in records()]
    derived = {key for base in bases for key in of(base)[0]["properties"]}
    return {key: entry for key, entry in of(name)[0].get("properties", {}).items() if key not in derived}


def test_there_are_hundreds_of_keys():
    assert sum(len(keys(name)) for name in records()) > 300


@pytest.mark.parametrize("name", sorted(records()))
def test_a_record_rejects_what_its_schema_rejects(name):
    top, required = of(name)
    for key, entry in keys(name).items():
        bad = [probe for probe in PROBES if not accepts(entry, top, probe)]
        assert bad, f"{key} takes anything"
        for probe in bad[entry.get("type") == "boolean" :]:  # 0 is false
            told = message(name, required | {key: probe})
            assert told is not None, f"{key} = {probe!r} is taken"
            assert told.startswith(f"file: {key}") and "\n" not in told, f"{key} = {probe!r}: {told}"


@pytest.mark.parametrize("name", sorted(records()))
def test_an_unknown_key_is_answered_with_the_nearest(name):
    _, required = of(name)
    for key in list(keys(name))[:2]:
        told = message(name, required | {f"{key}x": 1})
        assert told is not None and told.startswith(f"file: {key}x: unknown key; did you mean '{key}'?"), told
