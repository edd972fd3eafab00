"""The stress variables of a result file; `romdam.results.variables` takes them in.

Tension is positive. Envelopes and durations are over the written times (`outputs.output_interval`).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.core.scene import StressSites
from romdam.postprocess.stress.summary import (
    COMPONENTS,
    DCR_LEVELS,
    MEASURES,
    StressSummary,
    principal_stresses,
    stress_along,
)
from romdam.results.case import Array, Case, Variable
from romdam.results.stress.faces import FACE_COORDINATES, FACE_VARIABLES
from romdam.results.stress.sections import SECTION_COORDINATES, SECTION_VARIABLES

_NODE = ("stress_node",)
_NAMES = {
    "principal": "major principal stress",
    "vertical": "cantilever stress (up along the face on stress faces, else vertical)",
    "arch": "arch stress (along the horizontal tangent)",
}
_MANUALS = "USACE EM 1110-2-6051 (2003), EM 1110-2-6053 (2007)"


def _has(case: Case) -> bool:
    return case.stress is not None


def _has_strength(case: Case) -> bool:
    return case.stress is not None and case.stress.duration is not None


def _has_faces(case: Case) -> bool:
    return _has_strength(case) and bool(_sites(case).faces)


def _any_faces(case: Case) -> bool:
    return case.stress is not None and bool(_sites(case).faces)


def _has_probes(case: Case) -> bool:
    return case.stress is not None and bool(_sites(case).probes)


def _sites(case: Case) -> StressSites:
    assert case.scene.stress is not None
    return case.scene.stress


def _found(case: Case) -> StressSummary:
    assert case.stress is not None
    return case.stress


def _strength(case: Case) -> float:
    strength = _sites(case).strength
    assert strength is not None
    return strength


def _of_nodes(get: Callable[[Case, str], Array]) -> Callable[[Case], Array]:
    """Join what `get` gives for every block's stress nodes, one block after another."""
    return lambda case: np.concatenate([get(case, name) for name in _sites(case).blocks])


def _axis(name: str) -> Callable[[Case], Array]:
    return _of_nodes(lambda case, block: np.asarray(getattr(_sites(case).blocks[block], name)))


def _node_blocks(case: Case, block: str) -> Array:
    return np.full(len(_sites(case).blocks[block].nodes), block)


def _positions(case: Case, block: str) -> Array:
    return case.scene.blocks[block].points[_sites(case).blocks[block].nodes]


def _measure(table: str, measure: str) -> Callable[[Case], Array]:
    return lambda case: np.asarray(getattr(_found(case), table)[measure])


def _ratio(case: Case) -> Array:
    return np.asarray(_found(case).largest["principal"] / _strength(case))


def overstressed_areas(case: Case) -> Array:
    """Area of every stress face whose nodes exceed each of DCR_LEVELS at some time, (faces, levels) [m2]."""
    sites, ratio = _sites(case), _ratio(case)
    first = dict(zip(sites.blocks, _starts(sites), strict=True))
    areas = [face.area @ (ratio[first[face.block] + face.rows][:, None] > DCR_LEVELS) for face in sites.faces]
    return np.array(areas, dtype=float).reshape(-1, len(DCR_LEVELS))


def _starts(sites: StressSites) -> list[int]:
    counts = [len(nodes.nodes) for nodes in sites.blocks.values()]
    return [0, *np.cumsum(counts)[:-1].tolist()]


def _face_areas(case: Case) -> Array:
    return np.array([face.area.sum() for face in _sites(case).faces])


def _along(which: int) -> Callable[[Case], Array]:
    return lambda case: stress_along(_found(case).probes, _found(case).probe_axes[:, which])


