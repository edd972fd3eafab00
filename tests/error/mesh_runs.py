"""Runs on meshes, as they are compared, from histories that a test makes up."""

import numpy as np

from romdam.core.system import SLIP
from romdam.error.discretisation import MeshRun, mesh_histories


def mesh_run(history, position, area, joints, unknowns, *, nodes=(), spectrum=0.0, **more) -> MeshRun:
    """A run of a history with time, jump, forces and, of nodes, motions; `more` are fields of `MeshRun`."""
    spectra = spectrum * np.ones((3 * len(nodes), 4))
    histories = mesh_histories(history, joints, area, nodes, spectra)
    slides = getattr(history, "state", np.zeros((0, 0))) == SLIP
    return MeshRun(
        history.time, history.jump, position, joints, nodes, histories,
        area=area, slides=slides, unknowns=unknowns, **more,
    )  # fmt: skip
