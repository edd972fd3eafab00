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
from direction to direction. From n elements to fewer, n / r of them, the factor is 1 / (r^p - 1).

Fewer contact points than nodes (`spacing`) are a term of their own: the difference to the same run with a gap
at every node, on the mesh itself or, where the coarser sibling's nodes are much closer than the spacing, on
that. Every error is relative to what moves: histories less their values at rest.

References
----------
Roache, J. Fluids Eng. 116 (1994) 405: the grid convergence index, the same with a factor of safety.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from romdam.config.other_mesh import EVERY_DIRECTION
from romdam.contact.components import NORMAL, SHEAR_J
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ResultError, listed
from romdam.core.scene import Scene
from romdam.core.system import SLIP, History
from romdam.error.comparison import coinciding
from romdam.error.mesh_stress import MeshStress, face_errors, mesh_stress, section_errors
from romdam.error.metrics import (
    FLOOR,
    RelativeError,
    from_rest,
    magnitude_error,
    opening_error,
    opening_peaks,
    scaled,
)
from romdam.error.statement import ErrorStatement
from romdam.geometry.elements import ELEMENTS
from romdam.postprocess.stated_errors import percent
from romdam.postprocess.stress.summary import StressSummary

OVER_FINER, OVER_COARSER = 1.5, 0.5  # error over the difference to the sibling
OVER_COARSER_QUADRATIC = 0.2  # the same of displacements, where all elements are quadratic
_MOVING = ("opening", "slip", "residual_slip", "displacement", "section")  # these converge as displacements
_LOST = 0.3  # relative error of a history in L2 from which it counts as not resolved
# relative differences up to which a coarser quadratic mesh shows its order, and from which it shows none
_RESOLVED, _UNRESOLVED = 0.15, 0.6
_ORDERS = (1.3, 3.0)  # that two siblings may show
_LAST = 1.0  # [s] at the end of a run, over which a slip is averaged that is left
_AT_REST = 0.05  # of a joint's residual slip: one that slides by more about its mean of _LAST is not at rest


@dataclass(frozen=True)
class MeshRun:
    """A run on one mesh.

    Attributes
    ----------
    history : as integrated
    position : (ng, 3) of the gaps [m]
    area : (ng,) that they stand for [m2]
    joints : name -> slice of its gaps
    nodes : names of the output nodes, in the order of `history.disp`
    spectra : (3 nodes, periods) pseudo-acceleration of their absolute acceleration, 5 % damping [m/s2]
    unknowns : of the mesh
    stress : on faces and sections; None where the job asks for none
    quadratic : whether all elements have quadratic displacements
    """

    history: History
    position: Floats
    area: Floats
    joints: Mapping[str, slice]
    nodes: tuple[str, ...]
    spectra: Floats
    unknowns: int
    stress: MeshStress | None = None
    quadratic: bool = False


