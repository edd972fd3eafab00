"""What a run of a sliding gravity dam states of its modes and steps, beside the truth, and what that costs.

Two monoliths of Koyna's section (`configs/koyna.yaml`), their bases 10 m apart, with a contraction joint, in
20 s of two components of Northridge at three peak accelerations, with modes below 50 and 25 Hz. The true
error of the steps is the difference to an eighth of them, that of the modes the difference to all modes of
the mesh. Such histories are chaotic, so only many cases together say something: the last lines have the
geometric means of stated over true, the factors by which they scatter, and the cost over that of the run.

    python tests/reference/sliding_truth.py
"""

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from romdam.config.load import Job, load_config
from romdam.core.arrays import Floats
from romdam.core.system import System
from romdam.core.threads import cpu_time, one_thread
from romdam.error.metrics import relative_l2
from romdam.pipelines.error.estimate import estimate_run, estimate_steps, reduced_models
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for, simulate_motion
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import ALL_MODES
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.simulate import simulate_one
from romdam.timestepping.step_control import jump_differences

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from bench_damping_slip import RECORD, monolith

RECORDS = (RECORD, RECORD.with_name("northridge_mul279_g_dt0.01.txt"))
SECONDS, FINER = 20.0, 8
CASES = [(record, pga, cutoff) for pga in (0.47, 0.2, 0.3) for record in RECORDS for cutoff in (50.0, 25.0)]


def make_job(record: Path, pga: float, cutoff: float) -> Job:
    """Two monoliths in a record of a peak acceleration [g], with modes below a cutoff [Hz]."""
    raw: dict[str, Any] = monolith("reduced", finest_step="2.5 ms")
    wet = [{"block": f"monolith_{k}", "face": "upstream"} for k in (1, 2)]
    dam = raw["gravity_dam"]
    dam |= {"monoliths": ["15.24 m", "15.24 m"], "base": ["10 m", "0 m"]}
    dam["joints"]["contraction"] = {
        "normal_stiffness": "50 GPa/m",
        "shear_stiffness": "25 GPa/m",
        "friction": 0.6,
    }
    dam["divisions"] |= {"through": 2, "up": 8}
    raw["loads"]["hydrostatic"][0]["faces"] = raw["water"]["faces"] = wet
    raw["loads"]["joint_water"][0]["joints"] = ["base_1", "base_2"]
    raw["records"][0]["components"]["y"]["file"] = str(record)
    raw["records"][0]["scale"] = {"pga": f"{pga} g"}
    raw["outputs"]["error_estimate"] = True
    raw["model"], raw["transient"]["duration"] = {"cutoff": cutoff}, SECONDS
    return load_config(raw)


def measure(record: Path, pga: float, cutoff: float) -> Floats:
    """Stated and true error of the steps, then of the openings by the modes; cost over that of the run."""
    job = make_job(record, pga, cutoff)
    motion, scene = (
        load_motions(job.config.records, job.folder)[0],
        build_scene(job.config, job.folder, str(job.path)),
    )

    def jumps(system: System, finer: int) -> Floats:
        prepared = prepare(job, system)
        settings = settings_for(job, prepared, motion)
        steps = prepared.integrator.steps(settings.steps.finest / finer, motion.dt / finer, 0.01)
        ground = ground_at_steps(motion, steps.base, SECONDS, system)
        return simulate_one(prepared, ground, replace(settings, steps=steps, only_jumps=True)).jump

    reduced, finer = reduced_models(job, scene)
    assert finer is not None
    prepared, begin = prepare(job, reduced.system), cpu_time()
    run = simulate_motion(job, prepared, motion, SECONDS)
    between = cpu_time()
    said = (
        estimate_steps(job, prepared, motion, run)["estimated_time_error"],
        estimate_run(job, finer, motion, run).errors["opening"].l2,
    )
    cost = (cpu_time() - between) / (between - begin)
    steps = jump_differences(run.jump, jumps(reduced.system, FINER))[0]
    truth = jumps(reduce_scene(scene, ALL_MODES, job.config.damping).system, 1)
    return np.array([said[0], steps, said[1], relative_l2(run.jump[..., 0], truth[..., 0]), cost])


@one_thread()
def main() -> None:
    rows = []
    for record, pga, cutoff in CASES:
        rows.append(measure(record, pga, cutoff))
        steps, true_steps, modes, true_modes, cost = rows[-1]
        sys.stdout.write(
            f"{record.stem[:17]} {pga:4g} g {cutoff:3g} Hz  steps {steps:.3f} true {true_steps:.3f}  "
            f"modes {modes:.3f} true {true_modes:.3f}  cost {cost:.2f}\n"
        )
        sys.stdout.flush()
    table = np.array(rows)
    for name, k in (("steps", 0), ("modes", 2)):
        ratio = np.log(table[:, k] / table[:, k + 1])
        ends = np.exp([ratio.mean(), ratio.std(), ratio.min(), ratio.max()])
        sys.stdout.write(
            f"{name}: {ends[0]:.2f} times the truth, factor {ends[1]:.2f}, {ends[2]:.2f} to {ends[3]:.2f}\n"
        )
    sys.stdout.write(f"cost: {np.median(table[1:, 4]):.2f} of the run, median without the first one\n")


if __name__ == "__main__":
    main()