def _envelopes() -> dict[str, Variable]:
    envelopes = {}
    for name in MEASURES:
        text = _NAMES[name]
        low = text.replace("major", "minor")
        envelopes[f"max_{name}_stress"] = Variable(
            _NODE, "Pa", f"largest {text} over time", _measure("largest", name), _has
        )
        envelopes[f"min_{name}_stress"] = Variable(
            _NODE, "Pa", f"smallest {low} over time", _measure("smallest", name), _has
        )
        envelopes[f"max_{name}_stress_time"] = Variable(
            _NODE, "s", f"time of the largest {text}", _measure("time_of_largest", name), _has
        )
        envelopes[f"worst_{name}_stress"] = Variable(
            _NODE, "Pa", f"{text} at worst_{name}_time", _measure("at_worst", name), _has
        )
        envelopes[f"worst_{name}_time"] = Variable(
            (),
            "s",
            f"time at which the {text} is largest anywhere outside the ring",
            _measure("worst_time", name),
            _has,
        )
    return envelopes


STRESS_COORDINATES: dict[str, Variable] = {
    "stress_block": Variable(_NODE, "", "block of the stress node", _of_nodes(_node_blocks), _has),
    "stress_node_number": Variable(_NODE, "1", "node number in its block", _axis("nodes"), _has),
    "stress_position": Variable(
        ("stress_node", "component"), "m", "position of the stress node", _of_nodes(_positions), _has
    ),
    "stress_up": Variable(("stress_node", "component"), "1", "cantilever direction", _axis("up"), _has),
    "stress_arch": Variable(("stress_node", "component"), "1", "arch direction", _axis("arch"), _has),
    "stress_component": Variable(
        ("stress_component",),
        "",
        "component of the stress tensor",
        lambda c: np.array(COMPONENTS),
        _has,
    ),
    "dcr_level": Variable(("dcr_level",), "1", "demand-capacity ratio", lambda c: DCR_LEVELS, _has_strength),
    "stress_face": Variable(
        ("stress_face",),
        "",
        "name of the face",
        lambda c: np.array([face.name for face in _sites(c).faces], dtype=str),
        _any_faces,
    ),
    "stress_probe": Variable(
        ("stress_probe",),
        "",
        "name of the node with stress histories",
        lambda c: np.array(list(_sites(c).probes), dtype=str),
        _has_probes,
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
        lambda c: _found(c).tensor,
        _has,
    ),
    "tensile_strength": Variable(
        (), "Pa", "tensile strength", lambda c: np.asarray(_strength(c)), _has_strength
    ),
    "demand_capacity_ratio": Variable(
        _NODE,
        "1",
        "largest major principal stress over the tensile strength",
        _ratio,
        _has_strength,
        {"references": _MANUALS},
    ),
    "cumulative_inelastic_duration": Variable(
        ("stress_node", "dcr_level"),
        "s",
        "total duration of the major principal stress above dcr_level times the tensile strength",
        lambda c: np.asarray(_found(c).duration),
        _has_strength,
        {"references": _MANUALS},
    ),
    "stress_face_area": Variable(("stress_face",), "m2", "area of the face", _face_areas, _any_faces),
    "overstressed_area": Variable(
        ("stress_face", "dcr_level"),
        "m2",
        "area of the face that exceeds dcr_level times the tensile strength at some time",
        overstressed_areas,
        _has_faces,
        {"references": _MANUALS},
    ),
    "stress": Variable(
        ("time", "stress_probe", "stress_component"),
        "Pa",
        "stress tensor, tension positive",
        lambda c: _found(c).probes,
        _has_probes,
    ),
    "principal_stress": Variable(
        ("time", "stress_probe", "principal"),
        "Pa",
        "principal stresses, major first, tension positive",
        lambda c: principal_stresses(_found(c).probes),
        _has_probes,
    ),
    "vertical_stress": Variable(("time", "stress_probe"), "Pa", _NAMES["vertical"], _along(0), _has_probes),
    "arch_stress": Variable(("time", "stress_probe"), "Pa", _NAMES["arch"], _along(1), _has_probes),
    **FACE_VARIABLES,
    **SECTION_VARIABLES,
}
