"""The meshes and contact points that `study:` names, as jobs; what a job has not is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from romdam.config.load import Job
from romdam.config.other_mesh import (
    finer_in_direction,
    has_linear_elements_only,
    on_coarser_mesh,
    on_finer_mesh,
    on_limit_mesh,
    on_quadratic_elements,
    with_contact_points,
)
from romdam.config.sections.study import ContactPoints, StudiedMesh
from romdam.core.errors import ConfigError

MESHES: dict[StudiedMesh, str] = {
    "as_given": "as given",
    "twice": "twice the size",
    "half": "half the size",
    "quadratic": "quadratic",
    "quadratic_twice": "quadratic of twice the size",
    "finer_up": "finer up",
    "finer_through": "finer through",
    "finer_along": "finer along",
    "finer_rock": "finer rock",
}
CONTACT_POINTS: dict[ContactPoints, str] = {
    "as_given": "as given",
    "nodes": "every node",
    "corners": "corners",
    "mortar": "mortar",
}
_CHANGES: dict[StudiedMesh, tuple[Callable[[Job], Job], ...]] = {
    "as_given": (),
    "twice": (on_coarser_mesh,),
    "half": (on_finer_mesh,),
    "quadratic": (on_quadratic_elements,),
    "quadratic_twice": (on_quadratic_elements, on_coarser_mesh),
    "finer_up": (partial(finer_in_direction, direction="up"),),
    "finer_through": (partial(finer_in_direction, direction="through"),),
    "finer_along": (partial(finer_in_direction, direction="along"),),
    "finer_rock": (partial(finer_in_direction, direction="rock"),),
}


@dataclass(frozen=True)
class MeshVariant:
    """A mesh and contact points of a study.

    Attributes
    ----------
    mesh, contact_points : their names in tables
    job : with both
    """

    mesh: str
    contact_points: str
    job: Job


def studied_meshes(job: Job) -> list[MeshVariant]:
    """Every mesh of a study with every kind of contact points; the job itself where neither is studied.

    On linear elements, whose nodes are all corners, `corners` and `nodes` are one.

    Raises
    ------
    ConfigError
        for a mesh that the job does not have, that of the reference, and contact points that no mesh has.
    """
    wanted = job.config.study
    variants: list[MeshVariant] = []
    limit = on_limit_mesh(_without_nodes(job)) if wanted.varies_mesh else None
    for mesh in dict.fromkeys(wanted.meshes or ("as_given",)):
        on_mesh = job
        try:
            for change in _CHANGES[mesh]:
                on_mesh = change(on_mesh)
        except ConfigError as error:
            why = str(error).removeprefix(f"{job.path}: ")
            raise ConfigError(
                f"{job.path}: study.meshes: {mesh}: there is no such mesh: {why}; or take `{mesh}` out of "
                "the list"
            ) from None
        if mesh != "as_given":
            on_mesh = _without_nodes(on_mesh)
        if limit is not None and _mesh_of(on_mesh) == _mesh_of(limit):
            raise ConfigError(
                f"{job.path}: study.meshes: {mesh} is the mesh of the reference, which cannot show its own "
                f"error, the elements being quadratic or of a file; take `{mesh}` out of the list"
            )
        places = list(dict.fromkeys(wanted.contact_points or ("as_given",)))
        if has_linear_elements_only(on_mesh):
            alike: dict[ContactPoints, ContactPoints] = {"corners": "nodes"}
            places = list(dict.fromkeys(alike.get(points, points) for points in places))
        variants += [
            MeshVariant(MESHES[mesh], CONTACT_POINTS[points], with_contact_points(on_mesh, points))
            for points in places
        ]
    if "corners" in (wanted.contact_points or ()) and CONTACT_POINTS["corners"] not in {
        variant.contact_points for variant in variants
    }:
        raise ConfigError(
            f"{job.path}: study.contact_points: corners: no mesh that is studied has quadratic elements, and "
            "all nodes of linear ones are corners; name nodes instead, or a quadratic mesh in study.meshes"
        )
    return variants


def reference_meshes(job: Job) -> tuple[Job, Job]:
    """The job on the mesh of a study's reference, and on the coarser one that tells what that leaves.

    Raises
    ------
    ConfigError
        as `romdam.config.other_mesh.on_finer_mesh`.
    """
    job = _without_nodes(job)
    fine = on_limit_mesh(job)
    try:
        return fine, on_quadratic_elements(job)
    except ConfigError:
        return fine, job


def _without_nodes(job: Job) -> Job:
    """The job without output nodes, which another mesh need not have, and without stress."""
    outputs = job.config.outputs.model_copy(update={"nodes": {}, "stress": None})
    return replace(job, config=job.config.model_copy(update={"outputs": outputs}))


def _mesh_of(job: Job) -> tuple[object, ...]:
    """All that a mesh is made from."""
    return job.config.blocks, job.config.arch_dam, job.config.gravity_dam
