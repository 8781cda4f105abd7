"""The exciting forces of a scene on the modes of its structure, for a level of 1."""

from __future__ import annotations

import numpy as np

from vanedamp.coupling.scene.scene import Scene
from vanedamp.coupling.system.modal_basis import ModalBasis, interface_row


def force_shapes(scene: Scene, basis: ModalBasis, response: np.ndarray) -> np.ndarray:
    """Return the complex amplitudes (e, n) of the modal forces by harmonic, relative to a sine, for a level of 1.

    The level is a force, N, at the functional `response` (n,), or the factor of loads at several labels. Raises
    InputError for an unknown label.
    """
    shares = scene.excitation.shares
    if not scene.excitation.distributed:
        return np.array(list(shares.values()))[:, None] * response
    shapes = np.zeros((len(shares), len(response)), complex)
    orders = list(shares)
    for place, load in scene.excitation.loads.items():
        row = interface_row(basis, load.at, f"{place}.at" if scene.excitation.load else place)
        if load.order in orders:  # one without force has no order
            shapes[orders.index(load.order)] += load.amplitude * row
    return shapes
