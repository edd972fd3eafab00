"""Response spectra of the absolute acceleration of output nodes, by which meshes are compared."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.system import History, StepMotion
from romdam.postprocess.floor_spectra import SUBSTEPS, absolute_acceleration
from romdam.records.spectra import pseudo_acceleration

PERIODS = np.geomspace(0.05, 2.0, 60)  # [s]


def node_spectra(history: History, nodes: int) -> Floats:
    """Pseudo-acceleration (3 nodes, periods) of every component, 5 % damping [m/s2].

    Between the written rows the acceleration is as `romdam.postprocess.floor_spectra` has it: samples of it
    say nothing of impacts.

    Parameters
    ----------
    nodes : number of output nodes, the first in the history
    """
    if not nodes:
        return np.zeros((0, len(PERIODS)))
    dt = float(history.time[1] - history.time[0])
    motion = StepMotion(dt, history.acc, history.vel, history.ground)
    absolute = absolute_acceleration(motion, np.arange(3 * nodes))
    return np.array([pseudo_acceleration(row, dt / SUBSTEPS, PERIODS)[0] for row in absolute.T])
