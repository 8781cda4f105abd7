"""Input files at the border: TOML in, validated frozen records out, errors of one line that name the remedy."""

from __future__ import annotations

import contextlib
import difflib
import reprlib
import tomllib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, Strict, TypeAdapter, ValidationError

from vanedamp.files.errors import LARGEST, VanedampError
from vanedamp.files.foreign import existing
from vanedamp.files.reference import constants, options

T = TypeVar("T")

#: Every record read from a file knows all its keys and holds finite numbers. Its schema is built when it is read, as a
#: part of the schema of its file: on import it would be built once more
STRICT = ConfigDict(extra="forbid", allow_inf_nan=False, defer_build=True)

_UNKNOWN = ("unexpected_keyword_argument", "extra_forbidden")
_NO_TABLE = ("dataclass_type", "model_type", "dict_type", "mapping_type", "model_attributes_type")
_NO_LIST = ("tuple_type", "list_type")

#: no whole number is longer than TOML's
_LONGEST = 2**63 - 1
#: of a file of ours: bytes, and tables and lists one in another
_MOST_BYTES, _DEEPEST = 50_000_000, 30


def _not_huge(value: float) -> float:
    if abs(value) > LARGEST:
        raise ValueError(f"expected a number up to {LARGEST:g} in SI units")
    return value


def _not_tiny(value: float) -> float:
    if value < 1.0 / LARGEST:
        raise ValueError(f"expected at least {1.0 / LARGEST:g} in SI units")
    return value


def _not_long(value: int) -> int:
    if abs(value) > _LONGEST:
        raise ValueError(f"expected a whole number up to {_LONGEST}")
    return value


# numbers are numbers: no text, no booleans
Real = Annotated[float, Strict(), AfterValidator(_not_huge)]
Whole = Annotated[int, Strict(), AfterValidator(_not_long)]
Positive = Annotated[Real, Field(gt=0), AfterValidator(_not_tiny)]
NonNegative = Annotated[Real, Field(ge=0)]
Fraction = Annotated[Real, Field(ge=0, le=1)]


def _three(direction: Any) -> Any:
    if not isinstance(direction, list | tuple) or len(direction) != 3 or not any(direction):
        raise ValueError("expected three numbers, not all zero, such as [0, 1, 0]")
    return direction


#: a direction in space, of any length but zero
Direction = Annotated[tuple[Real, Real, Real], BeforeValidator(_three)]


def _along_axes(value: Any) -> Any:
    """Return one number for each of three axes, which a single one stands for."""
    return [value] * 3 if isinstance(value, int | float) else value


_Axes = tuple[NonNegative, NonNegative, NonNegative]
#: numbers along x, y and z, or one for all three
Axes = Annotated[_Axes, BeforeValidator(_along_axes, json_schema_input_type=NonNegative | _Axes)]


class InputError(VanedampError):
    """Bad input. The message is one line: file, key, error and remedy."""


def read_toml(path: str | Path) -> dict[str, Any]:
    """Return the tables of a TOML file, UTF-8 with or without a byte order mark. Raises InputError."""
    file = existing(path, InputError)
    if file.stat().st_size > _MOST_BYTES:
        raise InputError(f"{path}: has {file.stat().st_size / 1e6:.0f} MB; expected at most {_MOST_BYTES / 1e6:.0f} MB")
    try:
        text = file.read_text(encoding="utf-8-sig")
        data = tomllib.loads(text)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    except RecursionError:
        raise InputError(f"{path}: not valid TOML: nested too deeply") from None
    except ValueError as error:  # of tomllib's own class but for whole numbers of thousands of digits
        raise InputError(f"{path}: not valid TOML: {error}") from None
    if _depth(data) > _DEEPEST:
        raise InputError(f"{path}: its tables are nested too deeply; at most {_DEEPEST} levels")
    if r"\u0000" in text or r"\U00000000" in text:  # no result could hold it
        for path_inside in _with_zero(data, []):
            raise InputError(f"{path}: {dotted(path_inside)!r}: holds a zero character; leave \\u0000 out")
    return data


def _with_zero(data: Any, path: list[Any]) -> Iterator[list[Any]]:
    """Yield the places of names and texts with a zero character."""
    if isinstance(data, str) and "\0" in data:
        yield path
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        if isinstance(key, str) and "\0" in key:
            yield [*path, key]
        yield from _with_zero(value, [*path, key])


def _depth(data: Any) -> int:
    """Return how many tables and lists stand one in another."""
    level, depth = [data], 0
    while level:
        inner = (item.values() if isinstance(item, dict) else item for item in level)
        level = [value for values in inner for value in values if isinstance(value, dict | list)]
        depth += 1
    return depth


def validate(record: type[T], data: Mapping[str, Any], source: str) -> T:
    """Return `data` as a `record`. Raises InputError naming the source, the key and the remedy."""
    adapter: TypeAdapter[T] = _adapter(record)  # type: ignore[arg-type]
    with contextlib.suppress(ValidationError):
        return adapter.validate_python(dict(data))
    data = plain(data)
    try:
        return adapter.validate_python(data)
    except ValidationError as error:
        # a misspelt key is missing, too: its own complaint is the one that helps
        errors = sorted(error.errors(), key=lambda entry: entry["type"] not in _UNKNOWN)
        raise InputError(f"{source}: {_explain(adapter, errors[0], data)}") from None


def validated_or_none(record: type[T], data: Mapping[str, Any]) -> T | None:
    """Return plain `data` as a `record`, or None if it is none, without the message, which takes far longer."""
    try:
        return _adapter(record).validate_python(data)  # type: ignore[arg-type]
    except ValidationError:
        return None


