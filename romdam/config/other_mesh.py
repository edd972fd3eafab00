"""The same job on elements of half, or twice, the size, on quadratic ones, or with gaps at other places."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import NoReturn, TypeVar

from romdam.config.base import Model
from romdam.config.load import Job
from romdam.config.sections.geometry.arch_dam import ArchDamConfig
from romdam.config.sections.geometry.gravity_dam import GravityDamConfig
from romdam.config.sections.geometry.mesh_file import MeshFileConfig
from romdam.config.sections.geometry.refinement import (
    MOST_DIVISIONS,
    Counts,
    Divisions,
    every_count,
    in_all,
)
from romdam.config.sections.joints import JointProperties
from romdam.config.sections.study import ContactPoints
from romdam.core.errors import ConfigError

_QUADRATIC = {"hex8": "hex20", "tet4": "tet10"}
# divisions of the dam itself, whose nodes hold the gaps. What is made coarser first to last: the earlier, the
# more gaps are saved in all later ones
_OF_DAM = ("up", "through", "along")
_ROCK = ("perimeter", "rock", "depth", "upstream", "downstream", "banks")
EVERY_DIRECTION = "every direction"
_POINTS: dict[str, dict[str, object]] = {  # contact points -> keys of every joint
    "nodes": {"gaps": "nodes", "discretization": "node_to_node"},
    "corners": {"gaps": "corners", "discretization": "node_to_node"},
    "mortar": {"gaps": "nodes", "discretization": "mortar"},
}
MeshT = TypeVar("MeshT", MeshFileConfig, Divisions)
ModelT = TypeVar("ModelT", bound=Model)
DamConfig = ArchDamConfig | GravityDamConfig


def on_finer_mesh(job: Job) -> Job:
    """The job with elements of half the size: boxes, dams of a few keys, and mesh files.

    Raises
    ------
    ConfigError
        for a block whose stiffness and mass come from files, and for stiffnesses of single gaps.
    """
    _refuse_bound_to_mesh(job)
    return _on_other_mesh(job, finer=True)


def on_coarser_mesh(job: Job, *, rock: bool = True) -> Job:
    """The job with elements of twice the size; odd numbers of layers of rock are rounded up.

    Parameters
    ----------
    rock : whether what generated dams stand on is coarser too

    Raises
    ------
    ConfigError
        as `on_finer_mesh`; for mesh files that are not refined, and for odd numbers of elements in boxes and
        dams.
    """
    _refuse_bound_to_mesh(job)
    config = job.config
    for name, block in config.blocks.items():
        if block.box is not None:
            wanted = block.box.element_size
            sizes = (wanted,) * 3 if isinstance(wanted, float) else wanted
            for axis, length, size in zip("xyz", block.box.size, sizes, strict=True):
                count = length / size
                if round(count) % 2:
                    why = f"has {count:g} elements along {axis}, which cannot be halved"
                    _refuse_coarser(f"{job.path}: blocks.{name}.box", why)
        elif block.mesh is None or not block.mesh.refine:
            _refuse_coarser(f"{job.path}: blocks.{name}", "is of a file, which has no coarser mesh")
    for dam in (config.arch_dam, config.gravity_dam):
        if dam is not None and not dam.divisions.refine:
            for name in _OF_DAM:
                counts = getattr(dam.shared_divisions, name)
                if any(n % 2 for n in (counts if isinstance(counts, tuple) else (counts,))):
                    _refuse_counts(job, dam, name, "which cannot be halved")
    return _on_other_mesh(job, finer=False, rock=rock)


@dataclass(frozen=True)
class SiblingJob:
    """A job on another mesh than the one before it: in which direction that differs, and by how much.

    Attributes
    ----------
    times : size of its elements over that of those before, in that direction; below 1 where they are finer
    """

    direction: str
    times: float
    job: Job


def sibling_meshes(job: Job) -> list[SiblingJob]:
    """Jobs on other meshes, each of which differs from the one before in one direction; the first from `job`.

    A generated dam on quadratic elements is coarser in one more direction in each; other jobs have elements
    of twice the size in all directions at once. Odd numbers of elements that three divides become two thirds
    of what they are: every third node, and its gap, is in both meshes. Other odd divisions along an arch,
    which hold no gaps, are rounded up. Up and through a gravity dam every interval between elevations where
    something changes is so divided: an error that both meshes have in an interval which they share does not
    show in their difference.

    Below all these dams are the perimeter and the rock of `job`. The last one has layers of half the size in
    the perimeter and the inner half of the rock: one layer, and odd numbers of them, cannot be halved, and
    finer rock costs little below a coarse dam.

    Raises
    ------
    ConfigError
        as `on_coarser_mesh`, for numbers of elements through a dam, or up, of which neither half nor two
        thirds are whole, and for more layers of rock than a dam may have.
    """
    key, dam = _quadratic_dam(job)
    if dam is None:
        every = SiblingJob(EVERY_DIRECTION, 2.0, on_coarser_mesh(job, rock=False))
        return _with_finer_ground([every])
    _refuse_bound_to_mesh(job)
    divisions, chain = dam.shared_divisions, list[SiblingJob]()
    for direction in _OF_DAM:
        fewer = _coarser_counts(getattr(divisions, direction), rounded=_holds_no_gaps(dam, direction))
        if fewer is None:
            _refuse_counts(job, dam, direction, "of which neither half nor two thirds are whole")
        times, counts = fewer
        divisions = divisions.model_copy(update={direction: counts})
        changed = dam.model_copy(update={"divisions": divisions})
        chain.append(SiblingJob(direction, times, _of_another_mesh(job, {key: changed})))
    return _with_finer_ground(chain)


def _with_finer_ground(chain: list[SiblingJob]) -> list[SiblingJob]:
    """The chain, and where a dam stands on something its last job with finer layers of that.

    Stress, which runs are compared by, is in the last only.
    """
    job, changed = chain[-1].job, dict[str, object]()
    for key, dam in (("arch_dam", job.config.arch_dam), ("gravity_dam", job.config.gravity_dam)):
        if dam is not None and _has_ground(dam):
            changed[key] = _on_finer_ground(job, key, dam)
    if changed:
        chain = [*chain, SiblingJob("rock", 0.5, _of_another_mesh(job, changed))]
    return [replace(each, job=_without_stress(each.job)) for each in chain[:-1]] + chain[-1:]


def _on_finer_ground(job: Job, key: str, dam: DamConfig) -> DamConfig:
    """A dam on layers of half the size: those of the perimeter, and the inner half of those of the rock.

    Where some are halved already, all are.
    """
    divisions = dam.shared_divisions
    if divisions.halved or dam.rock is None:
        return _with_ground(job, key, dam, lambda n: 2 * n, 0.5)
    layers = {name: getattr(divisions, name) for name in _ROCK if hasattr(divisions, name)}
    perimeter = {name: 2 * count for name, count in layers.items() if name == "perimeter"}
    _refuse_many(job, key, "perimeter", perimeter.get("perimeter", 0))
    of_rock = max(count for name, count in layers.items() if name not in perimeter)
    changed = perimeter | {"halved": (of_rock + 1) // 2}
    return dam.model_copy(update={"divisions": divisions.model_copy(update=changed)})


def with_even_divisions(job: Job) -> Job:
    """The job of a generated dam on quadratic elements with the next mesh that has a coarser one.

    Numbers of elements of which neither half nor two thirds are whole become even; it is the same job where
    there are none.

    Raises
    ------
    ConfigError
        for a job that is not of such a dam alone, and for stiffnesses of single gaps.
    """
    key, dam = _only_quadratic_dam(job)
    _refuse_bound_to_mesh(job)
    divisions = dam.shared_divisions
    wanted = {
        name: every_count(counts, lambda n: 2 * math.ceil(n / 2))
        for name in _OF_DAM
        if _coarser_counts(counts := getattr(divisions, name), rounded=_holds_no_gaps(dam, name)) is None
    }
    if not wanted:
        return job
    changed = dam.model_copy(update={"divisions": divisions.model_copy(update=wanted)})
    return replace(job, config=job.config.model_copy(update={key: changed}))


def finer_in_direction(job: Job, direction: str) -> Job:
    """The job of a generated dam with half again as many elements in a direction, an even number.

    Parameters
    ----------
    direction : up, through or along, or rock for all below and beside the dam


    Raises
    ------
    ConfigError
        for a job that is not of a generated dam alone on quadratic elements, one without rock where that is
        the direction, and for more elements than a dam may have.
    """
    key, dam = _only_quadratic_dam(job)
    if direction == "rock" and not _has_ground(dam):
        raise ConfigError(f"{job.path}: {key}: there is no rock to refine")

    def finer(n: int) -> int:
        return 2 * math.ceil(0.75 * n)

    if direction == "rock":
        changed = _with_ground(job, key, dam, finer, 1.0 / 1.5)
    else:
        divisions = dam.shared_divisions
        counts = every_count(getattr(divisions, direction), finer)
        _refuse_many(job, key, direction, counts)
        changed = dam.model_copy(update={"divisions": divisions.model_copy(update={direction: counts})})
    return replace(job, config=job.config.model_copy(update={key: changed}))


def _with_ground(
    job: Job, key: str, dam: DamConfig, change: Callable[[int], int], of_growth: float
) -> DamConfig:
    """A dam with other numbers of layers and rows below and beside it.

    Parameters
    ----------
    of_growth : exponent of the growth of layers
    """
    divisions = dam.shared_divisions
    counts = {name: change(getattr(divisions, name)) for name in _ROCK if hasattr(divisions, name)}
    for name, count in counts.items():
        _refuse_many(job, key, name, count)
    halved = change(divisions.halved) if divisions.halved else 0
    wanted: dict[str, object] = counts | {"halved": halved, "growth": divisions.growth**of_growth}
    return dam.model_copy(update={"divisions": divisions.model_copy(update=wanted)})


def _refuse_many(job: Job, key: str, name: str, counts: Counts) -> None:
    """Raise for more elements than a dam may have."""
    if in_all(counts) > MOST_DIVISIONS:
        raise ConfigError(f"{job.path}: {key}.divisions: more than {MOST_DIVISIONS} {name} are not meshed")


def _coarser_counts(counts: Counts, *, rounded: bool) -> tuple[float, Counts] | None:
    """How many times as large elements are on a coarser mesh whose nodes this one has, and their numbers.

    Parameters
    ----------
    rounded : whether half may be rounded up, where nodes hold no gaps
    """
    each = counts if isinstance(counts, tuple) else (counts,)
    if not any(n % 2 for n in each):
        return 2.0, every_count(counts, lambda n: n // 2)
    if not any(n % 3 for n in each):
        return 1.5, every_count(counts, lambda n: 2 * n // 3)
    if rounded and max(each) > 1:
        half = every_count(counts, lambda n: (n + 1) // 2)
        return in_all(counts) / in_all(half), half
    return None


def _holds_no_gaps(dam: DamConfig, direction: str) -> bool:
    """Whether nodes along a direction hold no gaps: along an arch, whose joints part the cantilevers."""
    return direction == "along" and isinstance(dam, ArchDamConfig)


def _refuse_counts(job: Job, dam: DamConfig, name: str, why: str) -> NoReturn:
    """Raise for numbers of elements that have no coarser mesh, with numbers that have one."""
    divided, each = getattr(dam.divisions.refined, name), getattr(dam.shared_divisions, name)
    stated = list(divided) if isinstance(divided, tuple) else divided
    key = "arch_dam" if isinstance(dam, ArchDamConfig) else "gravity_dam"
    even = every_count(each, lambda n: 2 * math.ceil(n / 2))
    shared = ""
    if isinstance(dam, GravityDamConfig) and each != divided:
        shared = f", shared out as {list(each)} between {dam.ends_of_intervals[name]}"
    wanted = list(even) if isinstance(even, tuple) else even
    _refuse_coarser(
        f"{job.path}: {key}.divisions.{name}", f"is {stated}{shared}, {why}", f"make it {wanted}, or "
    )


def _only_quadratic_dam(job: Job) -> tuple[str, DamConfig]:
    """Key and section of a job's generated dam.

    Raises
    ------
    ConfigError
        without one alone on quadratic elements.
    """
    key, dam = _quadratic_dam(job)
    if dam is None:
        raise ConfigError(
            f"{job.path}: only a generated dam on quadratic elements is refined in one direction"
        )
    return key, dam


def _quadratic_dam(job: Job) -> tuple[str, DamConfig | None]:
    """Key and section of a job's generated dam, None without one alone on quadratic displacements."""
    dams = {"arch_dam": job.config.arch_dam, "gravity_dam": job.config.gravity_dam}
    present = [(key, dam) for key, dam in dams.items() if dam is not None]
    if len(present) != 1 or job.config.blocks or present[0][1].element in _QUADRATIC:
        return "", None
    return present[0]


