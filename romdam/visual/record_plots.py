"""A page of figures per ground motion: histories before and after correction, spectra."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from romdam.core.files import replacing
from romdam.core.motion import GroundMotion
from romdam.postprocess.record_curves import RecordCurves, record_curves, target_of
from romdam.postprocess.record_measures import PERIODS
from romdam.visual.style import COLOURS, GREY, STYLE, legend_below

Array = np.ndarray
AXES = ("x", "y", "z")
QUANTITIES = {"acc": "acceleration [m/s²]", "vel": "velocity [m/s]", "disp": "displacement [m]"}
Curves = tuple[RecordCurves, RecordCurves | None]  # of the motion, and before its correction


def plot_record(motion: GroundMotion, recorded: GroundMotion | None = None) -> Figure:
    """Draw acceleration, velocity and displacement of each shaken component, and its spectra.

    Parameters
    ----------
    motion : as the structure feels it, pads included
    recorded : before it was corrected or matched, drawn grey behind; None where neither was done
    """
    shaken = [i for i in range(3) if np.any(motion.acc[i] != 0.0)] or [0]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(max(5.6, 3.9 * len(shaken) + 0.4), 10.5), layout="constrained")
        panels = figure.subplots(5, len(shaken), squeeze=False, height_ratios=(1, 1, 1, 1.4, 1.4))
        for column, axis in enumerate(shaken):
            curves = record_curves(motion, axis), record_curves(recorded, axis) if recorded else None
            _histories(panels[:3, column], motion, curves, axis)
            if recorded is not None:
                _recorded(panels[:3, column], recorded, curves, _words(motion)[1])
            _response(panels[3, column], curves, motion)
            _fourier(panels[4, column], motion, curves)
        for row in panels:
            for ax in row[1:]:
                ax.set_ylabel("")
        _share_limits(panels)
        if recorded is not None:
            legend_below(figure, panels[0])
        figure.suptitle(_title(motion), fontsize=10)
    return figure


def write_record_plots(pairs: Iterable[tuple[GroundMotion, GroundMotion | None]], folder: Path) -> list[Path]:
    """Write one PNG per (motion, recorded) pair into `folder`, named after the record."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for motion, recorded in pairs:
        path = folder / f"{motion.name}.png"
        with mpl.rc_context(STYLE):
            figure = plot_record(motion, recorded)
            with replacing(path) as unfinished:
                figure.savefig(unfinished, format="png", dpi=130)
        paths.append(path)
    return paths


def _histories(panels: Array, motion: GroundMotion, curves: Curves, axis: int) -> None:
    after, before = curves
    start = _seconds(motion, "pad_before_s")  # pads lie at negative times: both histories start at 0
    label = _words(motion)[0] if before else None
    for ax, (quantity, unit) in zip(panels, QUANTITIES.items(), strict=True):
        values = getattr(after, quantity)
        ax.plot(after.time - start, values, color=COLOURS[0], lw=0.7, label=label)
        ax.axhline(0.0, color="black", lw=0.4, zorder=0)
        ax.set_ylabel(unit)
        peak = f"peak {np.abs(values).max():.3g}"
        ax.text(0.99, 0.97, peak, transform=ax.transAxes, ha="right", va="top", fontsize=8)
    for ax in panels[:2]:
        ax.tick_params(labelbottom=False)
    panels[0].set_title(f"component {AXES[axis]}")
    panels[2].set_xlabel("time [s]")
    _zoom_on_record(panels, motion)


def _recorded(panels: Array, recorded: GroundMotion, curves: Curves, label: str) -> None:
    """The histories before, behind those after."""
    after, before = curves
    assert before is not None
    start = _seconds(recorded, "pad_before_s")
    for ax, quantity in zip(panels, QUANTITIES, strict=True):
        values = getattr(before, quantity)
        ax.plot(before.time - start, values, color=GREY, lw=0.7, label=label, zorder=1)
        _keep_in_view(ax, getattr(after, quantity), values)


def _words(motion: GroundMotion) -> tuple[str, str]:
    """Words on a motion: what it is after what was done to it, and what it was before."""
    return ("matched", "scaled alone") if "matched" in target_of(motion) else ("corrected", "uncorrected")


