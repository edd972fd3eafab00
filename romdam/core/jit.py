"""Compiled functions: a cache that may be missing or damaged, whether views count references, and `at`.

A function that compiled code calls is lowered and no more (`_Linked`), and one that Python calls is optimised
once all that it calls is in it (`_Whole`), where numba is the one this was tried with; numba by itself
optimises both, with all below, at every level of calls, and makes each a way in from Python.

Every view (a row of a run's state) takes an atomic increment and a decrement, dozens per step. The time loop
itself makes no arrays, so it needs none; what it calls says so where it does make some, for the option is
handed down to the functions that are called. Both let Python's other threads go on.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import logging
import operator
import os
import stat
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import numba
from numba import types
from numba.core import cgutils
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, PassManager, register_pass
from numba.core.dispatcher import Dispatcher
from numba.core.imputils import impl_ret_borrowed
from numba.core.untyped_passes import IRProcessing
from numba.extending import lower_builtin, type_callable
from numba.misc.appdirs import AppDirs
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

from romdam.core.arrays import at, put
from romdam.core.files import hold, lock_folder
from romdam.core.fingerprint import code_digest, files_digest

log = logging.getLogger(__name__)

_SETTINGS: Any = numba.config
_LONG = 1.0  # seconds of compiling that are worth a line
_PATIENCE, _LOOK = 300.0, 0.05  # seconds to wait for a process that compiles the same, and between two looks
_RARELY = (50_000, 20, 20)  # objects made between two looks for garbage; looks before older ones are in them
_TRIED = (0, 68)  # the numba that `_Linked`, `_Whole` and `_Compiler` were tried with

# no arrays are made there, nor by what is called; or some may be
VIEWS: dict[str, Any] = {"cache": True, "nogil": True, "_nrt": False}
ARRAYS: dict[str, Any] = {"cache": True, "nogil": True, "_nrt": True}


class _Linked(JITCodeLibrary):
    """Code that is linked into what calls it: optimised and made the processor's there, with the rest, once.

    Nothing calls it from Python, so it has no address and no environment.
    """

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()  # type: ignore[no-untyped-call]
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Null: the code is nowhere but in its callers."""
        self._ensure_finalized()  # type: ignore[no-untyped-call]
        return 0

    @property
    def codegen(self) -> _Linked:
        """Object that numba asks to tell the function's environment, which is the callers'."""
        return self

    def set_env(self, name: str, environment: object) -> None:
        """Keep none."""


class _Whole(JITCodeLibrary):
    """Code that Python calls: not optimised before all that it calls is linked in, and then as a whole."""

    def _optimize_functions(self, module: Any) -> None:
        module.data_layout = self._codegen._data_layout


@register_pass(mutates_CFG=False, analysis_only=True)
class _ChooseLibrary(AnalysisPass):
    """Let a function be lowered to linked code, or to a whole."""

    _name = "romdam_choose_library"

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]

    def run_pass(self, state: Any) -> bool:
        """Give the function its library, which it otherwise gets when it is lowered."""
        codegen, name = state.targetctx.codegen(), state.func_id.func_qualname
        if state.flags.no_cpython_wrapper:
            state.library = _Linked(codegen, name)  # type: ignore[no-untyped-call]
        else:
            state.library = _Whole(codegen, name)  # type: ignore[no-untyped-call]
            state.library.enable_object_caching()
        return False


