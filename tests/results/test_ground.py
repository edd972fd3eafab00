"""The ground acceleration of a result is the one that was integrated, held against the motion it caused."""

import numpy as np
import pytest

import romdam

DT = 0.01


def ground(seconds=0.6):
    """(nt,) [m/s2], far from zero at its end, with a velocity that ends at zero."""
    time = np.arange(round(seconds / DT) + 1) * DT
    acc = 2.0 * np.sin(2.0 * np.pi * 4.3 * time) + 1.5 * np.cos(2.0 * np.pi * 31.0 * time)
    return acc - 0.5 * (acc[1:] + acc[:-1]).mean()


def job(step, **sections):
    """A wall of one mode and one static vector along each axis, damped by 3 %, shaken for 1 s."""
    wall = {"origin": [0, 0, 0], "size": [5, 5, 20], "element_size": "5 m"}
    return {
        "materials": {"concrete": {"E": "30 GPa", "nu": 0.18, "rho": "2440 kg/m3"}},
        "blocks": {"wall": {"material": "concrete", "box": wall}},
        "supports": [{"block": "wall", "face": "zmin"}],
        "damping": {"modal": "3 %"},
        "records": [{"file": "r.txt", "unit": "m/s2", "dt": "0.01 s", "components": {"y": 1}}],
        "model": {"modes": 2, "residual_vectors": 0},
        "transient": {"finest_step": step, "duration": "1 s"},
        "loads": {"initial_state": "undeformed"},
        "outputs": {
            "plots": False, "error_estimate": False, "output_interval": step,
            "nodes": {
                "top": {"block": "wall", "at": [0, 0, 20]},
                "middle": {"block": "wall", "at": [0, 0, 10]},
            },
        },
    } | sections  # fmt: skip


def run(tmp_path, raw, **options):
    np.savetxt(tmp_path / "r.txt", ground())
    return romdam.run(romdam.load_config(raw, tmp_path), **options).results[0].dataset


def integrated(data):
    """Ground acceleration along y that the motion of two nodes shows.

    Two coordinates q move along y. Each gives u_g'' = -(q'' + 2 xi w q' + w^2 q) / Gamma and is a combination
    of both nodes' displacements. So one combination of displacements, velocities and accelerations is u_g'';
    the factors are those of the rows in which the record shakes the wall, their ratios are the wall's.
    """
    columns = np.column_stack(
        [
            data[name].sel(node=node, component="y").values
            for node in ("top", "middle")
            for name in ("acceleration", "velocity", "displacement")
        ]
    )
    inside = data.time.values < 0.55
    known = data.ground_acceleration.sel(component="y").values
    scale = np.abs(columns).max(axis=0)
    factors = np.linalg.lstsq(columns[inside] / scale, known[inside], rcond=None)[0] / scale
    # both coordinates give the same u_g'', which is one relation among the six columns
    assert np.linalg.matrix_rank(columns[inside] / scale) == 5 < inside.sum() / 9
    return columns @ factors


@pytest.mark.parametrize("step", ["10 ms", "2.5 ms"])
@pytest.mark.parametrize("resampling", ["linear", "fourier"])
@pytest.mark.parametrize("integrator", ["adaptive", "modal"])
def test_ground_of_a_record_that_ends_before_the_run(tmp_path, integrator, resampling, step):
    raw = job(step)
    raw["transient"]["integrator"] = integrator
    raw["records"][0]["resampling"] = resampling
    data = run(tmp_path, raw)
    written, time = data.ground_acceleration.sel(component="y").values, data.time.values
    assert np.allclose(integrated(data), written, atol=1e-7)
    assert (written[time > 0.6 + 1e-9] == 0.0).all() and abs(written[time < 0.6 + 1e-9][-1]) > 1.0
    between = np.interp(time, np.arange(len(ground())) * DT, ground(), right=0.0)
    off = np.abs(written - between)[time < 0.6].max()
    assert off < 1e-12 if resampling == "linear" or step == "10 ms" else off > 0.05
    assert not data.ground_acceleration.sel(component=["x", "z"]).any()


def test_ground_of_a_motion_from_python_that_is_cut(tmp_path):
    motion = romdam.GroundMotion.from_arrays("p", {"y": ground(3.0)}, DT)
    data = run(tmp_path, job("5 ms"), motions=motion)
    assert np.allclose(integrated(data), data.ground_acceleration.sel(component="y"), atol=1e-7)
    assert np.allclose(data.ground_acceleration.sel(component="y")[::2], ground(3.0)[:101], atol=1e-12)


def test_ground_of_steps_that_an_accuracy_chooses(tmp_path):
    raw = job("10 ms")
    del raw["transient"]["finest_step"]
    data = run(tmp_path, raw | {"transient": raw["transient"] | {"accuracy": "1 %"}})
    assert np.allclose(integrated(data), data.ground_acceleration.sel(component="y"), atol=1e-7)
    assert not data.ground_acceleration.sel(time=slice(0.61, None)).any()


def test_ground_of_generalised_alpha_and_of_moving_supports(tmp_path):
    """Its acceleration at a step is not that of the equation of motion: the record says what is right."""
    raw = job("2.5 ms") | {"supports": [{"block": "wall", "face": "zmin", "motion": {"delay": "50 ms"}}]}
    raw["transient"]["integrator"] = "generalized_alpha"
    data = run(tmp_path, raw)
    expected = np.interp(data.time, np.arange(len(ground())) * DT, ground())
    expected[data.time.values > 0.6 + 1e-9] = 0.0
    assert np.allclose(data.ground_acceleration.sel(component="y"), expected, atol=1e-12)
