"""The parts of a run, timed in a process of its own: imports, the scene, loading compiled functions, run, writing.

Prints the seconds of the process as JSON.
"""

from __future__ import annotations

import itertools
import json
import sys
from time import process_time


def main(scene_file: str, output: str) -> None:
    """Do what `vanedamp run` does, part by part, but for the command line."""
    marks = [0.0, process_time()]
    from vanedamp.coupling.scene.scene import Scene
    from vanedamp.coupling.simulation import simulate
    from vanedamp.files.provenance import versions

    marks.append(process_time())
    scene = Scene.load(scene_file)
    marks.append(process_time())
    simulate(scene)
    marks.append(process_time())
    response = simulate(scene)
    marks.append(process_time())
    response.save(output, {"versions": versions(), "scene": scene.to_dict()})
    marks.append(process_time())
    start, imports, read, both, run, writing = (b - a for a, b in itertools.pairwise(marks))
    parts = {
        "interpreter": start, "imports": imports, "scene": read, "loading compiled functions": max(both - run, 0.0),
        "run": run, "writing": writing,
    }  # fmt: skip
    print(json.dumps(parts))


if __name__ == "__main__":
    main(*sys.argv[1:])
