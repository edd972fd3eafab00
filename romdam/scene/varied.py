"""The scene of a sample: other materials, levels of water and temperatures on the same meshes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from romdam.config.job import Config
from romdam.config.sections.geometry.arch_dam import PERIMETER, ROCK
from romdam.contact.laws.catalogue import find_law
from romdam.contact.laws.crack_water import CrackWater
from romdam.core.errors import ConfigError
from romdam.core.scene import Block, FreeField, Hydrostatic, Joint, Material, Reservoir, Scene
from romdam.scene.attachments import AttachmentPlaces, build_attachments
from romdam.scene.blocks import material_of
from romdam.scene.joint_water.build import with_water
from romdam.scene.reservoir.build import at_level
from romdam.scene.ties import scene_parts

_SAME = 1e-12  # relative, of two factors that are one


def vary_scene(scene: Scene, config: Config, source: str) -> Scene:
    """A scene with the materials, levels and temperatures of another configuration, else the same.

    It is what `romdam.scene.build.build_scene` makes of that configuration, without meshing or searching,
    once joints of an automatic stiffness get it by `romdam.scene.joints.with_properties`.

    Raises
    ------
    ConfigError
        for water below the foot of a joint, and an automatic stiffness between moduli that change apart.
    """
    names = block_materials(config)
    blocks = dict[str, Block]()
    for name, block in scene.blocks.items():
        now, then = material_of(config.materials[names[name]]), block.material
        now = now.with_mass(then.rho > 0.0)  # a block without mass stays so
        blocks[name] = block if now == then else replace(block, material=now)
    reservoir = scene.find(Reservoir)
    if reservoir is not None and config.water is not None and reservoir.level != config.water.level:
        foot = min(float(blocks[face.block].points[face.facets, 2].min()) for face in reservoir.faces)
        reservoir = at_level(reservoir, config.water, foot)
    water, face = list[Hydrostatic](), 0
    for load in config.loads.hydrostatic:
        of_load = scene.loads.water[face : face + len(load.faces)]
        water += [one if one.level == load.level else replace(one, level=load.level) for one in of_load]
        face += len(load.faces)
    joints = {
        name: _with_elements(joint, scene.blocks, blocks, source) for name, joint in scene.joints.items()
    }
    for k, wet in enumerate(config.loads.joint_water):
        for name in wet.joints:
            joint = joints[name]
            dry = tuple(rows for rows in joint.laws if find_law(rows.law) is not CrackWater)
            joint = replace(joint, water=np.zeros(len(joint.area)), uplift=None, laws=dry)
            location = f"{source}: loads.joint_water[{k}]"
            joints[name] = with_water(joint, wet, blocks, config.loads.gravity_of_water, location)
    warmed = dict(scene.loads.warmed)
    expanding = [name for name, block in blocks.items() if block.material.expansion > 0.0]
    for temperature in config.loads.temperature:
        if temperature.change is not None:
            warmed |= dict.fromkeys(temperature.blocks or expanding, temperature.change)
    warmed = {name: warmed[name] for name in blocks if np.any(warmed.get(name, 0.0))}
    attached = build_attachments(config, AttachmentPlaces(blocks, scene.fixed, scene.loads.gravity, source))
    loads = replace(scene.loads, water=tuple(water), warmed=warmed)
    varied = replace(scene, blocks=blocks, joints=joints, loads=loads)
    others = (one for one in (reservoir, _layers(scene, blocks, source)) if one is not None)
    return varied.with_effects(*attached, *others)


def _layers(scene: Scene, blocks: Mapping[str, Block], source: str) -> FreeField | None:
    """The layers of the free field, of the materials that their rock has now."""
    field = scene.find(FreeField)
    if field is None:
        return None
    now = dict[Material, Material]()
    for name in sorted(field.blocks):
        then, material = scene.blocks[name].material, blocks[name].material
        if now.setdefault(then, material) != material:
            raise ConfigError(
                f"{source}: materials: block {name!r} and others of the rock have the same values, and not "
                "all of them change; free_field takes one material at each level: vary them together"
            )
    return replace(field, materials=tuple(now.get(layer, layer) for layer in field.materials))


def _with_elements(
    joint: Joint, before: Mapping[str, Block], after: Mapping[str, Block], source: str
) -> Joint:
    """The joint beside elements of another modulus, which an automatic stiffness follows."""
    factors = [after[name].material.E / before[name].material.E for name in joint.blocks]
    if not any(joint.element_stiffness) or factors == [1.0, 1.0]:
        return joint
    if max(factors) - min(factors) > _SAME * max(factors):
        raise ConfigError(
            f"{source}: joints.{joint.name}.normal_stiffness: auto follows the elements on both sides, whose "
            f"moduli change by {factors[0]:.6g} and {factors[1]:.6g}; give a stiffness such as 16 "
            "GPa/m, or let one parameter vary both materials"
        )
    normal, shear = joint.element_stiffness
    return replace(joint, element_stiffness=(factors[0] * normal, factors[0] * shear))


def block_materials(config: Config) -> dict[str, str]:
    """Block -> name of its material in the configuration."""
    names = dict[str, str]()
    if config.gravity_dam is not None:
        gravity = config.gravity_dam
        rock = gravity.material if gravity.rock is None else gravity.rock.material
        monoliths = gravity.monolith_names
        names = {name: gravity.material if name in monoliths else rock for name in gravity.block_names}
    if config.arch_dam is not None:
        arch = config.arch_dam
        names = dict.fromkeys(arch.cantilever_names, arch.material)
        if arch.perimeter is not None:
            names[PERIMETER] = arch.perimeter.material
        for zone, rock_zone in arch.rock.zones.items() if arch.rock else ():
            names[f"{ROCK}_{zone}"] = rock_zone.material
    for name, section in config.blocks.items():
        names |= dict.fromkeys(config.made_of(name), section.material)
    return names


def part_factors(scene: Scene, varied: Scene, source: str) -> dict[str, tuple[float, float]]:
    """Block -> factors by which its part's stiffness and mass are those of another scene; of changed ones.

    Raises
    ------
    ConfigError
        for a part that does not change as a whole, whose basis is then another.
    """
    factors = dict[str, tuple[float, float]]()
    for part in scene_parts(scene).values():
        pairs = [(scene.blocks[name].material, varied.blocks[name].material) for name in part.blocks]
        if all(replace(before, damping=after.damping) == after for before, after in pairs):
            continue
        stiffness = {after.E / before.E for before, after in pairs}
        lasting = {after.sustained_ratio / before.sustained_ratio for before, after in pairs}
        mass = {after.rho / before.rho for before, after in pairs if before.rho > 0.0} or {1.0}
        for what, found in (
            ("modulus", stiffness),
            ("ratio E / E_dynamic", lasting),
            ("density", mass),
        ):
            if max(found) - min(found) > _SAME * max(found):
                raise ConfigError(
                    f"{source}: suite.parameters: the {what} of part {part.name!r} "
                    f"({', '.join(part.blocks)}) does not change as a whole, but by factors of "
                    f"{min(found):.6g} to {max(found):.6g}, so "
                    "that its reduced basis would be another; let one parameter vary all materials of tied "
                    "blocks that have the same value, or separate them by joints"
                )
        blocks = [scene.blocks[name] for name in part.blocks]
        if any(block.matrices is not None for block in blocks):
            raise ConfigError(
                f"{source}: suite.parameters: part {part.name!r} has matrices from a file, which no "
                "material changes; vary the materials of other blocks"
            )
        if any(block.absorbing for block in blocks):
            raise ConfigError(
                f"{source}: suite.parameters: part {part.name!r} has viscous faces, whose springs and "
                "dashpots do not change as its material does; vary the materials of other blocks"
            )
        factors |= dict.fromkeys(part.blocks, (max(stiffness), max(mass)))
    return factors
