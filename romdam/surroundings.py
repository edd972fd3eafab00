"""Surroundings of the command: signals, standard streams, the environment, the working folder."""

from __future__ import annotations

import gc
import io
import os
import signal
import sys
import threading
from typing import Any

from romdam.core.errors import ConfigError, OutputError, quote
from romdam.core.threads import VARIABLES

_LOADED = 500_000  # objects before the first search for cycles: what a run loads makes 400,000, and they stay
_YOUNG = 50_000  # objects between searches from then on: the figures of two records, of 20 MB each


class Signalled(BaseException):
    """The command is to end, with its workers and unfinished files; not an error that something handles."""

    def __init__(self, number: int) -> None:
        self.number = number
        super().__init__(f"stopped by {signal.Signals(number).name}; what is finished is kept")


def load_unsearched() -> None:
    """Load libraries without searching for cycles what they make: that takes 0.25 s of a run."""
    gc.set_threshold(_LOADED)


def search_what_comes() -> None:
    """Search for cycles what is made from now on, and no more what there is: before records are run."""
    gc.freeze()
    gc.set_threshold(_YOUNG)


def hear_signals() -> None:
    """Let SIGTERM, and a terminal that closes, end the command as Ctrl-C does."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, signal.SIGTERM)  # Windows has no SIGHUP
        if signal.getsignal(number) is signal.SIG_DFL:  # nohup ignores SIGHUP
            signal.signal(number, _raise)
    sys.unraisablehook = _raise_again


def _raise(number: int, _: object) -> None:
    signal.signal(number, signal.SIG_DFL)  # a second one ends it at once
    raise Signalled(number)


def _raise_again(lost: sys.UnraisableHookArgs) -> None:
    """Signal once more, a little later, where a library's callback has swallowed what a signal raised."""
    if not isinstance(lost.exc_value, Signalled | KeyboardInterrupt):
        sys.__unraisablehook__(lost)
        return
    number = signal.SIGINT
    if isinstance(lost.exc_value, Signalled):
        number = signal.Signals(lost.exc_value.number)
        signal.signal(number, _raise)
    threading.Timer(0.05, os.kill, (os.getpid(), number)).start()


def check_surroundings() -> None:
    """Refuse what makes libraries fail when they are imported, or relative paths mean nothing.

    Which windows matplotlib would open is of no concern: figures are files. A thread of OpenBLAS that waits
    spins for 2^18 cycles, a tenth of a millisecond, before it sleeps, not for its own 2^26: numpy and scipy
    start one each that has nothing to do, 0.2 CPU-s of a run on two cores. Where two do work, on dense
    eigenproblems of 800 and 2,500 unknowns, they are as quick with either.

    Raises
    ------
    ConfigError
        for a working folder that is gone, and a number of threads that is none.
    """
    os.environ["MPLBACKEND"] = "agg"
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "18")  # read when the library is loaded
    try:
        os.getcwd()
    except OSError as error:
        raise ConfigError(f"the working folder is gone ({error}); change to one that is there") from None
    for name in VARIABLES:
        value = os.environ.get(name, "1")
        if not (value.isascii() and value.isdigit() and int(value) > 0):
            raise ConfigError(
                f"{name}: this environment variable must be a whole number above 0, "
                f"got {quote(value)}; unset it"
            )


class Output(io.TextIOWrapper):
    """A standard stream that may be full, read by nobody, or know few characters.

    Whoever stops reading (`| head`) does not stop the work. What the stream's encoding lacks is escaped.
    """

    @classmethod
    def of(cls, stream: Any, told: bool) -> Any:
        """The same stream; one that is closed, or stands for another thing, is left as it is.

        Parameters
        ----------
        told : whether a stream that takes no more is an error
        """
        if not isinstance(stream, io.TextIOWrapper):
            return stream
        encoding = stream.encoding
        made = cls(stream.detach(), encoding=encoding, errors="backslashreplace", line_buffering=True)
        made._told = told
        return made

    _told = True

    def write(self, text: str) -> int:
        """Write and flush.

        Raises
        ------
        OutputError
            where the stream takes no more, and that is to be told.
        """
        try:
            count = super().write(text)
            super().flush()
        except OSError as error:
            self._drop()
            if self._told and not isinstance(error, BrokenPipeError):
                raise OutputError(f"standard output cannot be written ({error}); free the disk") from None
            return len(text)
        return count

    def _drop(self) -> None:
        """Lead all that comes, and what is in the buffer, to the null device."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.fileno())
        os.close(nowhere)