def _seconds(motion: GroundMotion, name: str) -> float:
    value = motion.provenance.get(name, 0.0)
    return float(value) if isinstance(value, int | float) else 0.0


def _zoom_on_record(panels: Array, motion: GroundMotion) -> None:
    """Show the record and a part of its pads, which say how long they go on."""
    before, after = _seconds(motion, "pad_before_s"), _seconds(motion, "pad_after_s")
    length = motion.duration - before - after
    margin = 0.12 * length
    for ax in panels:
        ax.set_xlim(-min(before, margin) - 0.01 * length, length + min(after, margin) + 0.01 * length)
    if before + after > 0.0:
        text = f"pads of {before:.3g} s and {after:.3g} s at the ends"
        panels[2].text(0.99, 0.03, text, transform=panels[2].transAxes, ha="right", va="bottom", fontsize=7)


def _keep_in_view(ax: Axes, after: Array, before: Array) -> None:
    """A drift of metres must not flatten the corrected history: it may leave the panel."""
    limit = 1.25 * float(np.max(np.abs(after)))
    if limit > 0.0 and np.max(np.abs(before)) > 3.0 * limit:
        ax.set_ylim(-limit, limit)
        ax.text(
            0.01, 0.03, f"uncorrected reaches {np.max(np.abs(before)):.3g}", transform=ax.transAxes,
            va="bottom", fontsize=7, color="#666666",
        )  # fmt: skip


def _response(ax: Axes, curves: Curves, motion: GroundMotion) -> None:
    after, before = curves
    if before is not None:
        ax.loglog(PERIODS, before.psa[0.05], color=GREY, lw=0.9, label=f"5 %, {_words(motion)[1]}")
    if target := target_of(motion):
        label = f"target, {100 * target['damping']:g} %"
        ax.loglog(
            target["periods_s"], target["sa_m_s2"], color="black", lw=1.2, ls="--", label=label, zorder=3
        )
    for k, (damping, psa) in enumerate(after.psa.items()):
        ax.loglog(PERIODS, psa, color=COLOURS[k], lw=1.0, label=f"{100 * damping:g} %")
    ax.set_xlabel("period [s]")
    ax.set_ylabel("PSa [m/s²]")
    ax.set_xlim(PERIODS[0], PERIODS[-1])
    ax.legend(loc="lower left")


def _fourier(ax: Axes, motion: GroundMotion, curves: Curves) -> None:
    after, before = curves
    if before is not None:
        ax.loglog(before.freq, before.amplitude, color=GREY, lw=0.9, label=_words(motion)[1])
    ax.loglog(after.freq, after.amplitude, color=COLOURS[0], lw=0.9)
    for corner in _corners(motion):
        ax.axvline(corner, color=COLOURS[1], lw=0.8, ls="--")
        ax.text(corner, 0.98, f" {corner:.2g} Hz", transform=ax.get_xaxis_transform(), va="top", fontsize=7)
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("Fourier amplitude [m/s]")
    ax.set_ylim(bottom=1e-6 * ax.get_ylim()[1])


def _corners(motion: GroundMotion) -> list[float]:
    steps = motion.provenance.get("correction", [])
    filters = [s for s in steps if s.get("step") == "butterworth"] if isinstance(steps, list) else []
    return [s[key] for s in filters for key in ("highpass_hz", "lowpass_hz") if s.get(key)]


def _share_limits(panels: Array) -> None:
    """One scale for the components of a row, so that they can be compared by eye."""
    for row in panels:
        low, high = min(ax.get_ylim()[0] for ax in row), max(ax.get_ylim()[1] for ax in row)
        for ax in row:
            ax.set_ylim(low, high)


def _title(motion: GroundMotion) -> str:
    channels = motion.provenance.get("channels", [])
    first = channels[0] if isinstance(channels, list) and channels else {}
    about = [str(first.get(key, "")) for key in ("event", "station_name", "station")]
    words = ", ".join(dict.fromkeys(word for word in about if word))
    return f"{motion.name}: {words}" if words else motion.name
