"""The state in which a run ends: all that integrators go on from, and what tells its model from others.

Another run begins with all of it in the same model, or at rest with what the joints remember in any model
that has the same joints.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from numpy.typing import NDArray

from romdam.core.arrays import Bools
from romdam.core.recorded import Expansion
from romdam.core.scene_effect import SceneEffect

# how the value of a gap follows from that of the merged gap that stands for it; "modes": of the unknowns;
# None: of the run, or of gaps that are never merged
STATE_QUANTITIES: dict[str, Expansion | str | None] = {
    "q": "modes",  # unknowns that are integrated, zero where they follow [m]
    "v": "modes",
    "a": "modes",  # of generalised-alpha [m/s2]
    "jump": "jump",  # (ng, d) that joint forces see [m]
    "traction": "force",  # (ng, d) [N]
    "unilateral": "force",  # (ng, d) the solver's force p_c [N]
    "relaxed": "force",  # (ng, d) force on modes that follow; empty without [N]
    "mean": "force",  # (ng, d) that acted over the last step [N]
    "spring": "jump",  # (ng, d) deformation [m]
    "accumulated_slip": "jump",  # (ng, 2) [m]
    "slip_rate": "jump",  # (ng, 2) mean over the last step [m/s]
    "contact": "equal",  # (ng,) open, stick or slip
    "closed": "equal",  # (ng,)
    "memory": None,  # (L, ng, s) of the further laws
    "last_step": None,  # (ng, 8) as the further laws read it
    "water": None,  # (ng,) in open gaps [N]
    "stored": None,  # (1,) energy in the gaps [J]
    "clock": None,  # (4 + 2 levels,) next level, whether laws evolve, last, finest step [s], refusals
    "ground_velocity": None,  # (k + 1,) integral of the ground acceleration, and its largest size [m/s]
}


@dataclass(frozen=True, eq=False)
class FinalState:
    """The last state of a run.

    Attributes
    ----------
    arrays : by the names of `STATE_QUANTITIES`, those that the integrator has
    integrator : its name
    model : of the system, see `romdam.core.model_signature`
    laws : key of each row of "memory", see `model_signature.law_key` -> (ng,) which gaps have that law
    source : key and file that messages about the state begin with
    """

    arrays: Mapping[str, NDArray[Any]]
    integrator: str
    model: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    laws: Mapping[str, Bools] = field(default_factory=dict)
    source: str = "Settings.start"


@dataclass(frozen=True, eq=False)
class InitialState(SceneEffect):
    """The state of another run that the runs of a scene begin with.

    Attributes
    ----------
    final : its gaps are those of the scene, in the scene's order
    take : "all", in the same model; or "joints": what these remember, in equilibrium under the static loads
    moves : whether that run ended in motion
    """

    final: FinalState
    take: Literal["all", "joints"]
    moves: bool

    @property
    def going_on(self) -> FinalState | None:
        """The state that runs go on from; None where they begin at rest."""
        return self.final if self.take == "all" else None
