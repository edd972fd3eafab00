"""What makes the effects of a scene of a configuration: an effect adds its builder to `BUILDERS`.

The configuration is read here; what stands below sees its own section of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from romdam.config.sections.loads import InitialStateConfig
from romdam.core.attachment import Attachment
from romdam.core.final_state import InitialState
from romdam.core.motion import MovingSupports
from romdam.core.scene import ConstructionStage, ForceHistory, FreeField, Joint, Reservoir, Scene, Tie
from romdam.core.scene_effect import SceneEffect
from romdam.scene.attachments import AttachmentPlaces, build_attachments
from romdam.scene.construction import construction_stages
from romdam.scene.draft import Draft
from romdam.scene.force_histories import build_force_histories
from romdam.scene.ground.free_field import free_field
from romdam.scene.ground.motion_along import along_remarks, motion_along
from romdam.scene.ground.moving_supports import moving_supports
from romdam.scene.initial_state import read_initial_state
from romdam.scene.reservoir.build import build_reservoir
from romdam.scene.ties import scene_parts


def with_effects(scene: Scene, draft: Draft) -> Scene:
    """Build every effect that a configuration has, each over the scene with those before it.

    Raises
    ------
    ConfigError
        for what an effect's builder refuses.
    """
    for build in BUILDERS:
        scene = scene.with_effects(*(effect for effect in build(scene, draft) if effect is not None))
    return scene


def _attachments(scene: Scene, draft: Draft) -> tuple[Attachment, ...]:
    places = AttachmentPlaces(scene.blocks, scene.fixed, scene.loads.gravity, draft.source)
    return build_attachments(draft.config, places)


def _free_field(scene: Scene, draft: Draft) -> tuple[FreeField, ...]:
    ground = draft.config.ground
    if ground.input != "free_field":
        return ()
    return (free_field(scene.blocks, draft.rock, ground, draft.source),)


def _reservoir(scene: Scene, draft: Draft) -> tuple[Reservoir | None]:
    contacts: tuple[Joint | Tie, ...] = (*scene.joints.values(), *scene.ties)
    water = draft.config.water
    return (build_reservoir(water, scene.blocks, contacts, scene.fixed, draft.files, draft.source),)


def _moving_supports(scene: Scene, draft: Draft) -> tuple[MovingSupports | None]:
    along, blocks = draft.config.ground.along, scene.blocks
    if along is None:
        parts = scene_parts(scene).values()
        return (moving_supports(draft.config.supports, blocks, parts, draft.source),)
    moving = motion_along(along, blocks, scene.fixed, draft.supported, f"{draft.source}: ground.along")
    draft.remarks.extend(along_remarks(scene, moving, along))
    return (moving,)


def _force_histories(scene: Scene, draft: Draft) -> tuple[ForceHistory, ...]:
    entries = draft.config.loads.force_history
    return build_force_histories(entries, scene.blocks, scene.fixed, draft.folder, draft.source)


def _construction(scene: Scene, draft: Draft) -> tuple[ConstructionStage, ...]:
    return construction_stages(draft.config, scene, draft.files, draft.source)


def _initial_state(scene: Scene, draft: Draft) -> tuple[InitialState, ...]:
    config = draft.config.loads.initial_state
    if not isinstance(config, InitialStateConfig):
        return ()
    state, remarks = read_initial_state(config, scene.joints, draft.folder, draft.source)
    draft.remarks.extend(remarks)
    return (state,)


Builder = Callable[[Scene, Draft], Iterable[SceneEffect | None]]

BUILDERS: tuple[Builder, ...] = (
    _attachments,
    _free_field,
    _reservoir,
    _moving_supports,
    _force_histories,
    _construction,
    _initial_state,
)
