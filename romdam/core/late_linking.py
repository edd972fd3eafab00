"""Compile a call tree once: functions are linked as they were lowered, and optimised where Python calls them.

Numba optimises every compiled function together with all that it calls, at every level of a tree of calls,
and makes each a function that Python can call. Of a time loop that calls sixty functions only the loop itself
is called by Python. Here a function that compiled code calls is lowered and no more (`_Linked`), and the loop
is optimised once, after all that it calls is linked into it (`_Whole`). A first start compiles in less time
so; `tests/benchmarks/bench_first_start.py` measures it.

While it resolves calls numba also compares the flags of compilation a hundred thousand times. Its hash is the
same for all flags, and its comparison collects the values of all options of both. `_same_flags` and
`_hash_of_flags` answer the same in a hundredth of the time, which is a fifth of that of compiling.

Everything here is inside numba and no interface of it, so the module is imported only for the versions that
it was tried with (`romdam.core.jit`); with others numba compiles in its own way, to the same numbers.
"""

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, PassManager, register_pass
from numba.core.targetconfig import TargetConfig
from numba.core.untyped_passes import IRProcessing


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


class Compiler(CompilerBase):
    """Numba's own passes, and the choice of a library."""

    def define_pipelines(self) -> list[PassManager]:
        """List the one way to compile."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_ChooseLibrary, IRProcessing)
        passes.finalize()
        return [passes]


OPTIONS: dict[str, Any] = {"no_cfunc_wrapper": True, "pipeline_class": Compiler}


def _same_flags(flags: Any, other: Any) -> bool:
    """Tell whether all options have equal values, of which those that are not set have their defaults."""
    if not isinstance(other, TargetConfig):
        return NotImplemented
    theirs: Any = other
    if flags.options.keys() != theirs.options.keys():
        return False
    return all(
        flags._values.get(name, flags.options[name].default)
        == theirs._values.get(name, theirs.options[name].default)
        for name in flags._values.keys() | theirs._values.keys()
    )


def _hash_of_flags(flags: Any) -> int:
    """Hash of the switches that are not at their defaults."""
    return hash(
        frozenset(
            (name, value)
            for name, value in flags._values.items()
            if isinstance(value, bool) and value != flags.options[name].default
        )
    )


TargetConfig.__eq__ = _same_flags  # type: ignore[method-assign]
TargetConfig.__hash__ = _hash_of_flags  # type: ignore[method-assign]
