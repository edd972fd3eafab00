"""What is checked of a run against limits: values and verdicts, as terminal, page and summary tell them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from romdam.postprocess.run_warnings import LEDGER_LIMIT
from romdam.postprocess.stated_errors import PARTS

MET, MISSED, NOT_JUDGED = "met", "missed", "not judged"
_BY_STEPS = {  # what an accuracy can be asked for besides openings -> attributes of a result
    "slips": ("solver_estimated_time_error_slips", "solver_accuracy_slips"),
    "residual slips": ("solver_estimated_time_error_residual_slips", "solver_accuracy_residual_slips"),
}


def verdict(value: float | None, limit: float | None) -> str:
    """MET, MISSED, or NOT_JUDGED where there is no limit or no value."""
    if value is None or limit is None or value != value:
        return NOT_JUDGED
    return MET if value <= limit else MISSED


@dataclass(frozen=True)
class Check:
    """A value of a run beside its limit; None where one of them is not known.

    Attributes
    ----------
    text : what is checked
    value, limit : shares of 1
    is_share : whether they are shown in percent
    """

    text: str
    value: float | None
    limit: float | None
    is_share: bool = True

    @property
    def verdict(self) -> str:
        """See `verdict`."""
        return verdict(self.value, self.limit)


def run_checks(
    attributes: Mapping[str, object], errors: Mapping[str, float], tolerance: float
) -> list[Check]:
    """Every check of a run.

    Parameters
    ----------
    attributes : of its result
    errors : stated errors of the openings, see `romdam.error.statement.opening_errors`
    tolerance : of the contact problem
    """

    def number(name: str) -> float | None:
        return float(str(attributes[name])) if name in attributes else None

    checks = list[Check]()
    if (residual := number("solver_largest_residual")) is not None:
        checks.append(Check("largest residual of the contact problem", residual, tolerance, False))
    if (ledger := number("solver_ledger_imbalance")) is not None:
        checks.append(Check("energy that the ledger lacks, of the exchanged", ledger, LEDGER_LIMIT))
    for part in reversed(PARTS):
        limit = number("solver_accuracy") if part == "steps" else None
        checks.append(Check(f"error of the openings from the {part}, L2", errors.get(part), limit))
    for name, (stated, asked) in _BY_STEPS.items():
        if stated in attributes:
            checks.append(Check(f"error of the {name} from the steps", number(stated), number(asked)))
    return checks
