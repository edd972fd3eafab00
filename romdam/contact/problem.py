"""The contact problem of all gaps at the end of a step.

Over a step the jumps respond linearly to the joint force, w = w_free + H p. The tension stiffness
K_nz acts for both signs of the opening, so it is linear and is included in H. The remaining force p_c is
unilateral: p = p_c - K_nz g with p_c >= 0, which acts through K_n - K_nz in compression only.
The compliance of the gaps (1/(K_n - K_nz), 1/K_s; zero where rigid) adds to the diagonal:

    y = W p_c + y_free,   W = H' + diag(compliance),   H' = (I + H D)^-1 H,   y_free = (I + H D)^-1 w_free,

with D = diag(K_nz) on the normal directions, and the initial gap and the accumulated slip in y_free:

    y_n >= 0,  p_n >= 0,  y_n p_n = 0;   |t| <= mu' p_n,  y_t = -lambda t/|t|,  lambda >= 0 where sliding.

W, the Delassus operator with the compliance on its diagonal, is symmetric and positive definite;
K_n = infinity is the same problem with a zero compliance.

The force is constant over the step. If it were the spring force at the end of the step, it would remove
energy from the springs like a damper. So it is the spring force at a point within the step (a generalised
midpoint rule): p = -k (theta e_1 + (1 - theta) e_0), with the deformation e of the spring at the start (0)
and the end (1) of the step, at most zero along the normal. With the theta ratio r = (1 - theta) / theta
this is the same problem with (1 + r) / k as the compliance and r e_0 added to y_free. For theta >= 1/2 no
gap returns more energy than it took: along the normal -p (w_1 - w_0) is at least the change of k e^2 / 2,
whether the gap stays closed, closes or opens. The same holds in shear, where the deformation at the end of
the step is reduced to the limit. Theta depends on z = k H_ii, the stiffness of the spring times the
flexibility of its gap over the step:

    theta = 1/2 + z / (z + z_0) / 2.

The deformation of a stiff spring alternates about its mean with the factor -r; with this theta it converges.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from romdam.contact.components import NORMAL, SHEAR_J, SHEAR_K
from romdam.contact.laws.catalogue import find_law, source_of
from romdam.contact.laws.compiled import Functions, compiled
from romdam.contact.laws.coulomb import Coulomb
from romdam.contact.laws.law import ENERGY, ENTRIES, MU_J, MU_K, STEP_ENTRIES, Law
from romdam.contact.solvers.state import solver_state
from romdam.core.arrays import Bools, Floats, Ints, Record, record, record_type
from romdam.core.errors import ConfigError
from romdam.core.system import GapLaw, LawRows

_HALF_WAY = (
    70.0  # z_0: from 40 on the openings no longer gain; from 150 on the forces of stiff gaps alternate
)
_LEAST_UNILATERAL = 1e-12  # of K_n: what of it is unilateral where tension stiffness takes all of it
_INVERTED = 1e-9  # of the unit matrix, what Z W may be off it


class Laws(NamedTuple):
    """The L further laws of the gaps, as the compiled step reads them.

    Attributes
    ----------
    parameters : (L, n, p) parameters of the laws, padded with zeros
    on : (L, n) whether a gap has the law
    start : (L, n, s) memory of the unloaded gaps
    strength : (L,) whether the law releases a strength
    follows_step : (L,) whether the bounds of the law depend on the solution of the step
    energy : (L, 2) entries of the memory that are stored and dissipated energy [J]; -1 without
    dashpot_share : (n,) share of the normal dashpot in the stiffness of a closed gap over the step
    per_second : (1,) 1 / dt; 0 in statics [1/s]
    functions : compiled functions of the laws
    """

    parameters: Floats
    on: Bools
    start: Floats
    strength: Bools
    follows_step: Bools
    energy: Ints
    dashpot_share: Floats
    per_second: Floats
    functions: Functions


class GapProblem(NamedTuple):
    """Constant arrays of the gap-space problem; n gaps, d directions each, N = d n.

    Attributes
    ----------
    W : (N, N) Delassus operator: jump per joint force, with the compliance of the gaps on the diagonal [m/N]
    Z : (n, n) its inverse (frictionless, where W is well conditioned), else (0, 0) [N/m]
    tension_transform : (N, N) or (0, 0), (I + H D)^-1 where there is tension stiffness
    tension : (n,) K_nz [N/m]
    compliance : (N,) of the gaps over the step, with (1 + theta ratio) [m/N]
    theta_ratio : (N,) (1 - theta) / theta; zero where the force follows the spring at the step's end
    self_flexibility : (N,) jump of a gap per unit force on that gap over the step, without compliance; in
        both shear directions the largest in the plane of the gap [m/N]
    mu : (n, 2) friction coefficient for p_c, scaled so that the limit is that of the whole normal force p_n
    whole : (n,) p_n / p_c of a closed gap
    gap : (n,) initial gap [m]
    slip : (n, 2) initial jump along j and k [m]; empty without friction
    laws : further laws; None if there is none (another type to numba, so that no law is compiled)
    """

    W: Floats
    Z: Floats
    tension_transform: Floats
    tension: Floats
    compliance: Floats
    theta_ratio: Floats
    self_flexibility: Floats
    mu: Floats
    whole: Floats
    gap: Floats
    slip: Floats
    laws: Laws | None


class Limits(NamedTuple):
    """Bounds of the shear of every gap, c + mu p_n along j and k; equal bounds limit the resultant.

    Attributes
    ----------
    cohesion : (n, 2) c [N]
    mu : (n, 2)
    tension : (n,) tension that a bond carries, as a value of p_c; p_n is p_c plus this [N]
    """

    cohesion: Floats
    mu: Floats
    tension: Floats


LIMIT, RELEASE, COMMIT = range(3)  # functions of a law
FAILURE = record_type(gap=int, law=int, function=int)


class GapMemory(NamedTuple):
    """Memory of the gaps from step to step, changed in place.

    Attributes
    ----------
    force : (N,) p_c of the last step, the start of the iteration [N]
    accumulated_slip : (n, 2) jump at which the shear springs have no deformation; only accepted steps change
        it; empty without friction [m]
    limits : current bounds
    history : (L, n, s) memory of the further laws; only accepted steps change it
    trial : (L, n, s) the same within a step
    limit : (6,) scratch for the bounds of a single gap
    step, last_step : (n, 8) state of the gaps in the last solution and in the last accepted step, as the laws
        read it; empty without further laws
    water : (n,) current force of the water that laws let into the gaps; empty without further laws [N]
    spring : (N,) deformation of the springs at the last accepted step: the opening if it is negative, and
        the jump minus the accumulated slip [m]
    failure : `FAILURE`: the gap farthest from a solution if the last step did not converge; or the gap at
        which a function of a law failed, with the number of the law from 1, which ends the run
    solver : state that the solver keeps between steps, see `romdam.contact.solvers.state`
    """

    force: Floats
    accumulated_slip: Floats
    limits: Limits
    history: Floats
    trial: Floats
    limit: Floats
    step: Floats
    last_step: Floats
    water: Floats
    spring: Floats
    failure: Record
    solver: Any


def gap_problem(
    H: Floats,
    law: GapLaw,
    dt: float = np.inf,
    most_ratio: float = 0.0,
    single_flexibility: Floats | None = None,
) -> GapProblem:
    """Set up the gap-space problem of one time step.

    Parameters
    ----------
    H : (N, N) jump per joint force over the step [m/N]; N = n (frictionless) or 3 n
    law : of the n gaps
    dt : length of the step, inf in statics [s]
    most_ratio : largest theta ratio: 1 permits theta from 1/2 on, 0 means theta = 1 (spring forces at the end
        of the step), which gaps with further laws always have
    single_flexibility : (N,) self flexibility of the gaps if rows of H stand for several merged gaps; that of
        H if not given [m/N]

    Raises
    ------
    ConfigError
        where K_n is not above zero; where K_nz exceeds K_n, or equals it at a gap with friction; for a
        dashpot on a rigid gap.
    """
    K_n, K_nz, K_s, n = law.K_n, law.K_nz, law.K_s, len(law)
    d = max(1, len(H) // max(n, 1))
    soft = ~(K_n > 0.0)  # True for NaN
    if soft.any():
        i = int(np.argmax(soft))
        raise ConfigError(
            f"joints: normal_stiffness must be above 0, got {K_n[i]:.4g} N/m at gap {i}; give a stiffness or "
            "rigid, or leave the joint out where the blocks never touch"
        )
    wrong = (K_nz > K_n) | ((K_nz == K_n) & (law.mu.max(axis=1, initial=0.0) > 0.0))
    if wrong.any():
        i = int(np.argmax(wrong))
        raise ConfigError(
            "joints: tension_stiffness must be below normal_stiffness (at most equal without friction), "
            f"got {K_nz[i]:.4g} N/m against {K_n[i]:.4g} N/m at gap {i}; lower tension_stiffness"
        )
    unilateral = np.maximum(K_n - K_nz, _LEAST_UNILATERAL * np.where(np.isinf(K_n), 1.0, K_n))
    with np.errstate(invalid="ignore"):
        whole = np.where(np.isinf(K_n), 1.0, K_n / unilateral)
    laws = _laws(law, unilateral, dt) if law.has_memory else None
    # compliance of the springs where the force follows them at the step's end
    compliance = np.zeros((n, d))
    compliance[:, NORMAL] = 1.0 / unilateral
    if laws is not None:
        compliance[:, NORMAL] *= 1.0 - laws.dashpot_share
    if d == 3:
        with np.errstate(divide="ignore"):
            compliance[:, SHEAR_J:] = np.where(K_s > 0.0, 1.0 / K_s, 0.0)[:, None]
    transform: Floats = np.zeros((0, 0))
    W: Floats = H
    if K_nz.any():
        D = np.zeros((n, d))
        D[:, NORMAL] = K_nz
        transform = np.asarray(np.linalg.inv(np.eye(len(H)) + H * D.ravel()), dtype=float)
        W = np.asarray(transform @ H)
    W = 0.5 * (W + W.T)
    if single_flexibility is None or len(transform):
        single_flexibility = self_flexibility(blocks_of_gaps(W, n)).ravel()
    with np.errstate(divide="ignore", invalid="ignore"):  # the same for both directions of the shear
        stiffness_share = 2.0 / _HALF_WAY * single_flexibility.reshape(n, d) / compliance
        ratio = np.where(compliance > 0.0, 1.0 / (1.0 + stiffness_share), 0.0)
    ratio = np.minimum(ratio, most_ratio if laws is None else 0.0)
    compliance *= 1.0 + ratio
    W = W + np.diag(compliance.ravel())
    # friction as its law puts it, once for all steps where no further law changes it
    rows, which = np.unique(law.mu, axis=0, return_inverse=True)
    limits = np.zeros((len(rows), ENTRIES))
    for row, limit in zip(rows, limits, strict=True):
        Coulomb.limit(row, np.zeros(0), np.zeros(STEP_ENTRIES), limit)
    mu = limits[which.reshape(-1), MU_J : MU_K + 1]
    slip = law.slip if d == 3 and len(law.slip) else np.zeros((n if d == 3 else 0, d - 1))
    return GapProblem(
        W=np.ascontiguousarray(W),
        Z=_dual(W) if d == 1 else np.zeros((0, 0)),
        tension_transform=np.ascontiguousarray(transform),
        tension=np.ascontiguousarray(K_nz, dtype=float),
        compliance=compliance.ravel(),
        theta_ratio=ratio.ravel(),
        self_flexibility=np.ascontiguousarray(single_flexibility),
        mu=np.ascontiguousarray(mu * whole[:, None]),
        whole=whole,
        gap=np.ascontiguousarray(law.gap, dtype=float),
        slip=np.ascontiguousarray(slip, dtype=float),
        laws=laws,
    )


def blocks_of_gaps(H: Floats, n: int) -> Floats:
    """The blocks (n, d, d) of every gap by itself on the diagonal of H (N, N)."""
    d = len(H) // max(n, 1)
    gaps = np.arange(n)
    return H.reshape(n, d, n, d)[gaps, :, gaps, :]


def self_flexibility(blocks: Floats) -> Floats:
    """Flexibility of single gaps (..., n, d) from their blocks (..., n, d, d).

    It is that along the normal and, for both directions of the shear, the largest in the plane of the gap:
    no choice of the axes changes it.
    """
    flexibility = np.diagonal(blocks, axis1=-2, axis2=-1).copy()
    if flexibility.shape[-1] > 1:
        jj, kk = blocks[..., SHEAR_J, SHEAR_J], blocks[..., SHEAR_K, SHEAR_K]
        largest = 0.5 * (jj + kk) + np.hypot(0.5 * (jj - kk), blocks[..., SHEAR_J, SHEAR_K])
        flexibility[..., SHEAR_J:] = largest[..., None]
    return flexibility


def _laws(law: GapLaw, stiffness: Floats, dt: float) -> Laws:
    """The further laws over a step; `stiffness` (n,) is that of a closed gap beyond K_nz [N/m]."""
    every = every_law(law)
    laws = [find_law(rows.law) for rows in every]
    shape = len(every), len(law)
    parameters = np.zeros((*shape, max((rows.values.shape[1] for rows in every), default=0)))
    on = np.zeros(shape, dtype=np.bool_)
    for k, rows in enumerate(every):
        parameters[k, :, : rows.values.shape[1]], on[k] = rows.values, rows.on
    dashpot_share = np.zeros(len(law))
    if law.viscosity.any():
        if (np.isinf(stiffness) & (law.viscosity > 0.0)).any():
            raise ConfigError(
                "joints: viscosity needs a finite normal_stiffness, got rigid; give a stiffness"
            )
        viscous = law.viscosity / dt
        finite = np.where(np.isinf(stiffness), 1.0, stiffness)
        dashpot_share = np.where(viscous > 0.0, viscous / (finite + viscous), 0.0)
    return Laws(
        parameters=parameters,
        on=on,
        start=law_memory(law, lambda each, values, i: each.initial(values, law.gap[i])),
        strength=np.array([each.strength for each in laws], dtype=np.bool_),
        follows_step=np.array([each.follows_step for each in laws], dtype=np.bool_),
        energy=np.array(
            [[each.memory.index(name) if name in each.memory else -1 for name in ENERGY] for each in laws],
            dtype=np.int64,
        ).reshape(-1, 2),
        dashpot_share=dashpot_share,
        per_second=np.array([1.0 / dt]),
        functions=compiled(laws),
    )


def every_law(law: GapLaw) -> tuple[LawRows, ...]:
    """The further laws, after friction as the first law."""
    if not law.has_memory or not law.mu.any():
        return law.laws
    return (LawRows(source_of(Coulomb), law.mu, np.asarray(law.mu.max(axis=1) > 0.0), shear=True), *law.laws)


def law_memory(law: GapLaw, memory_of: Callable[[type[Law], Floats, int], Sequence[float]]) -> Floats:
    """Make the memory of the further laws, (L, n, s); `memory_of` takes a law, parameters and a gap."""
    every = every_law(law)
    laws = [find_law(rows.law) for rows in every]
    memory = np.zeros((len(laws), len(law), max((len(each.memory) for each in laws), default=0)))
    for k, (each, rows) in enumerate(zip(laws, every, strict=True)):
        for i in np.flatnonzero(rows.on):
            memory[k, i, : len(each.memory)] = memory_of(each, rows.values[i], int(i))
    return memory


def _dual(W: Floats) -> Floats:
    """The inverse of W, or an empty array if W is too ill-conditioned."""
    nothing = np.zeros((0, 0))
    if len(W) == 0:
        return nothing
    try:
        Z = np.linalg.inv(W)
    except np.linalg.LinAlgError:
        return nothing
    good = np.abs(Z @ W - np.eye(len(W))).max() < _INVERTED
    return np.ascontiguousarray(0.5 * (Z + Z.T)) if good else nothing


def gap_memory(problem: GapProblem) -> GapMemory:
    """A memory with every gap open and unloaded."""
    n, N = len(problem.gap), len(problem.W)
    start = np.zeros((0, n, 0)) if problem.laws is None else problem.laws.start
    return GapMemory(
        force=np.zeros(N),
        accumulated_slip=np.zeros((0 if n == N else n, 2)),
        limits=Limits(np.zeros((n, 2)), problem.mu.copy(), np.zeros(n)),
        history=start.copy(),
        trial=start.copy(),
        limit=np.zeros(ENTRIES),
        step=np.zeros((0 if problem.laws is None else n, STEP_ENTRIES)),
        last_step=np.zeros((0 if problem.laws is None else n, STEP_ENTRIES)),
        water=np.zeros(0 if problem.laws is None else n),
        spring=np.zeros(N),
        failure=record(FAILURE),
        solver=solver_state(n, n != N),
    )
