"""`pytest --slow-clock`: clocks and timers of vanedamp in a child process, and those of others."""

import subprocess
import sys

from tests.tools.processes import PATIENCE, environment, startup
from tests.tools.startup_path.slow_clock import VARIABLE

PROGRAM = """
import threading, time
scope = {"__name__": "vanedamp.part", "threading": threading, "time": time}
exec("def now(): return time.monotonic()", scope)
exec("def timer(): return threading.Timer(1e6, print, ['up'])", scope)
print(scope["now"]() - time.monotonic() > 1000.0, threading.Timer(1e6, print).interval, end=" ")
timer = scope["timer"]()
timer.start()
timer.join()
"""


def test_clocks_and_timers_of_vanedamp_are_faster_in_child_processes():
    variables = environment(**startup(), **{VARIABLE: "1e9"})
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=variables, capture_output=True, text=True, check=False, timeout=PATIENCE
    )
    assert (done.stdout, done.stderr) == ("True 1000000.0 up\n", "")
