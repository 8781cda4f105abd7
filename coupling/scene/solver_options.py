"""The [solver] table of a scene: a method, and its options as the method's own file declares them.

Methods are named here, and loaded when a scene asks for one: a scene of the exact engine needs no other kernels.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, PlainSerializer, ValidationError, WrapValidator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError

from vanedamp.files.extensions import Registry
from vanedamp.files.reference import require
from vanedamp.files.toml_input import InputError, Positive, Whole, nearest

_METHODS = "vanedamp.coupling.methods"
#: the values of `solver.method`; coupling.methods.Method is the contract
METHODS = Registry(
    "method",
    {
        "exact": f"{_METHODS}.exact",
        "moreau": f"{_METHODS}.moreau",
        "penalty": f"{_METHODS}.penalty",
        "cosim": f"{_METHODS}.cosimulation",
        "solve_ivp": f"{_METHODS}.scipy_ivp",
    },
    "vanedamp.methods",
    ("Options", "begin", "VARIANTS"),
)
#: processor time of an excitation period, and of a time step, for one body on a rigid structure, s (docs/accuracy.md)
PERIOD_SECONDS, STEP_SECONDS = 20e-6, 0.1e-6


class SolverOptions(BaseModel):
    """The options of every method; those of one derive from it, with a Literal for `method` and defaults for all.

    Unlike the other tables this is a model, which knows the given options (`model_fields_set`): defaults differ from
    method to method, so that a scene whose method is replaced keeps the given options, and nothing else.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)

    method: str
    """method of time integration"""
    max_events: Annotated[Whole, Field(gt=0)] = 20_000_000
    """most changes of the motion (methods with steps: impacts); beyond, the run ends as event_budget"""

    @property
    def seconds_per_period(self) -> float:
        """Processor time per excitation period, s, roughly: to reject runs that take too long."""
        return PERIOD_SECONDS

    def check_samples(self, samples: int) -> None:
        """Raise InputError where this number of samples of a period cannot be taken."""


class SteppingOptions(SolverOptions):
    """The options of methods with steps of equal size."""

    steps_per_period: Annotated[Whole, Field(ge=4, le=10_000_000)] = 1000
    """equal steps in a period of the excitation"""
    penetration: Positive = 0.1
    """share of the free travel by which a body may overlap a rigid wall [-]"""

    @property
    def smallest_steps(self) -> int:
        """Steps of the smallest size per period."""
        return self.steps_per_period

    @property
    def seconds_per_period(self) -> float:
        """Processor time of an excitation period, s."""
        return PERIOD_SECONDS + STEP_SECONDS * self.smallest_steps

    def check_samples(self, samples: int) -> None:
        """Raise InputError where samples do not fall on steps."""
        if samples and self.steps_per_period % samples:
            raise InputError(
                f"solver.steps_per_period: {self.steps_per_period} is no multiple of {samples} samples a period"
            )


class PlanarOptions(SolverOptions):
    """The options of methods that take bodies with extent."""

    linearisation: Positive = 0.01
    """how much a tilt may shorten a body, as a share of the smallest play; beyond, a run is not ok [-]"""


def options_of(table: Mapping[str, Any]) -> SolverOptions:
    """Return the options in a [solver] table; None counts as not given.

    Raises pydantic's ValidationError, whose places are those in the table.
    """
    given = {key: value for key, value in table.items() if value is not None}
    method = given.get("method", "exact")
    if not isinstance(method, str) or method not in METHODS:
        *names, last = map(repr, METHODS.names())
        expected = {"expected": f"{', '.join(names)} or {last}"}
        raise _error(InitErrorDetails(type="literal_error", loc=("method",), input=method, ctx=expected))
    options: type[SolverOptions] = METHODS.part(method).Options
    for key in given:
        if key not in options.model_fields:
            reason = PydanticCustomError("option", "{reason}", {"reason": _stranger(key, method)})
            raise _error(InitErrorDetails(type=reason, loc=(key,), input=table))
    return options.model_validate(given)


def _stranger(key: str, method: str) -> str:
    """Return why a method has no such option: other methods have it, or none has."""
    known = {name: solver.Options.model_fields for name, solver in METHODS.all().items()}
    users = [name for name, options in known.items() if key in options]
    if users:
        return f"is for method {' or '.join(users)}, not {method}"
    return f"unknown key; {nearest(key, list({option for options in known.values() for option in options}))}"


def _error(details: InitErrorDetails) -> ValidationError:
    return ValidationError.from_exception_data("solver", [details])


def _by_method(value: Any, handler: Any) -> Any:
    return options_of(value) if isinstance(value, Mapping) else handler(value)


def _plain(options: SolverOptions) -> dict[str, Any]:
    """Return the given options as plain data, with those that every method has."""
    return options.model_dump(mode="json", include=options.model_fields_set | set(SolverOptions.model_fields))


class _EveryMethod:
    """JSON Schema of the [solver] table: the options of one method, of "exact" where none is named."""

    @staticmethod
    def __get_pydantic_json_schema__(schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        tables = {name: handler(method.Options.__pydantic_core_schema__) for name, method in METHODS.all().items()}
        for name, made in tables.items():
            table = handler.resolve_ref_schema(made)
            table["title"] = name
            if name != "exact":
                require(table, "method")
        return {"anyOf": list(tables.values())}


#: the [solver] table
Solver = Annotated[SolverOptions, WrapValidator(_by_method), PlainSerializer(_plain), _EveryMethod]
