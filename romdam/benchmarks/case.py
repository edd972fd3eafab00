"""What a case of the benchmark set declares, and the rows that it gives.

A case is declared once, with the answers of others and their sources, in the file of its subject. It builds
its model as a user does, from a configuration, wherever a configuration can describe it.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from fnmatch import fnmatchcase
from math import nan

from romdam.core.benchmark_row import BenchmarkRow, Kind, Verdict
from romdam.core.errors import ConfigError, describe_error, quote, recoverable
from romdam.core.threads import one_thread


@dataclass(frozen=True)
class PublishedValue:
    """A number of a case that is compared.

    Attributes
    ----------
    name : what it is
    published : the answer of others [unit]
    unit : SI unit, empty for a ratio
    tolerance : largest relative difference from `published` that is within
    source : publication with its year, and page or equation as far as they are known
    kind : whether the source prints its own number, quotes another's, is an equation, or is another code
    reason : why romdam's number is known to differ; empty where it should not
    measured : whether it was measured, on a dam or a model of one
    """

    name: str
    published: float
    unit: str
    tolerance: float
    source: str
    kind: Kind
    reason: str = ""
    measured: bool = False


@dataclass(frozen=True)
class BenchmarkCase:
    """A model with known answers.

    Attributes
    ----------
    name : on the command line
    what : the model in a sentence
    quantities : what is compared
    compute : romdam's numbers, in the order of `quantities`
    """

    name: str
    what: str
    quantities: tuple[PublishedValue, ...]
    compute: Callable[[], Sequence[float]]


def select_cases(cases: Sequence[BenchmarkCase], *patterns: str) -> tuple[BenchmarkCase, ...]:
    """The cases whose names any of some patterns with * and ? matches; all without a pattern.

    Raises
    ------
    ConfigError
        for a pattern that none matches, naming the cases that are near, or all.
    """
    names = [case.name for case in cases]
    for pattern in patterns:
        if any(fnmatchcase(name, pattern) for name in names):
            continue
        near = difflib.get_close_matches(pattern.replace("*", ""), names, n=3)
        near = near or [name for name in names if pattern.replace("*", "") in name]
        raise ConfigError(
            f"--only: none of {len(names)} cases is named {quote(pattern)}; "
            + (f"near it are {', '.join(near)}" if near else f"there are {', '.join(names)}")
        )
    chosen = patterns or ("*",)
    return tuple(case for case in cases if any(fnmatchcase(case.name, pattern) for pattern in chosen))


@one_thread()
def run_cases(
    cases: Sequence[BenchmarkCase], show: Callable[[str], AbstractContextManager[object]] = nullcontext
) -> list[BenchmarkRow]:
    """Compute the cases in their order; one that fails leaves rows that say so, and the others go on.

    Parameters
    ----------
    show : tells a watcher which case is on
    """
    rows: list[BenchmarkRow] = []
    for case in cases:
        with show(case.name):
            rows += _rows(case)
    return rows


def _rows(case: BenchmarkCase) -> Iterator[BenchmarkRow]:
    message, ours = "", [nan] * len(case.quantities)
    try:
        ours = [float(value) for value in case.compute()]
    except recoverable() as error:
        message = describe_error(error)
    for quantity, value in zip(case.quantities, ours, strict=True):
        difference = value / quantity.published - 1.0
        verdict: Verdict = "known difference" if quantity.reason else "within"
        if message:
            verdict = "failed"
        elif not abs(difference) <= quantity.tolerance:  # NaN is outside too
            verdict = "outside"
        yield BenchmarkRow(
            case.name,
            case.what,
            quantity.name,
            quantity.unit,
            value,
            quantity.published,
            difference,
            quantity.tolerance,
            verdict,
            quantity.source,
            quantity.kind,
            quantity.measured,
            message or quantity.reason,
        )
