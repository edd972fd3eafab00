"""The variables of whole faces in a result file: percentiles by area, demand and acceptance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.core.scene import MOST_RING
from romdam.postprocess.stress.faces import (
    BASES,
    CRITERIA,
    HEADLINE,
    LIMITS,
    MET,
    MISSED,
    NOT_JUDGED,
    PERCENTILES,
    UNDECIDED,
    FaceDemand,
    area_percentiles,
    face_demand,
)
from romdam.postprocess.stress.summary import DCR_LEVELS, MEASURES
from romdam.results.case import Array, Case, Variable

_MANUAL = "USACE EM 1110-2-6053 (2007); Ghanaat, 13WCEE (2004) 1115"
_TEXTS = {
    "principal": "major principal stress",
    "vertical": "cantilever stress",
    "arch": "arch stress",
}


# Conditions that are not those of `Case`: files of romdam 0.1 have stress without these variables.


def _of_nodes(case: Case) -> bool:
    return case.stress is not None


def of_faces(case: Case) -> bool:
    """Tell whether stress was computed on whole faces."""
    return case.has_stress_faces()


def _with_strength(case: Case) -> bool:
    return case.stress is not None and case.stress.change is not None


def _of_faces_with_strength(case: Case) -> bool:
    return of_faces(case) and _with_strength(case)


def _outside_ring(case: Case) -> list[tuple[Array, Array]]:
    """For each face, the rows of its nodes outside the ring among all stress nodes, and their areas [m2]."""
    first, count = dict[str, int](), 0
    for name, nodes in case.sites.blocks.items():
        first[name], count = count, count + len(nodes.nodes)
    chosen = []
    for face in case.sites.faces:
        counted = case.sites.blocks[face.block].counted[face.rows]
        chosen.append((first[face.block] + face.rows[counted], face.area[counted]))
    return chosen


def _percentiles(get: Callable[[Case], Array]) -> Callable[[Case], Array]:
    def of_case(case: Case) -> Array:
        values = get(case)
        return np.array(
            [area_percentiles(values[rows], area, PERCENTILES) for rows, area in _outside_ring(case)]
        )

    return of_case


def of_measure(table: str, measure: str) -> Callable[[Case], Array]:
    """Return what takes the values of a measure of stress from a table of the summary of a case."""
    return lambda case: np.asarray(getattr(case.stress_summary, table)[measure])


def headline_stress(case: Case) -> Array:
    """Stress that `HEADLINE` % of all faces' area, outside the ring, do not exceed, (measures,) [Pa]."""
    rows, area = (np.concatenate(arrays) for arrays in zip(*_outside_ring(case), strict=True))
    percent, largest = np.array([HEADLINE]), case.stress_summary.largest
    return np.array([area_percentiles(largest[m][rows], area, percent)[0] for m in MEASURES])


def _demands(case: Case) -> list[list[FaceDemand]]:
    """Compute for each face the demand of the total stress and that of its change."""
    sites, stress = case.sites, case.stress_summary
    assert stress.change is not None and stress.duration is not None
    assert stress.duration_of_change is not None and sites.strength is not None
    ratios = (stress.largest["principal"] / sites.strength, stress.change / sites.strength)
    both = tuple(zip(ratios, (stress.duration, stress.duration_of_change), strict=True))
    return [
        [face_demand(ratio[rows], duration[rows], area, DCR_LEVELS) for ratio, duration in both]
        for rows, area in _outside_ring(case)
    ]


def _demand(name: str) -> Callable[[Case], Array]:
    return lambda case: np.array(
        [[getattr(demand, name) for demand in demands] for demands in _demands(case)]
    )


def _accepted(case: Case) -> Array:
    """(faces, bases, kinds, criteria) whether each is met; where little of a face is judged nothing is."""
    kinds = LIMITS.values()
    met = [
        [[demand.judged(DCR_LEVELS, k) for k in kinds] for demand in demands] for demands in _demands(case)
    ]
    values = np.array(met, dtype=np.int8)
    mostly = case.sites.ring_shares > MOST_RING
    values[mostly] = np.where(values[mostly] == MET, UNDECIDED, values[mostly])
    return values


def _peak_position(case: Case) -> Array:
    """(faces, 3) where the envelope is largest outside the ring; NaN where the ring covers the face [m]."""
    values, blocks = case.stress_summary.largest["principal"], case.scene.blocks
    points = np.concatenate([blocks[name].points[nodes.nodes] for name, nodes in case.sites.blocks.items()])
    return np.array(
        [
            points[rows[values[rows].argmax()]] if len(rows) else np.full(3, np.nan)
            for rows, _ in _outside_ring(case)
        ]
    )


def peak_shares(case: Case) -> dict[str, float]:
    """Face -> share of the node with its largest stress in the area outside the ring [%]."""
    values = case.stress_summary.largest["principal"]
    return {
        face.name: 100.0 * float(area[values[rows].argmax()] / area.sum())
        for face, (rows, area) in zip(case.sites.faces, _outside_ring(case), strict=True)
        if area.sum() > 0.0
    }


