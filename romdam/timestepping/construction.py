"""Joints of a dam that is built in stages: what each gap's opening, slip and memory count from.

Every stage is an equilibrium under its loads, of the blocks that are there. A gap comes to be with the second
of its blocks, which is poured against the first as this stands: the jump of the state before is taken from
its reference. Gaps that are to be grouted carry compression only until then; at grouting they are filled as
`romdam.timestepping.grouting` says, their grouting pressure acting on the blocks of the stage. Other gaps
have their whole law from the beginning. What slips or breaks in a stage stays so in the next.

A block that is not there has no load and no gap, so that it stands still, free of stress, whatever its
stiffness; so the system's stiffness is that of the finished blocks in all stages.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from romdam.contact.components import NORMAL
from romdam.contact.problem import law_memory
from romdam.core.arrays import Bools, Floats
from romdam.core.errors import ConvergenceError, quote
from romdam.core.system import BuiltStages, GapLaw, System, with_parameters
from romdam.timestepping.equilibrium import GapState, static_equilibrium


def constructed(system: System, tolerance: float) -> System:
    """The system once it has gone through its stages of construction; itself where it has none.

    Parameters
    ----------
    tolerance : of the gaps' equilibrium

    Raises
    ------
    ConvergenceError
        where a stage has no equilibrium.
    """
    plan = system.construction
    if plan is None:
        return system
    law, d, n = system.law, system.law.directions, len(system.law)
    grout = law.grout if law.grout.size else np.zeros(n)
    whole: Bools = np.asarray(~plan.grouted.any(axis=0))  # gaps that have all of their law
    gap, shift = law.gap.copy(), np.zeros((n, d))
    slip, slipped = np.zeros((n, 2)), np.zeros((n, 2))
    memory = law_memory(law, lambda each, values, i: each.initial(values, law.gap[i]))
    filled_memory = law_memory(law, lambda each, values, i: each.initial(values, 0.0))
    opening, force = np.full((len(plan.names), n), np.nan), np.zeros((len(plan.names), n))
    q, before = np.zeros(system.size), np.zeros(n, dtype=bool)

    def take_off(gaps: Bools, normal: Floats, at_point_normal: Floats | None = None) -> None:
        """Let jumps count from the displacement q: tangential ones at all, normal ones by what is given."""
        gap[gaps] -= normal[gaps]
        if d == 3:
            slip[gaps] = -(system.B @ q).reshape(n, 3)[gaps, 1:]
        if system.at_point is not None:
            more = (system.at_point @ q).reshape(n, d)
            shift[gaps] = -more[gaps]
            if at_point_normal is not None:
                shift[gaps, NORMAL] = at_point_normal[gaps]

    def rest(load: Floats, present: Bools, stage: str) -> tuple[Floats, GapState]:
        """Equilibrium of what is there; slips and memory are kept."""
        holds = present & whole
        part = _of_gaps(system, _law_of_stage(law, gap, slip, slipped, memory, holds), present)
        try:
            displacement, gaps = static_equilibrium(replace(part, force=load), tolerance)
        except ConvergenceError as error:
            raise type(error)(f"construction, stage {quote(stage)}: {error}") from None
        kept = whole[present]
        if len(gaps.accumulated_slip):
            slipped[holds] = gaps.accumulated_slip[kept]
        if len(gaps.history):
            rows = len(memory) - len(gaps.history)
            memory[rows:, holds, : gaps.history.shape[2]] = gaps.history[:, kept]
        return displacement, gaps

    for k, stage in enumerate(plan.names):
        present, grouted = plan.present[k], plan.grouted[k]
        take_off(present & ~before, np.asarray(system.B[::d] @ q))
        before = present
        load = np.zeros(system.size)
        load[: len(plan.force)] = plan.force[:, k]  # water with waves has none
        q, gaps = rest(load, present, stage)
        opening[k, present], force[k, present] = gaps.jump[:, NORMAL], gaps.force[:, NORMAL]
        if system.at_point is not None:
            opening[k, present] += ((system.at_point @ q).reshape(n, d) + shift)[present, NORMAL]
        if not grouted.any():
            continue
        if grout[grouted].any():
            q, gaps = rest(load + system.B[::d].T @ (grout * grouted), present, stage)
        jump = np.zeros(n)
        jump[present] = gaps.jump[:, NORMAL]
        filled, points = np.maximum(jump, 0.0), None
        if system.at_point is not None:  # closed wherever it is looked at
            more = (system.at_point @ q).reshape(n, d)[:, NORMAL] + shift[:, NORMAL]
            points = shift[:, NORMAL] + filled - np.maximum(jump + more, 0.0)
        take_off(grouted, filled + grout / law.K_n, points)
        slipped[grouted], memory[:, grouted] = 0.0, filled_memory[:, grouted]
        whole = whole | grouted
    after = _law_of_stage(law, gap, slip, slipped, memory, np.ones(n, dtype=bool))
    return replace(
        system,
        law=replace(after, uplift=law.uplift),
        point_shift=None if system.at_point is None else shift.ravel(),
        construction=None,
        load_steps={},  # the stages have been their path
        built=BuiltStages(plan.names, opening, force, plan.grouted),
    )


def _law_of_stage(
    law: GapLaw, gap: Floats, slip: Floats, slipped: Floats, memory: Floats, whole: Bools
) -> GapLaw:
    """The law of all gaps in a stage, those that do not have it whole with compression only.

    Parameters
    ----------
    gap, slip, slipped, memory : as of `GapLaw`, of all gaps and laws
    whole : (n,) gaps that have all of their law
    """
    stage = replace(
        law,
        K_nz=law.K_nz * whole,
        mu=law.mu * whole[:, None],
        laws=tuple(replace(rows, on=rows.on & whole) for rows in law.laws),
        gap=gap.copy(),
        grout=np.zeros(0),
        uplift={},
    )
    if law.directions == 3:
        stage = replace(stage, slip=slip.copy())
    if stage.directions == 3 and slipped.any():
        stage = replace(stage, slipped=slipped.copy())
    fresh = law_memory(stage, lambda each, values, i: each.initial(values, stage.gap[i]))
    kept = memory[len(memory) - len(fresh) :]
    return stage if (kept == fresh).all() else replace(stage, memory=kept.copy())


def _of_gaps(system: System, law: GapLaw, gaps: Bools) -> System:
    """The system with some of its gaps and their law."""
    reduced = system.B.shape[0] // max(len(law), 1)
    rows = np.repeat(gaps, reduced)
    joints, start = dict[str, slice](), 0
    for name, of_joint in law.joints.items():
        count = int(gaps[of_joint].sum())
        joints[name], start = slice(start, start + count), start + count
    part = replace(
        law,
        K_n=law.K_n[gaps],
        K_nz=law.K_nz[gaps],
        K_s=law.K_s[gaps],
        mu=law.mu[gaps],
        gap=law.gap[gaps],
        joints=joints,
        laws=tuple(replace(each, values=each.values[gaps], on=each.on[gaps]) for each in law.laws),
        viscosity=law.viscosity[gaps] if law.viscosity.size else law.viscosity,
        slip=law.slip[gaps] if len(law.slip) else law.slip,
        slipped=law.slipped[gaps] if len(law.slipped) else law.slipped,
        memory=law.memory[:, gaps] if law.memory.size else law.memory,
    )
    less = replace(system, B=system.B[rows], law=part, at_point=None, pseudo_static=None, load_steps={})
    return with_parameters(less, part, None)
