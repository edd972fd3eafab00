"""Strength that gaps lose within a step: bonds, static friction, shear keys; one mechanism for all.

The limits of what is left (`contact.laws.point`) are solved as if they were ductile; a gap that reaches a
limit it cannot hold (the bond opens or slides, static friction is overcome, the key's depth is exceeded) is
weakened and the step solved again, until none is weakened any more. What was lost is committed once per
accepted step.
"""

from __future__ import annotations

from romdam.contact.components import SHEAR_J, SHEAR_K
from romdam.contact.laws.point import SLIP, shear_limit, slides
from romdam.contact.problem import BOND, DEPTH, KEY, SLIDES, Floats, GapMemory, GapProblem
from romdam.contact.solvers.newton import add_row
from romdam.core.jit import njit


@njit(cache=True)
def set_limits(problem: GapProblem, memory: GapMemory) -> None:
    """Put the shear limits c + mu p' to what is left; p' is p_c from the bond's tension on."""
    strength, limits = problem.strength, memory.limits
    for i in range(len(memory.trial)):
        bond = (strength.tension[i], strength.cohesion[i])
        if memory.trial[i, BOND]:
            bond = (0.0, 0.0)
        limits.tension[i] = bond[0]
        for a in range(2):
            keyed = strength.key[i, 1 + a] > 0.0 and not memory.trial[i, KEY]
            limits.cohesion[i, a], limits.mu[i, a] = shear_limit(
                problem.mu[i, a], strength.mu_static[i, a], bond, keyed, memory.trial[i, SLIDES]
            )


@njit(cache=True)
def bond_forces(problem: GapProblem, memory: GapMemory, y_free: Floats, sign: float) -> None:
    """Count the force from the tension of what is left of the bonds on (sign 1), or from zero again (-1)."""
    for i in range(len(memory.trial)):
        b, tension = len(y_free) // len(problem.gap) * i, memory.limits.tension[i]
        memory.force[b] += sign * tension
        if sign > 0.0:
            memory.force[b] = max(memory.force[b], 0.0)
        if tension > 0.0:
            add_row(problem.W[b], -sign * tension, y_free)


@njit(cache=True)
def opening(problem: GapProblem, memory: GapMemory, y: Floats, i: int, d: int) -> float:
    """Opening of gap i (with the initial gap) in a solution [m]."""
    shift = problem.strength.dash[i] * memory.spring[d * i]
    return y[d * i] - problem.compliance[d * i] * memory.force[d * i] + shift


@njit(cache=True)
def weaken(problem: GapProblem, memory: GapMemory, y: Floats) -> int:
    """Take from the gaps what they cannot hold in this solution (memory.force is p_c); how many lost some."""
    lost = 0
    d = len(y) // max(len(problem.gap), 1)
    for i in range(len(memory.trial)):
        strength, b, trial = problem.strength, d * i, memory.trial[i]
        p = memory.force[b] + memory.limits.tension[i]
        slipping = False
        if d == 3:
            limit_j, limit_k = memory.limits.cohesion[i] + memory.limits.mu[i] * p
            slipping = slides(limit_j, limit_k, memory.force[b + SHEAR_J], memory.force[b + SHEAR_K])
        has_bond = strength.tension[i] > 0.0 or strength.cohesion[i] > 0.0
        breaks = has_bond and not trial[BOND] and (slipping or (p <= 0.0 and y[b] > 0.0))
        begins = not trial[SLIDES] and slipping and (strength.mu_static[i] > problem.mu[i]).any()
        leaves = (
            not trial[KEY]
            and strength.key[i, DEPTH] > 0.0
            and opening(problem, memory, y, i, d) > strength.key[i, DEPTH]
        )
        trial[BOND], trial[SLIDES], trial[KEY] = (
            trial[BOND] or breaks,
            trial[SLIDES] or begins,
            trial[KEY] or leaves,
        )
        lost += int(breaks or begins or leaves)
    return lost


@njit(cache=True)
def settle(problem: GapProblem, memory: GapMemory, i: int, state: int, opening: float) -> bool:
    """Commit the history of gap i in an accepted step; whether it was weakened in it."""
    weak, trial = memory.weak[i], memory.trial[i]
    weakened = (trial[BOND] and not weak[BOND]) or (trial[KEY] and not weak[KEY])
    weakened = weakened or (trial[SLIDES] and not weak[SLIDES])
    weak[BOND] = trial[BOND]
    weak[SLIDES] = state == SLIP
    weak[KEY] = trial[KEY] and opening > problem.strength.key[i, DEPTH]
    return weakened
