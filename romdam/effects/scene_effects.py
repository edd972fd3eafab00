"""The effects of a scene, in the order in which they act."""

from __future__ import annotations

from romdam.config.sections.job import DampingConfig
from romdam.core.scene import Scene
from romdam.effects.added_mass import added_mass
from romdam.effects.attachments import attached_dashpots, attached_springs
from romdam.effects.compressible_water import compressible_water
from romdam.effects.construction import construction
from romdam.effects.damping import SolidDamping
from romdam.effects.effect import Effect
from romdam.effects.force_histories import force_histories
from romdam.effects.free_field import incoming_waves
from romdam.effects.inclined_waves import inclined_waves
from romdam.effects.moving_supports import moving_supports
from romdam.effects.static_loads import static_loads
from romdam.effects.sustained_moduli import sustained_moduli
from romdam.fem.assembly import Assembly
from romdam.linalg.solvers import AUTO, Solving


def scene_effects(
    scene: Scene, damping: DampingConfig, directions: int, assembly: Assembly, solving: Solving = AUTO
) -> tuple[Effect, ...]:
    """Make the effects of a scene.

    What supports displace is known to all others. Springs and masses act before the water, which moves with
    them, and dashpots after the damping of the solids. Damping acts on the mass of incompressible water.
    Waves in rock begin before the record, which waves in water then follow. Stages of construction are loads
    over the unknowns of all others.

    Parameters
    ----------
    directions : of every gap, 1 or 3
    assembly : matrices of the scene's blocks
    solving : how large parts are solved

    Raises
    ------
    ConfigError
        for effects that physics does not let act together.
    ReductionError
        where the reservoir's equations cannot be factored.
    """
    effects: list[Effect | None] = [
        static_loads(scene),
        sustained_moduli(scene),
        force_histories(scene),
        moving_supports(scene, directions, assembly, solving),
        attached_springs(scene),
        added_mass(scene),
        SolidDamping(scene, damping),
        attached_dashpots(scene),
        incoming_waves(scene, damping),
        inclined_waves(scene, damping),
        compressible_water(scene),
        construction(scene),
    ]
    return tuple(effect for effect in effects if effect is not None)
