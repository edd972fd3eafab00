"""What a computation knows of a scene or a system: whatever else these hold is refused by its name.

Some computations serve a part of all effects only, such as a deck for another code. A list of what they do
*not* know would go out of date in silence when somebody adds an effect. So they list the fields that they
know, and every other field must hold nothing. `romdam.config.effects.refuse_unknown_effects` does the same
with the effects of a job.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sized
from dataclasses import MISSING, fields
from typing import Any

import numpy as np
from scipy.sparse import issparse

from romdam.core.errors import ConfigError


def contents(of: Any) -> tuple[str, ...]:
    """Names of the fields of a dataclass that hold something: neither their default, nor empty, nor zero."""
    return tuple(
        field.name for field in fields(of) if not _is_nothing(getattr(of, field.name), field.default)
    )


def _is_nothing(value: Any, default: Any) -> bool:
    if value is None or (default is not MISSING and value is default):
        return True
    if issparse(value):
        return not value.nnz
    if isinstance(value, np.ndarray):
        return not value.any()
    if isinstance(value, bool):
        return value is (False if default is MISSING else default)
    if isinstance(value, int | float):
        return not value or value == default
    return isinstance(value, Sized) and not len(value)


def refuse_unknown(
    of: Any, known: Collection[str], what: str, remedies: Mapping[str, tuple[str, str]] | None = None
) -> None:
    """Refuse what a dataclass holds in fields that a computation does not know.

    Parameters
    ----------
    known : fields that may hold something
    what : of the computation, such as "written for other codes"
    remedies : field -> (key of the configuration, remedy), to refuse it by; else by the field's own name

    Raises
    ------
    ConfigError
        with the key and the remedy.
    """
    for name in contents(of):
        if name not in known:
            otherwise = f"{type(of).__name__}.{name}", "leave out the key that asks for it"
            key, remedy = (remedies or {}).get(name, otherwise)
            raise ConfigError(f"{key} is not {what}; {remedy}")


def refuse_unknown_kinds(
    effects: Iterable[object],
    known: Collection[type],
    what: str,
    remedies: Mapping[type, tuple[str, str]] | None = None,
) -> None:
    """Refuse effects of a scene of kinds that a computation does not know.

    Parameters
    ----------
    known : kinds that a scene may have
    what : of the computation, such as "written for other codes"
    remedies : kind -> (key of the configuration, remedy), to refuse it by; else by the name of its class

    Raises
    ------
    ConfigError
        with the key and the remedy.
    """
    for effect in effects:
        kind = type(effect)
        if kind not in known:
            otherwise = kind.__name__, "leave out the key that asks for it"
            key, remedy = (remedies or {}).get(kind, otherwise)
            raise ConfigError(f"{key} is not {what}; {remedy}")
