"""A job on a sibling of its mesh, and what a run on that says of the mesh's error."""

from __future__ import annotations

from dataclasses import dataclass, replace

from romdam.config.load import Job
from romdam.config.other_mesh import on_coarser_mesh, on_finer_mesh
from romdam.core.errors import describe_error, recoverable
from romdam.core.system import History
from romdam.error.discretisation import MeshRun, discretisation, mesh_run
from romdam.error.statement import ErrorStatement
from romdam.pipelines.simulation import Model, simulate_motion
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.postprocess.node_spectra import node_spectra
from romdam.postprocess.stress.summary import StressSummary
from romdam.results.case import Case
from romdam.timestepping.integrators.protocol import Progress


@dataclass(frozen=True)
class Sibling:
    """A job on a mesh of half the size of the elements (`finer`), or twice, and its model with stress."""

    job: Job
    model: Model
    finer: bool

    def state(self, model: Model, case: Case, progress: Progress) -> ErrorStatement:
        """State what the mesh changes in a run, by one on this mesh, or why that is unknown.

        Parameters
        ----------
        model : of the run
        case : the run, its history and stress as `stress_of` returns them
        """
        motion, seconds = case.motion, float(case.history.time[-1])
        try:
            other = simulate_motion(self.job, self.model.prepared, motion, seconds, progress)
            pair = run_of(model, case.history, case.stress), run_with_stress(self.model, other)
            about = {"record": motion.name, "seconds": seconds}
            return discretisation(*pair, finer=self.finer, about=about)
        except recoverable() as error:
            return unknown_mesh_error(describe_error(error))


@dataclass(frozen=True)
class NoSibling:
    """No other mesh to run on, and why."""

    why: str

    def state(self, model: Model, case: Case, progress: Progress) -> ErrorStatement:
        """State that what the mesh changes is unknown, and why."""
        return unknown_mesh_error(self.why)


def unknown_mesh_error(why: str) -> ErrorStatement:
    """State that what the mesh changes is unknown, and why."""
    return ErrorStatement("discretisation", f"What the mesh changes is unknown: {why}", {})


def sibling_job(job: Job, *, finer: bool) -> Job:
    """The job on elements of half the size, or twice; see `romdam.config.other_mesh`."""
    return on_finer_mesh(job) if finer else on_coarser_mesh(job)


def with_stress(model: Model) -> Model:
    """The model with the stress of its modes, where the job asks for stress."""
    return replace(model, stress=stress_fields(model.scene, model.reduced))


def run_of(model: Model, history: History, stress: StressSummary | None) -> MeshRun:
    """A run, as runs on other meshes are compared with it; `history` and `stress` as of `stress_of`."""
    spectra = node_spectra(history, len(model.scene.probes))
    return mesh_run(model.scene, history, model.system.law.joints, spectra, stress)


def run_with_stress(model: Model, history: History) -> MeshRun:
    """The same of a history as integrated, on a model `with_stress`."""
    return run_of(model, *stress_of(model.scene, model.stress, history))
