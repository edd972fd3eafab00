"""Configuration -> Scene."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np

from romdam.config.job import Config
from romdam.config.sections.loads import InitialStateConfig
from romdam.core.errors import ConfigError, Faults
from romdam.core.scene import (
    Block,
    FacePressure,
    Hydrostatic,
    Joint,
    PointForce,
    Probe,
    Scene,
)
from romdam.geometry.matrices.block import held_by, refuse_unreached
from romdam.geometry.meshes.files import MeshFiles
from romdam.geometry.meshes.sizes import refuse_large
from romdam.scene.attachments import AttachmentPlaces, build_attachments
from romdam.scene.blocks import dam_of, materials_of, named_blocks
from romdam.scene.construction import construction_stages, stage_temperatures
from romdam.scene.force_histories import build_force_histories
from romdam.scene.ground.free_field import free_field
from romdam.scene.ground.motion_along import along_remarks, motion_along
from romdam.scene.ground.moving_supports import moving_supports
from romdam.scene.ground.viscous import rock_of, with_viscous_faces
from romdam.scene.initial_state import read_initial_state
from romdam.scene.joint_stiffness import automatic_keys, automatic_remarks
from romdam.scene.joint_water.build import with_water
from romdam.scene.joints import build_joint
from romdam.scene.plausible import odd_remarks
from romdam.scene.reservoir.build import build_reservoir, refuse_level
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
    materials, files = materials_of(config), MeshFiles(folder)
    dam = dam_of(config, materials, source)
    blocks = dam.blocks | named_blocks(config, materials, files, dam.blocks, source)
    rock = rock_of(config.ground, dam.viscous)
    blocks = with_viscous_faces(blocks, (*config.ground.viscous, *dam.viscous), rock, source)
    waves = config.ground.input == "free_field"

    supported = {name: np.zeros((len(block.points), 3), dtype=bool) for name, block in blocks.items()}
    supported |= dam.held
    faults = Faults()
    for k, support in enumerate(config.supports):
        with faults.gathered():
            facets = select_facets(blocks[support.block], support.face, f"{source}: supports[{k}].face")
            for axis in support.fix:
                supported[support.block][np.unique(facets), "xyz".index(axis)] = True
    fixed = held_by(blocks, supported)

    _refuse_joined_twice(config, source)
    for tie in dam.ties:
        refuse_tied((blocks[tie.blocks[0]], blocks[tie.blocks[1]]), f"{source}: tie {tie.name} of the dam")
    named_ties = [build_tie(name, tie, blocks, f"{source}: ties.{name}") for name, tie in config.ties.items()]
    ties = (*dam.ties, *named_ties)
    rigid = tuple(merged_parts(fixed, ties).values())
    joints = dict[str, Joint]()
    for name, of_joint in config.every_joint.items():
        with faults.gathered():
            joints[name] = build_joint(name, of_joint, blocks, fixed, folder, source, rigid)
    pressures, forces, probes, still = _on_faces_and_nodes(config, blocks, source, faults)
    faults.raise_together()
    for k, water in enumerate(config.loads.joint_water):
        location = f"{source}: loads.joint_water[{k}]"
        for name in water.joints:
            joints[name] = with_water(joints[name], water, blocks, config.loads.gravity_of_water, location)
            joint = joints[name]
            resultant = ", ".join(f"{f / 1e6:.6g}" for f in joint.water_resultant)
            _log.info(
                "%s: joint %s: up to %.4g kPa; on %s: (%s) MN",
                location, name, (joint.water / joint.area).max() / 1e3, joint.blocks[1], resultant,
            )  # fmt: skip
    refuse_free_blocks(blocks, joints, fixed, source, ties)
    for part in rigid:
        refuse_massless_on_joints(part.mesh(blocks), part.blocks, part.fixed(fixed), blocks, source)

    stages, changes = stage_temperatures(config, blocks, files, source)
    weightless = [
        piece for name, block in config.blocks.items() if not block.weight for piece in config.made_of(name)
    ]
    gravity = np.zeros(3) if config.loads.gravity is None else np.array(config.loads.gravity)
    scene = Scene(
        blocks=blocks,
        joints=joints,
        fixed=fixed,
        pressures=pressures,
        forces=forces,
        gravity=gravity,
        attachments=build_attachments(config, AttachmentPlaces(blocks, fixed, gravity, source)),
        probes=probes,
        ties=ties,
        water=still,
        warmed={name: changes[name] for name in blocks if np.any(changes.get(name, 0.0))},
        excluded_from_gravity=dam.excluded_from_gravity | frozenset(weightless),
        radiating=frozenset() if waves else rock,
        free_field=free_field(blocks, rock, config.ground, source) if waves else None,
        staged_weight=config.loads.weight == "staged",
        load_order=() if isinstance(config.loads.order, str) else config.loads.order,
        reservoir=build_reservoir(config.water, blocks, (*joints.values(), *ties), fixed, files, source),
        stress=stress_sites(
            config.outputs.stress, Structure(blocks, joints, ties, fixed), f"{source}: outputs.stress"
        ),
        moving=moving_supports(config.supports, blocks, rigid, source)
        if config.ground.along is None
        else motion_along(config.ground.along, blocks, fixed, supported, f"{source}: ground.along"),
        force_histories=build_force_histories(config.loads.force_history, blocks, fixed, folder, source),
    )
    scene = replace(scene, construction=construction_stages(config, scene, stages, source))
    refuse_unreached(scene, supported, source)
    of_state: tuple[str, ...] = ()
    if isinstance(config.loads.initial_state, InitialStateConfig):
        initial, of_state = read_initial_state(config.loads.initial_state, joints, folder, source)
        scene = replace(scene, initial=initial)
    remarks = (
        *automatic_remarks(
            joints.values(), {name: automatic_keys(joint) for name, joint in config.every_joint.items()}
        ),
        *of_state,
        *files.remarks,
        *files.unused(),
        *odd_remarks(scene, materials, config.dam.joint_pairs if config.dam else ()),
        *along_remarks(scene, config.ground.along),
    )
    top = max(float(block.points[:, 2].max()) for block in blocks.values())
    overtopped = [
        f"loads.joint_water[{k}].level: {water.level:g} m is above all blocks, which reach to {top:g} m; is "
        "the unit right?"
        for k, water in enumerate(config.loads.joint_water)
        if water.level > top
    ]
    return replace(scene, remarks=(*remarks, *overtopped))


def _on_faces_and_nodes(
    config: Config, blocks: dict[str, Block], source: str, faults: Faults
) -> tuple[tuple[FacePressure, ...], tuple[PointForce, ...], tuple[Probe, ...], tuple[Hydrostatic, ...]]:
    """Loads on faces and at nodes, and observed nodes; `faults` gathers what is wrong with any of them."""
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
    return tuple(pressures), tuple(forces), tuple(probes), still


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
