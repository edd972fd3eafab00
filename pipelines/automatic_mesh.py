"""`transient.accuracy: {total: ...}`: the cheapest mesh of those tried whose stated error keeps its share."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeVar

from romdam.config.load import Job
from romdam.config.other_mesh import (
    EVERY_DIRECTION,
    finer_in_direction,
    on_coarser_mesh,
    on_finer_mesh,
    on_quadratic_elements,
    sibling_meshes,
    with_automatic_spacing,
    with_contact_points,
    with_even_divisions,
    with_gaps_at_every_node,
    with_mesh_of,
    with_spacing,
)
from romdam.config.sections.transient import MESH_SHARE
from romdam.core.errors import ConfigError, ConvergenceError, MeshError, ReductionError
from romdam.error.discretisation import OVER_COARSER_QUADRATIC, MeshRun, SiblingRun, discretisation
from romdam.error.statement import ErrorStatement
from romdam.pipelines.automatic_spacing import (
    CORNERS,
    Lengths,
    PointsChoice,
    fewest_points,
    nodes_of_run,
)
from romdam.pipelines.error.sibling import MANY_MORE
from romdam.pipelines.simulation import RunModel
from romdam.postprocess.stated_errors import percent
from romdam.results.case import Case
from romdam.timestepping.prepared import Progress

MOST_UNKNOWNS = 3e6  # of a mesh that is tried: a reduction of about an hour, and of 50 GB
AnyMesh = TypeVar("AnyMesh")
_OF_TWICE = 1.0 + 1.0 / OVER_COARSER_QUADRATIC  # times the error, on quadratic elements of twice the size
_COARSEST = 4.0  # times the distance of the nodes: the farthest that gaps are apart
_LEAST_LEFT = 0.05  # of the mesh's share: with less of it left, contact points are not made fewer
_TRUSTED = 0.03  # stated from a coarser mesh: beyond it that is too coarse to tell, and a finer one is asked
_ORDER = (
    2.0  # of the error in the size of the elements, to tell which mesh would keep an error: linear elements
)


@dataclass(frozen=True)
class Trial:
    """A run on one mesh, and what it took [s of CPU]."""

    run: MeshRun
    cpu_seconds: float


RunMesh = Callable[[Job, str], Trial]  # a job and what its mesh is called -> its run


@dataclass(frozen=True)
class MeshChoice:
    """The mesh that was chosen.

    Attributes
    ----------
    name : of that mesh
    job : on it
    total : relative error that mesh, modes and steps together may leave
    statement : of the mesh's error on the record that it was chosen on, and the table of all that was tried
    """

    name: str
    job: Job
    total: float
    statement: ErrorStatement

    def state(self, model: RunModel, case: Case, progress: Progress) -> ErrorStatement:
        """State the error of the mesh in a run: that of the run which it was chosen on."""
        return self.statement


@dataclass
class _Tried:
    """Meshes that were run, and the errors stated of them.

    Attributes
    ----------
    total : error of the openings in L2 that mesh, modes and steps together may leave
    about : record and configuration, for statements
    """

    job: Job
    total: float
    run_mesh: RunMesh
    about: dict[str, object]
    jobs: dict[str, Job] = field(default_factory=dict)
    trials: dict[str, Trial] = field(default_factory=dict)
    statements: dict[str, ErrorStatement] = field(default_factory=dict)
    # mesh -> direction, ratio of sizes and name of other meshes, and whether they are finer
    judged_by: dict[str, tuple[list[tuple[str, float, str]], bool]] = field(default_factory=dict)

    def compare(self, coarse: str, fine: str) -> str | None:
        """Run two meshes, one of half the size of the other; the coarser one that keeps the share, if any."""
        self.run(coarse)
        self.run(fine)
        self.judge(coarse, fine)  # better than before
        if self.error(coarse) <= self.share:
            return coarse
        if _TRUSTED < self.error(fine) <= self.share:
            finer = self.mesh(f"{fine}, halved", on_finer_mesh(self.jobs[fine]))
            self.run(finer)
            self.judge(fine, finer)
        return fine if self.error(fine) <= self.share else None

    def judge(self, coarse: str, fine: str) -> None:
        """State the errors of two meshes by each other."""
        self.judged_by[coarse] = [(EVERY_DIRECTION, 2.0, fine)], True
        self.judged_by[fine] = [(EVERY_DIRECTION, 2.0, coarse)], False
        for name in (coarse, fine):
            self.statements[name] = self.statement(name)

    def statement(self, name: str, points: tuple[MeshRun, MeshRun] | None = None) -> ErrorStatement:
        """The error of a mesh, and of its contact points where runs are given that tell it."""
        others, finer = self.judged_by[name]
        siblings = [SiblingRun(where, times, self.trials[other].run) for where, times, other in others]
        return discretisation(self.trials[name].run, siblings, finer=finer, about=self.about, points=points)

    def by_direction(self, name: str) -> MeshChoice:
        """Choose a dam's mesh: the direction that pays is refined until the share is kept.

        A direction pays by the square of its error over what refining it costs, unknowns times gaps. Where
        the share would hold an error of twice the size too, that mesh is where it begins.
        """
        self.judge_directions(name)
        while _OF_TWICE * self.error(name) <= self.share:
            coarser = [mesh for _, times, mesh in self.judged_by[name][0] if times > 1.0][-1]
            if _where_possible(sibling_meshes, self.jobs[coarser]) is None:
                break
            self.judge_directions(name := coarser)
        while self.error(name) > self.share:
            self.refuse_large(name)
            parts = self.statements[name].details["directions"]
            assert isinstance(parts, dict)
            pays = max(parts, key=lambda each: _worth(parts[each]))
            name = self.mesh(f"{name}, finer {pays}", finer_in_direction(self.jobs[name], pays))
            self.judge_directions(name)
        return self.choose(name)

    def judge_directions(self, name: str) -> None:
        """Run a dam's mesh and its siblings by direction, and state its error."""
        others, mesh = [], name
        for k, sibling in enumerate(sibling_meshes(self.jobs[name])):
            size = "finer" if sibling.times < 1.0 else "coarser"
            link = " and" if k and size == "coarser" else f", {size}"
            mesh = f"{mesh}{link} {sibling.direction}"
            others.append((sibling.direction, sibling.times, self.mesh(mesh, sibling.job)))
        for other in (name, *(each for _, _, each in others)):
            self.run(other)
        self.judged_by[name] = others, False
        self.statements[name] = self.statement(name)

    def with_contact_points(self, name: str) -> ErrorStatement:
        """The error of a mesh and of its contact points, by the smallest mesh with many more nodes."""
        if with_gaps_at_every_node(self.jobs[name]) is None:
            return self.statements[name]
        for tried in sorted(self.statements, key=lambda each: self.trials[each].run.unknowns):
            every_node = with_gaps_at_every_node(self.jobs[tried])
            assert every_node is not None
            points = self.mesh(f"{tried}, a gap at every node", every_node)
            self.run(points)
            pair = self.trials[tried].run, self.trials[points].run
            if len(pair[1].position) >= MANY_MORE * len(pair[0].position) or tried == name:
                break
        return self.statement(name, pair)

    def fewer_points(self, name: str) -> PointsChoice | None:
        """Contact points of a mesh, fewer than its nodes, that leave no more than it leaves of the share.

        None where so little is left that no distance could do.
        """
        left, run = self.share - self.error(name), self.trials[name].run
        nodes = nodes_of_run(run)
        # gaps apart by one and a half of the nodes' distance change twice what elements up and through leave
        least = max(
            [_LEAST_LEFT * self.share, *(self.of_direction(name, each) for each in ("up", "through"))]
        )
        if (
            left < least
            or all(of.count <= CORNERS for of in nodes.values())
            or any(joint.spacing is not None for joint in self.jobs[name].config.every_joint.values())
        ):
            return None

        def run_points(lengths: Lengths) -> MeshRun:
            each = ", ".join(f"{joint} {h:.3g} m" for joint, h in lengths.items() if h)
            return self.run_mesh(self.with_lengths(name, lengths), f"{name}, gaps apart: {each}").run

        try:
            points = fewest_points(run_points, nodes, _COARSEST, left, every_node=run)
        except (ConfigError, MeshError, ReductionError):  # faces that such gaps do not go with
            return None
        return points if points.run is not None else None

    def with_lengths(self, name: str, lengths: Lengths) -> Job:
        """The job of a mesh with gaps so far apart."""
        return with_spacing(with_automatic_spacing(self.jobs[name]), lengths)

    @property
    def share(self) -> float:
        """What the mesh may leave of it."""
        return MESH_SHARE * self.total

    def mesh(self, name: str, job: Job) -> str:
        """Name a mesh to be tried."""
        self.jobs[name] = job
        return name

    def run(self, name: str) -> None:
        """Run a mesh, if it has not been.

        Raises
        ------
        ConvergenceError
            with the name of the mesh: others of the same job may have come to rest.
        """
        if name in self.trials:
            return
        try:
            self.trials[name] = self.run_mesh(self.jobs[name], name)
        except ConvergenceError as error:
            raise ConvergenceError(
                f"{self.job.path}: transient.accuracy.total: on a mesh that it tried, {name}: {error}; or "
                "begin with twice as many elements"
            ) from None

    def can_run(self, name: str) -> bool:
        """Run a mesh if its elements and modes go with the job."""
        try:
            self.run(name)
        except (ConfigError, MeshError, ReductionError):
            return False
        return True

    def error(self, name: str) -> float:
        """Error of the openings in L2 that was stated of a mesh."""
        return self.statements[name].errors["opening"].l2

    def of_direction(self, name: str, direction: str) -> float:
        """What the elements of a mesh leave in one direction; 0 where that is not stated."""
        directions = self.statements[name].details.get("directions")
        return (
            directions[direction]["l2"] if isinstance(directions, dict) and direction in directions else 0.0
        )

    def refuse_large(self, name: str) -> None:
        """Refuse to refine a mesh where the one that would keep the share has too many unknowns."""
        if name not in self.statements:
            return
        trial, error = self.trials[name], self.error(name)
        refinements = max(1, math.ceil(math.log2(error / self.share) / _ORDER))
        unknowns, seconds = (8.0**refinements * number for number in (trial.run.unknowns, trial.cpu_seconds))
        if unknowns <= MOST_UNKNOWNS:
            return
        raise ConfigError(
            f"{self.job.path}: transient.accuracy.total: the mesh may leave {percent(self.share)} of it. The "
            f"last mesh tried, {name}, leaves {percent(error)}; one that keeps it would have about "
            f"{unknowns:.1g} unknowns, limit {MOST_UNKNOWNS:.0g}, and take about {seconds:.1g} s of CPU. Ask "
            f"for a total of {percent(1.1 * error / MESH_SHARE)}, or refine only where the joints are, with "
            "other divisions or a mesh file"
        )

    def choose(self, name: str) -> MeshChoice:
        """The choice of a mesh, with the table of all that were tried."""
        table = [
            {
                "mesh": tried,
                "unknowns": trial.run.unknowns,
                "gaps": len(trial.run.position),
                "opening_error": self.error(tried),
                "cpu_seconds": trial.cpu_seconds,
                "chosen": tried == name,
            }
            for tried, trial in self.trials.items()
            if tried in self.statements
        ]
        statement, job, of_joints = self.with_contact_points(name), self.jobs[name], ""
        more: dict[str, object] = {}
        if (points := self.fewer_points(name)) is not None and points.run is not None:
            with_points = self.statement(name, (points.run, self.trials[name].run))
            if with_points.errors["opening"].l2 <= self.share:
                statement, job = with_points, self.with_lengths(name, points.lengths)
                of_joints = f" Gaps apart from the nodes: {points.sentence}."
                more = {"gaps": len(points.run.position), "spacing": points.details}
        spaced = "contact_points" in statement.details and not of_joints
        remedy = " If contact points leave too much, leave `spacing` out or make it auto." if spaced else ""
        sentence = (
            f"{statement.sentence} Of {len(table)} meshes tried this one, {name}, was chosen: the mesh may "
            f"leave {percent(self.share)} of the total of {percent(self.total)} that was asked for."
            f"{of_joints}{remedy}"
        )
        details = dict(statement.details) | more | {"asked": self.total, "meshes": table}
        return MeshChoice(
            name,
            with_mesh_of(self.job, job),
            self.total,
            replace(statement, sentence=sentence, details=details),
        )


