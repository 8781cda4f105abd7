"""The [solver] table of a scene: the method and its options."""

from __future__ import annotations

from dataclasses import fields
from typing import Annotated, Literal

from pydantic import Field
from pydantic.dataclasses import dataclass

from vanedamp.files.toml_input import STRICT, NonNegative, Positive, Real, Whole

_STEPPING = ("moreau", "penalty", "cosim", "solve_ivp")
#: which methods an option belongs to, besides `method` and `max_events`, which belong to all
_USERS: dict[str, tuple[str, ...]] = {
    "steps_per_period": _STEPPING,
    "penetration": _STEPPING,
    "theta": ("moreau",),
    "scheme": ("penalty",),
    "alpha": ("penalty",),
    "contact_steps": ("penalty", "cosim"),
    "contact_stiffness": ("penalty", "cosim"),
    "slip_velocity": ("penalty", "cosim"),
    "exchange": ("cosim",),
    "hold": ("cosim",),
    "substeps": ("cosim",),
    "rtol": ("solve_ivp",),
    "complete_chatter": ("solve_ivp",),
}


@dataclass(frozen=True, config=STRICT)
class Solver:
    """The method, and the budget of events after which a run ends with status 'event_budget'.

    steps_per_period: steps (macro-steps of cosim) in an excitation period, 1000 unless given; for solve_ivp the least
    number, 32; penetration: share of the free travel by which a body may overlap a rigid wall, 0.1 (solve_ivp: 1e-3).
    moreau: theta of the one-step scheme (0.5). penalty: scheme; alpha of "hht" (-0.1). penalty and cosim, for rigid
    contacts: contact_stiffness (N/m), or contact_steps, the duration of a contact in steps (2 steps_per_period^(1/3));
    slip_velocity below which friction is viscous (m/s; from the stability limit unless given). cosim: exchange
    ("gauss_seidel"), hold (order of extrapolation within a macro-step, 1), substeps of the bodies (10). solve_ivp:
    relative tolerance rtol (1e-9), complete_chatter (true).
    """

    method: Literal["exact", "moreau", "penalty", "cosim", "solve_ivp"] = "exact"
    max_events: Annotated[Whole, Field(gt=0)] = 20_000_000
    steps_per_period: Annotated[Whole, Field(ge=4, le=10_000_000)] | None = None
    penetration: Positive | None = None
    theta: Annotated[Real, Field(ge=0.5, le=1)] | None = None
    scheme: Literal["central_difference", "newmark", "hht"] | None = None
    alpha: Annotated[Real, Field(ge=-1 / 3, le=0)] | None = None
    contact_steps: Annotated[Real, Field(ge=4)] | None = None
    contact_stiffness: Positive | None = None
    slip_velocity: NonNegative | None = None
    exchange: Literal["jacobi", "gauss_seidel"] | None = None
    hold: Annotated[Whole, Field(ge=0, le=1)] | None = None
    substeps: Annotated[Whole, Field(gt=0, le=10_000)] | None = None
    rtol: Annotated[Real, Field(ge=3e-14, lt=1)] | None = None
    complete_chatter: bool | None = None

    def __post_init__(self) -> None:
        for option in fields(self):
            users = _USERS.get(option.name)
            if users is None or getattr(self, option.name) is None or self.method in users:
                continue
            raise ValueError(f"{option.name}: is for method {' or '.join(users)}, not {self.method}")
        if self.alpha is not None and self.scheme != "hht":
            raise ValueError('alpha: is for scheme = "hht"')
        if self.contact_steps is not None and self.contact_stiffness is not None:
            raise ValueError("give one of contact_steps and contact_stiffness")

    @property
    def steps(self) -> int:
        """Steps in an excitation period."""
        return self.steps_per_period or (32 if self.method == "solve_ivp" else 1000)

    @property
    def deepest(self) -> float:
        """Share of the free travel by which a body may overlap a rigid wall."""
        return self.penetration or (1e-3 if self.method == "solve_ivp" else 0.1)
