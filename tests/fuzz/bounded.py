"""Run a call in a child process within limits of time and memory, and tell how it ended."""

from __future__ import annotations

import os
import pickle
import resource
import select
import signal
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass

from romdam.core.errors import RomdamError

_ROOM = 8 << 30  # bytes of address space beyond what the parent has, so that nothing takes the machine along


@dataclass(frozen=True)
class Outcome:
    """How a call ended.

    Attributes
    ----------
    value : what it returned; None where it did not
    refusal : message of the RomdamError it raised; empty where it did not
    crash : traceback of any other exception, or how the process died; empty where neither happened
    seconds : wall time
    grown : how much memory the call took at most; all that the process had, where it died [bytes]
    """

    value: object
    refusal: str
    crash: str
    seconds: float
    grown: int


def bounded(call: Callable[[], object], seconds: float = 30.0) -> Outcome:
    """Run a call in a forked child; one that takes longer than `seconds` is killed and counts as crashed.

    Parameters
    ----------
    call : returns something that pickles
    """
    began = time.perf_counter()
    ours, theirs = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(ours)
        _answer(call, theirs)
    os.close(theirs)
    data, late = _read_all(ours, began + seconds)
    if late:
        os.kill(child, signal.SIGKILL)
    _, status, usage = os.wait4(child, 0)
    took, peak = time.perf_counter() - began, 1024 * usage.ru_maxrss
    if late:
        return Outcome(None, "", f"killed after {seconds:g} s", took, peak)
    if not data:
        return Outcome(None, "", f"the process died, wait status {status}", took, peak)
    value, refusal, crash, grown = pickle.loads(data)
    return Outcome(value, refusal, crash, took, grown)


def _answer(call: Callable[[], object], pipe: int) -> None:
    """What the child does; it never returns."""
    space, before = 1024 * int(_status("VmSize")), _resident()
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")  # the peak is counted from here, not from what the parent has ever had
    resource.setrlimit(resource.RLIMIT_AS, (space + _ROOM, resource.RLIM_INFINITY))
    try:
        answer = (call(), "", "")
    except RomdamError as error:
        answer = (None, str(error) or "(no message)", "")
    except BaseException:
        answer = (None, "", traceback.format_exc())
    with os.fdopen(pipe, "wb") as file:
        file.write(pickle.dumps((*answer, 1024 * int(_status("VmHWM")) - before)))
    os._exit(0)


def _read_all(pipe: int, until: float) -> tuple[bytes, bool]:
    """Everything that comes through a pipe, and whether the time was up before its end."""
    found: list[bytes] = []
    with os.fdopen(pipe, "rb", buffering=0) as file:
        while True:
            ready, _, _ = select.select([file], [], [], max(0.0, until - time.perf_counter()))
            if not ready:
                return b"", True
            piece = file.read(1 << 20)
            if not piece:
                return b"".join(found), False
            found.append(piece)


def _resident() -> int:
    return 1024 * int(_status("VmRSS"))


def _status(name: str) -> str:
    """A line of /proc/self/status, in kB."""
    with open("/proc/self/status") as file:
        return next(line.split()[1] for line in file if line.startswith(f"{name}:"))
