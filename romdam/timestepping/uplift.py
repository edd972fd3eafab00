"""Uplift of cracked joints at rest: redrawn from the crack's tip until it agrees with the stresses.

The equilibrium is solved for an uplift, the tips of its cracks are read, the uplift is drawn for these, and
so on. A longer crack has more uplift, and more uplift a longer crack. So from the closed joint the tips move
downstream, and come to rest at the shortest crack that agrees with its uplift, if there is one. They converge
linearly, which Aitken's extrapolation shortens; it never passes drains, beyond which the uplift jumps.

While the dam is shaken this uplift stays. What the gaps that were closed at rest get besides as they open,
the law `CrackWater` adds: less of the whole pressure (zero), more up to the reservoir's (full), or nothing.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.contact.components import NORMAL
from romdam.contact.laws.catalogue import source_of
from romdam.contact.laws.crack_water import EXCESS, CrackWater
from romdam.contact.problem import every_law, law_memory
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConvergenceError, NoEquilibriumError
from romdam.core.system import OPEN, GapLaw, LawSource, RestUplift, System
from romdam.timestepping.equilibrium import GapState, ProximalStep, static_equilibrium

_MOST = 300  # equilibria; 10 to 30 are usual
_AGREES = 1e-9  # of a line's length: movement of a tip that is none
_BETWEEN = 3  # equilibria from one extrapolation to the next
_STEEPEST = 0.95  # ratio of two movements, from which on an extrapolation would be far
_FURTHEST = 0.9  # of what is uncracked, by which an extrapolation moves a tip at most

Tips = dict[str, Floats]


def with_uplift_at_rest(system: System, tolerance: float) -> System:
    """The system with the uplift of its cracks at rest; itself where no uplift follows from a crack.

    Parameters
    ----------
    tolerance : of the gaps' equilibrium

    Raises
    ------
    ConvergenceError
        where no equilibrium is found, as the crack grows.
    """
    law = system.law
    if not law.uplift:
        return system
    normal = system.B[:: law.directions].T
    earlier = np.zeros(len(law)) if system.uplift is None else system.uplift.added
    start = {name: np.zeros(len(uplift.length)) for name, uplift in law.uplift.items()}
    closed = {name: uplift.force(start[name]) for name, uplift in law.uplift.items()}
    tips, found, moves, change, solved = start, start, list[Tips](), np.inf, 0
    gaps: GapState | None = None
    steps: dict[float, ProximalStep] = {}
    while solved < _MOST:
        solved += 1
        added = _added(law, tips, closed)
        more = normal @ (added - earlier)
        loaded = replace(system, force=np.asarray(system.force + more), load_steps=_with_water(system, more))
        try:
            _, gaps = static_equilibrium(loaded, tolerance, steps)
        except ConvergenceError as error:
            if tips is found:
                raise type(error)(_without_equilibrium(law, tips, error)) from None
            tips, moves = found, []  # extrapolated too far
            continue
        found = _read_tips(law, gaps)
        moves.append({name: found[name] - tips[name] for name in tips})
        change = max(
            float(np.abs(moves[-1][name]).max() / uplift.length.max()) for name, uplift in law.uplift.items()
        )
        if change <= _AGREES:
            break
        tips = found
        if len(moves) == _BETWEEN:
            tips, moves = _extrapolated(law, found, moves), []
    assert gaps is not None
    crack, warnings = np.full(len(law), np.nan), list[str]()
    if change > _AGREES:
        warnings.append(
            f"uplift and crack at rest do not agree after {solved} equilibria: the last moved a tip by "
            f"{change:.2g} of the base, limit {_AGREES:g}; refine the gaps along the base, or set "
            "loads.joint_water[].crack: unchanged and give the diagram of the cracked base"
        )
    for name, uplift in law.uplift.items():
        if uplift.redrawn:
            crack[law.joints[name]] = uplift.at_gaps(tips[name])
            warnings += _through(name, tips[name], uplift.length)
            apart = int((_opened(gaps)[law.joints[name]] & ~uplift.in_crack(tips[name])).sum())
            if apart:
                warnings.append(
                    f"joint {name} is open at rest at {apart} gaps that no crack joins to its heel; the "
                    "uplift there stays, which is unsafe if water gets in from the toe or a side"
                )
    return replace(
        loaded,
        law=replace(_law_while_shaken(law, gaps, tips), uplift={}),
        uplift=RestUplift(added, crack, solved, change, tuple(warnings)),
    )


def _with_water(system: System, more: Floats) -> dict[str, Floats]:
    """Steps of the loads, with more force (n,) in that of the water."""
    steps = dict(system.load_steps)
    return steps | {"water": steps["water"] + more} if "water" in steps else steps


def _added(law: GapLaw, tips: Tips, closed: Tips) -> Floats:
    """Force of the water in the gaps, more than that of the closed joints (ng,) [N]."""
    added = np.zeros(len(law))
    for name, uplift in law.uplift.items():
        if uplift.redrawn and tips[name].any():
            added[law.joints[name]] = uplift.force(tips[name]) - closed[name]
    return added


def _opened(gaps: GapState) -> Bools:
    """(ng,) gaps that are open; one that has merely lost its load is not."""
    return np.asarray((gaps.state == OPEN) & (gaps.jump[:, NORMAL] > 0.0))


def _read_tips(law: GapLaw, gaps: GapState) -> Tips:
    """Tips of the cracks in an equilibrium; zero in joints whose uplift is not redrawn."""
    tips = {}
    for name, uplift in law.uplift.items():
        of_joint = law.joints[name]
        opening, is_open = gaps.jump[of_joint, NORMAL], _opened(gaps)[of_joint]
        found = uplift.tips(opening, is_open, np.isinf(law.K_n[of_joint]))
        tips[name] = found if uplift.redrawn else np.zeros_like(found)
    return tips


def _extrapolated(law: GapLaw, tips: Tips, moves: list[Tips]) -> Tips:
    """Tips where the movements, in geometric progression, would end; as they are where these are not."""
    before, last = (np.concatenate(list(moved.values())) for moved in moves[-2:])
    ratio = float(np.abs(last).max() / max(np.abs(before).max(), 1e-300))
    if not ratio < _STEEPEST or (before * last < 0.0).any():
        return tips
    further = {}
    for name, uplift in law.uplift.items():
        more = moves[-1][name] * ratio / (1.0 - ratio)
        most = tips[name] + _FURTHEST * (uplift.length - tips[name])
        most = np.where(tips[name] < uplift.drains_at, np.minimum(most, uplift.drains_at), most)
        further[name] = np.clip(tips[name] + more, 0.0, np.maximum(most, tips[name]))
    return further


def _law_while_shaken(law: GapLaw, gaps: GapState, tips: Tips) -> GapLaw:
    """The gaps' law with the water that enters or leaves what is closed at rest and opens later."""
    source = source_of(CrackWater)
    closed = ~_opened(gaps)
    laws = list(law.laws)
    for k, rows in enumerate(laws):
        if rows.law != source:
            continue
        values, on = rows.values.copy(), rows.on.copy()
        for name, uplift in law.uplift.items():
            of_joint, water = law.joints[name], uplift.force(tips[name])
            if uplift.earthquake == "zero":
                more = -water
            elif uplift.earthquake == "full":
                more = uplift.full_force() - water
            else:
                continue
            values[of_joint, EXCESS] = np.where(closed[of_joint], more, 0.0)
            on[of_joint] = closed[of_joint] & (np.abs(more) > 0.0)
        laws[k] = replace(rows, values=values, on=on)
    after = replace(law, laws=tuple(laws))
    return replace(after, memory=_memory_at_rest(after, source))


