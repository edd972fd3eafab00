"""The functions of laws as the step calls them: compiled once each, by pointer.

All laws have the same signatures, so the time stepping is compiled once for scenes with such laws, whichever
they are; a call through the pointer costs next to nothing. An exception does not pass a pointer: numba prints
it, and the caller goes on. So each function is called by one that says what came of it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

from numba import types
from numba.core.errors import NumbaError, NumbaExperimentalFeatureWarning

from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.law import Law
from romdam.contact.laws.outside import closed
from romdam.core.errors import ConfigError
from romdam.core.jit import caching_by_content, njit

MOST_LAWS = (
    8  # of one scene, those that only give a spring aside: the length of the tuples is part of their type
)
# what came of a call: nothing to tell, something was given up, or an exception or NaN
DONE, GAVE_UP, FAILED = range(3)
_ROW, _CAME = types.Array(types.float64, 1, "C"), types.int64
_SIGNATURES = {
    "limit": _CAME(_ROW, _ROW, _ROW, _ROW),
    "release": _CAME(_ROW, _ROW, _ROW),
    "commit": _CAME(_ROW, _ROW, _ROW),
}
_POINTED: dict[str, Any] = {"cache": True, "_nrt": False, "no_cfunc_wrapper": False}


class Functions(NamedTuple):
    """The functions of a scene's laws, each tuple filled up to MOST_LAWS with functions that do nothing."""

    limit: tuple[Any, ...]
    release: tuple[Any, ...]
    commit: tuple[Any, ...]


class _Pointer(types.WrapperAddressProtocol):
    """A compiled function of a law that others may call without knowing it."""

    def __init__(self, law: type[Law], function: Callable[..., Any], signature: Any) -> None:
        self.law, self._function, self._signature = law, njit(**_POINTED)(function), signature
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
    function, source = getattr(law, name), source_of(law) if law is not Law else None
    if function is None:
        return _Pointer(law, _NOTHING[name], _SIGNATURES[name])
    options: dict[str, Any] = {"_nrt": False}
    called = function
    if source is not None and source.file:
        called, options = closed(function, source.file).function, options | {"boundscheck": True}
    try:
        with caching_by_content("" if source is None else source.sha256):
            names = {"law": njit(**options)(called), "GAVE_UP": GAVE_UP, "DONE": DONE, "FAILED": FAILED}
            names["__name__"] = __name__  # where numba looks for the globals of what it reads from its cache
            calling = FunctionType(_CALLING[name].__code__, names, name)
            calling.__qualname__ = f"{law.__qualname__}.{name}"  # by which numba knows what it keeps
            return _Pointer(law, calling, _SIGNATURES[name])
    except NumbaError as error:
        reason = str(error).strip().splitlines()[-1]
        raise ConfigError(
            f"{function.__code__.co_filename}: {function.__qualname__} cannot be compiled: {reason}; "
            "it may use numbers, math and the arrays that it gets"
        ) from error


def law(*arguments: Any) -> Any:
    """The law's own function in those below, each of which is compiled once for every law."""
    raise NotImplementedError


def _limit(parameters: Any, memory: Any, step: Any, limit: Any) -> int:
    try:
        law(parameters, memory, step, limit)
    except Exception:
        return FAILED
    for entry in limit:
        if entry != entry:  # NaN: every bound would count as kept
            return FAILED
    return DONE


def _release(parameters: Any, memory: Any, step: Any) -> int:
    try:
        gave_up = law(parameters, memory, step)
    except Exception:
        return FAILED
    for entry in memory:
        if entry != entry:
            return FAILED
    return GAVE_UP if gave_up else DONE


def _commit(parameters: Any, memory: Any, step: Any) -> int:
    try:
        law(parameters, memory, step)
    except Exception:
        return FAILED
    for entry in memory:
        if entry != entry:
            return FAILED
    return DONE


_CALLING: dict[str, Callable[..., Any]] = {"limit": _limit, "release": _release, "commit": _commit}


def _no_limit(parameters: Any, memory: Any, step: Any, limit: Any) -> int:
    return DONE


def _no_change(parameters: Any, memory: Any, step: Any) -> int:
    return DONE


_NOTHING: dict[str, Callable[..., Any]] = {"limit": _no_limit, "release": _no_change, "commit": _no_change}
