"""What a correction did to the motion: said where it is much, refused where most of the motion is gone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from romdam.core.errors import RecordError
from romdam.records.measures import measure
from romdam.records.processing.offset import moving_average

Array = NDArray[np.float64]
SAID = 0.1  # change of a measure
LEFT = 0.5  # of a measure, at least
NOISE = 0.01  # of the strongest component's peak; a weaker component is not judged by itself
COMPARED = {"pga": ("PGA", "m/s2"), "pgv": ("PGV", "m/s"), "arias": ("Arias intensity", "m/s")}


def changed_measures(before: Array, after: Array, dt: float, names: Sequence[str]) -> tuple[str, ...]:
    """Say where a correction changes PGA, PGV or Arias intensity by more than `SAID`.

    Parameters
    ----------
    before : (k, nt) [m/s2]
    after : (k, nt with pads) [m/s2]
    names : of the components, k
    """
    had, has = measure(before, dt), measure(after, dt)
    judged = had["pga"] > 1e-9 * np.max(had["pga"], initial=0.0)  # else what rotation leaves of nothing
    said = []
    for row in np.flatnonzero(judged).tolist():
        changes = [
            f"{text} from {had[name][row]:.3g} to {has[name][row]:.3g} {unit} "
            f"({100 * (has[name][row] / had[name][row] - 1.0):+.0f} %)"
            for name, (text, unit) in COMPARED.items()
            if abs(has[name][row] - had[name][row]) > SAID * had[name][row]
        ]
        if changes:
            said.append(f"the correction changes, along {names[row]}, {', '.join(changes)}")
    return tuple(said)


def refuse_lost_motion(before: Array, after: Array, dt: float, names: Sequence[str]) -> None:
    """Refuse a correction that leaves less than `LEFT` of PGA, PGV or Arias intensity.

    Drift is no motion: both are compared without their average over some seconds.

    Parameters
    ----------
    before, after, names : as of `changed_measures`

    Raises
    ------
    RecordError
        naming component and measure.
    """
    had, has = (measure(acc - moving_average(acc, dt), dt) for acc in (before, after))
    judged = had["pga"] > NOISE * np.max(had["pga"], initial=0.0)
    for name, (text, unit) in COMPARED.items():
        for row in np.flatnonzero(judged & (has[name] < LEFT * had[name])).tolist():
            raise RecordError(
                f"correction: it leaves {100 * has[name][row] / had[name][row]:.0f} % of the {text} of "
                f"{names[row]} ({had[name][row]:.3g} to {has[name][row]:.3g} {unit}), at least "
                f"{100 * LEFT:g} % must stay; lower the high-pass, raise the low-pass, or take another chain"
            )
