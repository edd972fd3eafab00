"""Supports that do not move as the base does: which components have which motion."""

from __future__ import annotations

import logging
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from romdam.config.sections.supports import SupportConfig
from romdam.core.errors import ConfigError
from romdam.core.motion import MovingSupports, SupportMotion
from romdam.core.scene import Block
from romdam.scene.select import select_facets
from romdam.scene.ties import Part

log = logging.getLogger(__name__)

_NONE = -1  # number of the entry, or of the motion, where there is none


def moving_supports(
    supports: Sequence[SupportConfig], blocks: Mapping[str, Block], parts: Collection[Part], source: str
) -> MovingSupports | None:
    """Find the components that supports with a motion hold; None where all move as the base does.

    Components that the keys of a dam hold move as a support says that holds them too.

    Parameters
    ----------
    parts : of all blocks, merged by ties

    Raises
    ------
    ConfigError
        where supports of different motions meet on a node.
    """
    texts = ["" if support.motion is None else support.motion.model_dump_json() for support in supports]
    first = {text: texts.index(text) for text in texts if text}
    if not first:
        return None
    components = {name: np.full(block.points.shape, _NONE) for name, block in blocks.items()}
    entries = {part.name: np.full(part.every_node, _NONE) for part in parts}
    part_of = {name: part for part in parts for name in part.blocks}
    for k, support in enumerate(supports):
        facets = select_facets(blocks[support.block], support.face, f"{source}: supports[{k}].face")
        nodes, part = np.unique(facets), part_of[support.block]
        before = entries[part.name][part.number[support.block][nodes]]
        differ = [other for other in before[before > _NONE].tolist() if texts[other] != texts[k]]
        if differ:
            raise ConfigError(
                f"{source}: supports[{k}].motion: {len(differ)} of its nodes are held by "
                f"supports[{differ[0]}] too, which moves otherwise, limit 0; give faces that do not meet, or "
                "one motion"
            )
        entries[part.name][part.number[support.block][nodes]] = k
        if texts[k]:
            for axis in support.fix:
                components[support.block][nodes, "xyz".index(axis)] = list(first).index(texts[k])
    log.info("%s: supports: %d motions besides that of the base", source, len(first))
    motions = []  # without their records, which are read where records are
    for k in first.values():
        config = supports[k].motion
        assert config is not None
        motions.append(SupportMotion(k, config.delay, config.factor))
    return MovingSupports(tuple(motions), components)
