"""What a computation knows of a scene or a system: whatever else these hold is refused by its name.

A list of what is *not* supported goes out of date in silence when somebody adds an effect. So a computation
that does not ask an effect itself states the fields that it knows, and those that it does not know must hold
nothing. `romdam.config.effects.refuse_unknown_effects` does the same with the effects of a job.
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
    if isinstance(value, bool | int | float):
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
    remedies : field -> (key of the configuration, remedy), of those that it is known not to be able to have

    Raises
    ------
    ConfigError
        with the key and the remedy.
    """
    for name in contents(of):
        if name in known:
            continue
        unnamed = f"{type(of).__name__}.{name}", "leave out the key that asks for it"
        key, remedy = (remedies or {}).get(name, unnamed)
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
    remedies : kind -> (key of the configuration, remedy), of those that it is known not to be able to have

    Raises
    ------
    ConfigError
        with the key and the remedy.
    """
    for effect in effects:
        kind = type(effect)
        if kind not in known:
            key, remedy = (remedies or {}).get(kind, (kind.__name__, "leave out the key that asks for it"))
            raise ConfigError(f"{key} is not {what}; {remedy}")
