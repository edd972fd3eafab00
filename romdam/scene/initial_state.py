"""The state in which another run ended, for the joints of a scene."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from romdam.config.sections.loads import InitialStateConfig
from romdam.contact.laws.catalogue import find_law
from romdam.core.arrays import Ints
from romdam.core.errors import ConfigError, ResultError, listed, quote
from romdam.core.final_state import STATE_QUANTITIES, FinalState, InitialState
from romdam.core.final_state_file import VARIABLES, StoredState, read_final_state
from romdam.core.model_signature import law_key
from romdam.core.scene import Joint

KEY = "loads.initial_state.result"
_APART = 1e-6  # of the largest coordinate, and of unit axes: round-off of another machine is below 1e-9
_REST = 1e-6  # of the largest kinetic energy, below which a run has come to rest


def read_initial_state(
    config: InitialStateConfig, joints: Mapping[str, Joint], folder: Path, source: str
) -> tuple[InitialState, tuple[str, ...]]:
    """Read the state that runs begin with, and what of it may not be meant, one sentence each.

    Parameters
    ----------
    joints : of the scene
    folder : where relative paths in the configuration start
    source : name of the configuration file, for messages

    Raises
    ------
    ConfigError
        for a file that has no final state, and for one of other joints than those of the scene.
    """
    path = folder / config.result
    try:
        stored = read_final_state(path, f"{KEY}: {path}")
    except ResultError as error:
        raise ConfigError(f"{source}: {KEY}: {error}") from None
    final = _of_gaps(stored.final, _matching_gaps(stored, joints, f"{source}: {KEY}: {path}"))
    end, largest = stored.kinetic
    state = InitialState(final, config.take, moves=end > _REST * largest)
    if config.take == "all":
        return state, ()
    if len(final.arrays["accumulated_slip"]) == 0 and any(_carries_shear(joint) for joint in joints.values()):
        raise ConfigError(
            f"{source}: {KEY}: {path} knows no slip, as none of its joints carried shear, and joints of this "
            "job do; run that job with their friction"
        )
    return state, tuple(_remarks(state, joints, f"{KEY}: {path}", end / largest if largest else 0.0))


def _matching_gaps(stored: StoredState, joints: Mapping[str, Joint], begins: str) -> Ints:
    """The number in the state of every gap of the scene.

    Raises
    ------
    ConfigError
        for other joints, other gaps, and gaps at other places or with other axes.
    """
    if set(stored.joints) != set(joints):
        there, here = listed(sorted(stored.joints)) or "none", listed(sorted(joints)) or "none"
        raise ConfigError(f"{begins}: has the joints {there}, and this job {here}; both need the same")
    ends = dict(zip(stored.joints, np.cumsum(list(stored.joints.values())), strict=True))
    order = [np.zeros(0, dtype=np.int64)]
    size = max(float(np.abs(stored.position).max(initial=0.0)), 1e-300)
    remedy = "a state needs the same mesh, joints and spacing"
    for name, joint in joints.items():
        count, last = stored.joints[name], int(ends[name])
        gaps = np.arange(last - count, last)
        if count != len(joint.gap):
            raise ConfigError(
                f"{begins}: joint {quote(name)} has {count} gaps, and {len(joint.gap)} in this job; {remedy}"
            )
        apart = np.abs(stored.position[gaps] - joint.position).max(axis=1)
        turned = np.abs(stored.axes[gaps] - joint.axes).max(axis=(1, 2))
        for off, limit, what in (
            (apart, _APART * size, "m away"),
            (turned, _APART, "of its unit axes turned"),
        ):
            if (off > limit).any():
                i = int(off.argmax())
                raise ConfigError(
                    f"{begins}: gap {i} of joint {quote(name)} is {off[i]:.3g} {what} from that of this job, "
                    f"limit {limit:.1g}; {remedy}"
                )
        order.append(gaps)
    return np.concatenate(order)


def _of_gaps(final: FinalState, order: Ints) -> FinalState:
    """The state with its gaps in another order."""
    arrays = dict(final.arrays)
    for name in STATE_QUANTITIES:
        dims = VARIABLES[name][0]
        if "gap" in dims and name in arrays and arrays[name].size:
            arrays[name] = np.take(arrays[name], order, axis=dims.index("gap"))
    return replace(final, arrays=arrays, laws={name: on[order] for name, on in final.laws.items()})


def _carries_shear(joint: Joint) -> bool:
    return bool(joint.mu.any()) or any(rows.shear for rows in joint.laws)


def _remarks(state: InitialState, joints: Mapping[str, Joint], begins: str, moving: float) -> Iterator[str]:
    """Tell what of the state does not count in this job.

    Parameters
    ----------
    moving : kinetic energy at its end, of the largest
    """
    if state.moves:
        yield (
            f"{begins} ends in motion, with {moving:.1g} of the largest kinetic energy, which take: joints "
            "leaves out; let its record end in rest"
        )
    laws = {law_key(rows.law): find_law(rows.law) for joint in joints.values() for rows in joint.laws}
    now = {key for key, law in laws.items() if law.memory}
    memory = state.final.arrays["memory"]
    then = {key for key, values in zip(state.final.laws, memory, strict=True) if values.any()}
    for keys, what in (
        (then - now, "what they remember is left out, as no joint of this job has them"),
        (now - set(state.final.laws), "they begin afresh, as the joints had not got them"),
    ):
        if keys:
            yield f"{begins}: joint laws {listed({key.split()[0] for key in keys})}: {what}"