def _memory_at_rest(law: GapLaw, source: LawSource) -> Floats:
    """Memory of the laws (L, ng, s), of gaps closed at rest in spite of an initial gap that of closed ones.

    Empty where it is that of unloaded gaps.
    """
    memory, every = law.memory, every_law(law)
    for k, rows in enumerate(every):
        of_uplift = np.zeros(len(law), dtype=np.bool_)
        for name, uplift in law.uplift.items():
            of_uplift[law.joints[name]] = uplift.earthquake != "frozen"
        held = of_uplift & rows.on & (law.gap > 0.0)
        if rows.law == source and held.any():
            if not memory.size:
                memory = law_memory(law, lambda each, values, i: each.initial(values, law.gap[i]))
            memory = memory.copy()
            memory[k, held] = 0.0
    return memory


def _through(name: str, tips: Floats, length: Floats) -> list[str]:
    """Warn of a crack that runs through."""
    lines = int((tips >= length).sum())
    if lines == 0:
        return []
    share = "" if lines == len(tips) else f" on {lines} of {len(tips)} lines from heel to toe"
    return [
        f"joint {name} is cracked through at rest{share}: the whole base there has the pressure of the "
        "level, and other joints or supports hold the block"
    ]


def _without_equilibrium(law: GapLaw, tips: Tips, error: ConvergenceError) -> str:
    name = max(law.uplift, key=lambda each: float((tips[each] / law.uplift[each].length).max()))
    line = int(np.argmax(tips[name] / law.uplift[name].length))
    cracked, length = tips[name][line], law.uplift[name].length[line]
    end = f"there is no equilibrium any more ({error})"
    if not isinstance(error, NoEquilibriumError):
        end = f"none was found, which does not say that there is none ({error})"
    return (
        f"loads.joint_water: the uplift grows with the crack, and when joint {name} is cracked over "
        f"{cracked:.4g} m of {length:.4g} m {end}"
    )
