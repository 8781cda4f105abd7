"""A small sweep, and sweeps as processes that can be killed."""

import signal
import subprocess
import sys
import time

import tomli_w

from tests.tools.input_files import OSCILLATOR, RESONANCE
from tests.tools.processes import environment
from vanedamp.coupling.scene.scene import Scene
from vanedamp.files.toml_input import validate

DATA = OSCILLATOR | {
    "cavity": [{"name": "c1", "gap": 5e-4}],
    "damper": [{"cavity": "c1", "mass": 0.05, "friction": 0.3, "restitution": 0.6}],
    "time": {"periods": 90, "transient": 80},
    "sweep": {
        "cavity.c1.gap": [5e-4, 2e-4],
        "excitation.frequency": {"start": 0.97 * RESONANCE, "stop": 1.02 * RESONANCE, "num": 6},
    },
}


def scene(**changes):
    return validate(Scene, DATA | changes, "scene.toml")


def write(folder, **changes):
    (folder / "scene.toml").write_text(tomli_w.dumps(DATA | changes))


def command(folder, *arguments, output="sweep.h5"):
    """A sweep of the folder's scene.toml as a process."""
    words = [sys.executable, "-m", "vanedamp", "sweep", "scene.toml", "-o", output, *arguments]
    variables = environment(OMP_NUM_THREADS="1")
    return subprocess.Popen(words, cwd=folder, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def stamp(path):
    return path.stat().st_mtime_ns if path.exists() else 0


def kill_after_a_flush(folder, delay, *arguments):
    """Kill the sweep some time after its next checkpoint; one that has ended before begins again."""
    output, partial = folder / "sweep.h5", folder / "sweep.h5.partial"
    while True:
        before = stamp(partial)
        process = command(folder, *arguments)
        while stamp(partial) == before and process.poll() is None:
            time.sleep(0.005)
        time.sleep(delay)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        if process.returncode == -signal.SIGKILL and partial.exists():
            return
        output.unlink()
