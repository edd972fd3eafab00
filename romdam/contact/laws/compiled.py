"""The functions of laws as the step calls them: compiled once each, by address.

All laws have the same signatures, so the time stepping is compiled once for scenes with such laws, whichever
and how many they are; a call to the address costs next to nothing. Addresses are plain numbers: what numba
asks of an object that is a function, at every call from Python, took ten times the rest of a step. An
exception does not pass a pointer: numba prints
it, and the caller goes on. So each function is called by one that says what came of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.errors import NumbaError
from numba.extending import intrinsic

from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.law import Law
from romdam.contact.laws.outside import closed
from romdam.core.arrays import Ints
from romdam.core.errors import ConfigError
from romdam.core.jit import njit
from romdam.core.kept_code import caching_by_content

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
    """Addresses of the functions of a scene's L laws, (L,) each, see `call`; they hold in this process."""

    limit: Ints
    release: Ints
    commit: Ints


class _Compiled:
    """A compiled function of a law, which lives as long as the process, and its address."""

    def __init__(self, law: type[Law], function: Callable[..., Any], signature: Any) -> None:
        self._function = njit(**_POINTED)(function)
        self._function.compile(signature.args)
        made = self._function.get_compile_result(signature)
        self.address = int(made.library.get_pointer_to_function(made.fndesc.llvm_cfunc_wrapper_name))
        _LAWS[self.address] = law


_LAWS: dict[int, type[Law]] = {}  # by the addresses of their functions


def law_at(address: int) -> Any:
    """The law one of whose functions is at an address."""
    return _LAWS[int(address)]


def compiled(laws: Sequence[Any]) -> Functions:
    """Compile the functions of some laws.

    Raises
    ------
    ConfigError
        for a function that cannot be compiled.
    """
    return Functions(
        *(
            np.array([_compiled(name, law).address for law in laws], dtype=np.int64)
            for name in Functions._fields
        )
    )


def _calling(address: Any, rows: tuple[Any, ...]) -> Any:
    """Signature and code of a call to an address with rows of numbers."""
    if any(not isinstance(row, types.Array) or row.ndim != 1 or row.layout != "C" for row in rows):
        return None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function = types.FunctionType(_CAME(*[_ROW] * len(rows))).ftype
        return builder.call(builder.inttoptr(arguments[0], context.get_value_type(function)), arguments[1:])

    return _CAME(address, *rows), generate


def _limit_call(typing: Any, address: Any, parameters: Any, memory: Any, step: Any, limit: Any) -> Any:
    """Call a function `limit` at an address: what came of it."""
    return _calling(address, (parameters, memory, step, limit))


def _call(typing: Any, address: Any, parameters: Any, memory: Any, step: Any) -> Any:
    """Call a function `release` or `commit` at an address: what came of it."""
    return _calling(address, (parameters, memory, step))


# in compiled functions: call_limit(address, parameters, memory, step, limit), call(address, ..., step)
call_limit: Any = intrinsic(_limit_call)
call: Any = intrinsic(_call)


@cache
def _compiled(name: str, law: Any) -> _Compiled:
    function, source = getattr(law, name), source_of(law)
    if function is None:
        return _Compiled(law, _NOTHING[name], _SIGNATURES[name])
    options: dict[str, Any] = {"_nrt": False}
    called = function
    if source.file:
        called, options = closed(function, source.file).function, options | {"boundscheck": True}
    try:
        with caching_by_content(source.sha256):
            names = {"law": njit(**options)(called), "GAVE_UP": GAVE_UP, "DONE": DONE, "FAILED": FAILED}
            names["__name__"] = __name__  # where numba looks for the globals of what it reads from its cache
            calling = FunctionType(_CALLING[name].__code__, names, name)
            calling.__qualname__ = f"{law.__qualname__}.{name}"  # by which numba knows what it keeps
            return _Compiled(law, calling, _SIGNATURES[name])
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
    except Exception:  # here and below: compiled code can name no other kind, and a user's law may raise any
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
