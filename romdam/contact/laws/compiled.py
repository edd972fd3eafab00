"""The functions of laws as the step calls them: compiled once each, by pointer.

All laws have the same signatures, so the time stepping is compiled once for scenes with such laws, whichever
they are; a call through the pointer costs next to nothing.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple

from numba import types
from numba.core.errors import NumbaError, NumbaExperimentalFeatureWarning

from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.law import Law
from romdam.core.errors import ConfigError
from romdam.core.jit import caching_by_content, njit

MOST_LAWS = (
    8  # of one scene, those that only give a spring aside: the length of the tuples is part of their type
)
_ROW, _NUMBER, _FLAG = types.Array(types.float64, 1, "C"), types.float64, types.boolean
_SIGNATURES = {
    "limit": types.void(_ROW, _ROW, _ROW),
    "release": types.boolean(_ROW, _ROW, _NUMBER, _FLAG, _FLAG),
    "commit": types.void(_ROW, _ROW, _NUMBER, _FLAG, _NUMBER, _NUMBER),
}
_POINTED: dict[str, Any] = {"cache": True, "_nrt": False, "no_cfunc_wrapper": False}


class Functions(NamedTuple):
    """The functions of a scene's laws, each tuple filled up to MOST_LAWS with functions that do nothing."""

    limit: tuple[Any, ...]
    release: tuple[Any, ...]
    commit: tuple[Any, ...]


class _Pointer(types.WrapperAddressProtocol):
    """A compiled function that others may call without knowing it."""

    def __init__(self, function: Callable[..., Any], signature: Any) -> None:
        self._function, self._signature = njit(**_POINTED)(function), signature
        self._function.compile(signature.args)
        compiled = self._function.get_compile_result(signature)
        self._address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)

    def __wrapper_address__(self) -> int:
        return int(self._address)

    def signature(self) -> Any:
        return self._signature


def compiled(laws: Sequence[type[Law]]) -> Functions:
    """Compile the functions of some laws.

    Raises
    ------
    ConfigError
        for more than MOST_LAWS, and for a function that cannot be compiled.
    """
    if len(laws) > MOST_LAWS:
        raise ConfigError(
            f"joints: {len(laws)} laws in one scene, limit {MOST_LAWS}; unite some in one class of your own"
        )
    # said of every tuple of functions; what of them is used here works in all versions that are allowed
    warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning, module="numba.core.utils")
    filled = [*laws, *[Law] * (MOST_LAWS - len(laws))]
    return Functions(*(tuple(_pointer(name, law) for law in filled) for name in Functions._fields))


@cache
def _pointer(name: str, law: Any) -> _Pointer:
    function = getattr(law, name) or _NOTHING[name]
    try:
        with caching_by_content("" if law is Law else source_of(law).sha256):
            return _Pointer(function, _SIGNATURES[name])
    except NumbaError as error:
        reason = str(error).strip().splitlines()[-1]
        raise ConfigError(
            f"{function.__code__.co_filename}: {function.__qualname__} cannot be compiled: {reason}; "
            "it may use numbers, math and the arrays that it gets"
        ) from error


def _no_limit(parameters: Any, memory: Any, limit: Any) -> None:
    pass


def _no_release(parameters: Any, memory: Any, opening: float, pulled: bool, sliding: bool) -> bool:
    return False


def _no_commit(
    parameters: Any, memory: Any, opening: float, sliding: bool, rate_j: float, rate_k: float
) -> None:
    pass


_NOTHING: dict[str, Callable[..., Any]] = {"limit": _no_limit, "release": _no_release, "commit": _no_commit}
