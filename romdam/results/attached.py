"""Variables of what is attached to blocks: the forces of each effect that records them, such as anchors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from romdam.config.effects import EFFECTS
from romdam.core.arrays import Ints
from romdam.core.attachment import Attachment
from romdam.core.scene import Scene
from romdam.results.case import Array, Case, Variable


def _bearing(scene: Scene, effect: str) -> tuple[Ints, list[str]]:
    """Columns of `History.attached` of an effect, and the names of what each belongs to."""
    names = [
        (one.effect, one.name if len(one) == 1 else f"{one.name} {k + 1}")
        for one in scene.every(Attachment)
        if one.bears
        for k in range(len(one))
    ]
    some = [k for k, (of, _) in enumerate(names) if of == effect]
    return np.array(some, dtype=np.int64), [names[k][1] for k in some]


def attached_names(scene: Scene) -> dict[str, list[str]]:
    """Dimension over which forces are written -> names of what bears them, of the effects of a scene."""
    names = {entry.records: _bearing(scene, effect)[1] for effect, entry in EFFECTS.items() if entry.records}
    return {dim: some for dim, some in names.items() if some}


def _has(effect: str) -> Callable[[Case], bool]:
    return lambda case: bool(len(_bearing(case.scene, effect)[0]))


def _peak(effect: str, row: int) -> Callable[[Case], Array]:
    return lambda case: case.history.attached_peaks[row][_bearing(case.scene, effect)[0]]


def force_variables(effect: str, dim: str) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """The coordinate and the variables of the forces of an effect, over a dimension."""
    has, what = _has(effect), f"force of the {dim}, tension positive"
    coordinate = Variable(
        (dim,),
        "",
        f"name of the {dim}",
        lambda case: np.array(_bearing(case.scene, effect)[1], dtype=str),
        has,
    )
    force = Variable(
        ("time", dim),
        "N",
        what,
        lambda case: case.history.attached[:, _bearing(case.scene, effect)[0]],
        has,
    )
    over = "over all base steps; of dashpots over the written rows"
    peaks = {
        f"{dim}_force_{name}": Variable((dim,), "N", f"{name} {what}, {over}", _peak(effect, row), has)
        for row, name in enumerate(("least", "largest"))
    }
    return {dim: coordinate}, {f"{dim}_force": force} | peaks


_MADE = [force_variables(name, entry.records) for name, entry in EFFECTS.items() if entry.records]
ATTACHED_COORDINATES: dict[str, Variable] = {k: v for made, _ in _MADE for k, v in made.items()}
ATTACHED_VARIABLES: dict[str, Variable] = {k: v for _, made in _MADE for k, v in made.items()}


def attached_warnings(case: Case) -> list[str]:
    """Say where a force leaves the limits of what it is of, a sentence for each."""
    sentences, scene, first = [], case.scene, 0
    least, largest = case.history.attached_peaks
    for one in scene.every(Attachment):
        if not one.bears:
            continue
        rows = slice(first, first := first + len(one))
        low, high = float(least[rows].min()), float(largest[rows].max())
        if low < one.limits[0]:
            sentences.append(
                f"{one.key} goes slack: its force falls to {low / 1e3:.4g} kN, limit {one.limits[0] / 1e3:g} "
                "kN; the run goes on as if it could push"
            )
        if high > one.limits[1]:
            sentences.append(
                f"{one.key} is loaded above its strength: its force reaches {high / 1e3:.4g} kN, limit "
                f"{one.limits[1] / 1e3:.4g} kN; the run goes on as if it stayed elastic"
            )
    return sentences