def lists_for_numbers(record: type[T], data: Mapping[str, Any]) -> list[list[Any]]:
    """Return the places of plain data, by keys and numbers of entries, where a list stands and a number belongs."""
    try:
        _adapter(record).validate_python(data)  # type: ignore[arg-type]
    except ValidationError as error:
        errors = [
            entry for entry in error.errors() if entry["type"] == "float_type" and isinstance(entry["input"], list)
        ]
        return [_path_in_data(entry["loc"], data, names_absent_key=False) for entry in errors]
    return []


def tables(record: Any) -> dict[str, Any]:
    """Return a record as plain nested data, as in its file, without values that are None."""
    data: dict[str, Any] = _adapter(record.__class__).dump_python(record, mode="json", exclude_none=True, by_alias=True)
    return data


def plain(data: Any) -> Any:
    """Return data with Python's own numbers and lists in place of numpy's."""
    if isinstance(data, Mapping):
        return {key: plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [plain(value) for value in data]
    return data.tolist() if isinstance(data, np.ndarray | np.generic) else data


@lru_cache(maxsize=32)
def _adapter(record: Any) -> TypeAdapter[Any]:
    return TypeAdapter(record)


def nearest(word: str, known: list[str]) -> str:
    """Return "did you mean ...?" for a misspelt word, otherwise the list of known ones."""
    close = difflib.get_close_matches(word, known, n=1)
    return f"did you mean '{close[0]}'?" if close else f"known: {', '.join(sorted(known)) or 'none'}"


def _explain(adapter: TypeAdapter[Any], error: Any, data: Any) -> str:
    kind = error["type"]
    path = _path_in_data(error["loc"], data, names_absent_key="argument" in kind or "missing" in kind)
    key = dotted(path)
    if kind in _UNKNOWN:
        return f"{key}: {_unknown(adapter.json_schema(), error['loc'], str(path[-1]))}"
    if kind in ("missing", "missing_argument"):
        return f"{key}: missing; it is required here"
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        tag = error["ctx"]["discriminator"].strip("'")
        expected = error["ctx"].get("expected_tags") or ", ".join(_tags(adapter.json_schema(), error["loc"], tag))
        return f"{key}.{tag}: must be one of {expected}"
    value = error["input"]
    if kind in _NO_TABLE:
        heading = f"[{key}]" if path and isinstance(path[-1], str) else f"[[{dotted(path[:-1])}]]"
        return f"{key}: expected a table, headed {heading}"
    if kind in _NO_LIST and isinstance(value, Mapping) and len(path) == 1:
        return f"{key}: expected a list of tables, each headed [[{key}]], not [{key}]"
    if kind in ("too_short", "too_long"):
        side, bound = ("least", "min_length") if kind == "too_short" else ("most", "max_length")
        return f"{key}: expected at {side} {error['ctx'][bound]} entries, not {error['ctx']['actual_length']}"
    message = error["msg"].removeprefix("Value error, ").removeprefix("Input ")
    shown = f" (got {reprlib.repr(value)})" if isinstance(value, str | int | float | bool) else ""
    return f"{key}: {message}{shown}" if key else message


def _unknown(schema: dict[str, Any], location: tuple[Any, ...], name: str) -> str:
    """Explain a key that a table does not have: the variants that have it, or the keys that this one may have."""
    variants = _nodes(schema, location[:-1])
    # of several variants of a table the one at hand is a step of the location, by the value that distinguishes them
    tag = location[-2] if len(location) > 1 else ""
    fitting = [node for node in variants if tag in constants(node).values()]
    fitting = fitting or [node for node in variants if not constants(node)] or variants
    owners = [pair for node in variants if name in node.get("properties", {}) for pair in constants(node).items()]
    if owners:
        mine = next((f'{key} = "{value}"' for key, value in constants(fitting[0]).items()), tag)
        others = " or ".join(f'{key} = "{value}"' for key, value in owners)
        return f"belongs to {others}, not to {mine}"
    return f"unknown key; {nearest(name, sorted({key for node in fitting for key in node.get('properties', {})}))}"


def _path_in_data(location: tuple[Any, ...], data: Any, names_absent_key: bool) -> list[Any]:
    """Return the part of pydantic's location that names the file's own keys: tags of unions are left out."""
    path: list[Any] = []
    for position, step in enumerate(location):
        inside = isinstance(data, Mapping) and step in data
        if inside or (isinstance(data, list) and isinstance(step, int) and step < len(data)):
            data = data[step]
            path.append(step)
        elif names_absent_key and position == len(location) - 1:
            path.append(step)
    return path


def dotted(path: list[Any]) -> str:
    """Return a place in data as messages name it, such as damper[0].mass."""
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else (f".{step}" if text else str(step))
    return text


def _tags(schema: dict[str, Any], location: tuple[Any, ...], tag: str) -> list[str]:
    return [n["properties"][tag]["const"] for n in _nodes(schema, location) if tag in n.get("properties", {})]


def _nodes(schema: dict[str, Any], location: tuple[Any, ...]) -> list[dict[str, Any]]:
    """Return the JSON-schema objects that can stand at a location, unions spread out."""

    nodes = options(schema, schema)
    for step in location:
        inner: list[dict[str, Any]] = []
        for node in nodes:
            if isinstance(step, int) and "items" in node:
                inner += options(schema, node["items"])
            elif step in node.get("properties", {}):
                inner += options(schema, node["properties"][step])
            elif isinstance(node.get("additionalProperties"), dict):
                inner += options(schema, node["additionalProperties"])
        nodes = inner or nodes  # a union tag among the steps names no key
    return nodes
