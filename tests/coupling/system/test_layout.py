"""Scenes of all kinds are arrays of one layout: functions are compiled, for up to half a minute, for each layout."""

from numba import typeof

from tests.tools.planar import planar_scene, still_table
from tests.tools.random_scenes import random_jenkins, random_reduced, random_scene
from vanedamp.coupling.system.assembly import assemble, at_frequency
from vanedamp.coupling.system.system import on_structure


def test_one_compiled_function_serves_scenes_of_all_kinds(tmp_path):
    random_reduced(1).save(tmp_path / "rom.h5")
    block = {"mass": 1.0, "shape": "block", "length": 1.0, "height": 0.5}
    scenes = [
        random_scene(1),
        random_scene(1, "prescribed"),
        random_scene(1, "rom", 2).replace({"structure.file": str(tmp_path / "rom.h5")}),
        random_scene(1, "rigid", 2, shared=True),
        random_jenkins(1, "rigid", 0)[0],
        random_jenkins(1, "rigid", 1, "compliant")[0],
        planar_scene(still_table(), block),
    ]
    systems = [assemble(scene) for scene in scenes]
    systems += [at_frequency(systems[0], 3.0), *map(on_structure, systems)]
    assert {str(typeof(system)) for system in systems} == {str(typeof(systems[0]))}
    assert "A)" not in str(typeof(systems[0]))
