"""What the compiled functions of a user's law take from outside their own text.

Numba puts the values of globals, of a module's attributes and of closures into the code that it compiles,
once, and compiled functions that are called bring theirs. So a function is known by its text and by all of
these, which `closed` gathers; and it is compiled from a copy that has these very values, not from functions
that were compiled when they were others. What nobody can tell a change of is refused.
"""

from __future__ import annotations

import builtins
import dis
import enum
import itertools
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

from romdam.core.errors import ConfigError, quote
from romdam.core.fingerprint import code_digest

# whose functions and constants are known by their names: versions of these are in every key of what is kept
_KNOWN = frozenset(sys.stdlib_module_names) | {"numpy", "numba", "scipy", "romdam"}
_OBJECT_MODE = type(numba.objmode)  # Python code within a compiled function: it may read anything
_copies = itertools.count()
_PLAIN = (bool, int, float, complex, str, bytes, type(None))


@dataclass(frozen=True)
class Closed:
    """A function with all that it takes from outside.

    Attributes
    ----------
    function : a copy that has the values of now
    content : what it takes, as `romdam.core.fingerprint.fingerprint` takes it
    """

    function: Callable[..., Any]
    content: object


def closed(function: Callable[..., Any], file: str) -> Closed:
    """Gather what a function takes from outside.

    Parameters
    ----------
    file : of the law, whose text is known already

    Raises
    ------
    ConfigError
        for what may change without a trace, naming it.
    """
    function = getattr(function, "py_func", function)  # one that the user has compiled
    copy, content = _Walk(file, function.__qualname__).function(function)
    return Closed(copy, content)


