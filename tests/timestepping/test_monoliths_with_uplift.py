"""Three monoliths on massless rock: friction in bases and joints, weight, water, uplift, shaken."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml

from romdam import run
from romdam.config import load_config
from romdam.fem.loads import surface_force
from romdam.results.stored_run import read_run
from romdam.scene.build import build_scene
from romdam.terminal.lines import info_lines

RECORDS = Path(__file__).parents[2] / "data" / "records"
WIDTH, BASE, HEIGHT, LEVEL, G = 8.0, 24.0, 32.0, 28.0, 9.81
WEIGHT = 3 * 2400 * G * WIDTH * BASE * HEIGHT
NAMES = ("M1", "M2", "M3")
FRICTION = {"normal_stiffness": 20e9, "shear_stiffness": 10e9, "friction": 0.6}
BED = {"normal_stiffness": 1e11, "shear_stiffness": 5e10, "friction": 0.8, "cohesion": 1e6}


def job_in(folder, crack, duration):
    def block(at, size, **keys):
        return {"material": "concrete", "box": {"origin": at, "size": size, "element_size": 8.0}, **keys}

    faces = [{"block": name, "face": "ymin"} for name in NAMES]
    water = {"joints": [f"B{n}" for n in "123"], "level": LEVEL, "downstream": [0, 1, 0], "crack": crack}
    raw = {
        "materials": {"concrete": {"E": 30e9, "nu": 0.2, "rho": 2400}},
        "blocks": {name: block([k * WIDTH, 0, 0], [WIDTH, BASE, HEIGHT]) for k, name in enumerate(NAMES)}
        | {"rock": block([0, -16, -16], [24, 56, 16], mass=False)},
        "supports": [{"block": "rock", "face": "zmin"}],
        "joints": {
            "J12": {"between": ["M1", "M2"]} | FRICTION,
            "J23": {"between": ["M2", "M3"]} | FRICTION,
            **{f"B{n}": {"between": ["rock", f"M{n}"]} | BED for n in "123"},
        },
        "loads": {
            "gravity": [0, 0, -G],
            "hydrostatic": [{"level": LEVEL, "faces": faces}],
            "joint_water": [
                water | {"tailwater": 2.0, "drains": {"at": 3.0, "rule": "usbr"}},
                {"joints": ["J12", "J23"], "level": LEVEL, "downstream": [0, 1, 0], "waterstop": 1.0},
            ],
        },
        "damping": {"rayleigh": {"frequencies": [4, 30], "ratio": 0.05}},
        "records": [
            {
                "name": "nr",
                "unit": "9.81 m/s2",
                "dt": 0.01,
                "components": {
                    "x": {"file": str(RECORDS / "northridge_mul279_g_dt0.01.txt")},
                    "y": {"file": str(RECORDS / "northridge_mul009_g_dt0.01.txt")},
                },
            }
        ],
        "model": {"modes": 12},
        "transient": {"finest_step": 0.0025, "duration": duration},
        "outputs": {"error_estimate": True, "plots": False, "output_interval": 0.01},
    }
    (folder / "dam.yaml").write_text(yaml.safe_dump(raw))
    return load_config(folder / "dam.yaml")


@pytest.mark.slow
@pytest.mark.parametrize("crack", ["unchanged", "full"])
def test_reactions_rest_and_ledger(crack, tmp_path):
    """At rest weight, thrust and water are in balance to 1e-9 of the weight; the ledger stays shut.

    The balance is that of the run's forces, in double precision; the file rounds shear forces to single.
    """
    job = job_in(tmp_path, crack, 6.0)
    done = run(job, tmp_path / "out")
    (path,), result = done.paths, done.lone
    assert result is not None
    written = xr.load_dataset(path)
    assert written.shear_force.dtype == np.float32
    off = np.abs(written.shear_force.values - result.shear_force.values)
    assert (off <= 0.5 * np.spacing(np.abs(written.shear_force.values))).all()
    np.testing.assert_array_equal(written.normal_force, result.normal_force)
    scene = build_scene(job.config, job.folder, "dam.yaml")
    total = sum(surface_force(scene, name).sum(axis=0) for name in NAMES) - [0.0, 0.0, WEIGHT]
    normal, shear = result.normal_force.values[0], result.shear_force.values[0]
    axes = np.concatenate([result.gap_normal.values[:, None], result.gap_tangent.values], axis=1)
    stored = read_run(path).traction[0]
    for name in ("B1", "B2", "B3"):
        at = result.gap_joint.values == name
        joint = np.column_stack([-normal, shear])[at]
        total += np.einsum("na,nak->k", joint, axes[at]) + result.water_force.sel(joint=name).values
        np.testing.assert_array_equal(stored[at][:, 1:], written.shear_force.values[0][at])
    if "crack_water_force" in result:
        entered = result.crack_water_force.values
        base = np.char.startswith(result.gap_joint.values, "B")
        total += (entered[0] * base) @ result.gap_normal.values
        assert (entered[:, ~base] == 0.0).all()
        assert stored[:, 0] == pytest.approx(entered[0] - normal)
    assert np.abs(total).max() < 1e-9 * WEIGHT
    assert ("crack_water_force" in result) == (crack == "full")
    assert float(result.attrs["solver_ledger_imbalance"]) < 1e-10
    thrust = 3 * 1000 * G * WIDTH * LEVEL**2 / 2
    assert surface_force(scene, "M2")[:, 1].sum() == pytest.approx(thrust / 3, rel=1e-9)
    first = normal[result.gap_joint.values == "B1"].sum()
    lines = [line for line in info_lines(result) if line.startswith("water ")]
    assert len(lines) == 5
    assert lines[0].startswith("water          B1: ")
    assert lines[0].endswith(f"MN on M1; effective normal force at the start {1e-6 * first:.4g} MN")
