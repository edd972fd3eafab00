"""What a linear stage with tied joints cannot be made of."""

from __future__ import annotations

from romdam.config.effects import EFFECTS, unknown_effects
from romdam.config.sections.job import Sections

_COUPLED = "couples the modes, which a response spectrum needs one by one"
_WITHOUT = {  # why a response spectrum and a linear time history with tied joints have not these effects
    "compressible water": f"{_COUPLED}; set water.model: incompressible",
    "viscous boundary": f"{_COUPLED}; fix the rock at its boundary, with `mass: false`",
    "free field": f"{_COUPLED}; set ground.input: uniform",
    "dampers": f"{_COUPLED}; leave them out",
    "moving supports": "has several motions of the ground, and a response spectrum is of one; leave it out",
    "motion along": "has several motions of the ground, and a response spectrum is of one; leave it out",
    "staged construction": "grouts joints one after another, and the linear stage has all tied; leave it out",
    "force histories": "is a force in time, which no response spectrum knows; leave it out",
}


def refuse_linear_stage(config: Sections) -> None:
    """Refuse what the linear stage of a job cannot have.

    Raises
    ------
    ValueError
        with the key, the reason and the remedy.
    """
    if config.pipeline != "run":
        raise ValueError(
            f"linear_stage: is made for each record of a job, and pipeline: {config.pipeline} has other "
            "runs; leave one of the two out"
        )
    if config.model.order != "reduced":
        raise ValueError(
            "linear_stage: needs the modes of a reduced model, and model.order is full; set it to reduced"
        )
    if not isinstance(config.loads.initial_state, str):
        raise ValueError(
            "linear_stage: loads.initial_state is the end of a run with open joints, and the linear stage "
            "has them tied; leave one of the two out"
        )
    for name in unknown_effects(config, "linear stage"):
        reason = _WITHOUT.get(name, f"is {name}, which is not known to it; leave it out")
        raise ValueError(f"linear_stage: {EFFECTS[name].key} {reason}")
