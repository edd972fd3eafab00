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
            _histories(panels[:3, column], motion, recorded, curves)
            panels[0, column].set_title(f"component {AXES[axis]}")
            _spectra(panels[3, column], panels[4, column], motion, curves)
        for row in panels:
            for ax in row[1:]:
                ax.set_ylabel("")
            # the same scale for all components, so that they can be compared by eye
            low, high = min(ax.get_ylim()[0] for ax in row), max(ax.get_ylim()[1] for ax in row)
            for ax in row:
                ax.set_ylim(low, high)
        if recorded is not None:
            legend_below(figure, panels[0])
        channels = motion.provenance.get("channels", [])
        first = channels[0] if isinstance(channels, list) and channels else {}
        labels = [str(first.get(key, "")) for key in ("event", "station_name", "station")]
        words = ", ".join(dict.fromkeys(label for label in labels if label))
        figure.suptitle(f"{motion.name}: {words}" if words else motion.name, fontsize=10)
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


def _histories(panels: Array, motion: GroundMotion, recorded: GroundMotion | None, curves: Curves) -> None:
    """Draw the histories of a component after correction, and grey behind them those before.

    Pads lie at negative times, so both histories start at 0. A part of the pads is shown, and a text says how
    long they go on.
    """
    after, before = curves
    pad_before, pad_after = _seconds(motion, "pad_before_s"), _seconds(motion, "pad_after_s")
    for ax, (quantity, unit) in zip(panels, QUANTITIES.items(), strict=True):
        values = getattr(after, quantity)
        largest = float(np.max(np.abs(values)))
        label = _words(motion)[0] if before else None
        ax.plot(after.time - pad_before, values, color=COLOURS[0], lw=0.7, label=label)
        ax.axhline(0.0, color="black", lw=0.4, zorder=0)
        ax.set_ylabel(unit)
        ax.text(0.99, 0.97, f"peak {largest:.3g}", transform=ax.transAxes, ha="right", va="top", fontsize=8)
        if before is None or recorded is None:
            continue
        behind, start = getattr(before, quantity), _seconds(recorded, "pad_before_s")
        ax.plot(before.time - start, behind, color=GREY, lw=0.7, label=_words(motion)[1], zorder=1)
        # a drift of metres must not flatten the corrected history: it may leave the panel
        limit = 1.25 * largest
        if limit > 0.0 and np.max(np.abs(behind)) > 3.0 * limit:
            ax.set_ylim(-limit, limit)
            ax.text(
                0.01, 0.03, f"uncorrected reaches {np.max(np.abs(behind)):.3g}", transform=ax.transAxes,
                va="bottom", fontsize=7, color="#666666",
            )  # fmt: skip
    for ax in panels[:2]:
        ax.tick_params(labelbottom=False)
    panels[2].set_xlabel("time [s]")
    length = motion.duration - pad_before - pad_after
    margin = 0.12 * length
    for ax in panels:
        ax.set_xlim(-min(pad_before, margin) - 0.01 * length, length + min(pad_after, margin) + 0.01 * length)
    if pad_before + pad_after > 0.0:
        text = f"pads of {pad_before:.3g} s and {pad_after:.3g} s at the ends"
        panels[2].text(0.99, 0.03, text, transform=panels[2].transAxes, ha="right", va="bottom", fontsize=7)


def _spectra(response: Axes, fourier: Axes, motion: GroundMotion, curves: Curves) -> None:
    """Draw the response spectra of a component, and its Fourier spectrum with the corners of filters."""
    after, before = curves
    if before is not None:
        label = _words(motion)[1]
        response.loglog(PERIODS, before.psa[0.05], color=GREY, lw=0.9, label=f"5 %, {label}")
        fourier.loglog(before.freq, before.amplitude, color=GREY, lw=0.9, label=label)
    if target := target_of(motion):
        label = f"target, {100 * target['damping']:g} %"
        response.loglog(
            target["periods_s"], target["sa_m_s2"], color="black", lw=1.2, ls="--", label=label, zorder=3
        )
    for k, (damping, psa) in enumerate(after.psa.items()):
        response.loglog(PERIODS, psa, color=COLOURS[k], lw=1.0, label=f"{100 * damping:g} %")
    response.set_xlabel("period [s]")
    response.set_ylabel("PSa [m/s²]")
    response.set_xlim(PERIODS[0], PERIODS[-1])
    response.legend(loc="lower left")

    fourier.loglog(after.freq, after.amplitude, color=COLOURS[0], lw=0.9)
    steps = motion.provenance.get("correction", [])
    filters = [step for step in steps if step.get("step") == "butterworth"] if isinstance(steps, list) else []
    for corner in [each[key] for each in filters for key in ("highpass_hz", "lowpass_hz") if each.get(key)]:
        fourier.axvline(corner, color=COLOURS[1], lw=0.8, ls="--")
        fourier.text(
            corner, 0.98, f" {corner:.2g} Hz", transform=fourier.get_xaxis_transform(), va="top", fontsize=7
        )
    fourier.set_xlabel("frequency [Hz]")
    fourier.set_ylabel("Fourier amplitude [m/s]")
    fourier.set_ylim(bottom=1e-6 * fourier.get_ylim()[1])


def _words(motion: GroundMotion) -> tuple[str, str]:
    """Words on a motion: what it is after what was done to it, and what it was before."""
    return ("matched", "scaled alone") if "matched" in target_of(motion) else ("corrected", "uncorrected")


def _seconds(motion: GroundMotion, name: str) -> float:
    value = motion.provenance.get(name, 0.0)
    return float(value) if isinstance(value, int | float) else 0.0