def _has_ground(dam: DamConfig) -> bool:
    """Whether a dam stands on rock or on a perimeter."""
    return dam.rock is not None or (isinstance(dam, ArchDamConfig) and dam.perimeter is not None)


def on_quadratic_elements(job: Job) -> Job:
    """The job with elements of quadratic displacements, as many as it has, in every box and generated dam.

    Raises
    ------
    ConfigError
        as `on_finer_mesh`; for mesh files, whose elements stay as they are, and where all are quadratic.
    """
    _refuse_bound_to_mesh(job)
    config, blocks = job.config, dict(job.config.blocks)
    changed: dict[str, object] = {}
    for name, block in config.blocks.items():
        if block.box is None:
            raise ConfigError(f"{job.path}: blocks.{name}: is of a file, whose elements stay as they are")
        if (element := _QUADRATIC.get(block.box.element)) is not None:
            box = block.box.model_copy(update={"element": element})
            blocks[name] = block.model_copy(update={"box": box})
            changed["blocks"] = blocks
    for key, dam in (("arch_dam", config.arch_dam), ("gravity_dam", config.gravity_dam)):
        if dam is not None and (element := _QUADRATIC.get(dam.element)) is not None:
            changed[key] = dam.model_copy(update={"element": element})
    if not changed:
        raise ConfigError(f"{job.path}: all elements have quadratic displacements already")
    return _of_another_mesh(job, changed)


