"""The integrators that there are, as a configuration knows them; their code is loaded where it is used.

To add one, write a file beside those of `romdam.timestepping.integrators` and name it in `INTEGRATORS`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class IntegratorEntry:
    """An integrator before it is loaded; what it says of itself once it is, a test compares.

    Attributes
    ----------
    source : "module:class", see `romdam.timestepping.integrators.protocol.Integrator`
    uncoupled : whether it needs modes that nothing couples: a reduced model, with neither dashpots in the
        rock nor compressible water. Then `accuracy` can choose its step, and a study compare it
    damped : whether it suits scenes with damping
    keys : of the section `transient`, those that it alone reads
    """

    source: str
    uncoupled: bool = True
    damped: bool = True
    keys: tuple[str, ...] = ()


_HERE = "romdam.timestepping.integrators"

INTEGRATORS: dict[str, IntegratorEntry] = {
    "adaptive": IntegratorEntry(f"{_HERE}.adaptive:Adaptive"),
    "conserving": IntegratorEntry(f"{_HERE}.conserving:Conserving", damped=False),
    "modal": IntegratorEntry(f"{_HERE}.modal:Modal"),
    "generalized_alpha": IntegratorEntry(
        f"{_HERE}.generalized_alpha:GeneralizedAlpha", uncoupled=False, keys=("rho_inf",)
    ),
}
