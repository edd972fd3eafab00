"""Blocks of a scene: dams of a few keys, boxes, and what mesh files hold."""

from __future__ import annotations

from dataclasses import replace

from romdam.config.effects import has_viscous_boundary
from romdam.config.job import Config
from romdam.config.sections.job import MaterialConfig
from romdam.core.scene import Block, Material
from romdam.geometry.arch_dam.generator import Dam, arch_dam
from romdam.geometry.boxes import box_block
from romdam.geometry.cutting.pieces import cut_block
from romdam.geometry.gravity_dam import gravity_dam
from romdam.geometry.matrices.block import with_matrices
from romdam.geometry.meshes.files import MeshFiles


def materials_of(config: Config) -> dict[str, Material]:
    """The materials of a configuration by name."""
    return {name: material_of(m) for name, m in config.materials.items()}


def material_of(material: MaterialConfig) -> Material:
    """A material of a configuration; E_sustained is None where its moduli are one."""
    E, E_sustained = material.E, None
    if material.E_dynamic is not None and material.E_dynamic != E:
        E, E_sustained = material.E_dynamic, material.E
    damping = None if material.damping is None else material.damping.coefficients
    return Material(E, material.nu, material.rho, material.expansion, E_sustained, damping)


def dam_of(config: Config, materials: dict[str, Material], source: str) -> Dam:
    """The dam of a few keys; one of no blocks where the configuration has none.

    Raises
    ------
    ConfigError, MeshError
        as the generators of arch and gravity dams.
    """
    absorbs = has_viscous_boundary(config)
    if config.gravity_dam:
        return gravity_dam(config.gravity_dam, materials, f"{source}: gravity_dam", absorbs=absorbs)
    if config.arch_dam:
        return arch_dam(config.arch_dam, materials, f"{source}: arch_dam", absorbs=absorbs)
    return Dam({}, (), {}, frozenset())


def named_blocks(
    config: Config,
    materials: dict[str, Material],
    files: MeshFiles,
    of_dam: dict[str, Block],
    source: str,
) -> dict[str, Block]:
    """Blocks that the section `blocks` names; a block of the dam gets the material that stands there.

    Parameters
    ----------
    files : that they are read from
    of_dam : blocks of a dam of a few keys
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError, MeshError
        for boxes that their elements do not divide, mesh files, matrices and cuts.
    """
    blocks: dict[str, Block] = {}
    for name, section in config.blocks.items():
        location = f"{source}: blocks.{name}"
        material = materials[section.material].with_mass(section.mass)
        if section.box is not None:
            made = [box_block(name, section.box, material, f"{location}.box")]
        elif section.mesh is not None:
            made = files.blocks(name, section.mesh, material, f"{location}.mesh")
        else:
            made = [replace(of_dam[name], material=material)]
        if section.matrices is not None:
            numbered = None if section.mesh is None else files.numbered(section.mesh)
            supported = any(support.block == name for support in config.supports)
            whole = with_matrices(
                made[0], section.matrices, files.folder, numbered, f"{location}.matrices", supported=supported
            )
            made = [whole]
        for block in made:
            if block.name in config.cut:
                blocks |= cut_block(block, config.cut, files.folder, source)
            else:
                blocks[block.name] = block
    return blocks