@dataclass
class _Walk:
    """One walk over a function and what it calls; functions that call each other are met once."""

    file: str
    name: str
    met: dict[int, tuple[Any, object]] = field(default_factory=dict)

    def function(self, function: Any) -> tuple[Any, object]:
        """A copy of a function, and its content: its text, unless it is the law's, and what that takes."""
        code = function.__code__
        taken, cells = {"__builtins__": builtins}, tuple(CellType() for _ in code.co_freevars)
        copy = FunctionType(code, taken, function.__name__, function.__defaults__, cells)
        copy.__qualname__, copy.__kwdefaults__ = function.__qualname__, function.__kwdefaults__
        self.met[id(function)] = copy, ("met", function.__qualname__)
        contents: dict[str, object] = {}
        names = frozenset(name for each in _codes(code) for name in each.co_names)
        if "objmode" in names:
            raise self._refusal("objmode", "Python code within compiled code")
        called = {  # names of globals alone, of the function and of those within it
            instruction.argval
            for each in _codes(code)
            for instruction in dis.get_instructions(each)
            if instruction.opname in ("LOAD_GLOBAL", "LOAD_NAME")
        }
        for name in sorted(called & function.__globals__.keys()):
            taken[name], contents[name] = self.value(function.__globals__[name], name, names)
        for name, cell, outer in zip(code.co_freevars, cells, function.__closure__ or (), strict=True):
            cell.cell_contents, contents[f"closure {name}"] = self.value(outer.cell_contents, name, names)
        defaults = [self.value(value, "a default", names)[1] for value in function.__defaults__ or ()]
        return copy, (() if code.co_filename == self.file else _text(code), contents, defaults)

    def value(self, value: Any, name: str, names: frozenset[str]) -> tuple[Any, object]:
        """A copy of a value as compiled code may take it, and its content; `names` are the user's."""
        if id(value) in self.met:
            return self.met[id(value)]
        if isinstance(value, enum.Enum):
            return value, (type(value).__qualname__, value.name, self.value(value.value, name, names)[1])
        if isinstance(value, _PLAIN):
            return value, repr(value)
        if isinstance(value, np.ndarray | np.generic) and value.dtype.kind != "O":
            array = np.array(value)
            about = (str(array.dtype.descr), array.shape, array.tobytes())
            return (array if isinstance(value, np.ndarray) else value), about
        if isinstance(value, tuple):
            copies = [self.value(entry, name, names) for entry in value]
            return value if hasattr(value, "_fields") else tuple(c for c, _ in copies), [c for _, c in copies]
        if isinstance(value, Dispatcher):
            return self._compiled(value)
        if isinstance(value, _OBJECT_MODE):
            raise self._refusal(name, "Python code within compiled code")
        if self._is_known(value):
            return value, (type(value).__name__, *_known(value))
        if isinstance(value, FunctionType):
            copy, content = self.function(value)
            return numba.njit(copy), content
        if isinstance(value, ModuleType):
            return self._module(value, names)
        if isinstance(value, type) and issubclass(value, enum.Enum):
            return value, [self.value(entry, name, names)[1] for entry in value]
        if isinstance(value, type) and issubclass(value, BaseException):
            return value, value.__qualname__
        if isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
            return value, (value.__qualname__, list(value._fields))
        raise self._refusal(name, f"of type {type(value).__name__}")

    def _compiled(self, value: Any) -> tuple[Any, object]:
        """A function that numba compiles, from a copy: what it was compiled to had the values of then."""
        if self._is_known(value.py_func):
            return value, _known(value.py_func)
        function, content = self.function(value.py_func)
        types = () if value._can_compile else (list(value.nopython_signatures),)
        copy = numba.jit(*types, **value.targetoptions)(function)
        self.met[id(value)] = copy, content
        return copy, (sorted((key, repr(option)) for key, option in value.targetoptions.items()), content)

    def _module(self, module: ModuleType, names: frozenset[str]) -> tuple[Any, object]:
        """A module with what a function may take of it, by the names in the function's text."""
        copy = ModuleType(f"{module.__name__} {next(_copies)}")  # numba takes modules of one name for one
        contents: dict[str, object] = {}
        for name in sorted(names & vars(module).keys()):
            with suppress(ConfigError):  # another thing's attribute of that name; else numba misses it
                value, contents[name] = self.value(vars(module)[name], name, names)
                setattr(copy, name, value)
        return copy, contents

    def _is_known(self, value: Any) -> bool:
        """Tell whether a name says all of a value: not so where the user's file hides another's module."""
        top, beside = _qualified(value).partition(".")[0], Path(self.file).parent
        file = Path(getattr(sys.modules.get(top), "__file__", None) or "/nowhere/nowhere/nowhere")
        return top in _KNOWN and (top == "romdam" or beside not in (file.parent, file.parent.parent))

    def _refusal(self, name: str, what: str) -> ConfigError:
        return ConfigError(
            f"{self.file}: {self.name} takes {quote(name)} from outside, {what}, and nobody can tell when it "
            "changes; take numbers, texts, tuples, arrays, modules and functions that compile"
        )


def _codes(code: CodeType) -> Iterator[CodeType]:
    """The code of a function, and that of functions within it."""
    yield code
    for const in code.co_consts:
        if isinstance(const, CodeType):
            yield from _codes(const)


def _text(code: CodeType) -> object:
    consts = [_text(c) if isinstance(c, CodeType) else repr(c) for c in code.co_consts]
    return (code.co_code, consts, list(code.co_names), list(code.co_varnames), list(code.co_freevars))


def _known(value: Any) -> tuple[str, ...]:
    """Name of what a name says all of; where that is romdam's, the digest of its code, too."""
    name = _qualified(value)
    if not name.startswith("romdam."):
        return (name,)
    return name, code_digest(name if isinstance(value, ModuleType) else value.__module__)


def _qualified(value: Any) -> str:
    """Module and name of a function, a class or a type of numba's, of a module its name; else empty."""
    if isinstance(value, ModuleType):
        return value.__name__
    if isinstance(value, np.ufunc):
        return f"numpy.{value.__name__}"
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if isinstance(value, numba.types.Type):
        module, name = type(value).__module__, repr(value)
    return f"{module}.{name}" if module and name else ""
