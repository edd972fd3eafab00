"""Every configs/hard/*.yaml finishes soundly, or is refused with a reason before anything is computed."""

from pathlib import Path

import numpy as np
import pytest
from soundness import assert_sound

import romdam
from romdam.core.errors import RomdamError
from romdam.pipelines.input_motions import records_of, usable
from romdam.pipelines.run import run
from romdam.pipelines.simulation import prepare, simulate_motion
from romdam.reduction.synthesis import reduce_scene
from romdam.results.sliding import UNDEFINED
from romdam.results.variables import UNDEFINED_MODES
from romdam.scene.build import build_scene

FOLDER = Path(__file__).parents[2] / "configs" / "hard"
REFUSED = {"one_sample": "1 samples, at least 3", "two_samples": "2 samples, at least 3"}
LONG = {"thousands_of_gaps"}
SOUND = sorted(path.stem for path in FOLDER.glob("*.yaml") if path.stem not in REFUSED)


def march(name, **changes):
    """The system and the history of one configuration, `changes` to its transient settings."""
    job = romdam.load_config(FOLDER / f"{name}.yaml")
    if changes:
        transient = job.config.transient.model_copy(update=changes)
        job = type(job)(job.config.model_copy(update={"transient": transient}), job.path)
    motion = usable(records_of(job))[0]
    scene = build_scene(job.config, job.folder, str(job.path))
    system = reduce_scene(scene, job.config.model, job.config.damping).system
    return system, simulate_motion(job, prepare(job, system), motion, job.config.transient.duration)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow) if name in LONG else name for name in SOUND]
)
def test_a_hard_case_finishes_soundly(name):
    system, history = march(name)
    found = assert_sound(system.law, history)
    assert history.peaks["compression"].max() > 0.0, "the joint never closed: the case is not hard"
    if name in EXPECTED:
        EXPECTED[name](system, history, found)


def _keeps_energy(system, history, found):
    assert history.integrator == "conserving"
    assert abs(found["contact_share"]) <= 1e-6


def _just_touches(system, history, found):
    closed = (history.state > 0).any(axis=1)
    assert 0 < closed.sum() <= 3  # rows, 0.01 s each


def _is_caught(system, history, found):
    """The falling block ends at rest on its base, whatever the hops before."""
    assert (history.state[-1] > 0).all()
    assert np.diff((history.state > 0).any(axis=1).astype(int)).any()
    assert np.abs(history.disp[-1, 2] + 0.02) <= 1e-4
    assert np.abs(history.vel[-1]).max() <= 1e-3


def _hangs_on(system, history, found):
    """Friction carries the middle block through the shaking; it slips by less than a millimetre."""
    assert np.abs(history.disp).max() <= 1e-3


def _rocks(system, history, found):
    """Half of the foot lifts by centimetres while the other half stands."""
    lifted = (history.jump[..., 0] > 0.01).any(axis=1)
    assert lifted.any()
    assert (history.state[lifted] > 0).any()
    assert np.abs(history.disp[:, 1]).max() < 4.0  # half its width would be the point of no return


def _has_thousands(system, history, found):
    assert len(system.law) >= 2000
    assert history.traction.shape[2] == 1


EXPECTED = {
    "undamped": _keeps_energy,
    "undamped_rigid": _keeps_energy,
    "grazing": _just_touches,
    "chattering": _is_caught,
    "free_block": _hangs_on,
    "rocking_block": _rocks,
    "thousands_of_gaps": _has_thousands,
}


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_a_record_too_short_is_refused_before_anything_is_built(name, tmp_path):
    with pytest.raises(RomdamError, match=REFUSED[name]) as error:
        run(romdam.load_config(FOLDER / f"{name}.yaml"), tmp_path / "out")
    assert f"{name}.txt" in str(error.value)
    assert not list(tmp_path.rglob("*.nc"))


@pytest.mark.parametrize(
    "name",
    [
        "chattering",
        pytest.param("friction_2", marks=pytest.mark.slow),
        pytest.param("undamped_rigid", marks=pytest.mark.slow),
    ],
)
def test_the_command_writes_finite_results(name, tmp_path):
    paths = run(romdam.load_config(FOLDER / f"{name}.yaml"), tmp_path).paths
    with romdam.open_result(paths[0]) as opened:
        for variable in opened.dataset.data_vars.values():
            if variable.dtype.kind == "f" and variable.name not in (*UNDEFINED, *UNDEFINED_MODES):
                assert np.isfinite(variable.values).all(), variable.name


@pytest.mark.parametrize("name", ["friction_0.3", "rocking_block", "chattering", "soft_between"])
@pytest.mark.parametrize("integrator", ["modal", "adaptive"])
@pytest.mark.parametrize("dt", [0.01, 2e-4])
def test_hard_cases_at_other_steps(name, integrator, dt):
    system, history = march(name, finest_step=dt, integrator=integrator, duration=1.5)
    assert_sound(system.law, history)


def test_an_accuracy_is_reached_on_a_rocking_block():
    system, history = march("rocking_block", finest_step=None, accuracy=0.02)
    assert history.stats["estimated_time_error"] <= 0.02
    assert_sound(system.law, history)
