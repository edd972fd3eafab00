"""What tells the model that a final state belongs to from others: its modes, its joints and their laws."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from romdam.core.system import GapLaw, LawSource, System


def law_key(law: LawSource) -> str:
    """What tells a law from others: its name, and for a user's what its file does."""
    return f"{law.name} {law.sha256}".strip()


def model_signature(system: System) -> dict[str, NDArray[Any]]:
    """Arrays by which the model of a state is told from another, signs of its modes included.

    "participation" is B^T r with r the same numbers for all models of as many gaps, besides the load.
    """
    numbers = np.random.default_rng(46).uniform(0.5, 1.5, system.B.shape[0])
    load = np.asarray(system.load @ np.linspace(1.0, 2.0, system.load.shape[1]))
    return {
        "stiffness": system.K.diagonal(),
        "damping": system.C.diagonal(),
        "participation": np.asarray(system.B.T @ numbers),
        "load": load,
        "force": np.asarray(system.force),
        **law_arrays(system.law),
    }


def law_arrays(law: GapLaw) -> dict[str, NDArray[Any]]:
    """Parameters of the gaps by name, (ng, ...); finite numbers, rigid stiffnesses are -1."""

    def finite(values: NDArray[Any]) -> NDArray[Any]:
        return np.where(np.isinf(values), -1.0, values)

    parameters = {
        "normal_stiffness": finite(law.K_n),
        "tension_stiffness": finite(law.K_nz),
        "shear_stiffness": finite(law.K_s),
        "friction": finite(law.mu),
        "gap": law.gap,
        "viscosity": law.viscosity,
    }
    for number, rows in enumerate(law.laws):
        parameters[f"law {number + 1}, {rows.law.name}"] = np.where(
            rows.on[:, None], finite(rows.values), -1.0
        )
    return parameters
