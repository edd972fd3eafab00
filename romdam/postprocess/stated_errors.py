"""The stated errors of a run's openings together, as every table, page and report tells them."""

from __future__ import annotations

from collections.abc import Mapping

PARTS = ("mesh", "modes", "steps")


def percent(value: float) -> str:
    """An error as text, of two digits."""
    return f"{float(f'{100.0 * value:.2g}'):.6g} %"


def total_error(errors: Mapping[str, float]) -> tuple[float, list[str]]:
    """Sum of the stated errors in L2, which bounds their total, and the parts that nobody states.

    Parameters
    ----------
    errors : part among PARTS -> its error, as `romdam.error.statement.opening_errors` gives them
    """
    return sum(errors.values()), [part for part in PARTS if part not in errors]


def total_text(errors: Mapping[str, float]) -> str:
    """The total in words, with what is not known of it."""
    if not errors:
        return "unknown"
    total, unknown = total_error(errors)
    more = f", {' and '.join(unknown)} unknown" if unknown else ""
    return f"{percent(total)}{more}"
