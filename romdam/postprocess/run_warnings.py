"""Warnings that follow from the figures of a run, in sentences for the terminal and the file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import OPEN, History
from romdam.postprocess.stated_errors import percent
from romdam.records.processing.sequence import members_of

if TYPE_CHECKING:
    from romdam.config.sections.joint_water import JointWaterConfig

_MASS = 0.1  # of the effective mass, in modes that do not follow the ground, from which on a run is in doubt
_ROUGH = 0.05  # time-stepping error of a step that was given, from which on it is worth a word
_MOVES = 0.01  # of the largest speed, from which on a dam is not at rest
_FAR = 0.05  # of the root of a joint's area: a gap that moves farther counts as far from where it started
_ON_TIME = 1e-9  # round-off of a time [s]
COUNTED = ("the energy ledger is open", "the time-stepping error is about")  # what a suite counts itself
LEDGER_LIMIT = 1e-3  # of the largest energy exchanged; round-off is below 1e-9


def run_warnings(stats: Mapping[str, float]) -> list[str]:
    """Write a sentence for every figure of a run that is beyond its limit.

    Parameters
    ----------
    stats : of `romdam.core.system.History`
    """
    sentences = []
    if not stats.get("ledger_imbalance", 0.0) <= LEDGER_LIMIT:
        sentences.append(
            f"the energy ledger is open by {percent(stats['ledger_imbalance'])} of the energy exchanged, "
            f"limit {100 * LEDGER_LIMIT:g} %: the run is not to be trusted; try a finer "
            "transient.finest_step, or integrator adaptive"
        )
    reached = stats.get("estimated_time_error", math.inf)
    if "accuracy" in stats and not math.isfinite(reached):
        sentences.append(
            f"the time-stepping error is not known, wanted was {100 * stats['accuracy']:g} %: steps other "
            f"than {stats['finest_step']:.3g} s did not converge; give transient.finest_step instead"
        )
    elif "accuracy" in stats and not reached <= stats["accuracy"]:
        sentences.append(
            f"the time-stepping error is about {percent(reached)}, wanted was "
            f"{100 * stats['accuracy']:g} %: not reached at the finest step allowed, "
            f"{stats['finest_step']:.3g} s; state the error, or give transient.finest_step a finer step"
        )
    for name in ("slips", "residual_slips"):
        wanted, found = stats.get(f"accuracy_{name}"), stats.get(f"estimated_time_error_{name}")
        if wanted is not None and found is not None and not found <= wanted:
            sentences.append(
                f"the steps change the {name.replace('_', ' ')} by about {percent(found)}, wanted was "
                f"{100 * wanted:g} %: not reached at the finest step allowed, {stats['finest_step']:.3g} s"
            )
    if not stats.get("quasi_static_mass", 0.0) <= _MASS:
        sentences.append(
            f"modes with {stats['quasi_static_mass']:.0%} of the effective mass follow joint forces alone, "
            f"not the ground: displacements are too small; take a transient.finest_step below "
            f"{stats['finest_step']:.3g} s, or the integrator modal"
        )
    if "accuracy" not in stats and not stats.get("estimated_time_error", 0.0) <= _ROUGH:
        sentences.append(
            f"the steps change the openings by about {percent(stats['estimated_time_error'])} in L2, as "
            f"other steps show: take a finer transient.finest_step than {stats['finest_step']:.3g} s, or "
            "transient.accuracy; if a finer step does not help, the history is chaotic: trust the peaks only"
        )
    return sentences


def unrest_warnings(motion: GroundMotion, history: History) -> list[str]:
    """Say which record of a sequence finds the dam still moving, a sentence for each.

    The kinetic energy at its start is held against the largest before it.
    """
    kinetic, sentences = history.energy["kinetic"], []
    for member in members_of(motion)[1:]:
        start = float(str(member["start"]))
        row = int(np.searchsorted(history.time, start + _ON_TIME, side="right")) - 1
        if row < 1 or row + 1 >= len(kinetic):
            continue
        largest = float(kinetic[: row + 1].max())
        share = math.sqrt(float(kinetic[row]) / largest) if largest > 0.0 else 0.0
        if share > _MOVES:
            sentences.append(
                f"{member['record']} starts at {start:.4g} s, when the dam still moves at {share:.2g} of the "
                f"largest speed before (root of the kinetic energies), limit {_MOVES:g}; if it is to be at "
                "rest by then, give records[].rest more seconds"
            )
    return sentences


def far_warnings(scene: Scene, history: History) -> list[str]:
    """Say which joints move so far that their geometry changes, a sentence for each.

    The force of a gap acts at the points where its two sides started. Once they are a distance apart, its
    moment about one of the blocks is off by the force times the distance.
    """
    sentences, first = [], 0
    for name, joint in scene.joints.items():
        gaps = slice(first, first := first + len(joint.gap))
        moved = history.jump[:, gaps].copy()
        moved[..., 0] -= joint.gap
        distance = float(np.sqrt((moved**2).sum(axis=2)).max())
        size = math.sqrt(float(joint.whole_area.sum()))
        if distance > _FAR * size:
            sentences.append(
                f"joint {name} moves by up to {distance:.3g} m, {distance / size:.0%} of the root of its "
                f"area, limit {_FAR:.0%}: gaps stay between the points where they started, so that the "
                f"moment of its force about one of the blocks is off by the force times up to {distance:.3g} "
                "m, which no statement of error includes"
            )
    return sentences


def crack_warnings(water: Iterable[JointWaterConfig], scene: Scene, history: History) -> list[str]:
    """Say what was assumed of the water in joints that opened, a sentence for each that has a diagram.

    Parameters
    ----------
    water : `loads.joint_water`
    """
    sentences, first = [], 0
    diagrams = {name: entry for entry in water if entry.downstream is not None for name in entry.joints}
    for name, joint in scene.joints.items():
        gaps = slice(first, first := first + len(joint.gap))
        if name not in diagrams:
            continue
        opened = (history.state[:, gaps] == OPEN) & (history.jump[:, gaps, 0] > 0.0)  # unloaded is no crack
        share = opened @ joint.area / joint.area.sum()
        crack, earthquake = diagrams[name].crack, diagrams[name].earthquake or "frozen"
        at_rest = crack == "redrawn" or earthquake != "frozen"  # what is open at rest is as it should be
        if not share.any() or (at_rest and (share.max() <= share[0] or earthquake == "full")):
            continue
        if at_rest:
            sentences.append(
                f"joint {name} is open over {share[0]:.0%} of its area at the start and up to "
                f"{share.max():.0%} later; "
                + (
                    "what opens later has no water (earthquake: zero)"
                    if earthquake == "zero"
                    else "its uplift stays that of the crack at rest (earthquake: frozen)"
                )
                + ". After the earthquake a longer crack may let the reservoir in: check it at rest, without "
                "the bonds that were lost"
            )
            continue
        assumed = (
            "its open gaps have the pressure of the whole level (crack: full), but beyond the crack's tip "
            "the diagram stays that of the closed joint"
            if crack == "full"
            else "the water's pressure stays the diagram of the closed joint, in the crack too "
            "(crack: unchanged)"
        )
        sentences.append(
            f"joint {name} is open over {share[0]:.0%} of its area at the start and up to {share.max():.0%} "
            f"later, while {assumed}. A crack that lets the reservoir in has more uplift: this is unsafe "
            "where the crack is long"
        )
    return sentences
