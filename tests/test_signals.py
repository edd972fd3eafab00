"""Signals end the command whatever it is at; `tests/fuzz/test_surroundings.py` has the rest."""

import signal
import subprocess
import sys

import pytest

SWALLOWED = """
import os, signal, sys, time
from romdam.surroundings import hear_signals
hear_signals()
class Callback:
    def __del__(self):
        os.kill(os.getpid(), {number})
        time.sleep(0.01)
Callback()
time.sleep(10)
print("went on")
"""


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_signal_that_a_callback_swallows_ends_the_command_all_the_same(number):
    code = SWALLOWED.format(number=int(number))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=8)
    assert "went on" not in done.stdout and "ignored" not in done.stderr
    assert "KeyboardInterrupt" in done.stderr or f"stopped by {number.name}" in done.stderr
