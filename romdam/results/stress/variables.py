"""The stress variables of a result file; `romdam.results.variables` takes them in.

Tension is positive. Envelopes and durations are over the written times (`outputs.output_interval`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.postprocess.stress.sections import AXES, SIDES, linearised_stress
from romdam.postprocess.stress.summary import (
    COMPONENTS,
    DCR_LEVELS,
    MEASURES,
    principal_stresses,
    stress_along,
)
from romdam.results.case import Array, Case, Variable
from romdam.results.stress.faces import FACE_COORDINATES, FACE_VARIABLES, of_measure

_NODE = ("stress_node",)
_SECTIONS_OVER_TIME = ("time", "section", "section_axis")
_NAMES = {
    "principal": "major principal stress",
    "vertical": "cantilever stress (up along the face on stress faces, else vertical)",
    "arch": "arch stress (along the horizontal tangent)",
}
_MANUALS = "USACE EM 1110-2-6051 (2003), EM 1110-2-6053 (2007)"


def _of_nodes(get: Callable[[Case, str], Array]) -> Callable[[Case], Array]:
    """Join what `get` gives for every block's stress nodes, one block after another."""
    return lambda case: np.concatenate([get(case, name) for name in case.sites.blocks])


def _axis(name: str) -> Callable[[Case], Array]:
    return _of_nodes(lambda case, block: np.asarray(getattr(case.sites.blocks[block], name)))


def _ratio(case: Case) -> Array:
    assert case.sites.strength is not None
    return np.asarray(case.stress_summary.largest["principal"] / case.sites.strength)


def overstressed_areas(case: Case) -> Array:
    """Area of every stress face whose nodes exceed each of DCR_LEVELS at some time, (faces, levels) [m2]."""
    sites, ratio = case.sites, _ratio(case)
    counts = [len(nodes.nodes) for nodes in sites.blocks.values()]
    first = dict(zip(sites.blocks, [0, *np.cumsum(counts)[:-1].tolist()], strict=True))
    areas = [face.area @ (ratio[first[face.block] + face.rows][:, None] > DCR_LEVELS) for face in sites.faces]
    return np.array(areas, dtype=float).reshape(-1, len(DCR_LEVELS))


def _of_sections(name: str) -> Callable[[Case], Array]:
    return lambda case: np.array([getattr(section, name) for section in case.sites.sections])


def _linearised_stress(case: Case) -> Array:
    forces = case.stress_summary.sections
    return np.stack(
        [linearised_stress(section, forces[:, k]) for k, section in enumerate(case.sites.sections)], axis=1
    )


def _envelopes() -> dict[str, Variable]:
    envelopes = {}
    for name in MEASURES:
        text = _NAMES[name]
        low = text.replace("major", "minor")
        envelopes[f"max_{name}_stress"] = Variable(
            _NODE, "Pa", f"largest {text} over time", of_measure("largest", name), Case.has_stress
        )
        envelopes[f"min_{name}_stress"] = Variable(
            _NODE, "Pa", f"smallest {low} over time", of_measure("smallest", name), Case.has_stress
        )
        envelopes[f"max_{name}_stress_time"] = Variable(
            _NODE, "s", f"time of the largest {text}", of_measure("time_of_largest", name), Case.has_stress
        )
        envelopes[f"worst_{name}_stress"] = Variable(
            _NODE, "Pa", f"{text} at worst_{name}_time", of_measure("at_worst", name), Case.has_stress
        )
        envelopes[f"worst_{name}_time"] = Variable(
            (),
            "s",
            f"time at which the {text} is largest anywhere outside the ring",
            of_measure("worst_time", name),
            Case.has_stress,
        )
    return envelopes


SECTION_COORDINATES: dict[str, Variable] = {
    "section": Variable(("section",), "", "name of the section", _of_sections("name"), Case.has_sections),
    "section_axis": Variable(
        ("section_axis",),
        "",
        "normal, and two axes in the plane",
        lambda c: np.array(AXES),
        Case.has_sections,
    ),
    "section_side": Variable(
        ("section_side",),
        "",
        "end of the section along an axis in its plane",
        lambda c: np.array(SIDES),
        Case.has_sections,
    ),
    "section_axes": Variable(
        ("section", "section_axis", "component"),
        "1",
        "axes of the section",
        _of_sections("axes"),
        Case.has_sections,
    ),
    "section_centroid": Variable(
        ("section", "component"),
        "m",
        "centroid of the section's area",
        _of_sections("centroid"),
        Case.has_sections,
    ),
    "section_area": Variable(
        ("section",), "m2", "area of the section", _of_sections("area"), Case.has_sections
    ),
    "section_side_position": Variable(
        ("section", "section_side", "component"),
        "m",
        "ends of the section through its centroid",
        _of_sections("sides"),
        Case.has_sections,
    ),
}

