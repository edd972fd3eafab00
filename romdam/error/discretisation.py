"""The error of the mesh and of its contact points, from the same run on a sibling mesh.

Elements have a size h here and h/2, or 2 h, in the sibling. With an error C h^p the difference to the finer
sibling is (1 - 2^-p) of the error of h, that to the coarser one 2^p - 1 times it. Linear elements have p = 2,
and less at corners and edges. So the error is stated as `OVER_FINER` of the difference to a finer mesh, which
is right for p = 1.6 and within a factor of two for p above 0.6, and as `OVER_COARSER` of that to a coarser
mesh, right for p = 1.6 and within a factor of two for p of 1 to 2.3. Displacements of quadratic elements have
p of 3 and less: what moves, and forces of sections, which are sums of nodal forces, are stated as
`OVER_COARSER_QUADRATIC` of the difference to a coarser mesh, right for p = 2.6 and within a factor of two for
p of 1.8 to 3.5. Their stress and the forces of joints have p = 2. Where the coarser mesh is `_LOST`, as one
element through the thickness of an arch dam, no such order is seen (1.6 there), and `OVER_COARSER` is taken.

References
----------
Roache, J. Fluids Eng. 116 (1994) 405: the grid convergence index, the same with a factor of safety.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from romdam.contact.components import NORMAL, SHEAR_J
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ResultError, listed
from romdam.core.scene import Scene
from romdam.core.system import History
from romdam.error.comparison import coinciding
from romdam.error.mesh_stress import MeshStress, face_errors, mesh_stress, section_errors
from romdam.error.metrics import FLOOR, RelativeError, magnitude_error, opening_error, opening_peaks, scaled
from romdam.error.statement import ErrorStatement, percent
from romdam.geometry.elements import ELEMENTS
from romdam.postprocess.stress.summary import StressSummary

OVER_FINER, OVER_COARSER = 1.5, 0.5  # error over the difference to the sibling
OVER_COARSER_QUADRATIC = 0.2  # the same of displacements, where all elements are quadratic
_MOVING = ("opening", "slip", "residual_slip", "displacement", "section")  # these converge as displacements
_LOST = 0.3  # relative error of a history in L2 from which it counts as not resolved
_LAST = 1.0  # [s] at the end of a run, over which a slip is averaged that is left


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
    run: MeshRun, sibling: MeshRun, *, finer: bool, about: Mapping[str, object]
) -> ErrorStatement:
    """State what the mesh and its contact points change in a run, for every joint and output node.

    Openings and slips are compared joint by joint at gaps that both meshes have, forces as resultants of
    joints, stress by percentiles of faces outside the ring of `run`. Peaks are those of all places, since the
    largest values of two meshes may agree by chance. Joints without such a gap are named in
    the details.

    Parameters
    ----------
    sibling : the same with elements of half the size, or of twice the size
    finer : whether it is of half the size
    about : record, configuration and whatever else is to be written with it

    Raises
    ------
    ResultError
        where no gap of the one is at a gap of the other, or the two have other times.
    """
    better, judged = (sibling, run) if finer else (run, sibling)
    if len(run.history.time) != len(sibling.history.time):
        raise ResultError(
            f"the runs on both meshes have {len(run.history.time)} and {len(sibling.history.time)} rows; "
            "set outputs.output_interval"
        )
    rows, pair, joints = _gaps_of_both(judged, better)
    if not len(rows):
        raise ResultError(
            "no gap of the one mesh is at a gap of the other within 1 mm, so openings cannot be compared; "
            "compare runs on meshes whose nodes coincide"
        )
    jump, other = judged.history.jump[:, rows], better.history.jump[:, pair]
    errors = {"opening": opening_error(jump[..., NORMAL], other[..., NORMAL], joints, opening_peaks)}
    factor = OVER_FINER if finer else OVER_COARSER
    converges = run.quadratic and not finer and errors["opening"].l2 < _LOST
    factor_of = dict.fromkeys(_MOVING, OVER_COARSER_QUADRATIC if converges else factor)
    if jump.shape[2] > 1:
        errors["slip"] = _by_joint(jump[..., SHEAR_J:], other[..., SHEAR_J:], joints)
        errors["residual_slip"] = _residual_slips(judged, better)
    errors["joint_force"] = _forces(judged, better)
    nodes: dict[str, dict[str, object]] = {}
    for name in ("disp", "acc") if run.nodes else ():
        quantity = {"disp": "displacement", "acc": "acceleration"}[name]
        pairs = [
            getattr(result.history, name).reshape(len(result.history.time), -1, 3)
            for result in (judged, better)
        ]
        errors[quantity] = magnitude_error(*pairs, peaks=True)
        for k, node in enumerate(run.nodes):
            of_node = magnitude_error(pairs[0][:, k], pairs[1][:, k], peaks=True)
            error = scaled(of_node, factor_of.get(quantity, factor))
            nodes.setdefault(node, {})[quantity] = error.plain
    if run.nodes:
        errors["response_spectrum"] = magnitude_error(judged.spectra, better.spectra)
    errors = {name: scaled(error, factor_of.get(name, factor)) for name, error in errors.items()}
    of_stress: dict[str, object] = {}
    if judged.stress is not None and better.stress is not None:
        ring = judged.stress if finer else better.stress
        of_all_faces, faces = face_errors(judged.stress, better.stress, ring, factor)
        of_all_sections, sections = section_errors(judged.stress, better.stress, factor_of["section"])
        errors |= of_all_faces | of_all_sections
        of_stress = {"faces": faces, "sections": sections}
    lost = [name for name, error in errors.items() if error.l2 >= _LOST]
    if "acceleration" in lost and "response_spectrum" not in lost:
        lost.append("response_spectrum")
    details: dict[str, object] = {
        "sibling": "finer" if finer else "coarser",
        "unknowns": run.unknowns,
        "unknowns_sibling": sibling.unknowns,
        "gaps": len(run.position),
        "gaps_sibling": len(sibling.position),
        "gaps_compared": len(rows),
        "joints_not_compared": [name for name in judged.joints if name not in joints],
        "error_over_difference": factor_of["opening"],
        "not_resolved": lost,
        "nodes": nodes,
        **of_stress,
    }
    return ErrorStatement("discretisation", _sentence(errors, details, about), errors, details | dict(about))


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
    opening, lost = errors["opening"], _words(details["not_resolved"])
    resolved = [
        f", {_plural(name)} by {percent(errors[name].l2)}"
        for name in ("slip", "joint_force", "displacement", "acceleration", "section_force", "section_moment")
        if name in errors and _plural(name) not in lost
    ]
    stress = ""
    if "principal_stress" in errors and _plural("principal_stress") not in lost:
        stress = f", the 98 % stress of faces by {percent(errors['principal_stress'].peak)}"
    faces = details.get("faces", {})
    covered = [name for name, of_face in faces.items() if not of_face] if isinstance(faces, Mapping) else []
    if covered:
        stress += f", stress of {listed(covered)} unknown: no node of one mesh is outside the ring"
    histories = f"; neither mesh resolves {listed(lost)}" if lost else ""
    size = "half" if details["sibling"] == "finer" else "twice"
    return (
        f"The mesh and its contact points change the openings by about {percent(opening.l2)} in L2 and the "
        f"peaks by {percent(opening.peak)}{''.join(resolved)}{stress}{histories}: "
        f"{details['error_over_difference']} of the difference to elements of {size} the size "
        f"({details['unknowns_sibling']} unknowns for {details['unknowns']}), {about['seconds']:g} s of "
        f"{about['record']}."
    )


def _words(names: object) -> list[str]:
    return [_plural(name) for name in names if name != "opening"] if isinstance(names, list) else []


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


def _residual_slips(judged: MeshRun, better: MeshRun) -> RelativeError:
    """Error of every joint's mean slip over the last second, relative to FLOOR of the largest or more."""
    left, wanted = (_each_joint(result, _mean_slip) for result in (judged, better))
    largest = max((float(np.linalg.norm(slip)) for slip in wanted.values()), default=0.0)
    if largest == 0.0:
        return RelativeError(0.0, 0.0)
    off = {
        name: float(np.linalg.norm(left[name] - slip)) / max(float(np.linalg.norm(slip)), FLOOR * largest)
        for name, slip in wanted.items()
    }
    joints = {name: RelativeError(value, value) for name, value in off.items()}
    worst = max(float(np.linalg.norm(left[name] - slip)) for name, slip in wanted.items()) / largest
    return RelativeError(worst, worst, joints)


