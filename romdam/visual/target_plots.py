"""Spectra of the records that aim at one target, and their mean, beside it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, NullFormatter

from romdam.core.files import replacing
from romdam.core.motion import GroundMotion
from romdam.postprocess.record_curves import TargetCurves, target_curves
from romdam.visual.style import COLOURS, GREY, STYLE


def plot_target(curves: TargetCurves) -> Figure:
    """Draw every record's spectrum, their mean and the target; below, the mean over the target."""
    mean = curves.psa.mean(axis=0)
    share = mean / curves.sa
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(6.4, 6.4), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1))
        for i, psa in enumerate(curves.psa):
            above.loglog(
                curves.periods, psa, color=GREY, lw=0.7, label=None if i else f"{len(curves.psa)} records"
            )
        above.loglog(curves.periods, mean, color=COLOURS[0], lw=1.6, label="their mean")
        above.loglog(curves.periods, curves.sa, color="black", lw=1.6, ls="--", label="target")
        above.set_ylabel("PSa [m/s²]")
        for which in (above.yaxis.set_major_formatter, above.yaxis.set_minor_formatter):
            which(FormatStrFormatter("%g"))
        above.set_title(f"{curves.of}, {100 * curves.damping:g} % damping")
        above.legend()
        below.semilogx(curves.periods, share, color=COLOURS[0], lw=1.6)
        below.axhline(1.0, color="black", lw=1.0, ls="--")
        below.axhline(0.9, color="black", lw=0.6, ls=":")
        below.text(
            0.99, 0.04, f"{share.min():.2f} to {share.max():.2f}", transform=below.transAxes, ha="right"
        )
        below.set_ylabel("mean over target")
        below.set_xlabel("period [s]")
        below.set_xlim(curves.periods[0], curves.periods[-1])
        below.set_ylim(min(0.7, 0.95 * share.min()), max(1.3, 1.05 * share.max()))
        first, last = 0.999 * curves.periods[0], 1.001 * curves.periods[-1]
        ticks = [t for d in (0.01, 0.1, 1.0, 10.0) for t in (d, 2 * d, 5 * d) if first <= t <= last]
        below.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        below.xaxis.set_minor_formatter(NullFormatter())
    return figure


def write_target_plots(motions: Sequence[GroundMotion], folder: Path) -> list[Path]:
    """Write one PNG for each target that motions aim at; none where there is none."""
    paths = []
    for number, curves in enumerate(target_curves(motions), start=1):
        path = folder / f"target-{number}.png"
        with mpl.rc_context(STYLE), replacing(path) as unfinished:
            plot_target(curves).savefig(unfinished, format="png", dpi=130)
        paths.append(path)
    return paths
