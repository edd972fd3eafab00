"""Random gap-space problems, and a check of a solution that shares no code with the solver."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from further_laws import with_laws
from numpy.typing import NDArray
from point_law import Gap, Past, strong

from romdam.contact.problem import GapMemory, GapProblem, gap_memory, gap_problem
from romdam.contact.step import commit_gaps, solve_gaps
from romdam.core.arrays import Floats
from romdam.core.recorded import new_gap_arrays
from romdam.core.system import GapLaw

TOLERANCE = 1e-8
STEP = 1e-3  # [s], what the dashpots are taken over


@dataclass(frozen=True)
class Case:
    """One step: w = w_free + H p with the law's parameters; d is 1 or 3."""

    H: Floats
    stiffness: tuple[Floats, Floats, Floats]
    mu: Floats
    gap: Floats
    anchor: Floats
    w_free: Floats
    laws: dict[str, Floats] = field(default_factory=dict)

    @property
    def problem(self) -> GapProblem:
        return gap_problem(self.H, self.law, STEP)

    @property
    def law(self) -> GapLaw:
        return with_laws(GapLaw(*self.stiffness, self.mu, self.gap, {}), **self.laws)

    def parameters(self, i: int) -> Gap:
        """One gap's, for the point laws."""
        laws: dict[str, Any] = {name: values[i] for name, values in self.laws.items()}
        K_n, K_nz, K_s = (float(K[i]) for K in self.stiffness)
        key = laws.get("shear_key", (0.0, 0.0, 0.0))
        at_rest, fast, speed = laws.get("velocity", (0.0, 0.0, 0.0))
        return Gap(
            K_n,
            K_nz,
            K_s,
            (float(self.mu[i, 0]), float(self.mu[i, 1])),
            tension=float(laws.get("tensile_strength", 0.0)),
            cohesion=float(laws.get("cohesion", 0.0)),
            mu_static=tuple(laws.get("friction_static", (0.0, 0.0))),
            key=float(key[0]),
            keyed=(key[1] > 0.0, key[2] > 0.0),
            viscous=float(laws.get("viscosity", 0.0)) / STEP,
            velocity=(float(at_rest), float(fast), float(speed) * STEP),
            weakening=tuple(laws.get("weakening", (0.0, 0.0, 0.0))),
            rough=tuple(laws.get("rough", (0.0, 0.0, 0.0))),
        )


def random_case(
    seed: int,
    n: int,
    mu: tuple[float, float] = (0.0, 0.0),
    K_n: float = 1e9,
    K_nz: float = 0.0,
    K_s: float = 5e8,
    coupling: float = 1.0,
    floor: float = 1e-3,
) -> Case:
    """H is a Gram matrix of about 1e-9 m/N; `coupling` scales its off-diagonal part, `floor` is added.

    Free jumps are as often closed as open, initial gaps lie around zero (penetration included).
    """
    rng = np.random.default_rng(seed)
    d = 3 if max(mu) > 0.0 else 1
    A = rng.standard_normal((d * n, max(1, int(0.8 * d * n))))
    H = A @ A.T / A.shape[1]
    H = 1e-9 * (coupling * (H - np.diag(np.diag(H))) + np.diag(np.diag(H)) + floor * np.eye(d * n))
    full = np.ones(n)
    return Case(
        H=H,
        stiffness=(K_n * full, K_nz * full, K_s * full),
        mu=np.tile(np.asarray(mu, dtype=float), (n, 1)),
        gap=1e-4 * rng.standard_normal(n),
        anchor=1e-4 * rng.standard_normal((n, 2)) if d == 3 else np.zeros((0, 2)),
        w_free=1e-3 * rng.standard_normal(d * n),
    )


