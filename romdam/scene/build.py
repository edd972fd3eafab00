"""Configuration -> Scene."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from romdam.config.sections.geometry.cut import pieces_of
from romdam.config.sections.job import Config
from romdam.core.errors import ConfigError
from romdam.core.scene import (
    Block,
    Bools,
    FacePressure,
    Hydrostatic,
    Joint,
    Material,
    PointForce,
    Probe,
    Scene,
    Tie,
)
from romdam.geometry.arch_dam.generator import Dam, arch_dam
from romdam.geometry.boxes import box_block
from romdam.geometry.cutting.pieces import cut_block
from romdam.geometry.elements import Floats
from romdam.geometry.gravity_dam import gravity_dam
from romdam.geometry.matrices.block import held_by, refuse_unreached, with_matrices
from romdam.geometry.meshes.files import MeshFiles
from romdam.geometry.meshes.sizes import refuse_large
from romdam.scene.ground.free_field import free_field
from romdam.scene.ground.moving_supports import moving_supports
from romdam.scene.ground.viscous import rock_of, with_viscous_faces
from romdam.scene.joint_water.build import with_water
from romdam.scene.joints import build_joint
from romdam.scene.plausible import odd_remarks
from romdam.scene.reservoir.build import build_reservoir, refuse_level
from romdam.scene.select import nearest_node, refuse_selected_twice, select_facets
from romdam.scene.stress.sites import Structure, stress_sites
from romdam.scene.supports import refuse_free_blocks, refuse_massless_on_joints
from romdam.scene.ties import Part, build_tie, merged_parts, refuse_tied

_NO_DAM = Dam({}, (), {}, frozenset())


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
    refuse_large(config, source)
    materials = {name: Material(m.E, m.nu, m.rho, m.expansion) for name, m in config.materials.items()}
    dam = _dam(config, materials, source)
    files = MeshFiles(folder)
    blocks = dam.blocks | _blocks(config, materials, files, dam.blocks, source)
    rock = rock_of(config.ground, dam.viscous)
    blocks = with_viscous_faces(blocks, (*config.ground.viscous, *dam.viscous), rock, source)
    waves = config.ground.input == "free_field"
    fixed = held_by(blocks, supported := _fixed(config, blocks, dam.held, source))
    _refuse_joined_twice(config, source)
    ties = (*_dam_ties(dam, blocks, source), *_ties(config, blocks, source))
    rigid = merged_parts(fixed, ties)
    joints = {
        name: build_joint(name, joint, blocks, fixed, folder, source, tuple(rigid.values()))
        for name, joint in config.every_joint.items()
    }
    _fill_joints(config, joints, blocks, source)
    refuse_free_blocks(blocks, joints, fixed, source, ties)
    _refuse_massless(rigid.values(), blocks, fixed, source)
    scene = Scene(
        blocks=blocks,
        joints=joints,
        fixed=fixed,
        pressures=_pressures(config, blocks, source),
        forces=_forces(config, blocks, source),
        gravity=_gravity(config),
        probes=_probes(config, blocks, source),
        ties=ties,
        water=_water(config, blocks, source),
        warmed=_warmed(config, blocks, source),
        excluded_from_gravity=dam.excluded_from_gravity | _weightless(config),
        radiating=frozenset() if waves else rock,
        free_field=free_field(blocks, rock, config.ground.surface, source) if waves else None,
        staged_weight=config.loads.weight == "staged",
        reservoir=build_reservoir(config.water, blocks, (*joints.values(), *ties), fixed, files, source),
        stress=stress_sites(
            config.outputs.stress, Structure(blocks, joints, ties, fixed), f"{source}: outputs.stress"
        ),
        moving=moving_supports(config.supports, blocks, tuple(rigid.values()), source),
    )
    refuse_unreached(scene, supported, source)
    files.say_unused(source)
    pairs = config.dam.joint_pairs if config.dam else ()
    return replace(scene, remarks=(*odd_remarks(scene, materials, pairs), *_overtopped(config, blocks)))


def _refuse_massless(
    parts: Iterable[Part], blocks: dict[str, Block], fixed: dict[str, Bools], source: str
) -> None:
    for part in parts:
        refuse_massless_on_joints(part.mesh(blocks), part.blocks, part.fixed(fixed), blocks, source)


def _dam_ties(dam: Dam, blocks: dict[str, Block], source: str) -> Iterator[Tie]:
    for tie in dam.ties:
        refuse_tied((blocks[tie.blocks[0]], blocks[tie.blocks[1]]), f"{source}: tie {tie.name} of the dam")
        yield tie


def _ties(config: Config, blocks: dict[str, Block], source: str) -> Iterator[Tie]:
    for name, tie in config.ties.items():
        yield build_tie(name, tie, blocks, f"{source}: ties.{name}")


def _weightless(config: Config) -> frozenset[str]:
    without = [name for name, block in config.blocks.items() if not block.weight]
    return frozenset(piece for name in without for piece in pieces_of(name, config.cut))


def _dam(config: Config, materials: dict[str, Material], source: str) -> Dam:
    if config.gravity_dam:
        return gravity_dam(config.gravity_dam, materials, f"{source}: gravity_dam")
    return arch_dam(config.arch_dam, materials, f"{source}: arch_dam") if config.arch_dam else _NO_DAM


def _blocks(
    config: Config,
    materials: dict[str, Material],
    files: MeshFiles,
    made_by_dam: dict[str, Block],
    source: str,
) -> dict[str, Block]:
    blocks: dict[str, Block] = {}
    for name, block in config.blocks.items():
        constants = materials[block.material].with_mass(block.mass)
        if block.box is not None:
            block_made = box_block(name, block.box, constants, f"{source}: blocks.{name}.box")
        elif block.mesh is not None:
            block_made = files.block(name, block.mesh, constants, f"{source}: blocks.{name}.mesh")
        else:
            block_made = replace(made_by_dam[name], material=constants)
        if block.matrices is not None:
            numbered = None if block.mesh is None else files.numbered(block.mesh)
            location = f"{source}: blocks.{name}.matrices"
            supported = any(support.block == name for support in config.supports)
            block_made = with_matrices(
                block_made, block.matrices, files.folder, numbered, location, supported=supported
            )
        blocks |= (
            cut_block(block_made, config.cut, files.folder, source)
            if name in config.cut
            else {name: block_made}
        )
    return blocks


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


def _fixed(config: Config, blocks: dict[str, Block], held: dict[str, Bools], source: str) -> dict[str, Bools]:
    fixed = {name: np.zeros((len(block.points), 3), dtype=bool) for name, block in blocks.items()} | held
    for k, support in enumerate(config.supports):
        facets = select_facets(blocks[support.block], support.face, f"{source}: supports[{k}].face")
        for axis in support.fix:
            fixed[support.block][np.unique(facets), "xyz".index(axis)] = True
    return fixed


def _pressures(config: Config, blocks: dict[str, Block], source: str) -> tuple[FacePressure, ...]:
    pressures = []
    for k, load in enumerate(config.loads.pressure):
        facets = select_facets(blocks[load.block], load.face, f"{source}: loads.pressure[{k}].face")
        pressures.append(FacePressure(load.block, facets, load.value))
    return tuple(pressures)


def _fill_joints(config: Config, joints: dict[str, Joint], blocks: dict[str, Block], source: str) -> None:
    for k, water in enumerate(config.loads.joint_water):
        location = f"{source}: loads.joint_water[{k}]"
        for name in water.joints:
            joints[name] = with_water(joints[name], water, blocks, config.loads.gravity_of_water, location)


def _overtopped(config: Config, blocks: dict[str, Block]) -> Iterator[str]:
    top = max(float(block.points[:, 2].max()) for block in blocks.values())
    for k, water in enumerate(config.loads.joint_water):
        if water.level > top:
            yield (
                f"loads.joint_water[{k}].level: {water.level:g} m is above all blocks, which reach to "
                f"{top:g} m; is the unit right?"
            )


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


def _warmed(config: Config, blocks: dict[str, Block], source: str) -> dict[str, float]:
    changes, warmed = dict.fromkeys(blocks, 0.0), dict[str, int]()
    for k, load in enumerate(config.loads.temperature):
        names = load.blocks or [name for name, block in blocks.items() if block.material.expansion > 0.0]
        stiff = [name for name in names if blocks[name].material.expansion == 0.0]
        if stiff or not names:
            what = f"block {stiff[0]!r} is of a material" if stiff else "no block is of a material"
            raise ConfigError(
                f"{source}: loads.temperature[{k}]: {what} "
                f"{'without' if stiff else 'with'} thermal expansion; give materials.<name>.expansion, "
                "about 1e-5 1/K for concrete"
            )
        for name in names:
            if name in warmed:
                raise ConfigError(
                    f"{source}: loads.temperature[{k}]: the change of block {name!r} is named by "
                    f"loads.temperature[{warmed[name]}] already ({changes[name]:g} K), limit once; name each "
                    "block once, with its whole change"
                )
            changes[name], warmed[name] = load.change, k
    return {name: change for name, change in changes.items() if change != 0.0}


def _forces(config: Config, blocks: dict[str, Block], source: str) -> tuple[PointForce, ...]:
    forces = []
    for k, load in enumerate(config.loads.force):
        node = nearest_node(blocks[load.block], load.at, load.tolerance, f"{source}: loads.force[{k}].at")
        forces.append(PointForce(load.block, node, np.array(load.force)))
    return tuple(forces)


def _gravity(config: Config) -> Floats:
    gravity = config.loads.gravity
    return np.zeros(3) if gravity is None else np.array(gravity)


def _probes(config: Config, blocks: dict[str, Block], source: str) -> tuple[Probe, ...]:
    return tuple(
        Probe(
            name,
            at.block,
            nearest_node(blocks[at.block], at.at, at.tolerance, f"{source}: outputs.nodes.{name}.at"),
        )
        for name, at in config.outputs.nodes.items()
    )
