"""What no sound run has: numbers that are none, damping that gives energy, motion beyond the model's size."""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, cholesky

from romdam.core.errors import ConfigError, ConvergenceError
from romdam.core.recorded import GAP_QUANTITIES
from romdam.core.system import History, System
from romdam.timestepping.energy import exchanged

_ROUND_OFF = 1e-12  # of the largest coefficient of damping
_INDEFINITE = 1e-8  # of a damping matrix with a unit diagonal: the least eigenvalue of round-off is above -it
_GIVEN = 1e-6  # of the energy exchanged: round-off of a ledger is below 1e-10
_RESTING = 1e-9  # of the energy that rests in the scene: what is given below it is round-off
_FAR = 100.0  # times the size of the model: what is pulled off flies farther than it is large
_REMEDY = "look for stiffnesses, densities and units of extreme size, or take a finer transient.finest_step"


def refuse_active_damping(system: System) -> None:
    """Refuse a system whose damping matrix gives energy: C - D D^T must be positive semidefinite.

    Its symmetric part counts: what is skew between dam and water does no work. Of the unreduced mesh only the
    diagonal is looked at; `sound` judges its runs by their energy.

    Raises
    ------
    ConfigError
        with the unknown or the eigenvalue.
    """
    diagonal = np.asarray(system.C.diagonal(), dtype=float)
    if system.drag is not None:
        diagonal = diagonal - (system.drag**2).sum(axis=1)
    noise = _ROUND_OFF * np.abs(diagonal).max(initial=0.0)
    worst = int(np.argmin(diagonal)) if len(diagonal) else 0
    if len(diagonal) and diagonal[worst] < -noise:
        raise ConfigError(
            f"damping: the coefficient of unknown {worst} is {diagonal[worst]:.3g}, limit 0: it would give "
            "energy; of several kinds of damping, one takes off what another has; leave one of them out"
        )
    if system.diagonal or not system.reduced:
        return
    some = diagonal > noise
    C = system.C.toarray()[np.ix_(some, some)]
    if system.drag is not None:
        C = C - system.drag[some] @ system.drag[some].T
    size = np.sqrt(diagonal[some])
    C = 0.5 * (C + C.T) / size / size[:, None]
    try:
        cholesky(C + _INDEFINITE * np.eye(len(C)), check_finite=False)
    except LinAlgError:
        least = float(np.linalg.eigvalsh(C)[0])
        raise ConfigError(
            f"damping: the damping matrix is not positive semidefinite, its least eigenvalue is {least:.3g} "
            "with a unit diagonal, limit 0: it would give energy; of several kinds of damping, one takes off "
            "what another has; leave one of them out"
        ) from None


def sound(history: History, system: System) -> History | ConvergenceError:
    """The history, or the error that it is none: such numbers pass every comparison of a step."""
    law = system.law
    of_gaps = {of.title: getattr(history, name) for name, of in GAP_QUANTITIES.items() if of.moved}
    series = {
        **of_gaps,
        "displacement": history.disp,
        "velocity": history.vel,
        "acceleration": history.acc,
        **{f"energy {name}": values for name, values in history.energy.items()},
    }
    for name, values in series.items():
        finite = np.isfinite(values)
        if not finite.all():
            row, *where = np.argwhere(~finite)[0]
            at = f" at {law.gap_name(int(where[0]))}" if name in of_gaps else ""
            return ConvergenceError(
                f"t = {history.time[row]:.6g} s: the {name}{at} is {values[(row, *where)]}, which is no "
                f"number, though its step had passed for converged; {_REMEDY}"
            )
    for name, values in history.peaks.items():
        if not np.isfinite(values).all():
            i = int(np.argmin(np.isfinite(values)))
            return ConvergenceError(
                f"the peak of {name} at {law.gap_name(i)} is {values[i]}, which is no "
                "number; look for stiffnesses, densities and units of extreme size"
            )
    wrong = _beyond_the_model(history, system)
    if system.hysteretic is None:  # which is passive over a cycle, and gives energy back within one
        wrong = wrong or _given_by_damping(history)
    return wrong or history


def _given_by_damping(history: History) -> ConvergenceError | None:
    """The error where damping has given energy on the whole."""
    damping = history.energy.get("damping")
    if damping is None or not len(damping):
        return None
    least, row = float(damping.min()), int(np.argmin(damping))
    resting = max(float(np.abs(history.energy[name]).max()) for name in ("strain", "joint_stored"))
    if least >= -max(_GIVEN * exchanged(history.energy), _RESTING * resting):
        return None
    return ConvergenceError(
        f"t = {history.time[row]:.6g} s: damping has given {-least:.3g} J on the whole, limit 0; of several "
        "kinds of damping, one takes off what another has; leave one of them out"
    )


def _beyond_the_model(history: History, system: System) -> ConvergenceError | None:
    """The error where something moves farther than the mesh is large."""
    law, limit = system.law, _FAR * system.extent + float(np.abs(system.law.gap).max(initial=0.0))
    moved = list[tuple[str, float]]()
    for name in ("opening", "slip"):
        peaks = np.abs(history.peaks.get(name, np.zeros(0)))
        if len(peaks):
            at = int(peaks.argmax())
            moved.append((f"peak {name} at {law.gap_name(at)}", float(peaks[at])))
    for what, size in moved:
        if size > limit:
            return ConvergenceError(
                f"the {what} is {size:.3g} m, limit {limit:.3g} m, {_FAR:g} times the model: no equation of "
                f"small displacements holds there; {_REMEDY}"
            )
    return None