def _start_share(case: Case) -> Array:
    sites, values = case.sites, case.stress_summary.at_start
    assert sites.strength is not None
    over = [(area @ (values[rows] > sites.strength), area.sum()) for rows, area in _outside_ring(case)]
    return np.array([100.0 * above / whole if whole else np.nan for above, whole in over])


def _face_stresses() -> dict[str, Variable]:
    stresses = {}
    for m in MEASURES:
        for table, name, when in (
            ("largest", f"face_{m}_stress", f"largest {_TEXTS[m]} over time"),
            ("at_worst", f"face_worst_{m}_stress", f"{_TEXTS[m]} at worst_{m}_time"),
        ):
            text = f"{when}, not exceeded on area_percentile of the face outside the ring"
            dims = ("stress_face", "area_percentile")
            stresses[name] = Variable(dims, "Pa", text, _percentiles(of_measure(table, m)), of_faces)
    return stresses


FACE_COORDINATES: dict[str, Variable] = {
    "area_percentile": Variable(
        ("area_percentile",), "%", "share of a face's area outside the ring", lambda c: PERCENTILES, of_faces
    ),
    "stress_basis": Variable(
        ("stress_basis",),
        "",
        "stress with that of the loads at rest, or what is more than at the first time",
        lambda c: np.array(BASES),
        _of_faces_with_strength,
    ),
    "dam_kind": Variable(
        ("dam_kind",),
        "",
        "kind of dam that limits are for",
        lambda c: np.array(list(LIMITS)),
        _of_faces_with_strength,
    ),
    "criterion": Variable(
        ("criterion",), "", "what is limited", lambda c: np.array(CRITERIA), _of_faces_with_strength
    ),
}

FACE_VARIABLES: dict[str, Variable] = {
    "stress_ring": Variable(
        ("stress_node",),
        "1",
        "whether the node lies in the ring, where stress is that of the mesh and headlines leave it out",
        lambda c: np.concatenate([~nodes.counted for nodes in c.sites.blocks.values()]).astype(np.int8),
        _of_nodes,
        {"flag_values": np.array([0, 1], dtype=np.int8), "flag_meanings": "counted left_out"},
    ),
    "start_principal_stress": Variable(
        ("stress_node",),
        "Pa",
        "major principal stress at the first time, of the loads at rest where it starts from them",
        lambda c: c.stress_summary.at_start,
        _of_nodes,
    ),
    "ring_share": Variable(
        ("stress_face",),
        "%",
        "share of the face's area that the ring leaves out",
        lambda c: 100.0 * c.sites.ring_shares,
        of_faces,
    ),
    **_face_stresses(),
    "face_start_principal_stress": Variable(
        ("stress_face", "area_percentile"),
        "Pa",
        "start_principal_stress, not exceeded on area_percentile of the face outside the ring",
        _percentiles(lambda c: c.stress_summary.at_start),
        of_faces,
    ),
    "face_peak_position": Variable(
        ("stress_face", "component"),
        "m",
        "where the major principal stress is largest on the face outside the ring",
        _peak_position,
        of_faces,
    ),
    "face_start_overstressed_share": Variable(
        ("stress_face",),
        "%",
        "share of the area outside the ring where start_principal_stress is above the tensile strength",
        _start_share,
        _of_faces_with_strength,
    ),
    "change_demand_capacity_ratio": Variable(
        ("stress_node",),
        "1",
        "largest major principal stress of what is more than at the first time, over the tensile strength",
        lambda c: np.asarray(c.stress_summary.change) / np.asarray(c.sites.strength),
        _with_strength,
    ),
    "change_inelastic_duration": Variable(
        ("stress_node", "dcr_level"),
        "s",
        "total duration of the major principal stress of what is more than at the first time, above "
        "dcr_level times the tensile strength",
        lambda c: np.asarray(c.stress_summary.duration_of_change),
        _with_strength,
    ),
    "face_demand_capacity_ratio": Variable(
        ("stress_face", "stress_basis"),
        "1",
        "largest demand-capacity ratio outside the ring",
        _demand("ratio"),
        _of_faces_with_strength,
        {"references": _MANUAL},
    ),
    "face_inelastic_duration": Variable(
        ("stress_face", "stress_basis", "dcr_level"),
        "s",
        "longest cumulative inelastic duration at any node outside the ring",
        _demand("duration"),
        _of_faces_with_strength,
        {"references": _MANUAL},
    ),
    "face_overstressed_share": Variable(
        ("stress_face", "stress_basis", "dcr_level"),
        "%",
        "share of the area outside the ring that exceeds dcr_level times the strength at some time",
        _demand("share"),
        _of_faces_with_strength,
        {"references": _MANUAL},
    ),
    "acceptance": Variable(
        ("stress_face", "stress_basis", "dam_kind", "criterion"),
        "1",
        "whether the face meets the criterion of linear analysis; undecided where it does outside a "
        "ring that leaves out most of its area",
        _accepted,
        _of_faces_with_strength,
        {
            "references": _MANUAL,
            "flag_values": np.array([NOT_JUDGED, UNDECIDED, MISSED, MET], dtype=np.int8),
            "flag_meanings": "not_judged undecided missed met",
            "limits": "; ".join(f"{kind}: {limits}" for kind, limits in LIMITS.items()),
        },
    ),
}
