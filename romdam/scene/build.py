"""Configuration -> Scene."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from romdam.config.job import Config
from romdam.core.arrays import Bools
from romdam.core.errors import ConfigError, Faults
from romdam.core.scene import (
    Block,
    FacePressure,
    Hydrostatic,
    Joint,
    PointForce,
    Probe,
    Scene,
    StaticLoads,
    Tie,
)
from romdam.geometry.matrices.block import held_by, refuse_unreached
from romdam.geometry.meshes.files import MeshFiles
from romdam.geometry.meshes.sizes import refuse_large
from romdam.scene.blocks import dam_of, materials_of, named_blocks
from romdam.scene.construction import stage_temperatures
from romdam.scene.draft import Draft
from romdam.scene.effect_builders import with_effects
from romdam.scene.ground.viscous import rock_of, with_viscous_faces
from romdam.scene.joint_stiffness import automatic_keys, automatic_remarks
from romdam.scene.joint_water.build import with_water
from romdam.scene.joints import build_joint
from romdam.scene.plausible import odd_remarks
from romdam.scene.reservoir.build import refuse_level
from romdam.scene.select import nearest_node, refuse_selected_twice, select_facets
from romdam.scene.static_loads import ice_silt_and_lines
from romdam.scene.stress.sites import Structure, stress_sites
from romdam.scene.supports import refuse_free_blocks, refuse_massless_on_joints
from romdam.scene.ties import build_tie, merged_parts, refuse_tied

_log = logging.getLogger(__name__)


def build_scene(config: Config, folder: Path, source: str) -> Scene:
    """Mesh the blocks, find the joints, apply supports and loads, and check that every block is held.

    Parameters
    ----------
    folder : where relative paths in the configuration start
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError
        for boxes that their elements do not divide, faces or points that catch no node, joints
        between blocks that do not touch, gap tables, and blocks that nothing holds.
    MeshError
        for mesh files, and for joints whose meshes do not conform.
    """
    if config.unfound:
        raise ConfigError(
            f"{source}: {config.unfound[0]}: what is there has not been looked up; take `romdam.load_config`"
        )
    refuse_large(config, source)
    materials, files, faults = materials_of(config), MeshFiles(folder), Faults()
    dam = dam_of(config, materials, source)
    blocks = dam.blocks | named_blocks(config, materials, files, dam.blocks, source)
    rock = rock_of(config.ground, dam.viscous)
    blocks = with_viscous_faces(blocks, (*config.ground.viscous, *dam.viscous), rock, source)
    supported = _supported(config, blocks, dam.held, source, faults)
    fixed = held_by(blocks, supported)
    ties = _ties(config, blocks, dam.ties, source)
    parts = tuple(merged_parts(fixed, ties).values())
    joints = dict[str, Joint]()
    for name, of_joint in config.every_joint.items():
        with faults.gathered():
            joints[name] = build_joint(name, of_joint, blocks, fixed, folder, source, parts)
    loads, probes = _on_faces_and_nodes(config, blocks, source, faults)
    faults.raise_together()
    joints = _with_water(config, joints, blocks, source)
    refuse_free_blocks(blocks, joints, fixed, source, ties)
    for part in parts:
        refuse_massless_on_joints(part.mesh(blocks), part.blocks, part.fixed(fixed), blocks, source)

    _, changes = stage_temperatures(config, blocks, files, source)
    warmed = {name: changes[name] for name in blocks if np.any(changes.get(name, 0.0))}
    weightless = frozenset(
        piece for name, block in config.blocks.items() if not block.weight for piece in config.made_of(name)
    )
    scene = Scene(
        blocks=blocks,
        joints=joints,
        fixed=fixed,
        loads=replace(loads, warmed=warmed, excluded_from_gravity=dam.excluded_from_gravity | weightless),
        probes=probes,
        stress=stress_sites(
            config.outputs.stress, Structure(blocks, joints, ties, fixed), f"{source}: outputs.stress"
        ),
        ties=ties,
        radiating=frozenset() if config.ground.input == "free_field" else rock,
    )
    draft = Draft(config, supported, rock, folder, files, source)
    scene = with_effects(scene, draft)
    refuse_unreached(scene, supported, source)
    keys = {name: automatic_keys(joint) for name, joint in config.every_joint.items()}
    remarks = (
        *automatic_remarks(joints.values(), keys),
        *draft.remarks,
        *files.remarks,
        *files.unused(),
        *odd_remarks(scene, materials, config.dam.joint_pairs if config.dam else ()),
        *_overtopped(config, blocks),
    )
    return replace(scene, remarks=remarks)


def _supported(
    config: Config, blocks: dict[str, Block], held: dict[str, Bools], source: str, faults: Faults
) -> dict[str, Bools]:
    """Block name -> (n, 3) True where `supports`, or the keys of a dam, hold the component."""
    supported = {name: np.zeros((len(block.points), 3), dtype=bool) for name, block in blocks.items()} | held
    for k, support in enumerate(config.supports):
        with faults.gathered():
            facets = select_facets(blocks[support.block], support.face, f"{source}: supports[{k}].face")
            for axis in support.fix:
                supported[support.block][np.unique(facets), "xyz".index(axis)] = True
    return supported


def _ties(config: Config, blocks: dict[str, Block], of_dam: Sequence[Tie], source: str) -> tuple[Tie, ...]:
    _refuse_joined_twice(config, source)
    for tie in of_dam:
        refuse_tied((blocks[tie.blocks[0]], blocks[tie.blocks[1]]), f"{source}: tie {tie.name} of the dam")
    named = [build_tie(name, tie, blocks, f"{source}: ties.{name}") for name, tie in config.ties.items()]
    return (*of_dam, *named)


def _with_water(
    config: Config, joints: dict[str, Joint], blocks: dict[str, Block], source: str
) -> dict[str, Joint]:
    """The joints with the water that stands in them."""
    joints = dict(joints)
    for k, water in enumerate(config.loads.joint_water):
        location = f"{source}: loads.joint_water[{k}]"
        for name in water.joints:
            joint = with_water(joints[name], water, blocks, config.loads.gravity_of_water, location)
            joints[name] = joint
            resultant = ", ".join(f"{f / 1e6:.6g}" for f in joint.water_resultant)
            _log.info(
                "%s: joint %s: up to %.4g kPa; on %s: (%s) MN",
                location, name, (joint.water / joint.area).max() / 1e3, joint.blocks[1], resultant,
            )  # fmt: skip
    return joints


def _overtopped(config: Config, blocks: dict[str, Block]) -> list[str]:
    top = max(float(block.points[:, 2].max()) for block in blocks.values())
    return [
        f"loads.joint_water[{k}].level: {water.level:g} m is above all blocks, which reach to {top:g} m; is "
        "the unit right?"
        for k, water in enumerate(config.loads.joint_water)
        if water.level > top
    ]


def _on_faces_and_nodes(
    config: Config, blocks: dict[str, Block], source: str, faults: Faults
) -> tuple[StaticLoads, tuple[Probe, ...]]:
    """Static loads but temperatures, and observed nodes; `faults` gathers what is wrong with any of them."""
    pressures, forces, probes = list[FacePressure](), list[PointForce](), list[Probe]()
    still: tuple[Hydrostatic, ...] = ()
    for k, load in enumerate(config.loads.pressure):
        with faults.gathered():
            facets = select_facets(blocks[load.block], load.face, f"{source}: loads.pressure[{k}].face")
            pressures.append(FacePressure(load.block, facets, load.value))
    for k, force in enumerate(config.loads.force):
        with faults.gathered():
            at = f"{source}: loads.force[{k}].at"
            node = nearest_node(blocks[force.block], force.at, force.tolerance, at)
            forces.append(PointForce(force.block, node, np.array(force.force)))
    forces += ice_silt_and_lines(config.loads, blocks, source, faults)
    for name, probe in config.outputs.nodes.items():
        with faults.gathered():
            at = f"{source}: outputs.nodes.{name}.at"
            node = nearest_node(blocks[probe.block], probe.at, probe.tolerance, at)
            probes.append(Probe(name, probe.block, node))
    with faults.gathered():
        still = _water(config, blocks, source)
    loads = StaticLoads(
        gravity=np.zeros(3) if config.loads.gravity is None else np.array(config.loads.gravity),
        pressures=tuple(pressures),
        forces=tuple(forces),
        water=still,
        staged_weight=config.loads.weight == "staged",
        order=() if isinstance(config.loads.order, str) else config.loads.order,
    )
    return loads, tuple(probes)


def _water(config: Config, blocks: dict[str, Block], source: str) -> tuple[Hydrostatic, ...]:
    size = config.loads.gravity_of_water
    loads, of_density = [], dict[float, dict[tuple[str, tuple[int, ...]], str]]()
    for k, load in enumerate(config.loads.hydrostatic):
        location = f"{source}: loads.hydrostatic[{k}]"
        faces = [
            (face.block, select_facets(blocks[face.block], face.face, f"{location}.faces[{i}].face"))
            for i, face in enumerate(load.faces)
        ]
        for i, (name, facets) in enumerate(faces):  # other densities may add up: silt as a heavy fluid
            seen = of_density.setdefault(load.density, {})
            refuse_selected_twice(seen, name, facets, f"{location}.faces[{i}]")
        refuse_level(load.level, [blocks[name].points[facets, 2] for name, facets in faces], location)
        loads += [Hydrostatic(name, facets, load.level, load.density * size) for name, facets in faces]
    return tuple(loads)


def _refuse_joined_twice(config: Config, source: str) -> None:
    """A joint takes all facets that two blocks share; a second one would double every gap."""
    seen: dict[frozenset[str], str] = {}
    for name, joint in config.every_joint.items():
        other = seen.setdefault(frozenset(joint.between), name)
        if other != name:
            raise ConfigError(
                f"{source}: joints.{name}.between: blocks {joint.between[0]!r} and {joint.between[1]!r} are "
                f"already joined by joints.{other}, which takes all facets they share, limit one joint; "
                "remove one of the two"
            )
