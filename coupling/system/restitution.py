"""The restitution of a rigid contact at a speed of approach."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from vanedamp.coupling.numerics.compiler.function_address import address_of, call
from vanedamp.coupling.numerics.compiler.jit import inlined
from vanedamp.coupling.scene.contact_laws.law import ContactLaw
from vanedamp.files.toml_input import InputError


class Contacts(Protocol):
    """Restitutions (r,) of a system's contacts: coefficients, and the law that takes them."""

    @property
    def restitution(self) -> np.ndarray:
        """(r,) of each contact, or the coefficient from which the law takes it."""

    @property
    def restitution_at(self) -> int:
        """Address of that law; 0: the coefficient at every speed."""


#: speeds at which a law is tried, m/s
_SPEEDS = (0.0, *np.geomspace(1e-12, 1e3, 76))


def law_address(law: ContactLaw, coefficients: np.ndarray) -> int:
    """Return the address of a law's restitution, for `System.restitution_at`; 0 where it is the same at every speed.

    coefficients: (k,) of its contacts. Raises InputError where the restitution leaves [0, 1] up to 1 km/s.
    """
    if not law.depends_on_speed:
        return 0
    address = address_of(law.restitution_at)
    for coefficient in coefficients:
        for speed in _SPEEDS:
            value = call(address, speed, coefficient)
            if not 0.0 <= value <= 1.0:
                raise InputError(
                    f'contact: law "{law.law}" gives a restitution of {value:g} at {speed:.3g} m/s, with the '
                    f"coefficient {coefficient:g}; it must lie between 0 and 1"
                )
    return address


@inlined
def restitution_at(system, r, approach):
    """Return the restitution of contact r at a speed of approach (m/s), below zero as at none."""
    if system.restitution_at == 0:
        return system.restitution[r]
    return call(system.restitution_at, max(approach, 0.0), system.restitution[r])


def restitutions_at(system: Contacts, contacts: np.ndarray, approach: np.ndarray) -> np.ndarray:
    """Return the restitutions (k,) of some contacts (k,) at their speeds of approach (k,), for uncompiled code."""
    coefficients: np.ndarray = system.restitution[contacts]
    if system.restitution_at == 0:
        return coefficients
    pairs = zip(np.maximum(approach, 0.0), coefficients, strict=True)
    return np.array([call(system.restitution_at, speed, coefficient) for speed, coefficient in pairs])