SECTION_VARIABLES: dict[str, Variable] = {
    "section_force": Variable(
        _SECTIONS_OVER_TIME,
        "N",
        "resultant of the stress on the section: normal force, tension positive, and shear along its axes",
        lambda c: c.stress_summary.sections[..., :3],
        Case.has_sections,
    ),
    "section_moment": Variable(
        _SECTIONS_OVER_TIME,
        "N m",
        "moment of the stress about the section's axes through the centroid; about the normal it is torsion",
        lambda c: c.stress_summary.sections[..., 3:],
        Case.has_sections,
    ),
    "section_stress": Variable(
        ("time", "section", "section_side"),
        "Pa",
        "linearised normal stress N/A and M y/I at the ends of the section, tension positive",
        _linearised_stress,
        Case.has_sections,
    ),
}

STRESS_COORDINATES: dict[str, Variable] = {
    "stress_block": Variable(
        _NODE,
        "",
        "block of the stress node",
        _of_nodes(lambda c, block: np.full(len(c.sites.blocks[block].nodes), block)),
        Case.has_stress,
    ),
    "stress_node_number": Variable(_NODE, "1", "node number in its block", _axis("nodes"), Case.has_stress),
    "stress_position": Variable(
        ("stress_node", "component"),
        "m",
        "position of the stress node",
        _of_nodes(lambda c, block: c.scene.blocks[block].points[c.sites.blocks[block].nodes]),
        Case.has_stress,
    ),
    "stress_up": Variable(
        ("stress_node", "component"), "1", "cantilever direction", _axis("up"), Case.has_stress
    ),
    "stress_arch": Variable(
        ("stress_node", "component"), "1", "arch direction", _axis("arch"), Case.has_stress
    ),
    "stress_component": Variable(
        ("stress_component",),
        "",
        "component of the stress tensor",
        lambda c: np.array(COMPONENTS),
        Case.has_stress,
    ),
    "dcr_level": Variable(
        ("dcr_level",), "1", "demand-capacity ratio", lambda c: DCR_LEVELS, Case.has_stress_duration
    ),
    "stress_face": Variable(
        ("stress_face",),
        "",
        "name of the face",
        lambda c: np.array([face.name for face in c.sites.faces], dtype=str),
        Case.has_stress_faces,
    ),
    "stress_probe": Variable(
        ("stress_probe",),
        "",
        "name of the node with stress histories",
        lambda c: np.array(list(c.sites.probes), dtype=str),
        Case.has_stress_probes,
    ),
    **FACE_COORDINATES,
    **SECTION_COORDINATES,
}

STRESS_VARIABLES: dict[str, Variable] = {
    **_envelopes(),
    "worst_stress": Variable(
        ("stress_node", "stress_component"),
        "Pa",
        "stress tensor at worst_principal_time, tension positive",
        lambda c: c.stress_summary.tensor,
        Case.has_stress,
    ),
    "tensile_strength": Variable(
        (), "Pa", "tensile strength", lambda c: np.asarray(c.sites.strength), Case.has_stress_duration
    ),
    "demand_capacity_ratio": Variable(
        _NODE,
        "1",
        "largest major principal stress over the tensile strength",
        _ratio,
        Case.has_stress_duration,
        {"references": _MANUALS},
    ),
    "cumulative_inelastic_duration": Variable(
        ("stress_node", "dcr_level"),
        "s",
        "total duration of the major principal stress above dcr_level times the tensile strength",
        lambda c: np.asarray(c.stress_summary.duration),
        Case.has_stress_duration,
        {"references": _MANUALS},
    ),
    "stress_face_area": Variable(
        ("stress_face",),
        "m2",
        "area of the face",
        lambda c: np.array([face.area.sum() for face in c.sites.faces]),
        Case.has_stress_faces,
    ),
    "overstressed_area": Variable(
        ("stress_face", "dcr_level"),
        "m2",
        "area of the face that exceeds dcr_level times the tensile strength at some time",
        overstressed_areas,
        lambda c: c.has_stress_duration() and bool(c.sites.faces),
        {"references": _MANUALS},
    ),
    "stress": Variable(
        ("time", "stress_probe", "stress_component"),
        "Pa",
        "stress tensor, tension positive",
        lambda c: c.stress_summary.probes,
        Case.has_stress_probes,
    ),
    "principal_stress": Variable(
        ("time", "stress_probe", "principal"),
        "Pa",
        "principal stresses, major first, tension positive",
        lambda c: principal_stresses(c.stress_summary.probes),
        Case.has_stress_probes,
    ),
    "vertical_stress": Variable(
        ("time", "stress_probe"),
        "Pa",
        _NAMES["vertical"],
        lambda c: stress_along(c.stress_summary.probes, c.stress_summary.probe_axes[:, 0]),
        Case.has_stress_probes,
    ),
    "arch_stress": Variable(
        ("time", "stress_probe"),
        "Pa",
        _NAMES["arch"],
        lambda c: stress_along(c.stress_summary.probes, c.stress_summary.probe_axes[:, 1]),
        Case.has_stress_probes,
    ),
    **FACE_VARIABLES,
    **SECTION_VARIABLES,
}
