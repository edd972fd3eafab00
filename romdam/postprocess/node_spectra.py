"""Response spectra of the absolute acceleration of output nodes."""

from __future__ import annotations

import numpy as np

from romdam.core.arrays import Floats
from romdam.records.spectra import pseudo_acceleration

PERIODS = np.geomspace(0.05, 2.0, 60)  # [s]


def node_spectra(acc: Floats, ground: Floats, time: Floats) -> Floats:
    """Pseudo-acceleration (3 nodes, periods) of every component, 5 % damping [m/s2].

    Parameters
    ----------
    acc : (nt, 3 nodes) acceleration relative to the base [m/s2]
    ground : (nt, 3) of the base [m/s2]
    time : (nt,) [s]
    """
    interval, absolute = float(time[1] - time[0]), acc + np.tile(ground, (1, acc.shape[1] // 3))
    spectra = [pseudo_acceleration(history, interval, PERIODS) for history in absolute.T]
    return np.array(spectra).reshape(-1, len(PERIODS))
