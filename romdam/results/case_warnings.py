"""What a careful reader should know of a run."""

from __future__ import annotations

from romdam.config.load import Job
from romdam.postprocess.run_warnings import crack_warnings, far_warnings, run_warnings, unrest_warnings
from romdam.results.attached import attached_warnings
from romdam.results.case import Case
from romdam.results.sliding import sliding_warnings


def case_warnings(case: Case, job: Job) -> list[str]:
    """What is doubtful about a run, a sentence each."""
    return [
        *run_warnings(case.history.stats),
        *unrest_warnings(case.motion, case.history),
        *far_warnings(case.scene, case.history),
        *crack_warnings(job.config.loads.joint_water, case.scene, case.history),
        *sliding_warnings(case),
        *attached_warnings(case),
        *case.history.warnings,
    ]
