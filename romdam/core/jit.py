"""Compile functions, and let compiled functions take one row of many named arrays, or write into one.

The time loop and the contact solvers are Python functions that numba compiles. `njit` declares them. It
differs from numba's decorator of the same name in two things.

- What is compiled is kept on disk safely (`kept_code.py`).
- A tree of calls is optimised once, instead of once at every level (`late_linking.py`). For this a function
  is compiled in two forms. Python calls the entry, which is optimised together with all that it calls.
  Compiled functions call the other form, which is lowered to LLVM's code and no more, because it is optimised
  within the entry that it ends up in.

A run's state is a NamedTuple of arrays with one row for each run. `at` and `put` of `core.arrays` take a row
of all its arrays, and write one. Numba compiles no such function by itself, so their code is written out
here, in numba's two halves: the type of the result, and the code that makes it.

Two sets of options say whether a function and all that it calls make arrays. Numba's runtime (`_nrt`) counts
the references to every view of an array, which costs two atomic operations for each, dozens in a step. A
function that makes no arrays, as the time loop, needs no counts (`VIEWS`); others do (`ARRAYS`). With either
set Python's other threads go on while compiled code runs.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numba
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

from romdam.core.arrays import at, put
from romdam.core.kept_code import keep

_LINKED_LATE = ((0, 68),)  # versions of numba that `late_linking.py` was tried with

# where no array is made, neither there nor by what is called; and where some are
VIEWS: dict[str, Any] = {"cache": True, "nogil": True, "_nrt": False}
ARRAYS: dict[str, Any] = {"cache": True, "nogil": True, "_nrt": True}


def late_linking(version: tuple[int, ...]) -> dict[str, Any]:
    """Options by which a version of numba compiles a tree of calls once; none, where it was not tried.

    Without them numba compiles every function whole, which takes longer and gives the same numbers.
    """
    if version not in _LINKED_LATE:
        return {}
    from romdam.core.late_linking import OPTIONS  # inside numba: another version may not have what it imports

    return OPTIONS


_ENTRY = late_linking(numba.version_info.short)
# of the form that compiled functions call; empty where numba compiles every function whole
CALLED: Any = _ENTRY | {"no_cpython_wrapper": True} if _ENTRY else {}


def njit(cache: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit`, with a second form of the function for compiled callers.

    Parameters
    ----------
    cache : keep what is compiled for the next process; where that cannot be kept, or is damaged, it is
        compiled again
    options : numba's. `forceinline` applies to the function alone: unless it is stated, numba takes it from
        the caller, and so for all that is called, which takes twice as long to compile
    """
    options = {"forceinline": False} | _ENTRY | options

    def compiled(function: Callable[..., Any]) -> Any:
        if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # to debug
            return function
        entry: Any = numba.njit(**options)(function)
        if cache:
            keep(entry)
        if CALLED:
            called = numba.njit(**options | CALLED)(function)

            def template(args: Any, kws: Any) -> Any:
                """Let a literal argument count as its type: numba would compile for 0 and for integers."""
                literal = (types.Literal, types.Tuple)
                plain = [types.unliteral(kind) if isinstance(kind, literal) else kind for kind in args]
                return called.get_call_template(plain, kws)

            # by these numba resolves a call from compiled code: its types, and then its code
            entry.get_call_template, entry.get_overload = template, called.get_overload
        return entry

    return compiled


@njit(cache=True)
def copy(source: NDArray[Any], target: NDArray[Any]) -> None:
    """target = source, both (n,).

    Numba compiles `target[:] = source` with the message for shapes that differ: 3 s for every pair of types.
    """
    for i in range(len(target)):
        target[i] = source[i]


def _element(context: Any, kind: Any, index: Any) -> Any:
    """Signature of `array[index]`."""
    return context.resolve_function_type(operator.getitem, (kind, index), {})


def _type_of_view(context: Any, kind: Any, index: Any) -> Any:
    """Type of `at` of a value of this type."""
    if hasattr(kind, "instance_class"):  # a NamedTuple
        views = [_type_of_view(context, of, index) for of in kind]
        return types.BaseTuple.from_types(views, kind.instance_class)
    return _element(context, kind, index).return_type if isinstance(kind, types.Array) else kind


@type_callable(at)
def _type_at(context: Any) -> Callable[[Any, Any], Any]:
    """Type of `at` in compiled functions."""
    return lambda many, index: _type_of_view(context, many, index)


@lower_builtin(at, types.Any, types.Any)  # type: ignore[untyped-decorator]
def _lower_at(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    """Code of `at`, in place: functions cannot return records, and where numba inlines an `overload` it takes
    what is written to the views for dead code.
    """
    (_, index), typing = signature.args, context.typing_context

    def view(kind: Any, value: Any) -> Any:
        if hasattr(kind, "instance_class"):
            views = [view(of, builder.extract_value(value, i)) for i, of in enumerate(kind)]
            return context.make_tuple(builder, _type_of_view(typing, kind, index), views)
        if isinstance(kind, types.Array):
            element = context.get_function(operator.getitem, _element(typing, kind, index))
            return element(builder, (value, args[1]))
        return impl_ret_borrowed(context, builder, kind, value)

    return view(signature.args[0], args[0])


def _can_put(many: Any, index: Any, one: Any) -> bool:
    """Tell whether `put` has code for these types: whole arrays in C order of one type, and numbers."""
    if hasattr(many, "instance_class"):
        return len(many) == len(one) and all(
            _can_put(rows, index, values) for rows, values in zip(many, one, strict=True)
        )
    if isinstance(one, types.Array):
        whole, like = many.layout == one.layout == "C", many.dtype == one.dtype
        return bool(whole and like and many.ndim == one.ndim + 1)
    return isinstance(many, types.Array) and bool(many.ndim == 1)


@type_callable(put)
def _type_put(context: Any) -> Callable[[Any, Any, Any], Any]:
    """Type of `put` in compiled functions."""
    return lambda many, index, one: types.none if _can_put(many, index, one) else None


@lower_builtin(put, types.Any, types.Any, types.Any)  # type: ignore[untyped-decorator]
def _lower_put(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    """Code of `put`: arrays are copied whole, of the size that the source has."""
    (_, index, _), typing = signature.args, context.typing_context

    def write(many_kind: Any, many: Any, one_kind: Any, one: Any) -> None:
        if hasattr(many_kind, "instance_class"):
            for i, kinds in enumerate(zip(many_kind, one_kind, strict=True)):
                rows, values = builder.extract_value(many, i), builder.extract_value(one, i)
                write(kinds[0], rows, kinds[1], values)
        elif isinstance(one_kind, types.Array):
            call = _element(typing, many_kind, index)
            row = context.get_function(operator.getitem, call)(builder, (many, args[1]))
            target = make_array(call.return_type)(context, builder, row)
            source = make_array(one_kind)(context, builder, one)
            cgutils.raw_memcpy(builder, target.data, source.data, source.nitems, source.itemsize)
        else:
            call = typing.resolve_function_type(operator.setitem, (many_kind, index, one_kind), {})
            context.get_function(operator.setitem, call)(builder, (many, args[1], one))

    write(signature.args[0], args[0], signature.args[2], args[2])
    return context.get_dummy_value()