@dataclass(frozen=True)
class SiblingRun:
    """A run on another mesh.

    Attributes
    ----------
    direction : in which the meshes differ
    times : size of the coarser elements over that of the finer ones, in that direction
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
    """Put together what is compared of a run; `joints` and `spectra` as in `MeshRun`."""
    return MeshRun(
        history=history,
        position=scene.gap_position,
        area=np.concatenate([joint.whole_area for joint in scene.joints.values()]),
        joints=joints,
        nodes=tuple(probe.name for probe in scene.probes),
        spectra=spectra,
        unknowns=3 * sum(len(block.points) for block in scene.blocks.values()),
        stress=mesh_stress(scene, stress),
        quadratic=all(ELEMENTS[block.element].quadratic for block in scene.blocks.values()),
    )


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
        each coarser than the one before in one more direction
    finer : whether it is of half the size
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
    last = chain[-1].run
    differences = _differences(run, last, finer=finer)
    shown = None if second is None else _differences(last, second, finer=False).errors
    if shown is not None and shown["opening"].l2 >= _UNRESOLVED:
        shown = None
    factor = partial(_error_over_difference, run=run, finer=finer, shown=shown)
    directions = {EVERY_DIRECTION: _errors_of(differences, partial(factor, times=chain[0].times))}
    if len(chain) > 1:
        before = [run, *(coarser.run for coarser in chain[:-1])]
        directions = {
            coarser.direction: _errors_of(
                _differences(better, coarser.run, finer=False), partial(factor, times=coarser.times)
            )
            for better, coarser in zip(before, chain, strict=True)
        }
    of_elements = _root_of_squares([errors for errors, _ in directions.values()])
    nodes = {
        node: {name: error.plain for name, error in _root_of_squares(each).items()}
        for node in differences.nodes
        if (each := [of_nodes[node] for _, of_nodes in directions.values()])
    }
    errors, of_points = of_elements, dict[str, RelativeError]()
    if points is not None:
        of_points = _differences(*points, finer=True).errors
        errors = {name: _added(error, of_points.get(name)) for name, error in of_elements.items()}
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
        "gaps_compared": differences.compared,
        "joints_not_compared": differences.not_compared,
        "joints_still_sliding": differences.sliding,
        "error_over_difference": factor("opening", differences.errors["opening"], times=2.0),
        "order_shown": shown is not None,
        "not_resolved": lost,
        "nodes": nodes,
        **of_stress,
    }
    if len(chain) > 1:
        details["directions"] = {
            coarser.direction: errors["opening"].plain
            | {
                "times_unknowns_to_halve": _times_to_halve(better.unknowns, coarser.run.unknowns),
                "times_gaps_to_halve": _times_to_halve(len(better.position), len(coarser.run.position)),
            }
            for better, coarser, (errors, _) in zip(before, chain, directions.values(), strict=True)
        }
    if points is not None:
        details["elements"] = {name: error.plain for name, error in of_elements.items()}
        details["contact_points"] = {name: error.plain for name, error in of_points.items()}
        details["gaps_at_every_node"] = len(points[1].position)
    return ErrorStatement("discretisation", _sentence(errors, details, about), errors, details | dict(about))


@dataclass(frozen=True)
class _Differences:
    """What two runs differ by, relative to the better one.

    Attributes
    ----------
    errors : quantity -> difference
    nodes : output node -> quantity -> difference
    compared : number of gaps that both have
    not_compared : joints without such a gap
    sliding : joints that slide in the last second of either
    """

    errors: dict[str, RelativeError]
    nodes: dict[str, dict[str, RelativeError]]
    compared: int
    not_compared: list[str]
    sliding: list[str]


def _differences(run: MeshRun, other: MeshRun, *, finer: bool) -> _Differences:
    """Compare two runs; the other is the better one where it is `finer`. Stress is left out.

    Raises
    ------
    ResultError
        where no gap of the one is at a gap of the other, or the two have other times.
    """
    judged, better = (run, other) if finer else (other, run)
    if len(run.history.time) != len(other.history.time):
        raise ResultError(
            f"the runs on both meshes have {len(run.history.time)} and {len(other.history.time)} rows; "
            "set outputs.output_interval"
        )
    rows, pair, joints = _gaps_of_both(judged, better)
    if not len(rows):
        raise ResultError(
            "no gap of the one mesh is at a gap of the other within 1 mm, so openings cannot be compared; "
            "compare runs on meshes whose nodes coincide"
        )
    jump, better_jump = from_rest(judged.history.jump[:, rows], better.history.jump[:, pair])
    errors = {"opening": opening_error(jump[..., NORMAL], better_jump[..., NORMAL], joints, opening_peaks)}
    sliding = list[str]()
    if jump.shape[2] > 1:
        errors["slip"] = _by_joint(jump[..., SHEAR_J:], better_jump[..., SHEAR_J:], joints)
        residual, sliding = _residual_slips(judged, better)
        if residual is not None:
            errors["residual_slip"] = residual
    errors["joint_force"] = _of_each_joint(judged, better, _normal_force)
    errors["joint_pressure"] = _of_each_joint(judged, better, _largest_pressure)
    nodes: dict[str, dict[str, RelativeError]] = {}
    for name in ("disp", "acc") if run.nodes else ():
        quantity = {"disp": "displacement", "acc": "acceleration"}[name]
        pairs = [
            getattr(result.history, name).reshape(len(result.history.time), -1, 3)
            for result in (judged, better)
        ]
        if name == "disp":
            pairs = list(from_rest(*pairs))
        errors[quantity] = magnitude_error(*pairs, peaks=True)
        for k, node in enumerate(run.nodes):
            nodes.setdefault(node, {})[quantity] = magnitude_error(pairs[0][:, k], pairs[1][:, k], peaks=True)
    if run.nodes:
        errors["response_spectrum"] = magnitude_error(judged.spectra, better.spectra)
    missing = [name for name in judged.joints if name not in joints]
    return _Differences(errors, nodes, len(rows), missing, sliding)


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
    times : size of the coarser elements over that of the finer ones
    """
    if finer:
        return OVER_FINER
    if times != 2.0:
        of_twice = _error_over_difference(quantity, difference, run, finer=finer, shown=shown, times=2.0)
        return float(1.0 / (times ** np.log2(1.0 + 1.0 / of_twice) - 1.0))
    if not run.quadratic or quantity not in _MOVING:
        return OVER_COARSER
    former = None if shown is None else shown.get(quantity)
    if former is not None and difference.l2 > 0.0:
        order = float(np.clip(np.log2(max(former.l2 / difference.l2, 1.0)), *_ORDERS))
        return float(1.0 / (2.0**order - 1.0))
    rise = np.clip((difference.l2 - _RESOLVED) / (_UNRESOLVED - _RESOLVED), 0.0, 1.0)
    return float(OVER_COARSER_QUADRATIC + rise * (OVER_COARSER - OVER_COARSER_QUADRATIC))


