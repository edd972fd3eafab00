"""A small arch dam on rock without mass: reduced against its own mesh, and what the cut-off leaves.

Over 10 s of a real record with friction joints, water and staged weight: peak opening of every joint within
2 %, all openings within 5 % in L2, peak principal stress within 3 %.
"""

from pathlib import Path

import numpy as np
import pytest
from arch_dams import DIVISIONS, PERIMETER, ROCK, arch_dam
from simulating import simulated

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.error.metrics import largest_difference, opening_error, relative_l2
from romdam.pipelines.error.verify import verify
from romdam.pipelines.simulation import ground_at_steps
from romdam.pipelines.stresses import stress_fields, stress_of
from romdam.records.record_set import load_motions
from romdam.reduction.mode_choice import ALL_MODES, ModeChoice
from romdam.reduction.synthesis import reduce_scene, reduce_scene_twice
from romdam.scene.build import build_scene

CONFIGS = Path(__file__).parents[2] / "configs"
FACES = [{"block": f"C{k}", "face": "upstream"} for k in (1, 2, 3, 4)]


def job():
    """Four cantilevers in tet10, about 2,500 unknowns; the record shakes all joints open."""
    zones = {name: zone | {"mass": False} for name, zone in ROCK["zones"].items()}
    divisions = DIVISIONS | {"up": 2, "rock": 1}
    raw = arch_dam(element="tet10", divisions=divisions, perimeter=PERIMETER, rock=ROCK | {"zones": zones})
    record = "../data/records/northridge_mul{}_g_dt0.01.txt"
    components = {axis: {"file": record.format(name)} for axis, name in (("x", "279"), ("y", "009"))}
    raw |= {
        "loads": {
            "gravity": [0, 0, -9.81],
            "weight": "staged",
            "hydrostatic": [{"level": 90.0, "faces": FACES}],
        },
        "water": {"level": 90.0, "faces": FACES, "model": "westergaard"},
        "damping": {"rayleigh": {"frequencies": [2, 15], "ratio": 0.05}},
        "records": [{"name": "mul", "unit": "9.81 m/s2", "dt": 0.01, "components": components}],
        "model": {"cutoff": 50.0},
        "transient": {"finest_step": 0.0025},
        "outputs": {
            "output_interval": 0.01,
            "error_estimate": False,
            "stress": {"blocks": ["C1", "C2", "C3", "C4"]},
        },
    }
    return Job(parse_config(raw, "s.yaml"), CONFIGS / "s.yaml")


def build(asked):
    return build_scene(asked.config, asked.folder, str(asked.path))


def marched(built, motion, choice, damping):
    """Openings over 10 s, their peak at each joint, the largest principal stress of every stress node."""
    model = reduce_scene(built, choice, damping)
    ground = ground_at_steps(motion, 0.01, 10.0)
    history = simulated(model.system, ground, 0.01, integrator="adaptive", cuts=(4,))
    opening = history.jump[..., 0]
    stress = stress_of(built, stress_fields(built, model), history)[1].largest["principal"]
    return opening, [opening[:, own].max() for own in model.system.law.joints.values()], stress


@pytest.mark.slow
def test_error_of_the_cutoff_alone():
    """Against all modes at the same steps: what is left out of the basis is the whole difference."""
    asked = job()
    built, (motion,) = build(asked), load_motions(asked.config.records, asked.folder)
    whole = marched(built, motion, ALL_MODES, asked.config.damping)
    assert min(whole[1]) > 5e-3  # every joint opens
    errors = []
    for cutoff in (8.0, 25.0, 50.0):
        some = marched(built, motion, ModeChoice(cutoff=cutoff), asked.config.damping)
        l2 = relative_l2(some[0], whole[0])
        peaks = np.abs(np.array(some[1]) / whole[1] - 1).max()
        errors.append((l2, peaks, largest_difference(some[2], whole[2])))
    assert errors[0][0] > 0.05  # 8 Hz is too low
    assert (np.diff(errors, axis=0) < 0).all()
    assert (np.array(errors[-1]) < (0.015, 0.01, 0.02)).all()


@pytest.mark.slow
def test_estimate_knows_what_the_water_moves():
    """Without the answers to the water's inertia in its finer basis it is 0.27 to 0.29 of the truth here."""
    asked = job()
    built, (motion,) = build(asked), load_motions(asked.config.records, asked.folder)
    damping, ground = asked.config.damping, ground_at_steps(motion, 0.01, 10.0)
    models = reduce_scene_twice(built, ModeChoice(cutoff=50.0), damping)
    systems = [one.system for one in (*models, reduce_scene(built, ALL_MODES, damping))]
    own, finer, whole = (
        simulated(one, ground, 0.01, integrator="adaptive", cuts=(4,)).jump[..., 0] for one in systems
    )
    joints = systems[0].law.joints
    said, true = opening_error(own, finer, joints), opening_error(own, whole, joints)
    for name in joints:
        assert 0.5 < said.joints[name].l2 / true.joints[name].l2 < 2.0
    assert 0.8 < said.l2 / true.l2 < 1.1


@pytest.mark.slow
def test_reduced_dam_against_its_own_full_order(tmp_path):
    """Reduced at its step of 2.5 ms, the mesh by generalised-alpha at 0.625 ms."""
    found = verify(job(), tmp_path, duration=10.0).statement.document
    assert found["seconds"] == pytest.approx(10.0)
    assert max(joint["peak_error"] for joint in found["joints"].values()) < 0.02
    assert found["l2_error"] < 0.05
    assert found["peak_principal_stress_error"] < 0.03
    assert found["cpu_ratio_per_step"] > 1.0