def on_limit_mesh(job: Job) -> Job:
    """The job on a mesh whose error is far below its own: quadratic elements of half the size.

    Raises
    ------
    ConfigError
        as `on_finer_mesh`.
    """
    with suppress(ConfigError):  # elements of mesh files stay as they are
        job = on_quadratic_elements(job)
    return on_finer_mesh(job)


def with_spacing(job: Job, lengths: Mapping[str, float | None] | None = None) -> Job:
    """The job with a distance of the gaps [m] in every joint that has `spacing: auto`.

    Parameters
    ----------
    lengths : joint -> distance [m]; joints without one have a gap at every node
    """

    def keys_of(properties: JointProperties, names: tuple[str, ...]) -> dict[str, object]:
        each = {name: properties.spacing_of(name) for name in names}
        if "auto" not in each.values():
            return {}
        wanted = {
            name: (lengths or {}).get(name) if value == "auto" else value for name, value in each.items()
        }
        if len(set(wanted.values())) == 1:
            return {"spacing": next(iter(wanted.values()))}
        return {"spacing": {name: value for name, value in wanted.items() if value is not None}}

    return _with_joint_keys(job, keys_of)


def with_automatic_spacing(job: Job) -> Job:
    """The job with `spacing: auto` in every joint."""
    return _with_joint_keys(job, lambda joint, names: {"spacing": "auto"})