def _errors_of(
    differences: _Differences, factor: Callable[[str, RelativeError], float]
) -> tuple[dict[str, RelativeError], dict[str, dict[str, RelativeError]]]:
    """Errors of every quantity, and of output nodes, from what two runs differ by and the factor of each."""
    factor_of = {name: factor(name, error) for name, error in differences.errors.items()}
    nodes = {
        node: {name: scaled(error, factor_of[name]) for name, error in each.items()}
        for node, each in differences.nodes.items()
    }
    return {name: scaled(error, factor_of[name]) for name, error in differences.errors.items()}, nodes


def _root_of_squares(parts: Sequence[Mapping[str, RelativeError]]) -> dict[str, RelativeError]:
    """The root of the sum of squares of errors of every quantity, joint by joint too."""
    names = dict.fromkeys(name for part in parts for name in part)
    each = {name: [part[name] for part in parts if name in part] for name in names}
    return {
        name: RelativeError(
            float(np.linalg.norm([error.l2 for error in errors])),
            float(np.linalg.norm([error.peak for error in errors])),
            _root_of_squares([error.joints for error in errors]),
        )
        for name, errors in each.items()
    }


def _times_to_halve(count: int, coarser: int) -> float:
    """How many times a count is multiplied by half the size in a direction; it is linear in the divisions."""
    return 3.0 - 2.0 * coarser / count


def _added(error: RelativeError, more: RelativeError | None) -> RelativeError:
    """The sum of two errors, joint by joint where both have the joints."""
    if more is None:
        return error
    joints = {name: _added(each, more.joints.get(name)) for name, each in error.joints.items()}
    return RelativeError(error.l2 + more.l2, error.peak + more.peak, joints)


def _gaps_of_both(judged: MeshRun, better: MeshRun) -> tuple[Ints, Ints, dict[str, slice]]:
    """Gaps at the same places of a joint: their numbers in both runs, and each joint's slice of these."""
    rows, pair = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    joints, count = dict[str, slice](), 0
    for name, gaps in judged.joints.items():
        here, there = coinciding(judged.position[gaps], better.position[better.joints[name]])
        if len(here):
            rows.append(gaps.start + here)
            pair.append(better.joints[name].start + there)
            joints[name] = slice(count, count + len(here))
            count += len(here)
    return np.concatenate(rows), np.concatenate(pair), joints


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
        source = f"the root of squares over directions, from twice the size in each: {', '.join(each)}"
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


def _by_joint(values: Floats, better: Floats, joints: Mapping[str, slice]) -> RelativeError:
    """Error of histories (nt, ng, ...), all together and joint by joint."""
    each = {
        name: magnitude_error(values[:, gaps], better[:, gaps], peaks=True) for name, gaps in joints.items()
    }
    return replace(magnitude_error(values, better, peaks=True), joints=each)


