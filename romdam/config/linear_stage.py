"""What a linear stage with tied joints cannot be made of."""

from __future__ import annotations

from romdam.config.effects import EFFECTS, unknown_effects
from romdam.config.sections.job import Sections
from romdam.config.sections.linear_stage import LinearStageConfig

_COUPLED = "couples the modes, which a response spectrum needs one by one"
_WITHOUT = {  # why a response spectrum and a linear time history with tied joints have not these effects
    "compressible water": f"{_COUPLED}; set water.model: incompressible",
    "viscous boundary": f"{_COUPLED}; fix the rock at its boundary, with `mass: false`",
    "free field": f"{_COUPLED}; set ground.input: uniform",
    "inclined waves": f"{_COUPLED}; set ground.input: uniform",
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
    stage = config.linear_stage or LinearStageConfig()
    if stage.damping == "hysteretic":
        hysteretic_ratios(config)
        if config.loads.initial_state != "static":
            raise ValueError(
                "linear_stage.damping: hysteretic begins at rest under the static loads, and "
                "loads.initial_state: undeformed does not; set static, or viscous"
            )
    for name in unknown_effects(config, "linear stage"):
        reason = _WITHOUT.get(name, f"is {name}, which is not known to it; leave it out")
        raise ValueError(f"linear_stage: {EFFECTS[name].key} {reason}")


def hysteretic_ratios(config: Sections) -> tuple[float, dict[str, float]]:
    """The ratio xi of what has no material, and of materials that name none, and of each that does.

    Raises
    ------
    ValueError
        where damping has no one ratio.
    """
    modal, rayleigh = config.damping.modal, config.damping.rayleigh
    asked = "linear_stage.damping: hysteretic takes the ratio of each material"
    if isinstance(modal, tuple) and len({*modal}) > 1:
        raise ValueError(f"{asked}, and damping.modal has {len({*modal})}, limit 1; give damping.rayleigh")
    of_materials = {name: one.damping for name, one in config.materials.items() if one.damping is not None}
    for key, damping in [
        ("damping.rayleigh", rayleigh),
        *((f"materials.{n}.damping", d) for n, d in of_materials.items()),
    ]:
        if damping is not None and damping.ratio is None and damping.acts:
            raise ValueError(f"{asked}, and {key} has `alpha` and `beta`; give `ratio` and `frequencies`")
    for name, block in config.blocks.items():
        if block.matrices is not None and block.matrices.damping is not None:
            raise ValueError(
                f"{asked}, and blocks.{name}.matrices.damping is a viscous matrix; leave one of the two out"
            )
    if modal is not None:
        every = modal[0] if isinstance(modal, tuple) else modal
    else:
        every = 0.0 if rayleigh is None else rayleigh.ratio or 0.0
    return every, {name: damping.ratio or 0.0 for name, damping in of_materials.items()}
