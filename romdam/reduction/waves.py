"""Compressible water beside a reduced dam: the reservoir's own modes, and the rest as added mass.

The reservoir's basis X has its modes below the cut-off, what the forces of their damping make statically,
K^-1 C phi, which the modes by themselves approach slowly, and what the ground's motion makes. What these
leave of the static answer to the dam's motion,

    F = Q^T (K^-1 - X (X^T K X)^-1 X^T) Q,

is that of water so stiff that it answers at once: an added mass, so that the incompressible answer is kept
exactly. The dam's modes stay those of the dam alone, and so does its damping.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_matrix, diags_array

from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.scene import Scene
from romdam.core.system import System
from romdam.fem.water.compressible import Waves, with_waves
from romdam.linalg.dense import eigh
from romdam.linalg.factor import Factor
from romdam.linalg.modes.eigen import modes_below
from romdam.reduction.basis import over_coordinates
from romdam.reduction.methods.residual_vectors import independent

_OWN = 1e-6  # of a static answer, what is not in the modes: less is their round-off


@dataclass(frozen=True)
class ReducedWaves:
    """A reservoir in its own coordinates, and the flexibility (r, r) of the dam's wet nodes without them."""

    waves: Waves
    rest: Floats


def with_reservoir(system: System, scene: Scene, basis: dict[str, BlockBasis], whole: Waves | None) -> System:
    """Put the coordinates of a scene's compressible water, if it has any, behind those of its reduced dam."""
    if whole is None or scene.reservoir is None or scene.reservoir.sound is None:
        return system
    reduced = reduced_waves(whole, scene.reservoir.sound.cutoff)
    B = over_coordinates(whole.coupling, basis, system.size)
    M = system.M + csr_matrix(B.T @ reduced.rest @ B)
    return with_waves(replace(system, M=csr_matrix(M)), reduced.waves, csr_matrix(B))


def reduced_waves(waves: Waves, cutoff: float) -> ReducedWaves:
    """Reduce a reservoir to its modes below a frequency [Hz] and their static corrections."""
    factor = Factor(waves.K)
    omega2, X = _basis(waves, factor, cutoff)
    unit = waves.at_dam.toarray()
    at_dam = X.T @ unit
    rest = unit.T @ factor.solve(unit) - at_dam.T @ (at_dam / omega2[:, None])
    own = replace(
        waves,
        M=csr_matrix(diags_array(np.ones(len(omega2)))),
        C=csr_matrix(X.T @ (waves.C @ X)),
        K=csr_matrix(diags_array(omega2)),
        at_dam=csr_matrix(at_dam),
        load=X.T @ waves.load,
    )
    return ReducedWaves(own, 0.5 * (rest + rest.T))


def _basis(waves: Waves, factor: Factor, cutoff: float) -> tuple[Floats, Floats]:
    """Squared frequencies (m,) and M-orthonormal vectors (n, m) that are diagonal in K."""
    _, modes = modes_below(waves.K, waves.M, None, cutoff, factor)
    static = factor.solve(np.hstack([waves.C @ modes, waves.load]))
    size = np.sqrt((static * (waves.M @ static)).sum(axis=0))
    for _ in range(2):  # twice is enough for round-off
        static -= modes @ (modes.T @ (waves.M @ static))
    own = np.sqrt((static * (waves.M @ static)).sum(axis=0)) > _OWN * size
    X = np.hstack([modes, independent(static[:, own], waves.M)]) if own.any() else modes
    omega2, V = eigh(X.T @ (waves.K @ X), np.eye(X.shape[1]))
    return np.asarray(omega2), X @ V
