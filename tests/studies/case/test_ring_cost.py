"""What rings of 12, 36 and 72 sectors take, printed: `pytest -s -m slow tests/studies/case/test_ring_cost.py`."""

import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from tests.studies.case.test_ring_reduction import CASE
from vanedamp.rom.ring.deviations import Deviations
from vanedamp.rom.ring.study import amplification
from vanedamp.studies.case.ring_stages import ring_reduction
from vanedamp.studies.case.stages import assemble
from vanedamp.studies.case.tables import Case


def case_of(sectors: int, folder: Path) -> Case:
    """The disk with so many blades of the same pitch."""
    text = CASE.replace("sectors = 6", f"sectors = {sectors}")
    for name, value in (("inner_radius", 0.1), ("outer_radius", 0.16)):
        text = text.replace(f"{name} = {value}", f"{name} = {value - 0.16 + 0.16 * sectors / 6}")
    (folder / "case.toml").write_text(text)
    return Case.load(folder / "case.toml")


@pytest.mark.slow
@pytest.mark.parametrize("basis", ["modes", "sectors"])
def test_cost(tmp_path, basis):
    sizes = {}
    for sectors in (12, 36, 72):
        structure, times = assemble(case_of(sectors, tmp_path)), [time.perf_counter()]
        ring = ring_reduction(structure, basis=basis)
        times.append(time.perf_counter())
        deviations = Deviations(0.02 * np.random.default_rng(0).standard_normal(sectors))
        model = ring.model(deviations)
        times.append(time.perf_counter())
        factor = amplification(ring, deviations, 2, "tip").factor
        times.append(time.perf_counter())
        tracemalloc.start()  # apart from the times, which it would change
        ring_reduction(structure, basis=basis).model(deviations)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        ring.save(tmp_path / "ring.h5")
        sizes[sectors] = (tmp_path / "ring.h5").stat().st_size
        print(
            f"{basis}: {sectors} sectors of {structure.matrices.size} freedoms, {ring.size} coordinates, {model.size} "
            f"modes: reduction {times[1] - times[0]:.2f} s, model {times[2] - times[1]:.2f} s, amplification "
            f"{times[3] - times[2]:.2f} s ({factor:.3f}), memory {peak / 1e6:.1f} MB, file "
            f"{sizes[sectors] / 1e6:.2f} MB"
        )
    # the record of a ring by sectors does not grow with their number but for the motions of the faces
    assert basis == "modes" or sizes[72] < 2 * sizes[12]
