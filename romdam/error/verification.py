"""The verification: a reduced run against one of the full order, on the same record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.system import History
from romdam.error.comparison import Comparison, Openings, compare_openings
from romdam.error.metrics import largest_difference
from romdam.error.statement import ErrorStatement
from romdam.postprocess.stated_errors import percent

REFINEMENT = 4  # the full order steps at the reduced model's finest step / 4, where its own error is about
# 0.3 of the reduced model's,
SAMPLE = 16  # but at no less than this part of the record's step, so that the longest record ends


@dataclass(frozen=True)
class VerifiedRun:
    """One of the two runs.

    Attributes
    ----------
    history : as integrated
    openings : of it, with the gaps' positions
    stress : (k,) largest major principal stress over time of every stress node [Pa]; None if not asked for
    """

    history: History
    openings: Openings
    stress: Floats | None

    @property
    def step(self) -> float:
        """Finest step, taken where contact changes [s]."""
        return self.history.stats["finest_step"]


def full_order_step(reduced: VerifiedRun, record_step: float) -> float:
    """Step of the full order, fine enough to be compared with; not yet such that it divides the rows [s]."""
    return max(reduced.step / REFINEMENT, record_step / SAMPLE)


def verification(
    reduced: VerifiedRun, full: VerifiedRun, joints: Mapping[str, slice], about: Mapping[str, object]
) -> ErrorStatement:
    """State how far a reduced run is from the full order.

    Parameters
    ----------
    joints : name -> slice of its gaps
    about : record, configuration and whatever else is to be written with it

    Raises
    ------
    ResultError
        where no joint moved.
    """
    names = ("the reduced model", "the full order")
    comparison = compare_openings(reduced.openings, full.openings, names, joints)
    details = comparison.plain | _stress(reduced, full) | _cost(reduced, full) | dict(about)
    details["joints"] = _joint_peaks(comparison, reduced, full, joints)
    begin = f" from its {about['first_second']:g} s on" if about.get("first_second") else ""
    sentence = (
        f"Against the unreduced mesh (generalised-alpha, dt {full.step:g} s), {comparison.seconds:g} s of "
        f"{about['record']}{begin}: peak opening differs by {percent(comparison.error.peak)}, "
        f"all openings by {percent(comparison.error.l2)} in L2."
    )
    return ErrorStatement("verification", sentence, {"opening": comparison.error}, details)


def against_reference(
    reduced: VerifiedRun, full: VerifiedRun, stored: Openings, name: str
) -> dict[str, object]:
    """Compare both runs with a stored one.

    Parameters
    ----------
    stored, name : the openings of that run, and what messages call it

    Raises
    ------
    ResultError
        where its gaps or times do not match.
    """
    return {
        f"{kind}_against_reference": compare_openings(run.openings, stored, (f"the {kind} model", name)).plain
        for kind, run in (("reduced", reduced), ("full", full))
    }


def _joint_peaks(
    comparison: Comparison, reduced: VerifiedRun, full: VerifiedRun, joints: Mapping[str, slice]
) -> dict[str, dict[str, float]]:
    """Joint -> its peak opening in both runs [m], and the relative error."""
    return {
        name: {
            "peak": float(reduced.openings.opening[:, gaps].max()),
            "peak_full": float(full.openings.opening[:, gaps].max()),
            "peak_error": comparison.error.joints[name].peak,
        }
        for name, gaps in joints.items()
    }


def _stress(reduced: VerifiedRun, full: VerifiedRun) -> dict[str, object]:
    """Difference of the envelopes of the major principal stress; empty where no stress is asked for."""
    if reduced.stress is None or full.stress is None:
        return {}
    peak, peak_full = float(reduced.stress.max()), float(full.stress.max())
    return {
        "peak_principal_stress": peak,
        "peak_principal_stress_full": peak_full,
        "peak_principal_stress_error": abs(peak - peak_full) / float(np.abs(full.stress).max()),
        "principal_stress_worst_node_error": largest_difference(reduced.stress, full.stress),
    }


def _cost(reduced: VerifiedRun, full: VerifiedRun) -> dict[str, object]:
    """Steps and CPU seconds of both runs, and their ratios."""
    stats, stats_full = reduced.history.stats, full.history.stats
    cpu, cpu_full = stats["loop_cpu_seconds"], stats_full["loop_cpu_seconds"]
    per_step, per_step_full = cpu / stats["steps"], cpu_full / stats_full["steps"]
    return {
        "dt": reduced.step,
        "dt_full": full.step,
        "cpu_seconds": cpu,
        "cpu_seconds_full": cpu_full,
        "cpu_ratio": cpu_full / cpu,
        "cpu_seconds_per_step": per_step,
        "cpu_seconds_per_step_full": per_step_full,
        "cpu_ratio_per_step": per_step_full / per_step,
    }
