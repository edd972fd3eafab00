"""Elements of zero thickness: other programs' joints, cohesive or contact, which are no solids."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.core.arrays import Bools, Floats, Ints
from romdam.geometry.elements import ELEMENT_OF_CELL
from romdam.geometry.meshes.data import EVERYTHING, MeshFile

_THIN = 1e-6  # thickness over the size of an element, below which it has none
_OPPOSITE = {  # corners of hexahedra and wedges -> pairs of opposite faces, corner by corner
    8: (
        ((0, 1, 2, 3), (4, 5, 6, 7)),
        ((0, 1, 5, 4), (3, 2, 6, 7)),
        ((0, 3, 7, 4), (1, 2, 6, 5)),
    ),
    6: (((0, 1, 2), (3, 4, 5)),),
}


def without_interfaces(file: MeshFile) -> MeshFile:
    """A mesh without solids whose opposite faces coincide, node by node; they are said to be left out."""
    flat: dict[int, Bools] = {
        k: thin_rows
        for k, cells in enumerate(file.cells)
        if cells.dim == 3
        and cells.kind in ELEMENT_OF_CELL
        and (thin_rows := _flat(file.points, cells.nodes[:, : ELEMENT_OF_CELL[cells.kind].corners])).any()
    }
    solids = sum(len(cells.ids) for cells in file.cells if cells.dim == 3)
    if sum(int(rows.sum()) for rows in flat.values()) in (0, solids):  # a flat mesh has no joints
        return file
    cells, kept = list(file.cells), {}
    for k, rows in flat.items():
        kept[k] = np.cumsum(~rows) - 1  # new row of each that stays
        cells[k] = replace(cells[k], nodes=cells[k].nodes[~rows], ids=cells[k].ids[~rows])
    groups, left_out = dict[str, list[Ints]](), dict(file.left_out)
    everything = [np.arange(len(of_kind.ids)) for of_kind in file.cells]
    for label, members in (file.groups | {EVERYTHING: everything}).items():
        thin = [
            f"{count} {file.cells[k].kind} of zero thickness"
            for k, rows in flat.items()
            if (count := int(rows[members[k]].sum()))
        ]
        if thin:
            left_out[label] = ", ".join([*([left_out[label]] if label in left_out else []), *thin])
        if label != EVERYTHING:
            groups[label] = [
                kept[k][of_kind[~flat[k][of_kind]]] if k in flat else of_kind
                for k, of_kind in enumerate(members)
            ]
    faults = []
    for fault in file.faults:
        faulty = fault.rows
        if fault.kind in flat:
            faulty = kept[fault.kind][faulty[~flat[fault.kind][faulty]]]
        if len(faulty):
            faults.append(replace(fault, rows=faulty))
    k = next(iter(flat))
    first = file.cells[k].ids[np.argmax(flat[k])]
    remark = (
        f"{sum(int(rows.sum()) for rows in flat.values())} solids have no thickness and are left out (the "
        f"first is element {first}, {file.cells[k].kind}): another program's joint between the faces that "
        "they lie on; give a joint there, `joints.touching` finds all"
    )
    return replace(
        file,
        cells=cells,
        groups=groups,
        left_out=left_out,
        faults=tuple(faults),
        remarks=(*file.remarks, remark),
    )


def _flat(points: Floats, corners: Ints) -> Bools:
    """True for hexahedra and wedges, by their corners, of which two opposite faces coincide."""
    flat = np.zeros(len(corners), dtype=bool)
    for first, second in _OPPOSITE.get(corners.shape[1], ()):
        low, high = corners[:, list(first)], corners[:, list(second)]
        apart = np.linalg.norm(points[high] - points[low], axis=2).max(axis=1)
        middle = points[low].mean(axis=1, keepdims=True)
        size = np.linalg.norm(points[low] - middle, axis=2).min(axis=1)  # no corner is at the middle
        with np.errstate(invalid="ignore"):  # of nodes that are not given
            flat |= (apart <= _THIN * size) & (low != high).all(axis=1) & (corners >= 0).all(axis=1)
    return flat