class _Compiler(CompilerBase):
    """Numba's own passes, and the choice of a library."""

    def define_pipelines(self) -> list[PassManager]:
        """List the one way to compile."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_ChooseLibrary, IRProcessing)
        passes.finalize()
        return [passes]


_ENTRY: Any = {"no_cfunc_wrapper": True, "pipeline_class": _Compiler}
if numba.version_info.short != _TRIED:
    _ENTRY = {}
# options of functions that only compiled ones call
CALLED: Any = _ENTRY and _ENTRY | {"no_cpython_wrapper": True}


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit`, with a second function for compiled callers, which is only lowered.

    Where the cache cannot be written, or is damaged, that costs time and nothing else. `forceinline` is for
    the function itself: numba would hand it down to all that is called, which takes twice as long to compile.
    """
    options = {"forceinline": False} | _ENTRY | options

    def compiled(function: Callable[..., Any]) -> Any:
        if _SETTINGS.DISABLE_JIT:  # to debug
            return function
        entry: Any
        try:
            entry = numba.njit(**options)(function)
        except RuntimeError as error:
            if "no locator" not in str(error):
                raise
            # neither the package nor the user's home takes a cache
            folder = _temporary_cache()
            with nullcontext() if folder is None else _caching_in(folder):
                entry = numba.njit(**options | ({"cache": False} if folder is None else {}))(function)
        lock = _Lock()
        cache, compile_ = entry._cache, entry.compile
        if hasattr(cache, "_cache_file"):
            _guard(cache, lock)
            # numba looks at the file of the function alone; what it calls stands in other files, and those
            # of a checkout that is brought up to date change one by one
            index, folder = cache._cache_file, Path(function.__code__.co_filename).parent
            index._source_stamp = (index._source_stamp, _code_of(function.__module__, folder))

        def compile_without_collecting(signature: Any) -> Any:
            """Compile with few looks for garbage: at numba's millions of objects, they take an eighth of the
            time. The lock, taken where the cache holds nothing, is held until the code is kept, or failed.
            """
            before = gc.get_threshold()
            gc.set_threshold(*_RARELY)
            try:
                return compile_(signature)
            finally:
                gc.set_threshold(*before)
                lock.release()

        entry.compile = compile_without_collecting
        if CALLED:
            called = numba.njit(**options | CALLED | {"cache": False})(function)

            def template(args: Any, kws: Any) -> Any:
                """Types of calls, one for all values: numba would compile it for 0 and for integers."""
                literal = (types.Literal, types.Tuple)
                plain = [types.unliteral(kind) if isinstance(kind, literal) else kind for kind in args]
                return called.get_call_template(plain, kws)

            entry.get_call_template, entry.get_overload = template, called.get_overload
        return entry

    return compiled


class _Lock:
    """Lock of the process that compiles a function for some types of arguments: others wait for it.

    Processes that start together, as workers of a suite or of the tests, would each compile the same.
    """

    def __init__(self) -> None:
        self._held: tuple[Path, int] | None = None

    def take(self, cache: Any, signature: object) -> None:
        """Wait for another process that compiles the same, not for ever: it may be stopped."""
        kind = hashlib.sha256(repr(signature).encode()).hexdigest()[:16]
        path = Path(cache.cache_path) / f"{Path(cache._cache_file._index_name).stem}.{kind}.lock"
        end = time.monotonic() + _PATIENCE
        with suppress(OSError):  # where nothing can be written, nothing is kept either
            cache._impl.locator.ensure_cache_path()
            while (descriptor := hold(path)) is None and time.monotonic() < end:
                time.sleep(_LOOK)
            self._held = None if descriptor is None else (path, descriptor)

    def release(self) -> None:
        """Let others compile, or read what was kept."""
        if self._held is not None:
            path, descriptor = self._held
            self._held = None
            os.close(descriptor)
            with suppress(OSError):
                path.unlink()


@contextmanager
def _caching_in(folder: Path) -> Iterator[None]:
    """Let numba cache what is declared meanwhile in this folder."""
    before = _SETTINGS.CACHE_DIR
    _SETTINGS.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        _SETTINGS.CACHE_DIR = before


@contextmanager
def caching_by_content(sha256: str) -> Iterator[None]:
    """Keep functions of a file that is not romdam's, declared meanwhile, by the SHA-256 of its bytes.

    Numba by itself asks for the file's time and size, which two contents may share, and keeps what it
    compiles beside the file.
    """
    base = _SETTINGS.CACHE_DIR or AppDirs(appname="numba", appauthor=False).user_cache_dir
    with _caching_in(Path(base) / f"law-{sha256[:32]}") if sha256 else nullcontext():
        yield


