"""Systems of a few unknowns, written down by hand, as sparse and as diagonal (modal) `System`."""

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, diags_array, eye_array
from simulating import simulated

from romdam.core.arrays import Floats
from romdam.core.system import GapLaw, History, System


def gap_law(
    n: int,
    K_n: float | Floats = np.inf,
    K_nz: float | Floats = 0.0,
    K_s: float | Floats = np.inf,
    mu: ArrayLike = 0.0,
    gap: float | Floats = 0.0,
) -> GapLaw:
    """The same gap n times, in one joint."""
    full = np.ones(n)
    pair = np.broadcast_to(np.asarray(mu, dtype=float), (2,)) if np.ndim(mu) else np.array([mu, mu])
    return GapLaw(
        K_n * full, K_nz * full, K_s * full, np.tile(pair, (n, 1)), gap * full, {"wall": slice(0, n)}
    )


def sparse_system(
    M: ArrayLike,
    K: ArrayLike,
    B: ArrayLike,
    law: GapLaw,
    C: ArrayLike | None = None,
    force: ArrayLike | None = None,
    load: ArrayLike | None = None,
    floating: bool = False,
) -> System:
    """A system in physical unknowns; `load` is M r along x, the other components are zero."""
    M, K = np.atleast_2d(np.asarray(M, dtype=float)), np.atleast_2d(np.asarray(K, dtype=float))
    n = len(M)
    B = np.asarray(B, dtype=float).reshape(-1, n)
    inertia = np.zeros((n, 3))
    inertia[:, 0] = 0.0 if load is None else load
    return System(
        M=csr_matrix(M),
        C=csr_matrix(np.zeros((n, n)) if C is None else np.atleast_2d(C)),
        K=csr_matrix(K),
        B=csr_matrix(B),
        load=inertia,
        force=np.zeros(n) if force is None else np.asarray(force, dtype=float),
        observe=csr_matrix(np.eye(n)),
        law=law,
        parts={"all": slice(0, n)},
        diagonal=False,
        floating=floating,
    )


def modal_twin(system: System) -> System:
    """The same system in its open-joint modes (C must be diagonal in them); disp stays physical."""
    k, V = eigh(system.K.toarray(), system.M.toarray())
    k = np.where(np.abs(k) < 1e-12 * max(k.max(), 1.0), 0.0, k)
    C = V.T @ system.C.toarray() @ V
    assert np.abs(C - np.diag(np.diag(C))).max() <= 1e-9 * max(np.abs(C).max(), 1e-300)
    return dataclasses.replace(
        system,
        M=csr_matrix(eye_array(len(k))),
        C=csr_matrix(diags_array(np.diag(C))),
        K=csr_matrix(diags_array(k)),
        B=csr_matrix(system.B @ V),
        load=V.T @ system.load,
        force=V.T @ system.force,
        observe=csr_matrix(V),
        diagonal=True,
    )


def ground(acc: ArrayLike) -> Floats:
    """Ground acceleration along x."""
    x = np.asarray(acc, dtype=float)
    return np.stack([x, 0 * x, 0 * x])


def run(system: System, acc: ArrayLike, dt: float, **options: Any) -> History:
    """Integrate from rest (undeformed unless asked otherwise)."""
    options = {"initial_state": "undeformed"} | options
    if not system.diagonal:
        options = {"integrator": "generalized_alpha"} | options
    return simulated(system, ground(acc), dt, **options)


def still(duration: float, dt: float) -> Floats:
    """No ground motion."""
    return np.zeros(round(duration / dt) + 1)


def pulse(velocity: float, duration: float, steps: int, dt: float) -> Floats:
    """A triangular pulse that leaves the base with -velocity, so that all loose matter moves by +velocity."""
    acc = still(duration, dt)
    acc[: 2 * steps + 1] = np.concatenate([np.arange(steps), steps - np.arange(steps + 1)])
    return -velocity * acc / (steps**2 * dt)


def assert_ledger(history: History, relative: float = 1e-9) -> None:
    """The exact scheme's ledger closes; contact and friction only ever take energy."""
    energy = history.energy
    size = max(np.abs(energy["input"]).max(), energy["kinetic"].max(), energy["strain"].max(), 1e-300)
    assert np.abs(energy["residual"]).max() <= relative * size
    for name in ("contact", "friction", "damping"):
        assert np.diff(energy[name]).min(initial=0.0) >= -relative * size, name