def _worth(part: Mapping[str, float]) -> float:
    """What refining a direction is worth, see `_Tried.by_direction`."""
    cost = part["times_unknowns_to_halve"] * part["times_gaps_to_halve"]
    return part["l2"] ** 2 / max(cost - 1.0, 1e-3)


def with_accuracy(job: Job, accuracy: float | None) -> Job:
    """The job with an accuracy of its steps, and of `modes: auto`."""
    transient = job.config.transient.model_copy(update={"accuracy": accuracy})
    return replace(job, config=job.config.model_copy(update={"transient": transient}))


def choose_mesh(job: Job, total: float, run_mesh: RunMesh, about: dict[str, object]) -> MeshChoice:
    """Choose the mesh whose error keeps its share of a total.

    The given mesh and one of elements of twice the size are run first, or of half where there is none of
    twice. If neither keeps the share, elements of quadratic displacements follow, of twice the size, then as
    given. Quadratic elements, also given ones, have gaps at the corners of their faces where such joints can
    be made, of which there are a third. Then each mesh is refined until one does, in the direction that pays
    where a generated dam states its error by direction. The error of a mesh is stated as by `romdam verify
    --mesh`, from siblings of the same kind; what a coarser one in every direction states beyond 3 % is asked
    of a finer one. What the mesh that is chosen leaves of its share may go to contact points: those of each
    joint are as far apart as that allows (`automatic_spacing`).

    Parameters
    ----------
    total : relative error of the openings in L2 that mesh, modes and steps together may leave
    run_mesh : makes and runs a job's model on the record to choose on
    about : `record`, `seconds` and whatever else the statement is to say

    Raises
    ------
    ConfigError
        where no mesh of at most MOST_UNKNOWNS would do, and where there is no other mesh.
    """
    tried = _Tried(job, total, run_mesh, about)
    quadratic = _where_possible(on_quadratic_elements, job)
    kinds = {"": job} if quadratic is None else {"": job, "quadratic ": quadratic}
    for kind, mesh in kinds.items():
        size, last, coarse, points = 1.0, tried.mesh(f"{kind}elements as given", mesh), None, ""
        # a job that has no other elements may have quadratic ones already
        if (kind or quadratic is None) and (corners := _gaps_at_corners(mesh)) is not None:
            name = tried.mesh(f"{last}, gaps at corners", corners)
            if tried.can_run(name):
                mesh, last, points = corners, name, ", gaps at corners"
        even = _where_possible(with_even_divisions, mesh)
        if even is not None:  # a dam, whose error is stated by direction
            return tried.by_direction(last if even == mesh else tried.mesh(f"{last}, divisions even", even))
        coarser = _where_possible(on_coarser_mesh, mesh)
        if coarser is not None:
            coarse = tried.mesh(f"{kind}elements of twice the size{points}", coarser)
        if coarse is not None and tried.can_run(coarse):
            kept = tried.compare(coarse, last)
        elif not kind:
            size, fine = 0.5, tried.mesh("elements of half the size", on_finer_mesh(mesh))
            kept, last = tried.compare(last, fine), fine
        else:
            kept = None  # it is compared with elements of half the size below
        if kept is not None:
            return tried.choose(kept)
    while True:
        tried.refuse_large(last)
        size /= 2.0
        fine = tried.mesh(
            f"{kind}elements of {size:g} times the size{points}", on_finer_mesh(tried.jobs[last])
        )
        if (kept := tried.compare(last, fine)) is not None:
            return tried.choose(kept)
        last = fine


def _gaps_at_corners(job: Job) -> Job | None:
    """The job with gaps at corners of faces; None where a joint is to be mortar, or where all have them."""
    joints = job.config.every_joint.values()
    if any(joint.discretization == "mortar" for joint in joints) or all(
        joint.gaps == "corners" for joint in joints
    ):
        return None
    return _where_possible(lambda whole: with_contact_points(whole, "corners"), job)


def _where_possible(change: Callable[[Job], AnyMesh], job: Job) -> AnyMesh | None:
    """The job on another mesh, or on several, or None where it has no such mesh."""
    try:
        return change(job)
    except ConfigError:
        return None