def with_gaps_at_every_node(job: Job) -> Job | None:
    """The job with a gap at every node of its joints; None where no joint has a `spacing`."""
    if not any(isinstance(joint.spacing, float) for joint in job.config.every_joint.values()):
        return None
    return _with_joint_keys(job, lambda joint, names: {"spacing": None})


def with_steps_of(job: Job, finest: float) -> Job:
    """The job with a finest step [s], where it asks for an accuracy of the steps."""
    if job.config.transient.step_accuracy is None:
        return job
    transient = job.config.transient.model_copy(update={"accuracy": None, "finest_step": finest})
    return replace(job, config=job.config.model_copy(update={"transient": transient}))


def with_contact_points(job: Job, points: ContactPoints) -> Job:
    """The job with the gaps of every joint at other places.

    Raises
    ------
    ConfigError
        for stiffnesses of single gaps, and for blocks whose stiffness and mass come from files.
    """
    if points == "as_given":
        return job
    _refuse_bound_to_mesh(job)
    return _with_joint_keys(job, lambda joint, names: _POINTS[points])


def _with_joint_keys(
    job: Job, keys_of: Callable[[JointProperties, tuple[str, ...]], dict[str, object]]
) -> Job:
    """The job with other keys in all properties of joints, wherever they stand.

    Parameters
    ----------
    keys_of : the new keys from the properties, and the names of the joints that have them
    """
    config = job.config
    changed = {
        path: properties.model_copy(update=keys_of(properties, names))
        for path, (properties, names) in config.joint_sections.items()
    }
    sections: dict[str, object] = {
        "joints": {name: changed[f"joints.{name}"] for name in config.joints},
        "cut": {
            name: _with_joints(cut, changed.get(f"cut.{name}.joints")) for name, cut in config.cut.items()
        },
    }
    if config.arch_dam is not None:
        sections["arch_dam"] = _with_joints(config.arch_dam, changed.get("arch_dam.joints"))
    if (dam := config.gravity_dam) is not None:
        kinds = {
            key: changed[path] for key, _ in dam.joints if (path := f"gravity_dam.joints.{key}") in changed
        }
        joints = dam.joints.model_copy(update=kinds)
        sections["gravity_dam"] = dam.model_copy(update={"joints": joints})
    return replace(job, config=config.model_copy(update=sections))


def _with_joints(section: ModelT, joints: JointProperties | None) -> ModelT:
    """A section with other properties of its joints, if it has some."""
    return section if joints is None else section.model_copy(update={"joints": joints})


