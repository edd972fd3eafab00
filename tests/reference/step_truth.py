"""What every run says of the error of its steps, beside the true one.

The true error is the difference of a run to one with a sixteenth of its finest step, over the whole record.

    python tests/reference/step_truth.py                       15 cases of two cantilevers
    python tests/reference/step_truth.py configs/arch_dam.yaml    any configuration, its first record
"""

import argparse
import sys
from collections.abc import Iterator

from certificate_truth import RECORDS, make_job
from estimate_truth import Case, case_of

from romdam.config.load import load_config
from romdam.core.threads import one_thread
from romdam.error.metrics import relative_l2
from romdam.pipelines.error.estimate import estimate_steps
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for
from romdam.reduction.synthesis import reduce_scene
from romdam.timestepping.prepared import Prepared
from romdam.timestepping.settings import Settings
from romdam.timestepping.simulate import simulate_one

FINER = 16
SCENES = [(record, "penalty") for record in RECORDS] + [("mul009", "rigid"), ("mul009", "friction")]
STEPS = (0.0025, 0.00125)


def settings_of(case: Case, prepared: Prepared, finest: float) -> Settings:
    """Settings of a case with another finest step [s]."""
    transient = case.job.config.transient.model_copy(update={"finest_step": finest, "accuracy": None})
    config = case.job.config.model_copy(update={"transient": transient})
    job = type(case.job)(config, case.job.path)
    return settings_for(job, prepared, case.motion)


def line(case: Case, finest: float) -> str:
    """True and estimated error of a step [s], and their ratio, as text."""
    duration = case.job.config.transient.duration
    system = reduce_scene(case.scene, case.job.config.model, case.job.config.damping).system
    prepared = prepare(case.job, system)
    run, truth = (
        simulate_one(prepared, ground_at_steps(case.motion, own.steps.base, duration, system), own)
        for own in (settings_of(case, prepared, step) for step in (finest, finest / FINER))
    )
    true = relative_l2(run.jump[..., 0], truth.jump[..., 0])
    said = estimate_steps(case.job, prepared, case.motion, run)["estimated_time_error"]
    return (
        f"{case.name:30s} {1e3 * finest:6.3g} ms  true {100 * true:7.3f} %  said {100 * said:7.3f} %  "
        f"{said / true:5.2f}\n"
    )


def cases(configurations: list[str]) -> Iterator[tuple[Case, float]]:
    """Cases and their finest steps [s]."""
    for path in configurations:
        case = case_of(path, load_config(path))
        for step in (case.job.config.transient.finest_step or case.motion.dt / 4,):
            yield case, step
    for record, scene in [] if configurations else SCENES:
        case = case_of(f"{record} {scene}", make_job(record, scene, {"modes": 60}))
        for step in STEPS:
            yield case, step


@one_thread()
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("configurations", nargs="*")
    for case, finest in cases(parser.parse_args().configurations):
        sys.stdout.write(line(case, finest))
        sys.stdout.flush()


if __name__ == "__main__":
    main()
