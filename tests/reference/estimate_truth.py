"""What the estimate of every run says of its reduction error, joint by joint, beside the true one.

The true error of a basis is the difference of its run to one with all modes of the mesh, same scheme and same
steps. Where there are too many modes for that, `--full 0.00125` integrates the unreduced mesh by
generalised-alpha at such a step, and the basis once more by the same scheme at the same step, so that nothing
but the reduction is in it either; what the run's own steps leave is stated beside. `--ground 1e-5` states
what a ground motion larger by so much changes in a run: where that is much, no basis brings histories near
to the truth.

    python tests/reference/estimate_truth.py                       30 cases of two cantilevers, 8 with mortar
    python tests/reference/estimate_truth.py --scenes              29 of blocks tied, bonded, keyed, wet, ...
    python tests/reference/estimate_truth.py configs/koyna.yaml    any configuration, its first record
    python tests/reference/estimate_truth.py configs/koyna.yaml --ground 1e-5
    python tests/reference/estimate_truth.py configs/arch_dam.yaml --begin 4 --seconds 5.4 --full 0.00125
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from certificate_truth import CASES, MORTAR_CASES, make_job
from estimate_scenes import scene_cases

from romdam.config.load import Job, load_config
from romdam.core.arrays import Floats
from romdam.core.motion import GroundMotion
from romdam.core.scene import Scene
from romdam.core.system import History, System
from romdam.core.threads import one_thread
from romdam.effects.full_order import assemble_full
from romdam.error.metrics import RelativeError, opening_error
from romdam.pipelines.automatic_modes import choose_modes
from romdam.pipelines.error.estimate import estimate_run, reduced_models
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for, simulate_motion
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import ALL_MODES
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.integrators.registry import FULL_ORDER
from romdam.timestepping.simulate import simulate_one


@dataclass(frozen=True)
class Row:
    """One joint of one case, or all of them: relative errors as they are and as they are estimated.

    `opening` is the largest true one [m].
    """

    case: str
    joint: str
    opening: float
    true: RelativeError
    estimated: RelativeError


@dataclass(frozen=True)
class Case:
    """A job on one ground motion, and its scene."""

    name: str
    job: Job
    motion: GroundMotion
    scene: Scene

    def simulated(
        self, system: System, finest: float, integrator: str | None = None, base: float | None = None
    ) -> History:
        """A run at a finest step and a base step, that of the record if not given [s]."""
        prepared = prepare(self.job, system, integrator)
        settings = settings_for(self.job, prepared, self.motion, (finest, base or self.motion.dt))
        if integrator is not None:
            interval = settings.steps.interval
            settings = replace(settings, steps=prepared.integrator.steps(finest, self.motion.dt, interval))
        ground = ground_at_steps(self.motion, settings.steps.base, self.job.config.transient.duration)
        return simulate_one(prepared, ground, settings)


def case_of(name: str, job: Job, begin: float = 0.0, seconds: float | None = None) -> Case:
    """A job on its first record from `begin` on, for so many seconds if they are given."""
    motion = load_motions(job.config.records, job.folder)[0]
    motion = replace(motion, acc=motion.acc[:, round(begin / motion.dt) :])
    if seconds is not None:
        transient = job.config.transient.model_copy(update={"duration": seconds})
        job = replace(job, config=job.config.model_copy(update={"transient": transient}))
    return Case(name, job, motion, build_scene(job.config, job.folder, str(job.path)))


@cache
def cantilevers(record: str, scene: str) -> tuple[Case, Floats]:
    """A case of `certificate_truth`, and its true openings."""
    case = case_of(f"{record} {scene}", make_job(record, scene, {"modes": "all"}))
    return case, with_all_modes(case, 0.000625)


def with_all_modes(case: Case, finest: float, base: float | None = None) -> Floats:
    """Openings (nt, gaps) with all modes of the mesh [m]."""
    system = reduce_scene(case.scene, ALL_MODES, case.job.config.damping).system
    return case.simulated(system, finest, base=base).jump[..., 0]


def measure(case: Case, truth: Floats | None = None, full: float | None = None) -> list[Row]:
    """The rows of a case, over all joints and of each.

    Parameters
    ----------
    truth : (nt, gaps) true openings [m]
    full : step of the unreduced mesh that the truth is to be taken from [s]
    """
    if case.job.config.model.modes == "auto":
        case = replace(case, job=choose_modes(case.job, case.scene, [case.motion]))
    reduced, finer = reduced_models(case.job, case.scene)
    assert finer is not None
    duration = case.job.config.transient.duration
    run = simulate_motion(case.job, prepare(case.job, reduced.system), case.motion, duration)
    estimated = estimate_run(case.job, finer, case.motion, run).errors["opening"]
    opening = run.jump[..., 0]
    if full is not None:
        opening = case.simulated(reduced.system, full, FULL_ORDER).jump[..., 0]
        truth = case.simulated(assemble_full(case.scene, case.job.config.damping), full, FULL_ORDER).jump[
            ..., 0
        ]
        steps = opening_error(run.jump[..., 0], opening)
        sys.stdout.write(f"{case.name}: what the steps of both change: L2 {100 * steps.l2:.3f} %\n")
    elif truth is None:
        truth = with_all_modes(case, run.stats["finest_step"], run.stats["base_step"])
    joints = reduced.system.law.joints
    true = opening_error(opening, truth, joints)
    rows = [Row(case.name, "all", float(truth.max()), true, estimated)]
    return rows + [
        Row(case.name, name, float(truth[:, own].max()), true.joints[name], estimated.joints[name])
        for name, own in joints.items()
    ]


def sensitivity(case: Case, share: float) -> str:
    """What a ground motion larger by a share changes in the openings of a run, as text."""
    config, joints = case.job.config, case.scene.joints
    system = reduce_scene(case.scene, config.model, config.damping).system
    louder = replace(case, motion=replace(case.motion, acc=(1.0 + share) * case.motion.acc))
    step = config.transient.finest_step or case.motion.dt / 4
    moved, opening = (one.simulated(system, step).jump[..., 0] for one in (louder, case))
    error = opening_error(moved, opening, system.law.joints)
    each = ", ".join(f"{name} {100 * error.joints[name].l2:.2g}" for name in joints)
    whole = f"L2 {100 * error.l2:.2g} %, peak {100 * error.peak:.2g} %"
    return f"{case.name}: ground times 1 + {share:g}: {whole}; L2 of {each}\n"


def line(row: Row) -> str:
    """A row as text: true, estimated, and their ratio, in L2 and of the peak."""
    true, said = row.true, row.estimated
    measures = [(true.l2, said.l2), (true.peak, said.peak)]
    text = [f"{100 * a:7.3f} {100 * b:7.3f} {b / a if a else np.nan:6.2f}" for a, b in measures]
    return f"{row.case:40s} {row.joint:18s} {1e3 * row.opening:8.3f} mm  L2 {text[0]}  peak {text[1]}\n"


def tables(asked: argparse.Namespace) -> Iterator[list[Row]]:
    """The rows of every case that is asked for."""
    for path in asked.configurations:
        case = case_of(Path(path).stem, load_config(path), asked.begin, asked.seconds)
        if asked.ground:
            sys.stdout.write(sensitivity(case, asked.ground))
        else:
            yield measure(case, full=asked.full)
    for name, some in scene_cases(asked.seconds or 4.0) if asked.scenes else ():
        yield measure(replace(case_of(name, some), name=name))
    others = [] if asked.configurations or asked.scenes else [*CASES, *MORTAR_CASES]
    for record, scene, base in others:
        whole, truth = cantilevers(record, scene)
        yield measure(replace(whole, name=f"{whole.name} {base}", job=make_job(record, scene, base)), truth)


@one_thread()
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("configurations", nargs="*")
    parser.add_argument("--scenes", action="store_true", help="small scenes of every way to meet")
    parser.add_argument("--begin", type=float, default=0.0, help="of the record [s]")
    parser.add_argument("--seconds", type=float)
    parser.add_argument("--full", type=float, help="step of the unreduced mesh [s]")
    parser.add_argument("--ground", type=float, help="share by which the ground motion is changed")
    for rows in tables(parser.parse_args()):
        sys.stdout.writelines(map(line, rows))
        sys.stdout.flush()


if __name__ == "__main__":
    main()