def _mean_slip(run: MeshRun, gaps: slice) -> Floats:
    """Slip (2,) of a joint, mean over its area and the last second [m]."""
    time, area = run.history.time, run.area[gaps]
    slip = run.history.jump[time >= time[-1] - _LAST, gaps, SHEAR_J:].mean(axis=0)
    return np.asarray(area @ slip / area.sum())


def _forces(judged: MeshRun, better: MeshRun) -> RelativeError:
    """Error of the normal forces of joints, each the sum over its gaps and the mean between rows."""
    values, wanted = (_each_joint(result, _normal_force) for result in (judged, better))
    every = np.stack(list(wanted.values()), axis=1)
    each = {name: magnitude_error(values[name], wanted[name], every) for name in wanted}
    all_joints = magnitude_error(np.stack(list(values.values()), axis=1), every, peaks=True)
    return replace(all_joints, joints=each)


def _normal_force(run: MeshRun, gaps: slice) -> Floats:
    """Normal force (nt,) of a joint, mean over the interval before each row [N]."""
    return np.asarray(run.history.mean_traction[:, gaps, NORMAL].sum(axis=1))


def _each_joint(run: MeshRun, quantity: Callable[[MeshRun, slice], Floats]) -> dict[str, Floats]:
    return {name: quantity(run, gaps) for name, gaps in run.joints.items()}
