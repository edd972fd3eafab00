"""Siblings of a mesh: the models that a run is repeated on, to state the error of its mesh.

A run is judged by one or more other models of the same job:

- elements of twice the size, in all directions at once, or in one more direction from each mesh to the next;
- below the coarsest of these dams, rock and a perimeter in layers of half the size;
- elements of four times the size, which show the order of convergence;
- elements of half the size, where there is no coarser mesh and the scene is small;
- a gap at every node, where the job has fewer contact points.

`find_sibling` builds them, or gives the reason why there are none. `Sibling.state` runs them and states the
error.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

from romdam.config.load import Job
from romdam.config.other_mesh import (
    EVERY_DIRECTION,
    SiblingJob,
    on_coarser_mesh,
    on_finer_mesh,
    sibling_meshes,
    with_compared_stress,
    with_gaps_at_every_node,
    with_steps_of,
)
from romdam.core.errors import (
    ConfigError,
    ConvergenceError,
    MeshError,
    ReductionError,
    describe_error,
    placed,
    recoverable,
)
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.effects.full_order import assemble_full
from romdam.error.discretisation import MeshRun, SiblingRun, discretisation, mesh_run
from romdam.error.statement import ErrorStatement
from romdam.fem.stress import observing_stress
from romdam.geometry.elements import ELEMENTS
from romdam.pipelines.automatic_modes import with_modes, with_vectors
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.simulation import RunModel, prepare, simulate_motion
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.postprocess.node_spectra import node_spectra
from romdam.postprocess.stress.summary import StressSummary
from romdam.reduction.mode_choice import mode_choice
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene
from romdam.results.case import Case
from romdam.timestepping.prepared import Progress

_NO_MESH = (ConfigError, ConvergenceError, MeshError, ReductionError)  # why a job does not go with a mesh
_MOST_UNKNOWNS, _MOST_GAPS = 60_000, 800  # of a finer mesh that is run without being asked for
MANY_MORE = 2.5  # times the contact points: from here on a coarser mesh's nodes stand for every node
_DENSE, _MANY_MODES = 3_000, 100  # unknowns above which another mesh takes so many modes in place of all


@dataclass(frozen=True)
class OtherModel:
    """A job on another mesh or with other contact points, and its model with stress."""

    job: Job
    model: RunModel

    def run(self, case: Case, progress: Progress) -> MeshRun:
        """Run the motion of a case, with the steps that it took."""
        job = with_steps_of(self.job, case.history.stats["finest_step"])
        seconds = float(case.history.time[-1])
        history = simulate_motion(job, self.model.prepared, case.motion, seconds, progress)
        return run_with_stress(self.model, history)


@dataclass(frozen=True)
class Sibling:
    """The models that a run is repeated on, to state the error of its mesh and of its contact points.

    Attributes
    ----------
    meshes : one, with elements of half the size (`finer`) or twice; or several, each of which differs from
        the one before in one direction
    finer : whether elements have half the size
    second : elements of four times the size, which show the order; None where there is no such mesh
    points : a gap at every node, in place of `spacing`; None where the job has a gap at every node
    points_of_sibling : whether `points` has the sibling's mesh, otherwise the run's own
    """

    meshes: tuple[tuple[SiblingJob, OtherModel], ...]
    finer: bool
    second: OtherModel | None = None
    points: OtherModel | None = None
    points_of_sibling: bool = False

    @property
    def others(self) -> list[OtherModel]:
        """All models that are run."""
        meshes = [model for _, model in self.meshes]
        return [*meshes, *(other for other in (self.second, self.points) if other is not None)]

    def state(self, model: RunModel, case: Case, progress: Progress) -> ErrorStatement:
        """Run all models as the run was run, and state what the mesh changes in it, or why that is unknown.

        Parameters
        ----------
        model : of the run
        case : the run, its history and stress as `stress_of` returns them
        """
        try:
            run = run_of(model, case.history, case.stress)
            siblings = [
                SiblingRun(sibling.direction, sibling.times, other.run(case, progress))
                for sibling, other in self.meshes
            ]
            second = None if self.second is None else self.second.run(case, progress)
            points = None
            if self.points is not None:
                fewer = siblings[-1].run if self.points_of_sibling else run
                points = fewer, self.points.run(case, progress)
            about = {"record": case.motion.name, "seconds": float(case.history.time[-1])}
            return discretisation(run, siblings, finer=self.finer, about=about, second=second, points=points)
        except recoverable() as error:
            return unknown_mesh_error(describe_error(error))


@dataclass(frozen=True)
class NoSibling:
    """No other mesh to run on, and why."""

    why: str

    def state(self, model: RunModel, case: Case, progress: Progress) -> ErrorStatement:
        """State that what the mesh changes is unknown, and why."""
        return unknown_mesh_error(self.why)


def find_sibling(job: Job, scene: Scene, store: BlockStore | None) -> Sibling | NoSibling:
    """Make what the mesh of a scene is judged by, as `outputs.mesh_error` says.

    Where it says nothing, elements have twice the size; where there is no such mesh, and the scene is small,
    half the size.

    Raises
    ------
    ConfigError
        where there is no such mesh, or the job does not go with it, and a job asks for that one.
    """
    asked = job.config.outputs.mesh_error
    try:
        return _sibling(job, scene, store, finer=asked == "finer")
    except _NO_MESH as error:
        if asked != "auto":
            raise ConfigError(f"{job.path}: outputs.mesh_error: no {asked} mesh: {error}") from None
        why = str(error).removeprefix(f"{job.path}: ")
    unknowns, gaps = 8 * _unknowns(scene), 4 * len(scene.gap_position)
    if unknowns > _MOST_UNKNOWNS or gaps > _MOST_GAPS:
        return NoSibling(
            f"{why}. Elements of half the size would have about {unknowns} unknowns and {gaps} gaps; beyond "
            f"{_MOST_UNKNOWNS} and {_MOST_GAPS} a run takes them with `outputs: {{mesh_error: finer}}` only"
        )
    try:
        return _sibling(job, scene, store, finer=True)
    except _NO_MESH as error:
        return NoSibling(str(error).removeprefix(f"{job.path}: "))


def _sibling(job: Job, scene: Scene, store: BlockStore | None, *, finer: bool) -> Sibling:
    """Models of a job on elements of half the size, or of twice, and of what else its mesh is judged by."""
    meshes = tuple((sibling, _other_model(sibling.job, store)) for sibling in sibling_jobs(job, finer=finer))
    mesh, second = meshes[-1][1], None
    quadratic = all(ELEMENTS[block.element].quadratic for block in scene.blocks.values())
    if quadratic and not finer and len(meshes) == 1:
        with suppress(*_NO_MESH):
            second = _other_model(on_coarser_mesh(mesh.job), store)
    every_node = with_gaps_at_every_node(job)
    if every_node is None:
        return Sibling(meshes, finer, second)
    if not finer and (of_sibling := with_gaps_at_every_node(mesh.job)) is not None:
        points, gaps = _other_model(of_sibling, store), len(mesh.model.scene.gap_position)
        if len(points.model.scene.gap_position) >= MANY_MORE * gaps:
            return Sibling(meshes, finer, second, points, points_of_sibling=True)
    return Sibling(meshes, finer, second, _other_model(with_compared_stress(every_node), store))


def _other_model(job: Job, store: BlockStore | None) -> OtherModel:
    """Build a job's model. Of a large mesh `all` modes are `_MANY_MODES` with residual vectors here."""
    scene, model, damping = scene_of(job), job.config.model, job.config.damping
    with placed(job.path):
        reduced = None
        if model.order == "full":
            system = observing_stress(scene, assemble_full(scene, damping))
        else:
            if model.modes == "all" and _unknowns(scene) > _DENSE:
                model = with_vectors(with_modes(job, _MANY_MODES)).config.model
            reduced = reduce_scene(scene, mode_choice(model), damping, store)
            system = reduced.system
        # of another mesh nobody reads how far its state at rest depends on the order of the loads
        prepared = replace(prepare(job, system), compares_orders=False)
        with_basis = with_stress(RunModel(scene, prepared, reduced))
        return OtherModel(job, replace(with_basis, reduced=None))  # several are held beside each other


