"""The errors romdam raises; each message names the place, the value, the limit and the remedy."""

from __future__ import annotations

import reprlib

_SHOWN = 80  # characters of a value in a message


class RomdamError(Exception):
    """Base of every error that a user's input or model can cause."""


class ConfigError(RomdamError):
    """A configuration file, or the scene it describes, is wrong."""


class RecordError(RomdamError):
    """A ground-motion record cannot be used."""


class MeshError(RomdamError):
    """A mesh file or a generated mesh cannot be used."""


class ReductionError(RomdamError):
    """A block cannot be reduced as asked."""


class ConvergenceError(RomdamError):
    """An equilibrium or a time step did not converge."""


class ResultError(RomdamError):
    """A result or model file cannot be read or written."""


class OutputError(RomdamError):
    """Standard output takes no more."""


class WorkerError(RomdamError):
    """Processes that compute were lost while they did."""


def shown(value: object) -> str:
    """A value as messages quote it: its repr cut to a part of a line.

    However deep its parts are, or often repeated (a YAML file's anchors make billions of a few), only a
    few of them are looked at.
    """
    short = reprlib.Repr()
    short.maxlevel, short.maxstring, short.maxother, short.maxlong = 3, _SHOWN, _SHOWN, _SHOWN
    text = " ".join(short.repr(value).split())
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 3]}..."
