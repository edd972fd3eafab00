"""The errors romdam raises; each message names the place, the value, the limit and the remedy."""

from __future__ import annotations

import reprlib
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path

_SHOWN = 80  # characters of a value in a message


class RomdamError(Exception):
    """Base of every error that a user's input or model can cause."""


class ConfigError(RomdamError):
    """A configuration file, or the scene it describes, is wrong."""


class RecordError(RomdamError):
    """A ground-motion record cannot be used.

    Attributes
    ----------
    key : of the record's entry in a configuration, such as components.y.channel, if one is to be mended
    """

    def __init__(self, message: str = "", key: str = "") -> None:
        self.key = key
        super().__init__(message)


class MeshError(RomdamError):
    """A mesh file or a generated mesh cannot be used."""


class ReductionError(RomdamError):
    """A block cannot be reduced as asked."""


class ConvergenceError(RomdamError):
    """An equilibrium or a time step did not converge."""


class NoEquilibriumError(ConvergenceError):
    """Loads that no forces of the joints balance, as limit analysis proves."""


class ResultError(RomdamError):
    """A result or model file cannot be read or written."""


class WriteError(ResultError):
    """The disk or the folder does not take a file."""


class OutputError(RomdamError):
    """Standard output takes no more."""


class WorkerError(RomdamError):
    """Processes that compute were lost while they did."""


def recoverable() -> tuple[type[Exception], ...]:
    """Errors of one run of several: it fails, and the others go on.

    A function, for the command's first line loads no NumPy.
    """
    from numpy.linalg import LinAlgError

    return (RomdamError, ArithmeticError, LinAlgError, MemoryError)


def describe_error(error: Exception) -> str:
    """An error as one sentence; what is none of romdam's own with its kind."""
    return str(error) if isinstance(error, RomdamError) else f"{type(error).__name__}: {error}"


@contextmanager
def placed(path: Path) -> Iterator[None]:
    """Errors of a configuration that the body raises begin with its file, unless they name it already."""
    try:
        yield
    except (ConfigError, MeshError, ReductionError) as error:
        if str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error


class Faults:
    """Errors of parts that do not need each other, raised together once all are known."""

    def __init__(self) -> None:
        self.errors = list[RomdamError]()

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Keep an error that the body raises."""
        try:
            yield
        except RomdamError as error:
            self.errors.append(error)

    def raise_together(self) -> None:
        """Raise what was kept, a line each; nothing where there is nothing.

        Raises
        ------
        RomdamError
            the lone error itself; of several one of their kind, or a ConfigError where kinds differ.
        """
        if len(self.errors) == 1:
            raise self.errors[0]
        if self.errors:
            kinds = {type(error) for error in self.errors}
            kind = kinds.pop() if len(kinds) == 1 else ConfigError
            raise kind("\n".join(dict.fromkeys(str(error) for error in self.errors)))


def listed(names: Collection[str], most: int = 20) -> str:
    """Names as messages list them, not all of many; "none" where there is none."""
    some = [name[:_SHOWN] for name in sorted(names)[:most]]
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(some)}{more}" or "none"


def quote(value: object) -> str:
    """A value as messages quote it: its repr cut to a part of a line.

    However deep its parts are, or often repeated (a YAML file's anchors make billions of a few), only a
    few of them are looked at.
    """
    short = reprlib.Repr()
    short.maxlevel, short.maxstring, short.maxother, short.maxlong = 3, _SHOWN, _SHOWN, _SHOWN
    text = " ".join(short.repr(value).split())
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."
