"""Many runs on one reduced system, marched together: ground motions, joint parameters, dampings.

What differs from run to run never touches the basis, so the products with the modes, which a lone run spends
waiting for memory, are made for all runs at once. Every run takes exactly the steps that it takes alone;
results differ by the order in which sums are made, that is by round-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.core.arrays import Floats
from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.system import GapLaw, History, System
from romdam.timestepping.modal.runs import Case, Progress
from romdam.timestepping.options import TransientOptions
from romdam.timestepping.simulate import integrate_cases

Outcome = History | ConvergenceError


@dataclass(frozen=True)
class BatchRun:
    """One run of a batch.

    Attributes
    ----------
    ground : (3, nt) ground acceleration at every base step [m/s2]
    law : the gaps' parameters
    damping : (m,) modal damping coefficients c [1/s], or None for the system's own
    """

    ground: Floats
    law: GapLaw
    damping: Floats | None = None


def march_batch(
    system: System,
    runs: Sequence[BatchRun],
    options: TransientOptions,
    progress: Progress | None = None,
) -> list[Outcome]:
    """Integrate all runs from the initial state over their whole ground motions.

    Parameters
    ----------
    system : the open-joint system; its law and damping are replaced by those of the runs
    runs : may differ in length
    options : the same for all
    progress : called with (base steps done, base steps in all)

    Returns
    -------
    list, in the order of the runs: the history, or why there is none. A run that fails does not disturb the
    others. In `stats`, "loop_cpu_seconds" is the run's share of the march by its steps, "batch" the number of
    runs that marched together.

    Raises
    ------
    ConfigError
        where options or a law do not suit the system.
    """
    if options.start is not None or options.shift is not None:
        raise ConfigError("a batch starts from initial_state and adds no jumps; integrate the run alone")
    variants = _variants(system, runs)
    cases = [Case(variant, run.ground) for variant, run in zip(variants, runs, strict=True)]
    return integrate_cases(cases, options, progress)


def _variants(system: System, runs: Sequence[BatchRun]) -> list[System]:
    """The system of every run; runs of equal parameters share one."""
    known: dict[tuple[object, ...], System] = {}
    variants = []
    for run in runs:
        key = _key(run)
        if key not in known:
            known[key] = with_parameters(system, run.law, run.damping)
        variants.append(known[key])
    return variants


def _key(run: BatchRun) -> tuple[object, ...]:
    law = run.law
    arrays = (law.K_n, law.K_nz, law.K_s, law.mu, law.gap, law.viscosity)
    damping = b"" if run.damping is None else run.damping.tobytes()
    laws = tuple((one.law, one.values.tobytes(), one.on.tobytes()) for one in law.laws)
    return (laws, damping, *(np.asarray(values).tobytes() for values in arrays))


def with_parameters(system: System, law: GapLaw, damping: Floats | None) -> System:
    """The same blocks with other joints' parameters and another damping.

    Parameters
    ----------
    damping : (m,) modal coefficients c [1/s], or None to keep the system's own

    Raises
    ------
    ConfigError
        for a law with shear on a system whose joints were reduced without it; for another number of gaps.
    """
    n, given = len(system.law), system.B.shape[0] // max(len(system.law), 1)
    if len(law) != n:
        raise ConfigError(f"the system has {n} gaps, got parameters of {len(law)}")
    if law.directions > given > 0:
        raise ConfigError(
            "joints: the system was reduced without the gaps' tangential directions, so a run on it can have "
            "no friction, cohesion or shear key; reduce it with friction"
        )
    B = system.B if law.directions == given else csr_matrix(system.B[::given])
    C = system.C if damping is None else csr_matrix(diags_array(np.asarray(damping, dtype=float)))
    return replace(system, law=law, B=B, C=C)
