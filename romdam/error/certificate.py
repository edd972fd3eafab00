"""The certificate: the error of a result from its own joint forces and the full-order linear model.

The order of the stages stands in `romdam.pipelines.error.certify`, the reasons in `romdam.error.replay`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.arrays import Floats
from romdam.core.system import History, System
from romdam.error.comparison import ComparedRun, compare
from romdam.error.metrics import (
    RelativeError,
    energy_error,
    magnitude_error,
    relative_l2,
)
from romdam.error.replay import Defect, Forces, Replayed, replay_start, step_factor
from romdam.error.statement import ErrorStatement
from romdam.postprocess.stated_errors import percent
from romdam.results.stored_run import StoredRun

REPLAY_STEP = (
    0.0025  # [s] longest step of the replay; at twice it the main job's defect doubles, the error stays
)


@dataclass(frozen=True)
class Correction:
    """A run fed with the full order's defect, once or again.

    Attributes
    ----------
    first, last : defect of the run's own forces, and of those of the pass before the last
    corrected : the finer model's history with the last defect
    before : (nt, ng, d) jumps that the last pass has corrected [m]
    """

    first: Defect
    last: Defect
    corrected: History
    before: Floats

    @property
    def changed(self) -> float:
        """Change of the openings in the last pass, in L2."""
        return relative_l2(self.before[..., 0], self.corrected.jump[..., 0])


def replay_substeps(interval: float) -> int:
    """Steps of the replay in the time between two rows [s]."""
    return math.ceil(interval / REPLAY_STEP * (1.0 - 1e-9))


def ready_to_replay(system: System, interval: float) -> Replayed:
    """Factor a system for the replay of rows that lie so far apart [s]; it starts from nothing yet."""
    factor = step_factor(system, interval / replay_substeps(interval))
    return Replayed(system, np.zeros(system.size), factor=factor)


def replay_forces(run: StoredRun, mean: Floats, ground_at: Callable[[float], Floats]) -> Forces:
    """Joint forces of a run for its replay.

    Parameters
    ----------
    mean : (nt, ng, d) mean force over the interval that ends at each row [N]
    ground_at : step -> (3, nt) ground acceleration at every step of the run [m/s2]
    """
    substeps = replay_substeps(run.interval)
    ground, first = ground_at(run.interval / substeps), run.traction[0].ravel()
    return Forces(ground, mean.reshape(len(mean), -1), first, run.interval, substeps)


def replayed_models(
    run: StoredRun, full: Replayed, reduced: Replayed, finer: System, embed: csr_matrix, *, static: bool
) -> tuple[Replayed, Replayed, Replayed]:
    """The full, the reduced and the finer model, each with the displacement that its replay starts from.

    Parameters
    ----------
    full, reduced : that start from nothing yet; the reduced one with its basis
    embed : (finer, reduced), see `romdam.reduction.refinement.embedding`
    static : whether the run started in equilibrium
    """
    q, force = run.q[0], run.traction[0].ravel()
    guesses = ((full, reduced.basis @ q), (reduced, q), (Replayed(finer, q), embed @ q))
    mesh, coarse, fine = (
        replace(model, start=replay_start(model.system, guess, force, static)) for model, guess in guesses
    )
    return mesh, coarse, fine


def certificate(run: StoredRun, correction: Correction, joints: dict[str, slice]) -> ErrorStatement:
    """State the error of a run.

    Parameters
    ----------
    joints : name -> slice of its gaps
    """
    judged = compared_whole(run.time, run.jump[..., 0], run.disp, run.strain, joints)
    better = compared_correction(correction.corrected, correction.last, joints)
    errors = compare("certificate", judged, better).errors
    linear = _linear_errors(correction.first, run.jump.shape[2])
    details = {
        "record": run.attributes["record"],
        "result": run.path.name,
        "defect_for_the_same_forces": {name: error.plain for name, error in linear.items()},
        "last_pass_changed": correction.changed,
        "peak_opening": float(judged.opening.max()),
        "peak_opening_corrected": float(better.opening.max()),
        "configuration_sha256": run.attributes["configuration_sha256"],
    }
    return ErrorStatement("certificate", _sentence(run, errors, linear), errors, details)


def compared_whole(
    time: Floats, opening: Floats, disp: Floats, strain: Floats, joints: Mapping[str, slice]
) -> ComparedRun:
    """A run as a certificate compares it.

    Parameters
    ----------
    opening, disp, strain : (nt, ng) [m], (nt, 3 * probes) [m], empty without output nodes, (nt,) energy [J]
    joints : name -> slice of its gaps
    """
    histories = ({"displacement": disp} if disp.size else {}) | {"energy": strain}
    return ComparedRun(time, opening[..., None], joints=joints, histories=histories)


def compared_correction(corrected: History, defect: Defect, joints: Mapping[str, slice]) -> ComparedRun:
    """The corrected run of the finer model, with what that itself lacks at points and at output nodes."""
    opening = corrected.jump[..., 0] + defect.point_fine[:, :: corrected.jump.shape[2]]
    disp, strain = corrected.disp + defect.disp_fine, corrected.energy["strain"]
    return compared_whole(corrected.time, opening, disp, strain, joints)


def _linear_errors(defect: Defect, directions: int) -> dict[str, RelativeError]:
    """Errors of the reduced model where the joint forces are the same."""
    jump, off = defect.jump_full[:, ::directions], defect.jump[:, ::directions]
    errors = {"opening": magnitude_error(jump - off, jump)}
    if defect.disp.size:
        errors["displacement"] = magnitude_error(defect.disp_full - defect.disp, defect.disp_full)
    return errors | {"energy": energy_error(defect.energy, defect.energy_full)}


def _sentence(run: StoredRun, errors: dict[str, RelativeError], linear: dict[str, RelativeError]) -> str:
    undamped = " Without damping histories part in time; the peak is what counts."
    parting = undamped if run.attributes.get("integrator") == "conserving" else ""
    moved = f"displacements by {percent(errors['displacement'].l2)}, " if "displacement" in errors else ""
    return (
        f"Certificate, {run.time[-1]:g} s of {run.attributes['record']}: leaving out modes changes "
        f"the openings by {percent(errors['opening'].l2)} in L2 and {percent(errors['opening'].peak)} at "
        f"the peak, {moved}strain energy by "
        f"{percent(errors['energy'].l2)}; for the same joint forces the openings differ by "
        f"{percent(linear['opening'].l2)}. The step's own error is not in it.{parting}"
    )
