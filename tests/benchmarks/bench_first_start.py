"""What does a first start compile, and how long? Functions, signatures, CPU seconds, with an empty cache.

    python tests/benchmarks/bench_first_start.py [configs/two_cantilevers.yaml] [--signatures]

Every function that numba compiles for `romdam run CONFIG`, numba's own too, without what the functions that
it calls take: types are inferred, code is lowered, LLVM optimises it and writes it in the processor's
language; the rest is numba's own passes. `--signatures` prints what tells apart the argument types of
functions that are compiled for several.
"""

from __future__ import annotations

import os
import tempfile

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ["NUMBA_CACHE_DIR"] = tempfile.mkdtemp(prefix="romdam-first-start-")  # before numba is imported

import argparse
import shutil
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any, NamedTuple

from numba.core import event

from romdam.config.load import load_config
from romdam.pipelines.run import run

PHASES = ("types", "lowering", "LLVM", "other")
OUTSIDE = "outside"


class Function(NamedTuple):
    """A function that is compiled, as linked code or to be called from Python."""

    name: str
    from_python: bool


class Account(event.Listener):
    """CPU seconds of every function and phase, those of what is compiled within it taken off."""

    def __init__(self) -> None:
        self.seconds: dict[Any, Any] = defaultdict(Counter)
        self.signatures: dict[Any, list[tuple[Any, ...]]] = defaultdict(list)
        self._under_way: list[tuple[Any, str]] = [(OUTSIDE, "other")]
        self._last = time.process_time()

    def on_start(self, what: event.Event) -> None:
        """Put down the time since the last event, and begin another phase, or function."""
        self._count()
        function, _ = self._under_way[-1]
        if what.kind == "numba:compile":
            function = _function(what.data["dispatcher"])
            self.signatures[function].append(what.data["args"])
        self._under_way.append((function, _phase(what)))

    def on_end(self, what: event.Event) -> None:
        """Put down the time since the last event, and go on with what was before."""
        self._count()
        self._under_way.pop()

    def _count(self) -> None:
        now, (function, phase) = time.process_time(), self._under_way[-1]
        self.seconds[function][phase] += now - self._last
        self._last = now


def _function(dispatcher: Any) -> Function:
    python = dispatcher.py_func
    name = f"{python.__module__}.{python.__qualname__}".replace("<locals>.", "")
    return Function(name, not dispatcher.targetoptions.get("no_cpython_wrapper", False))


def _phase(what: event.Event) -> str:
    if what.kind == "numba:llvm_lock":
        return "LLVM"
    name = what.data.get("name", "") if what.kind == "numba:run_pass" else ""
    return "types" if "inference" in name else "lowering" if "lowering" in name else "other"


def compiled(config: Path) -> Account:
    """Run a job with an empty cache; what it compiled."""
    account, out = Account(), tempfile.mkdtemp()
    kinds = ("numba:compile", "numba:run_pass", "numba:llvm_lock")
    for kind in kinds:
        event.register(kind, account)
    try:
        run(load_config(config), out)
    finally:
        for kind in kinds:
            event.unregister(kind, account)
        shutil.rmtree(out)
        shutil.rmtree(os.environ["NUMBA_CACHE_DIR"])
    return account


def print_table(account: Account) -> None:
    """A row for each function, the dearest first, and their sum."""
    print(f"{'CPU s':>7} " + " ".join(f"{phase:>8}" for phase in PHASES) + "  signatures, function")
    total: Any = Counter()
    functions = {of: spent for of, spent in account.seconds.items() if of != OUTSIDE}
    for of, spent in sorted(functions.items(), key=lambda one: -one[1].total()):
        called = ", called from Python" if of.from_python else ""
        print(f"{_numbers(spent)}  {len(account.signatures[of])} {of.name}{called}")
        total.update(spent)
    signatures = sum(len(kinds) for kinds in account.signatures.values())
    print(f"{_numbers(total)}  {signatures} of {len(functions)} functions in all")
    print(f"{account.seconds[OUTSIDE].total():7.2f} everything else")


def _numbers(spent: Any) -> str:
    return f"{spent.total():7.2f} " + " ".join(f"{spent[phase]:8.2f}" for phase in PHASES)


def print_signatures(account: Account) -> None:
    """The arguments in which the signatures of one function differ."""
    for of, kinds in account.signatures.items():
        for number, values in enumerate(zip(*kinds, strict=True)):
            if len(set(values)) > 1:
                print(f"{of.name}, argument {number}: " + " | ".join(map(str, values)))


def main() -> None:
    root = Path(__file__).parents[2]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("config", type=Path, nargs="?", default=root / "configs" / "two_cantilevers.yaml")
    parser.add_argument("--signatures", action="store_true")
    asked = parser.parse_args()
    account = compiled(asked.config)
    print_table(account)
    if asked.signatures:
        print_signatures(account)


if __name__ == "__main__":
    main()