def solve_step(problem: GapProblem, memory: GapMemory, w_free: Floats) -> tuple[Floats, float]:
    """(y, residual) of one step, started from the gaps that carry force; `w_free` is left as it was."""
    y = np.empty(len(w_free))
    closed = memory.force[:: max(len(w_free) // max(len(problem.gap), 1), 1)] > 0.0
    residual = solve_gaps(problem, memory, closed, w_free.copy(), y, TOLERANCE, False)
    return y, residual


def solve(
    case: Case, memory: GapMemory | None = None, problem: GapProblem | None = None
) -> tuple[Floats, Floats, NDArray[np.uint8], GapMemory, float, float]:
    """Solve and commit one step; (jump, force, state, memory, stored, friction)."""
    problem = case.problem if problem is None else problem
    if memory is None:
        memory = gap_memory(problem)
        memory.accumulated_slip[:] = case.anchor
    n, N = len(case.gap), len(case.w_free)
    y, residual = solve_step(problem, memory, case.w_free)
    assert residual <= TOLERANCE, f"not converged: {residual:.3g}"
    gaps = new_gap_arrays(n, N // n)
    stored, friction, _ = commit_gaps(problem, memory, y, gaps)
    return gaps.jump, gaps.traction, gaps.state, memory, stored, friction


def check(
    case: Case,
    jump: Floats,
    force: Floats,
    state: NDArray[np.uint8],
    before: Sequence[Past] | None = None,
) -> None:
    """The solution satisfies w = w_free + H p, and every gap its own law.

    `before` is what the gaps have left in the step, without the anchors; no more must be lost.

    Finite stiffness: against the point laws, evaluated at the jump of the solution. Rigid:
    complementarity, disc or box, and sliding against the shear.
    """
    n, N = len(case.gap), len(case.w_free)
    d = N // n
    p_scale = max(np.abs(force).max(), 1e-6)
    w = (case.w_free + case.H @ force.ravel()).reshape(n, d)
    w[:, 0] += case.gap
    w_scale = np.abs(case.w_free).max() + np.abs(case.gap).max() + np.abs(case.H).max() * p_scale
    assert np.abs(w - jump).max() <= 1e-9 * w_scale
    K_n, _, K_s = case.stiffness
    for i in range(n):
        if np.isinf(K_n[i]):
            _check_rigid(case, i, jump[i], force[i], p_scale, w_scale)
            continue
        j = np.zeros(3)
        j[:d] = jump[i]
        past = Past() if before is None else before[i]
        past = past._replace(anchor=tuple(case.anchor[i]) if d == 3 else (0.0, 0.0))
        law, wanted, now = strong((j[0], j[1], j[2]), past, case.parameters(i))
        # the solver's tolerance is on the force; the law sees the jump, W times that, through its stiffness
        gain = max(K_n[i], K_s[i] if d == 3 else 0.0) * np.abs(case.H).max()
        slack = 5.0 * TOLERANCE * (1.0 + gain) * p_scale + 1e-12 * gain * w_scale / np.abs(case.H).max()
        assert np.abs(force[i] - law[:d]).max() <= slack, (i, force[i], law)
        grazing = abs(j[0]) * K_n[i] <= slack
        assert grazing or (state[i] == 0) == (wanted == 0), (i, state[i], law)
        assert now.broken == past.broken


def _check_rigid(case: Case, i: int, jump: Floats, force: Floats, p_scale: float, w_scale: float) -> None:
    K_nz, K_s, mu = case.stiffness[1][i], case.stiffness[2][i], case.mu[i]
    p_n = force[0] + K_nz * jump[0]  # less the linear tension
    assert p_n >= -1e-9 * p_scale
    assert jump[0] >= -TOLERANCE * w_scale
    assert min(p_n / p_scale, jump[0] / w_scale) <= 1e-8
    if len(jump) == 1:
        return
    t, limit = force[1:], mu * max(p_n, 0.0)
    slip = jump[1:] + t / K_s - case.anchor[i]  # move of the anchor
    slack = 1e-7 * p_scale
    if mu[0] == mu[1]:
        size = np.hypot(*t)
        assert size <= limit[0] + slack
        if size < limit[0] - slack:
            assert np.abs(slip).max() <= 1e-7 * w_scale
        # the anchor slides against the shear
        assert -(t @ slip) >= (1 - 1e-6) * size * np.hypot(*slip) - 1e-7 * p_scale * w_scale
        return
    for a in range(2):
        assert abs(t[a]) <= limit[a] + slack
        if abs(t[a]) < limit[a] - slack:
            assert abs(slip[a]) <= 1e-7 * w_scale
        assert -t[a] * slip[a] >= -1e-7 * p_scale * w_scale
