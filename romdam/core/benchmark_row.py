"""A number of the benchmark set beside that of others, as cases give it and tables and pages show it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

# printed by who computed or measured it, quoted by somebody else, an equation, computed with another code
Kind = Literal["printed", "secondary", "closed form", "another code"]
Verdict = Literal["within", "known difference", "outside", "failed"]
WRONG: tuple[Verdict, ...] = ("outside", "failed")


@dataclass(frozen=True)
class BenchmarkRow:
    """One number of others with romdam's beside it.

    Attributes
    ----------
    case : name of its case
    what : the model in a sentence
    quantity, unit : what is compared, and its SI unit
    published : the answer of others [unit]
    ours : romdam's number [unit]; NaN where the case failed
    difference : ours / published - 1; NaN where the case failed
    tolerance : largest relative difference that is within
    verdict : within the tolerance, within it with a known reason to differ, outside, or failed
    source : publication, with its year
    kind : what the source gives
    measured : whether the number of others was measured, on a dam or a model of one
    note : the reason of a known difference, or the error
    """

    case: str
    what: str
    quantity: str
    unit: str
    ours: float
    published: float
    difference: float
    tolerance: float
    verdict: Verdict
    source: str
    kind: Kind
    measured: bool
    note: str