@contextmanager
def keeping_nothing() -> Iterator[None]:
    """Let functions that are declared meanwhile be compiled anew in every process, whatever they ask for.

    Numba keeps them by the time and size of their file, with the values that they have taken from elsewhere.
    """
    numbas: Any = Dispatcher
    enable = numbas.enable_caching
    numbas.enable_caching = lambda self: None
    try:
        yield
    finally:
        numbas.enable_caching = enable


@functools.cache
def _temporary_cache() -> Path | None:
    """This user's own folder for compiled functions among the temporary ones; None where it cannot be had.

    What is cached is unpickled: a folder that another user has made, or may write into, is not used.
    """
    try:
        folder = Path(tempfile.gettempdir()) / f"romdam-numba-{os.getuid()}"
        folder.mkdir(mode=0o700, exist_ok=True)
        about = folder.lstat()
        private = about.st_uid == os.geteuid() and stat.S_IMODE(about.st_mode) & 0o077 == 0
        if not (private and stat.S_ISDIR(about.st_mode)):
            raise OSError(f"{folder} is not this user's alone")
        tempfile.TemporaryFile(dir=folder).close()
    except (OSError, AttributeError) as error:  # AttributeError: Windows has no getuid
        log.warning(
            "no folder takes compiled functions (%s): compiling takes a minute; set NUMBA_CACHE_DIR", error
        )
        return None
    log.warning("compiled functions are kept in %s; set NUMBA_CACHE_DIR to another folder", folder)
    return folder


@functools.cache
def _code_of(module: str, folder: Path) -> str:
    """SHA-256 of what compiled functions of a module may call and take: of what it imports, in the end.

    A module that is not romdam's may call all of romdam, and what stands in the folder of its file.
    """
    if module.startswith("romdam."):
        return code_digest(module, __name__)
    return files_digest(sorted(folder.glob("*.py"))) + code_digest()


def _guard(cache: Any, lock: _Lock) -> None:
    """Make a cache that cannot be read or written count as empty: numba unpickles whatever it finds.

    Between a look for what is not there and its being kept numba compiles, which is said where it takes long,
    while it does and once it is done. Two processes that keep at once would write each other's data under one
    name of the index, so each keeps alone.
    """
    load, save = cache.load_overload, cache.save_overload
    asked, watch = [0.0], [threading.Timer(_LONG, _say_compiling)]

    def read(*key: Any) -> Any:
        try:
            return load(*key)
        except Exception as error:  # whatever unpickling raises of a damaged file, or of another numba's
            log.info("%s: compiled functions cannot be read (%s); compiling again", cache.cache_path, error)
            with suppress(OSError):
                cache.flush()
            return None

    def load_overload(*key: Any) -> Any:
        asked[0] = time.perf_counter()
        kept = read(*key)
        if kept is None:
            watch[0] = threading.Timer(_LONG, _say_compiling)
            watch[0].daemon = True
            watch[0].start()
            lock.take(cache, key[0])
            kept = read(*key)
            if kept is not None:
                watch[0].cancel()
        return kept

    def save_overload(*compiled: Any) -> None:
        watch[0].cancel()
        seconds = time.perf_counter() - asked[0]
        if seconds > _LONG:
            log.info("compiled in %.0f s", seconds)
        try:
            cache._impl.locator.ensure_cache_path()
            with lock_folder(Path(cache.cache_path)):
                save(*compiled)
        except Exception as error:  # of the disk or of pickling: what is compiled works all the same
            log.info("%s: compiled functions cannot be kept (%s)", cache.cache_path, error)

    cache.load_overload, cache.save_overload = load_overload, save_overload


def _say_compiling() -> None:
    log.info("compiling, once for this version: it takes up to a minute ...")


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
