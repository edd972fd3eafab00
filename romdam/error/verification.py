"""The verification: a reduced run against one of the full order, on the same record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from romdam.error.comparison import ComparedRun, compare
from romdam.error.metrics import largest_difference
from romdam.error.statement import ErrorStatement
from romdam.postprocess.stated_errors import percent

STRESS = "principal_stress"  # history of a run: (k,) largest over time of every stress node [Pa]
REFINEMENT = 4  # the full order steps at the reduced model's finest step / 4, where its own error is about
# 0.3 of the reduced model's,
SAMPLE = 16  # but at no less than this part of the record's step, so that the longest record ends


def full_order_step(reduced: ComparedRun, record_step: float) -> float:
    """Step of the full order, fine enough to be compared with; not yet such that it divides the rows [s]."""
    return max(reduced.stats["finest_step"] / REFINEMENT, record_step / SAMPLE)


def verification(reduced: ComparedRun, full: ComparedRun, about: Mapping[str, object]) -> ErrorStatement:
    """State how far a reduced run is from the full order.

    Parameters
    ----------
    reduced, full : with `STRESS` where it is asked for
    about : record, configuration and whatever else is to be written with it

    Raises
    ------
    ResultError
        where no joint moved.
    """
    differences = compare("verification", reduced, full)
    opening, details = differences.errors["opening"], differences.plain
    if STRESS in reduced.histories and STRESS in full.histories:
        stress, stress_full = reduced.histories[STRESS], full.histories[STRESS]
        peak, peak_full = float(stress.max()), float(stress_full.max())
        details |= {
            "peak_principal_stress": peak,
            "peak_principal_stress_full": peak_full,
            "peak_principal_stress_error": abs(peak - peak_full) / float(np.abs(stress_full).max()),
            "principal_stress_worst_node_error": largest_difference(stress, stress_full),
        }
    (dt, cpu, steps), (dt_full, cpu_full, steps_full) = (
        [run.stats[name] for name in ("finest_step", "loop_cpu_seconds", "steps")] for run in (reduced, full)
    )
    details |= {
        "dt": dt,
        "dt_full": dt_full,
        "cpu_seconds": cpu,
        "cpu_seconds_full": cpu_full,
        "cpu_ratio": cpu_full / cpu,
        "cpu_seconds_per_step": cpu / steps,
        "cpu_seconds_per_step_full": cpu_full / steps_full,
        "cpu_ratio_per_step": (cpu_full / steps_full) / (cpu / steps),
    }
    details |= about
    details["joints"] = {
        name: {
            "peak": float(reduced.opening[:, gaps].max()),
            "peak_full": float(full.opening[:, gaps].max()),
            "peak_error": opening.joints[name].peak,
        }
        for name, gaps in reduced.joints.items()
    }
    begin = f" from its {about['first_second']:g} s on" if about.get("first_second") else ""
    sentence = (
        f"Against the unreduced mesh (generalised-alpha, dt {dt_full:g} s), {differences.seconds:g} s of "
        f"{about['record']}{begin}: peak opening differs by {percent(opening.peak)}, "
        f"all openings by {percent(opening.l2)} in L2."
    )
    return ErrorStatement("verification", sentence, {"opening": opening}, details)


def against_stored(reduced: ComparedRun, full: ComparedRun, stored: ComparedRun) -> dict[str, object]:
    """Compare both runs with a stored one.

    Raises
    ------
    ResultError
        where its gaps or times do not match.
    """
    return {
        f"{kind}_against_reference": compare("stored", replace(run, name=f"the {kind} model"), stored).plain
        for kind, run in (("reduced", reduced), ("full", full))
    }
