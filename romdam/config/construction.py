"""Stages of construction that cannot be, as far as the configuration alone tells."""

from __future__ import annotations

from romdam.config.sections.job import Sections
from romdam.core.errors import quote


def refuse_wrong_construction(config: Sections) -> None:
    """Refuse stages of the same name, blocks poured twice, and what stages and other keys contradict.

    Raises
    ------
    ValueError
        with the key, the reason and the remedy.
    """
    stages = config.construction
    if not stages:
        return
    names, poured = dict[str, int](), dict[str, str]()
    grouted = {name for stage in stages for zone in stage.grout for name in zone.joints}
    for k, stage in enumerate(stages):
        if names.setdefault(stage.name, k) != k:
            raise ValueError(
                f"construction[{k}].name: {quote(stage.name)} is the name of construction"
                f"[{names[stage.name]}] too; rename one"
            )
        for block in stage.pour:
            if block in poured:
                raise ValueError(
                    f"construction[{k}].pour: block {quote(block)} is poured in stage "
                    f"{quote(poured[block])} already, limit once; take it out"
                )
            poured[block] = stage.name
        if stage.level is None:
            continue
        levels = [load.level for load in config.loads.hydrostatic]
        if not levels:
            raise ValueError(
                f"construction[{k}].level is that of the still water of loads.hydrostatic, and there is "
                "none; give its faces and last level there"
            )
        if stage.level > max(levels):
            raise ValueError(
                f"construction[{k}].level: {stage.level:g} m is above every level of loads.hydrostatic, the "
                f"highest of which is {max(levels):g} m; lower it"
            )
    if config.loads.initial_state == "undeformed":
        raise ValueError(
            "construction leads to a state at rest, and loads.initial_state: undeformed starts without one; "
            "set static"
        )
    pressed = [name for name, joint in config.every_joint.items() if joint.law_keys["grouting_pressure"]]
    if lacking := [name for name in pressed if name not in grouted]:
        raise ValueError(
            f"joints.{lacking[0]}.grouting_pressure: no stage of `construction` grouts the joint; name it in "
            "one, or leave the pressure out"
        )
