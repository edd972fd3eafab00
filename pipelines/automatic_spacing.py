"""`spacing: auto`: in each joint gaps as far apart as the wanted accuracy allows, on the strongest record.

How far apart, follows from what each joint's gaps leave (`romdam.error.contact_points`): a joint that hardly
opens has few. The lengths may lie between multiples of the distance of the nodes.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from romdam.config.load import Job
from romdam.config.other_mesh import with_spacing
from romdam.core.motion import GroundMotion
from romdam.core.scene import Joint
from romdam.error.contact_points import error_over_difference, fewest_gaps, joint_differences
from romdam.error.discretisation import MeshRun
from romdam.error.statement import percent
from romdam.pipelines.automatic_modes import FIRST, with_modes, with_vectors
from romdam.pipelines.error.sibling import run_of
from romdam.pipelines.moving_supports import scene_of
from romdam.pipelines.simulation import RunModel, as_run, prepare, simulate_motion
from romdam.records.processing.resampling import strongest_part
from romdam.reduction.storage.model_file import BlockStore
from romdam.reduction.synthesis import reduce_scene

log = logging.getLogger(__name__)

SECONDS = 10.0  # of a record, as `romdam verify` compares
CORNERS = 4  # of a face, which have a gap at any distance
_COARSEST = 8.0  # times the distance of the nodes: what is tried first
_DENSE = 1.5  # times that distance: below it every node has a gap
_TRIES = 4  # of lengths, then every node has a gap
_SAFETY = 0.9  # of the accuracy, which lengths are to keep
_JUDGES = 1.5  # times the lengths of another run: from here on that run tells the error

Lengths = dict[str, float | None]  # joint -> distance of its gaps [m], None for a gap at every node
RunPoints = Callable[[Lengths], MeshRun]


@dataclass(frozen=True)
class Nodes:
    """Number of nodes of a joint that can have a gap, and their mean distance [m]."""

    count: int
    distance: float


@dataclass(frozen=True)
class PointsChoice:
    """Contact points that keep an accuracy.

    Attributes
    ----------
    lengths : of every joint
    errors : what every joint's points add to the error of all openings in L2, relative; empty where no length
        was found that keeps it
    run : with these lengths, None where every node has a gap
    """

    lengths: Lengths
    errors: dict[str, float]
    run: MeshRun | None

    @property
    def details(self) -> dict[str, dict[str, float | int | None]]:
        """Of every joint its length [m], the number of its gaps, and the error that they leave."""
        gaps = _gaps(self.run) if self.run is not None else {}
        return {
            name: {"spacing": h, "gaps": gaps.get(name), "l2": self.errors.get(name)}
            for name, h in self.lengths.items()
        }

    @property
    def sentence(self) -> str:
        """The same for readers."""
        return _said(self.lengths, _gaps(self.run) if self.run is not None else {}, self.errors)


def automatic_joints(job: Job) -> list[str]:
    """Names of the joints with `spacing: auto`."""
    return [name for name, joint in job.config.every_joint.items() if joint.spacing == "auto"]


def choose_spacing(job: Job, motions: list[GroundMotion], store: BlockStore | None = None) -> Job:
    """The job with gaps as far apart as changes the openings by at most `transient.accuracy`, in each joint.

    Lengths are run on the strongest `SECONDS` of the record of the largest acceleration. What they change is
    stated as for a mesh, from the run on half of each; where they are too coarse, every node has a gap, which
    is not run here.

    Raises
    ------
    ConfigError
        for faces that are too curved for gaps between their nodes.
    ConvergenceError
        where a step does not converge.
    """
    accuracy = job.config.transient.step_accuracy
    assert accuracy is not None  # the configuration asks for it
    motion = as_run(job, max(motions, key=lambda m: m.peak))
    if all(support.motion is None for support in job.config.supports):  # those that move begin at rest
        _, motion = strongest_part(motion, SECONDS)
    trial = with_modes(with_vectors(job), FIRST) if job.config.model.modes == "auto" else job
    every_joint = scene_of(with_spacing(job)).joints
    nodes = {name: nodes_of(every_joint[name]) for name in automatic_joints(job)}

    def run(lengths: Lengths) -> MeshRun:
        return _run(with_spacing(trial, lengths), motion, store)

    return with_spacing(job, fewest_points(run, nodes, _COARSEST, accuracy).lengths)


def nodes_of(joint: Joint) -> Nodes:
    """Number and distance of the nodes of a joint whose nodes all have gaps."""
    count = len(joint.area)
    return Nodes(count, math.sqrt(joint.whole_area.sum() / count))


def nodes_of_run(run: MeshRun) -> dict[str, Nodes]:
    """The same of every joint of a run with a gap at every node."""
    counts = _gaps(run)
    return {name: Nodes(counts[name], math.sqrt(run.area[gaps].mean())) for name, gaps in run.joints.items()}


def fewest_points(
    run: RunPoints,
    nodes: Mapping[str, Nodes],
    coarsest: float,
    accuracy: float,
    every_node: MeshRun | None = None,
) -> PointsChoice:
    """Choose the distance of the gaps of every joint, see the module.

    Parameters
    ----------
    run : runs the scene with gaps so far apart
    nodes : of every joint to choose for
    coarsest : times the distance of the nodes: lengths to begin with, which are not exceeded
    accuracy : relative error of all openings in L2 that contact points may leave
    every_node : run with a gap at every node, by which all are judged; half of each length if not given
    """
    dense = {name: _DENSE * of.distance for name, of in nodes.items()}
    least = {name: length * (1.0 if every_node else _JUDGES) for name, length in dense.items()}
    lengths: Lengths = {name: coarsest * of.distance for name, of in nodes.items()}
    finer: Lengths = dict.fromkeys(nodes)
    judge = every_node
    for _ in range(_TRIES):
        judged = run(lengths)
        if every_node is None and (judge is None or not _tells(finer, lengths)):
            finer = {name: h and max(h / 2.0, dense[name]) for name, h in lengths.items()}
            judge = run(finer)
        assert judge is not None
        errors = {
            name: error * error_over_difference(lengths.get(name), finer.get(name))
            for name, error in joint_differences(judged, judge).items()
        }
        total, gaps, more = math.sqrt(sum(e**2 for e in errors.values())), _gaps(judged), _gaps(judge)
        log.info(
            "spacing: %s; all: %s, accuracy %s",
            _said(lengths, gaps, errors),
            percent(total),
            percent(accuracy),
        )
        alike = [n for n, h in lengths.items() if h and gaps[n] == more[n] < nodes[n].count]
        if total <= accuracy and not alike:
            return PointsChoice(lengths, errors, judged)
        if alike:  # two runs that are the same say nothing of either
            factors = {name: 0.5 if name in alike else 1.0 for name in lengths}
        else:
            adjusted = {name: e for name, e in errors.items() if lengths.get(name)}
            others = total / max(math.sqrt(sum(e**2 for e in adjusted.values())), 1e-12)
            scaled = {name: e * others for name, e in adjusted.items()}
            factors = fewest_gaps(scaled, gaps, _SAFETY * accuracy)
        lengths = {
            name: shorter if h and (shorter := factors.get(name, 1.0) * h) >= least[name] else None
            for name, h in lengths.items()
        }
        if not any(lengths.values()):
            break
    log.info("gaps apart from the nodes are too coarse: every node has a gap")
    return PointsChoice(dict.fromkeys(nodes), {}, None)


def _tells(finer: Lengths, lengths: Lengths) -> bool:
    """Whether a run with finer lengths tells the error of a run with others."""
    return all(not (g := finer[name]) or (h is not None and h >= _JUDGES * g) for name, h in lengths.items())


def _gaps(run: MeshRun) -> dict[str, int]:
    """Number of gaps of every joint."""
    return {name: int(gaps.stop - gaps.start) for name, gaps in run.joints.items()}


def _said(lengths: Lengths, gaps: Mapping[str, int], errors: Mapping[str, float]) -> str:
    """What each joint has, and what its points change in L2 of all openings."""
    return ", ".join(
        f"{name} {'every node' if h is None else f'{h:.3g} m'} ({gaps[name]} gaps, which change the openings "
        f"by about {percent(errors.get(name, 0.0))})"
        for name, h in lengths.items()
    )


def _run(job: Job, motion: GroundMotion, store: BlockStore | None) -> MeshRun:
    """Run a job without the stress of its modes."""
    scene = scene_of(job)
    reduced = reduce_scene(scene, job.config.model, job.config.damping, store)
    model = RunModel(scene, prepare(job, reduced.system), reduced)
    return run_of(model, simulate_motion(job, model.prepared, motion), None)