def _residual_slips(judged: MeshRun, better: MeshRun) -> tuple[RelativeError | None, list[str]]:
    """Error of the mean slip over the last second of joints at rest, and the joints that still slide.

    It is relative to the slip that is left, or to FLOOR of the largest if that is more; None where every
    joint slides.
    """
    left, wanted, before = (
        {name: slip(result, gaps) for name, gaps in result.joints.items()}
        for result, slip in ((judged, _mean_slip), (better, _mean_slip), (better, _first_slip))
    )
    size = {name: float(np.linalg.norm(wanted[name] - before[name])) for name in wanted}
    largest = max(size.values(), default=0.0)
    if largest == 0.0:
        return RelativeError(0.0, 0.0), []
    sliding = [
        name
        for name in wanted
        if any(
            _still_slides(result, result.joints[name], max(size[name], FLOOR * largest))
            for result in (judged, better)
        )
    ]
    rest = [name for name in wanted if name not in sliding]
    if not rest:
        return None, sliding
    largest = max(size[name] for name in rest)
    off = {name: float(np.linalg.norm(left[name] - wanted[name])) for name in rest}
    if largest == 0.0:
        return RelativeError(0.0, 0.0), sliding
    relative = {name: off[name] / max(size[name], FLOOR * largest) for name in rest}
    joints = {name: RelativeError(value, value) for name, value in relative.items()}
    worst = max(off.values()) / largest
    return RelativeError(worst, worst, joints), sliding


def _mean_slip(run: MeshRun, gaps: slice) -> Floats:
    """Slip (2,) of a joint, mean over its area and the last second [m]."""
    time, area = run.history.time, run.area[gaps]
    slip = run.history.jump[time >= time[-1] - _LAST, gaps, SHEAR_J:].mean(axis=0)
    return np.asarray(area @ slip / area.sum())


def _first_slip(run: MeshRun, gaps: slice) -> Floats:
    """Slip (2,) of a joint at rest, mean over its area [m]."""
    area = run.area[gaps]
    return np.asarray(area @ run.history.jump[0, gaps, SHEAR_J:] / area.sum())


def _still_slides(run: MeshRun, gaps: slice, residual: float) -> bool:
    """Tell whether a joint slides in the last second, by more than `_AT_REST` of its residual slip [m]."""
    time, area = run.history.time, run.area[gaps]
    last = time >= time[-1] - _LAST
    if not (run.history.state[last][:, gaps] == SLIP).any():
        return False
    slip = np.einsum("g,tga->ta", area, run.history.jump[last][:, gaps, SHEAR_J:]) / area.sum()
    return bool(np.linalg.norm(slip - slip.mean(axis=0), axis=1).max() > _AT_REST * residual)


def _of_each_joint(
    judged: MeshRun, better: MeshRun, quantity: Callable[[MeshRun, slice], Floats]
) -> RelativeError:
    """Error of a history (nt,) of every joint, less its value at rest."""
    pairs = {
        name: from_rest(quantity(judged, judged.joints[name]), quantity(better, better.joints[name]))
        for name in judged.joints
    }
    values, wanted = ({name: pair[i] for name, pair in pairs.items()} for i in (0, 1))
    every = np.stack(list(wanted.values()), axis=1)
    each = {name: magnitude_error(values[name], wanted[name], every) for name in wanted}
    all_joints = magnitude_error(np.stack(list(values.values()), axis=1), every, peaks=True)
    return replace(all_joints, joints=each)


def _normal_force(run: MeshRun, gaps: slice) -> Floats:
    """Normal force (nt,) of a joint, mean over the interval before each row and at rest in the first [N]."""
    return np.asarray(_normal_forces(run.history, gaps).sum(axis=1))


def _largest_pressure(run: MeshRun, gaps: slice) -> Floats:
    """Largest pressure (nt,) of a joint's gaps, from the same forces [Pa]."""
    return np.asarray((_normal_forces(run.history, gaps) / run.area[gaps]).max(axis=1))


def _normal_forces(history: History, gaps: slice) -> Floats:
    """Normal forces (nt, n) of a joint's gaps: at rest in the first row, then means before each row [N]."""
    forces = history.mean_traction[:, gaps, NORMAL].copy()
    forces[0] = history.traction[0, gaps, NORMAL] + (history.water[0, gaps] if history.water.size else 0.0)
    return forces
