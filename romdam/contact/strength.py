"""Shear strength that gaps have left, of the rows of a history."""

from __future__ import annotations

import numpy as np

from romdam.contact.components import NORMAL
from romdam.contact.cone import shear_limit
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.compiled import law_at
from romdam.contact.laws.law import COHESION_J, ENTRIES, MU_J, NORMAL_FORCE, OPENING, STEP_ENTRIES, TENSION
from romdam.contact.problem import Laws
from romdam.contact.softening import put_limit
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConvergenceError
from romdam.core.jit import njit


def shear_strength(
    mu: Floats, laws: Laws | None, memory: Floats, opening: Floats, force: Floats
) -> tuple[Floats, Bools]:
    """Largest shear that every gap can carry under its present compression, c + mu p, as the laws have it.

    Parameters
    ----------
    mu : (n, 2) friction of the gaps, which counts where there are no further laws
    laws : further laws, or None
    memory : (nt, L, n, s) what these keep of each gap, see `romdam.contact.problem.GapMemory`
    opening : (nt, n) with the initial gap [m]
    force : (nt, n, d) joint force, compression positive [N]

    Returns
    -------
    (strength, bonded) : (nt, n, 2) along j and k, inf where nothing bounds it [N]; (nt, n) whether the gap
        has any without compression; both empty where gaps carry no shear

    Raises
    ------
    ConvergenceError
        where a law fails.
    """
    if force.shape[2] == 1:
        return np.zeros((0, force.shape[1], 2)), np.zeros((0, force.shape[1]), dtype=np.bool_)
    if laws is None:
        strength = mu * np.maximum(force[..., NORMAL], 0.0)[..., None]
        return strength, np.zeros(strength.shape[:2], dtype=np.bool_)
    strength, bonded = np.zeros((*force.shape[:2], 2)), np.zeros(force.shape[:2], dtype=np.bool_)
    compression = np.ascontiguousarray(force[..., NORMAL])
    failed = _fill(laws, memory, np.ascontiguousarray(opening), compression, strength, bonded)
    if failed > 0:
        law = source_of(law_at(laws.functions.limit[failed - 1])).name
        raise ConvergenceError(f"law {law}: its function limit raises an exception, or gives NaN")
    return strength, bonded


@njit(cache=True)
def _fill(
    laws: Laws, memory: Floats, opening: Floats, compression: Floats, strength: Floats, bonded: Bools
) -> int:
    limit, step = np.zeros(ENTRIES), np.zeros(STEP_ENTRIES)
    for row in range(len(memory)):
        for i in range(compression.shape[1]):
            step[OPENING], step[NORMAL_FORCE] = opening[row, i], compression[row, i]
            failed = put_limit(laws, memory[row], i, step, limit)
            if failed > 0:
                return failed
            pressed = max(compression[row, i] + limit[TENSION], 0.0)
            for a in range(2):
                mu = max(limit[MU_J + a], 0.0)
                cohesion = max(limit[COHESION_J + a] - mu * limit[TENSION], 0.0)
                strength[row, i, a] = shear_limit(cohesion, mu, pressed)
                bonded[row, i] = bonded[row, i] or limit[TENSION] > 0.0 or limit[COHESION_J + a] > 0.0
    return 0
