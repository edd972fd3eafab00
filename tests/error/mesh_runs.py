"""Runs on meshes, as they are compared, from histories that a test makes up."""

from typing import Any

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.system import SLIP
from romdam.error.discretisation import MeshRun, mesh_histories


def mesh_run(
    history: Any,
    position: Floats,
    area: Floats,
    joints: dict[str, slice],
    unknowns: int,
    *,
    nodes: tuple[str, ...] = (),
    spectrum: float = 0.0,
    **more: Any,
) -> MeshRun:
    """A run of a history with time, jump, forces and, of nodes, motions; `more` are fields of `MeshRun`."""
    spectra = spectrum * np.ones((3 * len(nodes), 4))
    histories = mesh_histories(history, joints, area, nodes, spectra)
    slides = getattr(history, "state", np.zeros((0, 0))) == SLIP
    return MeshRun(
        history.time, history.jump, position, joints, nodes, histories,
        area=area, slides=slides, unknowns=unknowns, **more,
    )  # fmt: skip