def _unknowns(scene: Scene) -> int:
    """Three for each node."""
    return 3 * sum(len(block.points) for block in scene.blocks.values())


def unknown_mesh_error(why: str) -> ErrorStatement:
    """State that what the mesh changes is unknown, and why."""
    return ErrorStatement("discretisation", f"What the mesh changes is unknown: {why}", {})


def sibling_jobs(job: Job, *, finer: bool) -> list[SiblingJob]:
    """The job on elements of half the size, or on its sibling meshes; see `romdam.config.other_mesh`."""
    if finer:
        return [SiblingJob(EVERY_DIRECTION, 2.0, on_finer_mesh(job))]
    return sibling_meshes(job)


def with_stress(model: RunModel) -> RunModel:
    """The model with the stress of its modes, where the job asks for stress."""
    return replace(model, stress=stress_fields(model.scene, model.reduced_at_rest))


def run_of(model: RunModel, history: History, stress: StressSummary | None) -> MeshRun:
    """A run, as runs on other meshes are compared with it; `history` and `stress` as of `stress_of`."""
    spectra = node_spectra(history, len(model.scene.probes))
    return mesh_run(model.scene, history, model.system.law.joints, spectra, stress)


def run_with_stress(model: RunModel, history: History) -> MeshRun:
    """`run_of` for a history as it was integrated, on a model from `with_stress`."""
    return run_of(model, *stress_of(model.scene, model.stress, history))
