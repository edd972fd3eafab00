"""All gaps together at the end of a step: the arrays of the implicit problem.

Over a step the jumps respond linearly to the joint force, w = w_free + H p. The tension stiffness
K_nz acts in both signs of the opening; it is linear and goes into H, so that what remains is
purely unilateral: p = p_c - K_nz g with p_c >= 0 acting through K_n - K_nz in compression only.
The compliance of the gaps (1/(K_n - K_nz), 1/K_s; zero where rigid) adds to the diagonal:

    y = W p_c + y_free,   W = H' + diag(compliance),   H' = (I + H D)^-1 H,   y_free = (I + H D)^-1 w_free,

with D = diag(K_nz) on the normal directions, and the initial gap and the slip anchors in y_free:

    y_n >= 0,  p_n >= 0,  y_n p_n = 0;   |t| <= mu' p_n,  y_t = -lambda t/|t|,  lambda >= 0 where sliding.

W is symmetric and positive definite; K_n = infinity is the same problem with a zero on the diagonal.

A force that is constant over the step and follows the springs at the step's end takes energy out of them like
a damper. So it may follow them at a point within the step, 1 - theta of the way before its end (a generalised
midpoint rule): p = -k (theta e_1 + (1 - theta) e_0), e the deformation of the spring, at most zero along
the normal. With lag = (1 - theta) / theta this is the same problem with (1 + lag) / k as the compliance and
lag e_0 added to y_free. For theta of 1/2 or more no gap ever gives back more than it took: along the normal
-p (w_1 - w_0) is at least the change of k e^2 / 2 whether the gap stays closed, closes or opens, and in
shear too, where the deformation left at the step's end is cut to the limit. With H what the step lets a jump
move, theta follows z = k H,

    theta = 1/2 + z / (z + z_0) / 2,

so that the deformation of a stiff spring, which alternates about its mean with the factor -lag, comes to
rest. Against theta = 1 the error of the openings falls to 0.3 where z is about 25 (the two-cantilever model
at 0.0025 s), to a twentieth at 3, and stays where gaps are stiff; the largest joint force is 4 to 8 % short,
not 30 to 44 %.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from romdam.contact.laws.catalogue import find_law, source_of
from romdam.contact.laws.compiled import Functions, compiled
from romdam.contact.laws.coulomb import Coulomb
from romdam.contact.laws.law import Law
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConfigError
from romdam.core.system import GapLaw, LawRows

_HALF_WAY = (
    70.0  # z_0: from 40 on the openings no longer gain; from 150 on the forces of stiff gaps alternate
)


class Laws(NamedTuple):
    """What a step needs of the gaps' further laws, L of them.

    Attributes
    ----------
    parameters : (L, n, p) as the laws' functions get them, filled up with zeros
    on : (L, n) which gaps have which
    start : (L, n, s) memory of the unloaded gaps
    dash : (n,) share of a normal dashpot in the closed gap's stiffness over the step
    per_second : (1,) 1 over the step, 0 in statics [1/s]
    functions : of the laws
    """

    parameters: Floats
    on: Bools
    start: Floats
    dash: Floats
    per_second: Floats
    functions: Functions


class GapProblem(NamedTuple):
    """Constant arrays of the gap-space problem; n gaps, d directions each, N = d n.

    Attributes
    ----------
    W : (N, N) flexibility of the jumps with the gaps' own compliance on the diagonal [m/N]
    Z : (n, n) its inverse (frictionless, where W is well conditioned), else (0, 0) [N/m]
    lift : (N, N) or (0, 0), the factor (I + H D)^-1 where there is tension stiffness
    tension : (n,) K_nz [N/m]
    compliance : (N,) of the gaps over the step, with (1 + lag) [m/N]
    lag : (N,) (1 - theta) / theta; zero where the force follows the spring at the step's end
    own : (N,) how far a force moves its own jump over the step, without compliance [m/N]
    mu : (n, 2) friction on p_c, scaled so that the limit is mu times the whole normal force
    whole : (n,) whole normal force per p_c of a closed gap
    gap : (n,) initial gap [m]
    laws : further laws; None without any, which is a type of its own to numba
    frictional : True where gaps have shear, else None, which is a type of its own to numba: what is not
        called is not compiled either
    """

    W: Floats
    Z: Floats
    lift: Floats
    tension: Floats
    compliance: Floats
    lag: Floats
    own: Floats
    mu: Floats
    whole: Floats
    gap: Floats
    laws: Laws | None
    frictional: bool | None


class Limits(NamedTuple):
    """What bounds the shear of every gap: c + mu p_n, equal along j and k for a bound on the resultant.

    Attributes
    ----------
    cohesion : (n, 2) c [N]
    mu : (n, 2)
    tension : (n,) that a bond carries, in terms of p_c; p_n above is p_c plus this [N]
    """

    cohesion: Floats
    mu: Floats
    tension: Floats


class ActiveSet(NamedTuple):
    """The inverse of W (or Z) on an active set, changed in place.

    Attributes
    ----------
    active : (n,) whether a gap is in the set
    inverse : (n, n) the inverse on the set in its leading rows
    order : (n,) the gaps of the set in the order of those rows
    counts : (4,) size of the set, changes since the inverse was made, changes in all, largest in a step
    work : (3, n) scratch
    """

    active: NDArray[np.bool_]
    inverse: Floats
    order: NDArray[np.int64]
    counts: NDArray[np.int64]
    work: Floats


class GapMemory(NamedTuple):
    """What the solver carries from step to step.

    Attributes
    ----------
    force : (N,) p_c of the last step, the warm start [N]
    anchor : (n, 2) slip anchors [m], moved by accepted steps only; empty without friction
    active, inverse, order, counts : two of each of `ActiveSet`'s: closed gaps with W, open gaps with Z.
        With friction inverse[0] holds W on the gaps of order[0] in single precision, active[0] says which
        these are, counts[0, 0] is their number, and
        counts[0, 1:] are the steps that needed Newton, the iterations in all and the most in a step;
        inverse[1] holds the principal pivot of W on the held gaps (`solvers.condensation`), active[1] says
        which these are, order[1] for how many solutions every gap has been stuck, counts[1, 0] is the held
        gaps' number and counts[1, 1] its sum over the solutions
    known : (2, N) with friction, the force of the last solution and what W makes of it [N], [m]; else (2, 0)
    work : (3, N) scratch
    limits : in force now
    history : (L, n, s) what the further laws keep of each gap, moved by accepted steps only
    trial : (L, n, s) the same within a step
    limit : (5,) scratch, what the laws put of one gap
    spring : (N,) deformation of the gaps' springs at the last accepted step: the opening where it is
        below zero, and the jump from the slip anchor [m]
    worst : (1,) the gap farthest from a solution, where the last step did not converge
    """

    force: Floats
    anchor: Floats
    active: NDArray[np.bool_]
    inverse: Floats
    order: NDArray[np.int64]
    counts: NDArray[np.int64]
    known: Floats
    work: Floats
    limits: Limits
    history: Floats
    trial: Floats
    limit: Floats
    spring: Floats
    worst: NDArray[np.int64]


def gap_problem(
    H: Floats, law: GapLaw, step: tuple[float, float] = (np.inf, 0.0), own: Floats | None = None
) -> GapProblem:
    """Set up the gap-space problem of one time step.

    Parameters
    ----------
    H : (N, N) jump per joint force over the step [m/N]; N = n (frictionless) or 3 n
    law : of the n gaps
    step : its length, inf in statics [s]; the largest lag, 1 where forces may follow the springs from half of
        it on, 0 at its end only, as those of gaps with further laws always do
    own : (N,) flexibility of a single gap per force of all those that a row stands for; H's where each
        stands for itself [m/N]

    Raises
    ------
    ConfigError
        where K_nz exceeds K_n, or equals it at a gap with friction; for a dashpot on a rigid gap.
    """
    (dt, most_lag), K_n, K_nz, K_s, n = step, law.K_n, law.K_nz, law.K_s, len(law)
    d = max(1, len(H) // max(n, 1))
    _check_tension(K_n, K_nz, law.mu)
    unilateral = np.maximum(K_n - K_nz, 1e-12 * np.where(np.isinf(K_n), 1.0, K_n))
    with np.errstate(invalid="ignore"):
        whole = np.where(np.isinf(K_n), 1.0, K_n / unilateral)
    laws = _laws(law, unilateral, dt) if law.has_memory else None
    compliance = np.zeros((n, d))
    compliance[:, 0] = 1.0 / unilateral
    if laws is not None:
        compliance[:, 0] *= 1.0 - laws.dash
    if d == 3:
        with np.errstate(divide="ignore"):
            compliance[:, 1:] = np.where(K_s > 0.0, 1.0 / K_s, 0.0)[:, None]
    lift: Floats = np.zeros((0, 0))
    W: Floats = H
    if K_nz.any():
        D = np.zeros((n, d))
        D[:, 0] = K_nz
        lift = np.asarray(np.linalg.inv(np.eye(n * d) + H * D.ravel()), dtype=float)
        W = np.asarray(lift @ H)
    W = 0.5 * (W + W.T)
    own = W.diagonal() if own is None or len(lift) else own
    lag = np.minimum(_lag(own.reshape(n, d), compliance), most_lag if laws is None else 0.0)
    compliance *= 1.0 + lag
    W = W + np.diag(compliance.ravel())
    return GapProblem(
        W=np.ascontiguousarray(W),
        Z=_dual(W) if d == 1 else np.zeros((0, 0)),
        lift=np.ascontiguousarray(lift),
        tension=np.ascontiguousarray(K_nz, dtype=float),
        compliance=compliance.ravel(),
        lag=lag.ravel(),
        own=np.ascontiguousarray(own),
        mu=np.ascontiguousarray(law.mu * whole[:, None]),
        whole=whole,
        gap=np.ascontiguousarray(law.gap, dtype=float),
        laws=laws,
        frictional=True if d == 3 else None,
    )


def _lag(flexibility: Floats, compliance: Floats) -> Floats:
    """(1 - theta) / theta of every spring, (n, d); the same for both directions of the shear."""
    with np.errstate(divide="ignore", invalid="ignore"):
        lag = np.where(compliance > 0.0, 1.0 / (1.0 + 2.0 / _HALF_WAY * flexibility / compliance), 0.0)
    lag[:, 1:] = lag[:, 1:].min(axis=1, initial=1.0, keepdims=True)
    return lag


def _laws(law: GapLaw, stiffness: Floats, dt: float) -> Laws:
    """The further laws over a step; `stiffness` (n,) is that of a closed gap beyond K_nz [N/m]."""
    rows = every_law(law)
    laws = [find_law(one.law) for one in rows]
    shape = len(rows), len(law)
    parameters = np.zeros((*shape, max((one.values.shape[1] for one in rows), default=0)))
    on = np.zeros(shape, dtype=np.bool_)
    for k, one in enumerate(rows):
        parameters[k, :, : one.values.shape[1]], on[k] = one.values, one.on
    start = law_memory(law, lambda each, values, i: each.initial(values, law.gap[i]))
    return Laws(
        parameters, on, start, _dashpot_share(law, stiffness, dt), np.array([1.0 / dt]), compiled(laws)
    )


def every_law(law: GapLaw) -> tuple[LawRows, ...]:
    """The further laws, and friction as one before them."""
    if not law.has_memory or not law.mu.any():
        return law.laws
    return (LawRows(source_of(Coulomb), law.mu, np.asarray(law.mu.max(axis=1) > 0.0), shear=True), *law.laws)


def law_memory(law: GapLaw, memory_of: Callable[[type[Law], Floats, int], Sequence[float]]) -> Floats:
    """What the further laws keep of each gap, (L, n, s); `memory_of` gives it for law, parameters and gap."""
    rows = every_law(law)
    laws = [find_law(one.law) for one in rows]
    memory = np.zeros((len(laws), len(law), max((len(each.memory) for each in laws), default=0)))
    for k, (each, one) in enumerate(zip(laws, rows, strict=True)):
        for i in np.flatnonzero(one.on):
            memory[k, i, : len(each.memory)] = memory_of(each, one.values[i], int(i))
    return memory


def _dashpot_share(law: GapLaw, stiffness: Floats, dt: float) -> Floats:
    if not law.viscosity.any():
        return np.zeros(len(law))
    if (np.isinf(stiffness) & (law.viscosity > 0.0)).any():
        raise ConfigError("joints: viscosity needs a finite normal_stiffness, got rigid; give a stiffness")
    viscous = law.viscosity / dt
    finite = np.where(np.isinf(stiffness), 1.0, stiffness)
    return np.where(viscous > 0.0, viscous / (finite + viscous), 0.0)


def _check_tension(K_n: Floats, K_nz: Floats, mu: Floats) -> None:
    wrong = (K_nz > K_n) | ((K_nz == K_n) & (mu.max(axis=1, initial=0.0) > 0.0))
    if wrong.any():
        i = int(np.argmax(wrong))
        raise ConfigError(
            "joints: tension_stiffness must be below normal_stiffness (at most equal without friction), "
            f"got {K_nz[i]:.4g} N/m against {K_n[i]:.4g} N/m at gap {i}; lower tension_stiffness"
        )


def _dual(W: Floats) -> Floats:
    """The inverse of W, or nothing where round-off would spoil it."""
    nothing = np.zeros((0, 0))
    if len(W) == 0:
        return nothing
    try:
        Z = np.linalg.inv(W)
    except np.linalg.LinAlgError:
        return nothing
    good = np.abs(Z @ W - np.eye(len(W))).max() < 1e-9
    return np.ascontiguousarray(0.5 * (Z + Z.T)) if good else nothing


def gap_memory(problem: GapProblem) -> GapMemory:
    """A memory with every gap open and unloaded."""
    n, N = len(problem.gap), len(problem.W)
    start = np.zeros((0, n, 0)) if problem.laws is None else problem.laws.start
    return GapMemory(
        force=np.zeros(N),
        anchor=np.zeros((0 if n == N else n, 2)),
        active=np.zeros((2, n), dtype=np.bool_),
        inverse=np.zeros((2, N, N) if n == N else (2, N, (N + 1) // 2)),
        order=np.full((2, n), N, dtype=np.int64),  # what is stuck at first counts as long stuck
        counts=np.zeros((2, 4), dtype=np.int64),
        known=np.zeros((2, 0 if n == N else N)),
        work=np.zeros((3, N)),
        limits=Limits(np.zeros((n, 2)), problem.mu.copy(), np.zeros(n)),
        history=start.copy(),
        trial=start.copy(),
        limit=np.zeros(5),
        spring=np.zeros(N),
        worst=np.zeros(1, dtype=np.int64),
    )
