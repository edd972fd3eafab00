"""The error of the mesh and of its contact points, from the same run on a sibling mesh.

Elements have a size h here and h/2, or 2 h, in the sibling. With an error C h^p the difference to the finer
sibling is (1 - 2^-p) of the error of h, that to the coarser one 2^p - 1 times it. Linear elements have p = 2,
and less at corners and edges. So the error is stated as `OVER_FINER` of the difference to a finer mesh, which
is right for p = 1.6 and within a factor of two for p above 0.6, and as `OVER_COARSER` of that to a coarser
mesh, right for p = 1.6 and within a factor of two for p of 1 to 2.3. Displacements of quadratic elements have
p of 3 and less: what moves, and forces of sections, which are sums of nodal forces, are stated as
`OVER_COARSER_QUADRATIC` of the difference to a coarser mesh, right for p = 2.6. The less the coarser mesh
resolves, the lower is the order that is seen: from a difference of `_RESOLVED` to one of `_UNRESOLVED` the
factor rises to `OVER_COARSER`. Where there is a second sibling of elements of 4 h, the order of the two
differences is taken in place of all this. Stress of quadratic elements and the forces of joints have p = 2.

Quadratic meshes of generated dams have a chain of siblings, each of twice the size in one more direction than
the one before. A difference in one direction is small and keeps the order of its elements, which that in
every direction at once does not, and each sibling is cheaper than the one before. Errors are the root of the
sum of squares over the directions: differences of joints that open and close in turn are hardly correlated
from direction to direction. From n elements to n / r, fewer or more, the factor is 1 / |r^p - 1|.

What a dam stands on is judged by layers of half the size, in the inner half of rock that grows away from the
dam, below the last, coarsest, dam.

Fewer contact points than nodes (`spacing`) are a term of their own: the difference to the same run with a gap
at every node, on the mesh itself or, where the coarser sibling's nodes are much closer than the spacing, on
that. Every error is relative to what moves: histories less their values at rest.

References
----------
Roache, J. Fluids Eng. 116 (1994) 405: the grid convergence index, the same with a factor of safety.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from romdam.config.other_mesh import EVERY_DIRECTION
from romdam.contact.components import NORMAL, SHEAR_J
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import listed
from romdam.core.scene import Scene
from romdam.core.system import SLIP, History
from romdam.error.comparison import OVER_COARSER, OVER_FINER, QUANTITIES, ComparedRun, Differences, compare
from romdam.error.mesh_stress import MeshStress, face_errors, mesh_stress, section_errors
from romdam.error.metrics import FLOOR, RelativeError, combined, scaled
from romdam.error.statement import ErrorStatement
from romdam.geometry.elements import ELEMENTS
from romdam.postprocess.stated_errors import percent
from romdam.postprocess.stress.summary import StressSummary

OVER_COARSER_QUADRATIC = 0.2  # error over the difference, of displacements where all elements are quadratic
_MOVING = ("opening", "slip", "residual_slip", "displacement", "section")  # these converge as displacements
_LOST = 0.3  # relative error of a history in L2 from which it counts as not resolved
# relative differences up to which a coarser quadratic mesh shows its order, and from which it shows none
_RESOLVED, _UNRESOLVED = 0.15, 0.6
_ORDERS = (1.3, 3.0)  # that two siblings may show
_LAST = 1.0  # [s] at the end of a run, over which a slip is averaged that is left
_AT_REST = 0.05  # of a joint's residual slip: one that slides by more about its mean of _LAST is not at rest


@dataclass(frozen=True)
class MeshRun(ComparedRun):
    """A run on one mesh.

    Attributes
    ----------
    area : (ng,) that the gaps stand for [m2]
    slides : (nt, ng) whether a gap slides; empty where joints carry no shear
    unknowns : of the mesh
    stress : on faces and sections; None where the job asks for none
    quadratic : whether all elements have quadratic displacements
    """

    area: Floats = field(default_factory=lambda: np.zeros(0))
    slides: Bools = field(default_factory=lambda: np.zeros((0, 0), dtype=bool))
    unknowns: int = 0
    stress: MeshStress | None = None
    quadratic: bool = False


@dataclass(frozen=True)
class SiblingRun:
    """A run on another mesh.

    Attributes
    ----------
    direction : in which the meshes differ
    times : size of its elements over that of the run before, in that direction; below 1 where they are finer
    """

    direction: str
    times: float
    run: MeshRun


def mesh_run(
    scene: Scene,
    history: History,
    joints: Mapping[str, slice],
    spectra: Floats,
    stress: StressSummary | None = None,
) -> MeshRun:
    """Put together what is compared of a run.

    Parameters
    ----------
    joints : name -> slice of its gaps
    spectra : (3 nodes, periods) pseudo-acceleration of their absolute acceleration, 5 % damping [m/s2]
    """
    area = np.concatenate([joint.whole_area for joint in scene.joints.values()])
    nodes = tuple(probe.name for probe in scene.probes)
    return MeshRun(
        time=history.time,
        jump=history.jump,
        position=scene.gap_position,
        joints=joints,
        nodes=nodes,
        histories=mesh_histories(history, joints, area, nodes, spectra),
        area=area,
        slides=history.state == SLIP,
        unknowns=3 * sum(len(block.points) for block in scene.blocks.values()),
        stress=mesh_stress(scene, stress),
        quadratic=all(ELEMENTS[block.element].quadratic for block in scene.blocks.values()),
    )


def mesh_histories(
    history: History, joints: Mapping[str, slice], area: Floats, nodes: Sequence[str], spectra: Floats
) -> dict[str, Floats]:
    """Histories of a run that are compared besides jumps: of whole joints, and of output nodes.

    The force of a joint is that of the interval before each row, and at rest in the first [N]; its pressure
    is the largest of its gaps, of the same forces [Pa].
    """
    force = history.mean_traction[..., NORMAL].copy()
    force[0] = history.traction[0, :, NORMAL] + (history.water[0] if history.water.size else 0.0)
    rows = len(history.time)
    of_joints = np.zeros((2, rows, len(joints)))
    for k, gaps in enumerate(joints.values()):
        of_joints[:, :, k] = force[:, gaps].sum(axis=1), (force[:, gaps] / area[gaps]).max(axis=1)
    histories = {"joint_force": of_joints[0], "joint_pressure": of_joints[1]}
    if nodes:
        motions = {"displacement": history.disp, "acceleration": history.acc}
        histories |= {name: motion.reshape(rows, -1, 3) for name, motion in motions.items()}
        histories["response_spectrum"] = spectra
    return histories


def discretisation(
    run: MeshRun,
    sibling: MeshRun | Sequence[SiblingRun],
    *,
    finer: bool,
    about: Mapping[str, object],
    second: MeshRun | None = None,
    points: tuple[MeshRun, MeshRun] | None = None,
) -> ErrorStatement:
    """State what the mesh and its contact points change in a run, for every joint and output node.

    Openings and slips are compared joint by joint at gaps that both meshes have, forces as resultants of
    joints, stress by percentiles of faces outside the ring of `run`. Peaks are those of all places, since the
    largest values of two meshes may agree by chance. Joints without such a gap are named in
    the details.

    Parameters
    ----------
    sibling : the same with elements of half the size, or of twice the size; or a chain of runs on meshes,
        each of which differs from the one before in one direction
    finer : whether the first is of half the size
    about : record, configuration and whatever else is to be written with it
    second : a coarser sibling's own, of four times the size, which shows the order
    points : runs on one mesh, with the contact points of `run` and with a gap at every node; None where `run`
        has a gap at every node

    Raises
    ------
    ResultError
        where no gap of the one is at a gap of the other, or the two have other times.
    """
    chain = [SiblingRun(EVERY_DIRECTION, 2.0, sibling)] if isinstance(sibling, MeshRun) else list(sibling)
    last, steps = chain[-1].run, list(zip([run, *(each.run for each in chain)], chain, strict=False))
    differences, sliding = _differences(run, last) if finer else _differences(last, run)
    shown = None if second is None else _differences(second, last)[0].errors
    if shown is not None and shown["opening"].l2 >= _UNRESOLVED:
        shown = None
    factor = partial(_error_over_difference, run=run, finer=finer, shown=shown)
    pairs = [(differences, chain[0].times)]
    if len(chain) > 1:
        pairs = [(_between(before, other), other.times) for before, other in steps]
    parts = [
        {name: scaled(error, factor(name, error, times=times)) for name, error in found.errors.items()}
        for found, times in pairs
    ]
    of_elements = {
        name: combined([part[name] for part in parts if name in part], lambda e: float(np.linalg.norm(e)))
        for name in dict.fromkeys(name for part in parts for name in part)
    }
    of_nodes = [name for name, each in QUANTITIES.items() if each.at == "nodes" and name in of_elements]
    nodes = {node: {name: of_elements[name].joints[node].plain for name in of_nodes} for node in run.nodes}
    of_elements = _of_no_nodes(of_elements)
    errors, of_points = of_elements, dict[str, RelativeError]()
    if points is not None:
        of_points = _of_no_nodes(_differences(*points, kind="contact points")[0].errors)
        errors = dict(of_elements)
        for name, more in of_points.items():
            if name in errors:  # joint by joint where both have the joints
                joints = {each: error for each, error in more.joints.items() if each in errors[name].joints}
                errors[name] = combined([errors[name], replace(more, joints=joints)], sum)
    lost = [name for name, error in errors.items() if error.l2 >= _LOST]
    if "acceleration" in lost and "response_spectrum" not in lost:
        lost.append("response_spectrum")
    of_stress: dict[str, object] = {}
    if run.stress is not None and last.stress is not None:
        judged, better = (run.stress, last.stress) if finer else (last.stress, run.stress)
        ring = judged if finer else better
        of_all_faces, faces = face_errors(judged, better, ring, OVER_FINER if finer else OVER_COARSER)
        of_section = factor("section", differences.errors["opening"], shown=None, times=2.0)
        of_all_sections, sections = section_errors(judged, better, of_section)
        errors = errors | of_all_faces | of_all_sections
        lost += [name for name, error in (of_all_faces | of_all_sections).items() if error.l2 >= _LOST]
        of_stress = {"faces": faces, "sections": sections}
    details: dict[str, object] = {
        "sibling": "finer" if finer else "coarser",
        "unknowns": run.unknowns,
        "unknowns_sibling": last.unknowns,
        "gaps": len(run.position),
        "gaps_sibling": len(last.position),
        "gaps_compared": differences.gaps,
        "joints_not_compared": differences.not_compared,
        "joints_still_sliding": sliding,
        "error_over_difference": factor("opening", differences.errors["opening"], times=2.0),
        "order_shown": shown is not None,
        "not_resolved": lost,
        "nodes": nodes,
        **of_stress,
    }
    if len(chain) > 1:
        details["directions"] = {
            other.direction: part["opening"].plain
            | {
                "times_unknowns_to_halve": _times_to_halve(before.unknowns, other.run.unknowns),
                "times_gaps_to_halve": _times_to_halve(len(before.position), len(other.run.position)),
            }
            for (before, other), part in zip(steps, parts, strict=False)
        }
    if points is not None:
        details["elements"] = {name: error.plain for name, error in of_elements.items()}
        details["contact_points"] = {name: error.plain for name, error in of_points.items()}
        details["gaps_at_every_node"] = len(points[1].position)
    return ErrorStatement("discretisation", _sentence(errors, details, about), errors, details | dict(about))


def _differences(
    judged: MeshRun, better: MeshRun, kind: str = "discretisation"
) -> tuple[Differences, list[str]]:
    """What two runs differ by, with the slips that they leave, and joints that still slide in either.

    Stress is left out.

    Raises
    ------
    ResultError
        where no gap of the one is at a gap of the other, or the two have other times.
    """
    differences, sliding = compare(kind, judged, better), list[str]()
    if "slip" in differences.errors:
        residual, sliding = _residual_slips(judged, better)
        if residual is not None:
            order = ("opening", "slip", "residual_slip", *differences.errors)
            errors = differences.errors | {"residual_slip": residual}
            differences = replace(differences, errors={name: errors[name] for name in order})
    return differences, sliding


def _between(before: MeshRun, other: SiblingRun) -> Differences:
    """What a run and the next one of a chain differ by."""
    judged, better = (before, other.run) if other.times < 1.0 else (other.run, before)
    return _differences(judged, better)[0]


def _error_over_difference(
    quantity: str,
    difference: RelativeError,
    run: MeshRun,
    *,
    finer: bool,
    shown: Mapping[str, RelativeError] | None,
    times: float,
) -> float:
    """The factor from a difference to the error, see the module.

    Parameters
    ----------
    shown : the differences of the sibling to a second one, of twice its elements' size
    times : size of the sibling's elements over that of the run before
    """
    if finer:
        return OVER_FINER
    if times != 2.0:
        of_twice = _error_over_difference(quantity, difference, run, finer=finer, shown=shown, times=2.0)
        return float(1.0 / abs(times ** np.log2(1.0 + 1.0 / of_twice) - 1.0))
    if not run.quadratic or quantity not in _MOVING:
        return OVER_COARSER
    former = None if shown is None else shown.get(quantity)
    if former is not None and difference.l2 > 0.0:
        order = float(np.clip(np.log2(max(former.l2 / difference.l2, 1.0)), *_ORDERS))
        return float(1.0 / (2.0**order - 1.0))
    rise = np.clip((difference.l2 - _RESOLVED) / (_UNRESOLVED - _RESOLVED), 0.0, 1.0)
    return float(OVER_COARSER_QUADRATIC + rise * (OVER_COARSER - OVER_COARSER_QUADRATIC))


def _of_no_nodes(errors: Mapping[str, RelativeError]) -> dict[str, RelativeError]:
    """The errors, with those of joints but not with those of output nodes."""
    whole = {name for name, each in QUANTITIES.items() if each.at == "nodes"}
    return {name: replace(error, joints={}) if name in whole else error for name, error in errors.items()}


def _times_to_halve(count: int, other: int) -> float:
    """How many times a count is multiplied by half the size in a direction; it is linear in the divisions.

    Parameters
    ----------
    other : with elements of twice the size in that direction, or of half
    """
    return other / count if other > count else 3.0 - 2.0 * other / count


def _sentence(
    errors: Mapping[str, RelativeError], details: Mapping[str, object], about: Mapping[str, object]
) -> str:
    opening, names = errors["opening"], details["not_resolved"]
    lost = [_plural(name) for name in names if name != "opening"] if isinstance(names, list) else []
    resolved = [
        f", {_plural(name)} by {percent(errors[name].l2)}"
        for name in (
            "slip", "joint_force", "joint_pressure", "displacement", "acceleration", "section_force",
            "section_moment",
        )
        if name in errors and _plural(name) not in lost
    ]  # fmt: skip
    stress = ""
    if "principal_stress" in errors and _plural("principal_stress") not in lost:
        stress = f", the 98 % stress of faces by {percent(errors['principal_stress'].peak)}"
    faces = details.get("faces", {})
    covered = [name for name, of_face in faces.items() if not of_face] if isinstance(faces, Mapping) else []
    if covered:
        stress += f", stress of {listed(covered)} unknown: no node of one mesh is outside the ring"
    histories = f"; neither mesh resolves {listed(lost)}" if lost else ""
    size = "half" if details["sibling"] == "finer" else "twice"
    sliding, factor = details["joints_still_sliding"], float(str(details["error_over_difference"]))
    if isinstance(sliding, list) and sliding:
        histories += f"; the slip that is left in {listed(sliding)} is not stated, for it still slides"
    source = f"{factor:.2g} of the difference to elements of {size} the size"
    if isinstance(directions := details.get("directions"), Mapping):
        each = [
            f"{name} {percent(part['l2'])} (half the size: {part['times_unknowns_to_halve']:.2g} times the "
            f"unknowns, {part['times_gaps_to_halve']:.2g} times the gaps)"
            for name, part in directions.items()
        ]
        where = "the dam and half of it in the rock" if "rock" in directions else "each"
        source = f"the root of squares over directions, from twice the size in {where}: {', '.join(each)}"
    elif details["order_shown"]:
        source += ", as the difference to four times the size shows"
    elif OVER_COARSER_QUADRATIC < factor < OVER_COARSER:
        source += f" (the truth is between {OVER_COARSER_QUADRATIC} and {OVER_COARSER} of it)"
    points = details.get("contact_points")
    if isinstance(points, Mapping):
        source += f", and {percent(points['opening']['l2'])} for contact points that are fewer than the nodes"
    return (
        f"The mesh and its contact points change the openings by about {percent(opening.l2)} in L2 and the "
        f"peaks by {percent(opening.peak)}{''.join(resolved)}{stress}{histories}: {source} "
        f"({details['unknowns_sibling']} unknowns for {details['unknowns']}), {about['seconds']:g} s of "
        f"{about['record']}."
    )


def _plural(name: str) -> str:
    if name == "response_spectrum":
        return "response spectra"
    return f"{name.replace('_', ' ')}{'es' if name.endswith('s') else 's'}"


def _residual_slips(judged: MeshRun, better: MeshRun) -> tuple[RelativeError | None, list[str]]:
    """Error of the mean slip over the last second of joints at rest, and the joints that still slide.

    It is relative to the slip that is left, or to FLOOR of the largest if that is more; None where every
    joint slides. A joint slides that moves in that second by more than `_AT_REST` of its residual slip.
    """
    last, runs = judged.time >= judged.time[-1] - _LAST, (judged, better)
    slips = {name: [_mean_slip(run, run.joints[name]) for run in runs] for name in judged.joints}
    left = {name: [slip[last].mean(axis=0) for slip in pair] for name, pair in slips.items()}
    size = {name: float(np.linalg.norm(left[name][1] - pair[1][0])) for name, pair in slips.items()}
    largest = max(size.values(), default=0.0)
    if largest == 0.0:
        return RelativeError(0.0, 0.0), []

    def slides(run: MeshRun, name: str, slip: Floats, mean: Floats) -> bool:
        moves = np.linalg.norm(slip[last] - mean, axis=1).max()
        far = moves > _AT_REST * max(size[name], FLOOR * largest)
        return bool(far and run.slides[last][:, run.joints[name]].any())

    sliding = [name for name in slips if any(map(slides, runs, (name, name), slips[name], left[name]))]
    rest = [name for name in slips if name not in sliding]
    if not rest:
        return None, sliding
    largest = max(size[name] for name in rest)
    if largest == 0.0:
        return RelativeError(0.0, 0.0), sliding
    off = {name: float(np.linalg.norm(left[name][0] - left[name][1])) for name in rest}
    relative = {name: off[name] / max(size[name], FLOOR * largest) for name in rest}
    worst = max(off.values()) / largest
    return RelativeError(worst, worst, {name: RelativeError(e, e) for name, e in relative.items()}), sliding


def _mean_slip(run: MeshRun, gaps: slice) -> Floats:
    """Slip (nt, 2) of a joint, mean over its area [m]."""
    area = run.area[gaps]
    return np.asarray(np.einsum("g,tga->ta", area, run.jump[:, gaps, SHEAR_J:]) / area.sum())
