"""Stages of construction of a scene: which blocks are there, what acts on them, which gaps are grouted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from romdam.config.job import Config
from romdam.config.sections.construction import GroutConfig
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConfigError, listed, quote
from romdam.core.scene import Block, ConstructionStage, Scene
from romdam.geometry.meshes.files import MeshFiles
from romdam.scene.supports import refuse_free_blocks
from romdam.scene.temperature import temperature_changes
from romdam.scene.ties import scene_parts

BEFORE = "before the stages"  # name of the stage in which the weight of blocks acts that no stage pours

Changes = dict[str, float | Floats]


def stage_temperatures(
    config: Config, blocks: Mapping[str, Block], files: MeshFiles, source: str
) -> tuple[list[Changes], Changes]:
    """Changes of temperature at the end of each stage, and those under the loads of runs.

    What a stage names stays until another stage, or `loads.temperature`, names the block again.

    Returns
    -------
    (stages, runs) : block name -> of the block, or (n,) of its nodes [K]

    Raises
    ------
    ConfigError
        as `temperature_changes` does, and for blocks that are not poured yet.
    """
    changes, stages = Changes(), list[Changes]()
    present = set(blocks) - {name for stage in config.construction for name in stage.pour}
    for k, stage in enumerate(config.construction):
        present |= set(stage.pour)
        key = f"construction[{k}].temperature"
        for i, load in enumerate(stage.temperature):
            if missing := [name for name in load.blocks or () if name not in present]:
                raise ConfigError(
                    f"{source}: {key}[{i}].blocks: block {quote(missing[0])} has a temperature in stage "
                    f"{quote(stage.name)} and is not poured yet; pour it before, or leave it out"
                )
        there = {name: block for name, block in blocks.items() if name in present}
        changes = changes | temperature_changes(stage.temperature, there, files, source, key)
        stages.append(changes)
    return stages, changes | temperature_changes(config.loads.temperature, blocks, files, source)


def construction_stages(
    config: Config, scene: Scene, files: MeshFiles, source: str
) -> tuple[ConstructionStage, ...]:
    """The stages in which a scene was built; none where the configuration has none.

    Parameters
    ----------
    scene : with joints and loads
    files : of the scene, which may have temperatures

    Raises
    ------
    ConfigError
        for an order that cannot be: water, grout or ties before the blocks, blocks that nothing holds yet,
        zones beyond a joint, and joints that are grouted twice or in part only.
    """
    if not config.construction:
        return ()
    temperatures, _ = stage_temperatures(config, scene.blocks, files, source)
    zones = {name: joint.position[:, 2] for name, joint in scene.joints.items()}
    ends = np.cumsum([0, *(len(z) for z in zones.values())])
    of_joint = {name: slice(a, b) for name, a, b in zip(zones, ends[:-1], ends[1:], strict=True)}
    poured_in = {name: stage.name for stage in config.construction for name in stage.pour}
    present = frozenset(scene.blocks) - frozenset(poured_in)
    done = np.full(int(ends[-1]), -1)  # stage that has grouted each gap
    level: float | None = None
    stages = list[ConstructionStage]()
    nothing = np.zeros(len(done), dtype=bool)
    if scene.loads.gravity.any() and present - scene.loads.excluded_from_gravity:
        stages.append(ConstructionStage(BEFORE, present, None, {}, nothing))
        _refuse_loose(scene, present, f"{source}: construction: {BEFORE}")
    for k, (stage, warmed) in enumerate(zip(config.construction, temperatures, strict=True)):
        location = f"{source}: construction[{k}]"
        present |= frozenset(stage.pour)
        level = stage.level if stage.level is not None else level
        if stage.pour:
            _refuse_loose(scene, present, f"{location}.pour: stage {quote(stage.name)}")
        if stage.level is not None:
            _refuse_level(scene, present, stage.level, poured_in, f"{location}.level")
        grouted = nothing.copy()
        for i, zone in enumerate(stage.grout):
            for name in zone.joints:
                at = f"{location}.grout[{i}]"
                missing = [block for block in scene.joints[name].blocks if block not in present]
                if missing:
                    raise ConfigError(
                        f"{at}: joint {quote(name)} is grouted in stage {quote(stage.name)}, and its block "
                        f"{quote(missing[0])} is poured in stage {quote(poured_in[missing[0]])}; pour it "
                        "before"
                    )
                of_zone = nothing.copy()
                of_zone[of_joint[name]] = _inside(zone, zones[name], name, at)
                if (again := of_zone & (done >= 0)).any():
                    first = int(np.flatnonzero(again)[0])
                    z = zones[name][first - of_joint[name].start]
                    raise ConfigError(
                        f"{at}: {int(again.sum())} of {int(of_zone.sum())} gaps of joint {quote(name)} in "
                        f"the zone, the first at z = {z:.6g} m, are grouted in stage "
                        f"{quote(config.construction[done[first]].name)} already, limit 0; let the zones meet"
                    )
                done[of_zone] = k
                grouted |= of_zone
        stages.append(ConstructionStage(stage.name, present, level, warmed, grouted))
    for name, gaps in of_joint.items():
        left = done[gaps] < 0
        if left.any() and not left.all():
            z = zones[name][left]
            raise ConfigError(
                f"{source}: construction: {int(left.sum())} of {len(left)} gaps of joint {quote(name)}, at z "
                f"= {z.min():.6g} to {z.max():.6g} m, are grouted in no stage, limit 0; add a zone for them"
            )
    _refuse_ties(scene, stages, poured_in, source)
    return tuple(stages)


def _inside(zone: GroutConfig, z: Floats, name: str, location: str) -> Bools:
    """(gaps of the joint,) which of them a zone grouts."""
    low = -np.inf if zone.above is None else zone.above
    high = np.inf if zone.below is None else zone.below
    inside = (z >= low) & (z < high)
    if not inside.any():
        raise ConfigError(
            f"{location}: no gap of joint {quote(name)} is in the zone from {low:g} to {high:g} m, limit 1; "
            f"its gaps are at z = {z.min():.6g} to {z.max():.6g} m"
        )
    return np.asarray(inside)


def _refuse_loose(scene: Scene, present: frozenset[str], location: str) -> None:
    """Refuse blocks that nothing which is there holds."""
    try:
        refuse_free_blocks(
            {name: block for name, block in scene.blocks.items() if name in present},
            {name: joint for name, joint in scene.joints.items() if present.issuperset(joint.blocks)},
            {name: held for name, held in scene.fixed.items() if name in present},
            location,
            tuple(tie for tie in scene.ties if present.issuperset(tie.blocks)),
        )
    except ConfigError as error:
        raise ConfigError(f"{error}; or pour first what it stands on") from None


def _refuse_level(
    scene: Scene, present: frozenset[str], level: float, poured_in: Mapping[str, str], location: str
) -> None:
    """Refuse water on faces of blocks that are not there, and water below all faces."""
    foot = np.inf
    for water in scene.loads.water:
        lowest = float(scene.blocks[water.block].points[water.facets, 2].min())
        foot = min(foot, lowest)
        if water.block not in present and lowest < min(level, water.level):
            raise ConfigError(
                f"{location}: water at {level:g} m wets block {quote(water.block)}, whose face begins at "
                f"{lowest:.6g} m, before it is poured in stage {quote(poured_in[water.block])}; pour it "
                "before, or lower the water"
            )
    if level <= foot:
        raise ConfigError(
            f"{location}: {level:g} m is below every face of loads.hydrostatic, the lowest of which begins "
            f"at {foot:.6g} m; is the unit right?"
        )


def _refuse_ties(
    scene: Scene, stages: Sequence[ConstructionStage], poured_in: Mapping[str, str], source: str
) -> None:
    """Refuse blocks that are tied to others and not poured with them, once these are loaded.

    The stiffness of a part is that of all its blocks.
    """
    for part in scene_parts(scene).values():
        born = [name for name in part.blocks if name in poured_in]
        if not born:
            continue
        when = {poured_in[name] for name in born}
        if len(when) > 1:
            raise ConfigError(
                f"{source}: construction: the tied blocks {listed(born)} are poured in several stages, "
                f"{listed(sorted(when))}, limit one: a part of tied blocks has the stiffness of all of them; "
                "pour them together, or let a joint part them"
            )
        earlier = [name for name in part.blocks if name not in poured_in]
        for stage in stages:
            if born[0] in stage.blocks:
                break
            for name in earlier:
                if why := _loaded(scene, stage, name):
                    raise ConfigError(
                        f"{source}: construction: block {quote(name)} has {why} in stage "
                        f"{quote(stage.name)}, before block {quote(born[0])}, which is tied to it, is "
                        f"poured in stage {quote(poured_in[born[0]])}: a part of tied blocks has the "
                        "stiffness of all of them; pour it before, or let a joint part them"
                    )


def _loaded(scene: Scene, stage: ConstructionStage, name: str) -> str:
    """What a block that is there carries in a stage; empty for nothing."""
    if (
        scene.loads.gravity.any()
        and name not in scene.loads.excluded_from_gravity
        and scene.blocks[name].material.rho > 0.0
    ):
        return "weight"
    if np.any(stage.warmed.get(name, 0.0)):
        return "a change of temperature"
    for water in scene.loads.water:
        lowest = scene.blocks[name].points[water.facets, 2].min() if water.block == name else np.inf
        if stage.level is not None and lowest < min(stage.level, water.level):
            return "water"
    for joint in scene.joints.values():
        if name in joint.blocks and stage.blocks.issuperset(joint.blocks):
            return f"joint {joint.name}"
    return ""