def has_linear_elements_only(job: Job) -> bool:
    """Whether every element is known to have nodes at its corners only; those of mesh files are not known."""
    config = job.config
    boxes = [block.box.element if block.box is not None else "" for block in config.blocks.values()]
    dams = [dam.element for dam in (config.arch_dam, config.gravity_dam) if dam is not None]
    return all(element in _QUADRATIC for element in boxes + dams)


def with_mesh_of(job: Job, other: Job) -> Job:
    """The job with the mesh and the contact points of another, and all else its own."""
    keys = ("blocks", "arch_dam", "gravity_dam", "cut", "joints")
    mesh = {key: getattr(other.config, key) for key in keys}
    return replace(job, config=job.config.model_copy(update=mesh))


def with_compared_stress(job: Job) -> Job:
    """The job with stress on faces and sections only, by which meshes are compared, or without any."""
    stress = job.config.outputs.stress
    if stress is not None:
        only: dict[str, object] = {"blocks": (), "nodes": {}, "strength": None}
        stress = stress.model_copy(update=only) if stress.faces or stress.sections else None
    outputs = job.config.outputs.model_copy(update={"stress": stress})
    return replace(job, config=job.config.model_copy(update={"outputs": outputs}))


def _without_stress(job: Job) -> Job:
    """The job without stress, which the last of a chain of meshes is compared by."""
    outputs = job.config.outputs.model_copy(update={"stress": None})
    return replace(job, config=job.config.model_copy(update={"outputs": outputs}))


def _refuse_bound_to_mesh(job: Job) -> None:
    """Refuse what belongs to the nodes or to the number of gaps of one mesh."""
    for name, block in job.config.blocks.items():
        if block.matrices is not None:
            raise ConfigError(
                f"{job.path}: blocks.{name}.matrices: stiffness and mass come from another program, so there "
                "is no other mesh, and what it would change is unknown; compare with matrices of another mesh"
            )
    for name, joint in job.config.every_joint.items():
        for key, value in joint.law_keys.items():
            if isinstance(value, dict) and value.get("per_gap"):
                raise ConfigError(
                    f"{job.path}: {key} of joint {name} is {value['per_gap']:g} N/m of each gap, so with "
                    "more or fewer gaps the joint has another stiffness; give it per area (16 GPa/m)"
                )


def _refuse_coarser(location: str, why: str, remedy: str = "") -> NoReturn:
    """Raise for what has no mesh of elements twice the size."""
    raise ConfigError(
        f"{location}: {why}; {remedy}compare with a finer mesh instead (`romdam verify --mesh finer`)"
    )


def _on_other_mesh(job: Job, *, finer: bool, rock: bool = True) -> Job:
    """The job with other numbers of elements."""
    config, blocks = job.config, dict(job.config.blocks)
    for name, block in blocks.items():
        if block.box is not None:
            size, factor = block.box.element_size, 0.5 if finer else 2.0
            other = factor * size if isinstance(size, float) else tuple(factor * edge for edge in size)
            box = block.box.model_copy(update={"element_size": other})
            blocks[name] = block.model_copy(update={"box": box})
        elif block.mesh is not None:
            blocks[name] = block.model_copy(update={"mesh": _refined(block.mesh, finer=finer)})
    changed: dict[str, object] = {"blocks": blocks}
    for key, dam in (("arch_dam", config.arch_dam), ("gravity_dam", config.gravity_dam)):
        if dam is not None:
            divisions: Divisions = dam.divisions
            if finer or (divisions.refine and rock):
                divisions = _refined(divisions, finer=finer)
            else:
                divisions = dam.shared_divisions
                halved: dict[str, object] = {
                    name: every_count(counts, lambda n: (n + 1) // 2)
                    for name, counts in divisions.counts.items()
                    if rock or name in _OF_DAM
                }
                if rock:
                    halved |= {"halved": (divisions.halved + 1) // 2, "growth": divisions.growth**2}
                divisions = divisions.model_copy(update=halved)
            changed[key] = dam.model_copy(update={"divisions": divisions})
    return _of_another_mesh(job, changed)


def _of_another_mesh(job: Job, changed: dict[str, object]) -> Job:
    """The job with some sections changed, and with no other stress than what meshes are compared by."""
    job = with_compared_stress(job)
    outputs = job.config.outputs.model_copy(update={"mesh_error": False})
    return replace(job, config=job.config.model_copy(update=changed | {"outputs": outputs}))


def _refined(mesh: MeshT, *, finer: bool) -> MeshT:
    """The mesh refined once more, or once less."""
    return mesh.model_copy(update={"refine": mesh.refine + (1 if finer else -1)})
