"""Registry of the integrators that a configuration may name; the code of each is loaded when it is used.

To add an integrator, write a file in `romdam/timestepping/integrators` and name it in `INTEGRATORS`.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class IntegratorEntry:
    """What a configuration must know of an integrator before its code is loaded.

    A test compares each entry with the class.

    Attributes
    ----------
    source : "module:class", see `romdam.timestepping.prepared.Integrator`
    uncoupled : whether it needs uncoupled modes: a reduced model without viscous faces and compressible
        water. Only then can `accuracy` choose its step, and `romdam study` compare it
    damped : whether it suits scenes with damping
    keys : keys of the section `transient` that no other integrator reads
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
