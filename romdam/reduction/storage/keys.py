"""Keys of stored bases: the SHA-256 of everything that a basis depends on.

Mesh, element, material, supports, what the joints retain, the loads that the basis answers statically, the
choice of modes, the layout, the name of the method, and the code that reduces, with all that it imports and
the libraries that multiply and factor for it: what is found is what would be computed, to the bit. Stiffness
and friction of joints, gaps, damping, weight and records are not part of it; water is, where a finer basis
answers its inertia. See `romdam.reduction.reductor.basis_keys`.
"""

from __future__ import annotations

from romdam.core.motion import MovingSupports
from romdam.core.scene import FreeField, Material
from romdam.reduction.mode_choice import ModeChoice
from romdam.reduction.substructure import Substructure

CODE = "romdam.reduction.synthesis"  # which imports all methods, and by them all that makes a basis


def block_content(substructure: Substructure, choice: ModeChoice) -> tuple[object, ...]:
    """Return what the Craig-Bampton basis of a single block depends on; its name is not part of it."""
    (name,) = substructure.blocks
    block, fixed, wet = (
        substructure.scene.blocks[name],
        substructure.scene.fixed[name],
        substructure.block_wet,
    )
    elastic = (block.material.E, block.material.nu, block.material.rho)
    mesh = (block.element, block.points, block.cells, elastic)
    absorbing = (block.absorbing,) if block.absorbing else ()
    matrices = () if block.matrices is None else (block.matrices,)
    water = (wet,) if choice.finer and wet is not None else ()
    loads = substructure.block_load_directions
    return mesh, fixed, *absorbing, *matrices, substructure.interface, loads, choice.stored, *water


def key_content(substructure: Substructure, choice: ModeChoice) -> tuple[object, ...]:
    """Return everything that is known of a part and its loads, on which any basis of it depends."""
    mesh_part, scene, wet = substructure.mesh_part, substructure.scene, substructure.wet
    of_blocks = [
        (name, scene.blocks[name].element, _undamped(scene.blocks[name].material), scene.blocks[name].points,
         scene.blocks[name].cells, mesh_part.number[name], scene.fixed[name], scene.blocks[name].absorbing)
        for name in mesh_part.blocks
    ]  # fmt: skip
    kinds = [
        sorted(names & set(mesh_part.blocks))
        for names in (scene.loads.excluded_from_gravity, scene.radiating)
    ]
    slaves = () if mesh_part.slaves is None else (mesh_part.slaves,)
    field, moving = scene.find(FreeField), scene.find(MovingSupports)
    waves = () if field is None else (_waves(field),)
    moved = [] if moving is None else [moving.components[name] for name in mesh_part.blocks]
    carried = (moved,) if any((number >= 0).any() for number in moved) else ()
    shares = {} if moving is None else moving.shares
    carried += tuple(shares[name] for name in mesh_part.blocks if name in shares)
    matrices = [m for name in mesh_part.blocks if (m := scene.blocks[name].matrices) is not None]
    water = (wet,) if choice.finer and wet is not None else ()
    loads = substructure.operator, substructure.static_forces
    return (of_blocks, *slaves, *waves, *carried, *matrices, kinds, *loads, choice.stored, *water)


def _undamped(material: Material) -> dict[str, object]:
    """What a basis depends on of a material: all but its damping."""
    return {key: value for key, value in vars(material).items() if key != "damping"}


def _waves(field: FreeField) -> dict[str, object]:
    every = vars(field) | {"materials": tuple(_undamped(material) for material in field.materials)}
    return (
        every if field.inclined else {key: every[key] for key in ("levels", "materials", "order", "blocks")}
    )
