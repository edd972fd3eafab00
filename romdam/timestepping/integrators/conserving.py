"""Massless boundary and joint force linear over a fixed step: for scenes without damping.

A joint force constant over the step takes almost all energy out of impacts that nothing damps (94 to 99 % in
10 s on the two-cantilever model, at any step); this scheme keeps it, within a drift that the ledger reports
as `contact`. The step itself is `romdam.timestepping.modal.massless_boundary`.

References
----------
Monjaraz-Tec, Gross, Krack, Comput. Struct. 260 (2022) 106698: massless boundaries.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from romdam.contact.laws.catalogue import further_keys
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.system import History, System
from romdam.timestepping.equilibrium import system_gap_problem
from romdam.timestepping.modal.integrator import ModalIntegrator
from romdam.timestepping.modal.mode_split import ModeSplit, make_split
from romdam.timestepping.prepared import Prepared

_FEW = 30  # modes up to which all may be dynamic
_BONDED = 4.0  # largest bonded angular frequency times step: the scheme is stable at any, but not accurate


@dataclass(frozen=True)
class Conserving(ModalIntegrator):
    """The integrator of undamped reduced models; its histories part in time, and peaks scatter."""

    name: ClassVar[str] = "conserving"
    conserving: bool = True

    def supports(self, system: System) -> None:
        """Refuse damping, and laws that it does not know.

        Raises
        ------
        ConfigError
            for a system that is not diagonal, or damped, and for further joint laws.
        """
        if system.C.count_nonzero():
            raise ConfigError(
                "transient.integrator: conserving is for scenes without damping, and this one has some: its "
                "massless joint boundary is wrong where damping acts on it; use adaptive, the default here"
            )
        if system.law.has_memory:
            raise ConfigError(
                f"transient.integrator: conserving knows no {', '.join(further_keys(system.law))}; "
                "use adaptive, or leave these keys out of the joints"
            )
        if system.pseudo_static is not None:
            raise ConfigError(
                "transient.integrator: conserving knows one motion of the base, and a support has a motion "
                "of its own; give damping, or take adaptive, modal or generalized_alpha"
            )
        if system.signals:
            raise ConfigError(
                f"transient.integrator: conserving knows the motion of the base alone, and "
                f"{system.signals[0].name} is a force that varies in time; give damping, or take adaptive, "
                "modal or generalized_alpha"
            )
        super().supports(system)

    def compared(self, history: History) -> Floats:
        """(ng,) the peak opening of every gap."""
        return history.peaks["opening"].copy()

    def split(self, prepared: Prepared, step: float) -> ModeSplit:
        """Let the modes that the step resolves be dynamic."""
        return prepared.cache.get_or_compute(
            ("split", step), lambda: split_at_massless_boundary(prepared.system, step)
        )


def split_at_massless_boundary(system: System, step: float) -> ModeSplit:
    """Split the modes so that the gaps' boundary is massless: joint forces follow from displacements.

    Dynamic are the lowest modes whose bonded frequency (every gap closed, the rest a static flexibility) the
    step resolves, and of many modes only the lower third, which the mesh resolves. The coupling of the
    dynamic modes to the gaps is tapered by Lanczos' sigma factors, what it leaves is added to the static
    flexibility: a sharp cut rings (70 % of the pressure on a bouncing bar, 0.04 % with the taper).

    Raises
    ------
    ConfigError
        where no split is possible: rigid gaps on a boundary that keeps its mass.
    """
    k = system.K.diagonal()
    massive = np.flatnonzero(system.M.diagonal() > 0.0)
    order = massive[np.argsort(k[massive], kind="stable")]
    G = system.B.toarray()
    compliance = system_gap_problem(system, np.zeros((len(G), len(G)))).compliance
    ends = np.flatnonzero(np.diff(k[order], append=np.inf) > 1e-9 * k[order]) + 1
    third = len(ends) if len(order) <= _FEW else int(np.searchsorted(ends, len(order) / 3.0))
    most = min(max(third, 1), len(ends))  # rigid motions of many blocks may be more than a third
    low, high = 0, most
    while low < high:  # bisect for the largest number of dynamic modes
        middle = (low + high + 1) // 2
        bonded = _bonded_frequency(k, G, compliance, order[: ends[middle - 1]])
        low, high = (middle, high) if bonded * step <= _BONDED else (low, middle - 1)
    if low == 0:  # what is left out may hold more than what is taken in: bisection misses one that fits
        every = np.array([_bonded_frequency(k, G, compliance, order[:end]) for end in ends[:most]])
        low = int(np.flatnonzero(every * step <= _BONDED).max(initial=-1)) + 1
    if low == 0 and np.isinf(every).all():
        raise ConfigError(
            "transient.integrator: conserving needs joints whose boundary has no mass, and here it has some: "
            "rigid gaps, and no higher modes to give their boundary a flexibility; keep more modes, give the "
            "joints a finite normal_stiffness, or damping"
        )
    if low == 0:
        raise ConfigError(
            f"transient.finest_step: {step:g} s is too long for integrator conserving: on their closed gaps "
            f"the blocks swing with {every.min():.4g} rad/s at least, limit {_BONDED:g} rad in a step; take "
            f"{0.99 * _BONDED / every.min():.3g} s or less, lower the joints' stiffness, or give "
            "damping"
        )
    dynamic, left = np.sort(order[: ends[low - 1]]), order[ends[low - 1] :]
    taper = np.sinc(np.sqrt(k[dynamic] / k[left].min())) if len(left) else np.ones(len(dynamic))
    return make_split(system, dynamic, np.setdiff1d(np.arange(len(k)), dynamic), taper)


def _bonded_frequency(k: Floats, G: Floats, compliance: Floats, dynamic: Ints) -> float:
    """Highest angular frequency of the dynamic modes, every gap closed; inf if their boundary has mass."""
    rest = np.setdiff1d(np.arange(len(k)), dynamic)
    if (k[rest] <= 0.0).any():
        return np.inf
    flexibility = (G[:, rest] / k[rest]) @ G[:, rest].T + np.diag(compliance)
    size, vectors = np.linalg.eigh(flexibility)
    if len(size) and size[0] <= 1e-10 * size[-1]:
        return np.inf
    seen = (vectors.T @ G[:, dynamic]) / np.sqrt(size)[:, None]
    return float(np.sqrt(np.linalg.eigvalsh(np.diag(k[dynamic]) + seen.T @ seen)[-1]))
