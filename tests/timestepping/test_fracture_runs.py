"""Runs of blocks on a joint that softens: any mesh and spacing, suites, states, warnings."""

import numpy as np
import pytest
import yaml

import romdam
from romdam.core.errors import ConfigError

F, G, AREA = 1e6, 200.0, 2.0  # Pa, N/m, m2


def job(
    folder,
    size=0.5,
    spacing=None,
    along="x",
    peak=60.0,
    energy=G,
    softening="linear",
    finest_step="0.5 ms",
    duration=2.0,
    **changes,
):
    """A tower of 2 x 1 x 4 m on a base, pushed over along x, or pulled off along z, by a rising acceleration.

    It rises to `peak` [m/s2] within 1 s and is gone 0.5 s later.
    """
    time = np.linspace(0.0, 2.0, 401)
    push = peak * np.interp(time, [0.0, 1.0, 1.5], [0.0, 1.0, 0.0]) ** 1.5
    np.savetxt(folder / "push.txt", push if along == "x" else -push)
    box = {"element_size": size, "element": "hex8"}
    joint = {
        "between": ["base", "tower"],
        "normal_stiffness": "100 GPa/m",
        "shear_stiffness": "50 GPa/m",
        "shear_key": {"depth": 1.0},
        "fracture": {"tensile_strength": F, "energy": energy, "softening": softening},
    }
    record = {"name": "push", "file": "push.txt", "unit": "m/s2", "dt": 0.005, "components": {along: 1}}
    raw: dict[str, object] = {
        "materials": {"concrete": {"E": "30 GPa", "nu": 0.2, "rho": "2400 kg/m3"}},
        "blocks": {
            "base": {"material": "concrete", "box": box | {"origin": [0, 0, -1], "size": [2, 1, 1]}},
            "tower": {"material": "concrete", "box": box | {"origin": [0, 0, 0], "size": [2, 1, 4]}},
        },
        "supports": [{"block": "base", "face": "zmin"}],
        "joints": {"lift": joint | ({"spacing": spacing} if spacing else {})},
        "damping": {"rayleigh": {"alpha": 0.0, "beta": 1e-4}},
        "records": [record],
        "loads": {"gravity": [0, 0, -9.81]},
        "model": {"modes": 20},
        "transient": {"finest_step": finest_step, "duration": duration},
        "outputs": {"plots": False, "error_estimate": False, "mesh_error": False, "output_interval": "2 ms"},
    }
    path = folder / "tower.yaml"
    path.write_text(yaml.safe_dump(raw | changes))
    return romdam.load_config(path)


def result_of(folder, **changes):
    return romdam.open_result(romdam.run(job(folder, **changes), out=folder / "out").paths[0]).dataset


@pytest.mark.parametrize(
    ("size", "spacing"),
    [
        (1.0, None),
        pytest.param(0.5, None, marks=pytest.mark.slow),
        pytest.param(0.25, None, marks=pytest.mark.slow),
        (0.25, 0.5),
    ],
    ids=["1", "2", "4", "of 4"],
)
def test_a_tower_pulled_off_takes_the_energy_of_its_whole_joint(tmp_path, size, spacing):
    """2 m2 of 200 N/m, from meshes of 6 to 45 gaps, within 1 %; stored energy goes into motion."""
    found = result_of(tmp_path, size=size, spacing=spacing, along="z", peak=200.0)
    assert (found.opening[-1] > 1e-3).all()
    assert float(found.dissipated_energy[-1].sum()) == pytest.approx(G * AREA, rel=0.01)
    assert np.abs(found.energy_residual.values).max() <= 1e-9 * np.abs(found.energy_input.values).max()


@pytest.mark.slow
def test_load_against_crack_opening_converges_with_the_mesh(tmp_path):
    """Pushed over, cracked from the heel: the load at openings of 50 and 100 um of the heel, against that of
    elements of 0.125 m. Of 0.25 m it is off by 1.6 %, with gaps 0.5 m apart by 3.7 %, of 0.5 m by 5.0 %."""
    loads = []
    for size, spacing in ((0.125, None), (0.25, None), (0.25, 0.5), (0.5, None)):
        found = result_of(tmp_path, size=size, spacing=spacing)
        widest = np.maximum.accumulate(found.opening.values.max(axis=1))
        times = [
            np.interp(at, widest[found.time <= 1.0], found.time[found.time <= 1.0]) for at in (5e-5, 1e-4)
        ]
        loads.append(np.array(times) ** 1.5)
    for one, off in zip(loads[1:], (0.02, 0.04, 0.055), strict=True):
        assert one == pytest.approx(loads[0], rel=off)


@pytest.mark.parametrize(
    ("softening", "energy", "peak", "finest_step"),
    [
        ("linear", 40.0, 40.0, "0.1 ms"),
        pytest.param("exponential", 40.0, 40.0, "0.1 ms", marks=pytest.mark.slow),
        # the last two gaps crack in turn unless what closes a crack is all that the other answers
        pytest.param("exponential", 82.04727492633185, 42.659189063528366, "0.1 ms", marks=pytest.mark.slow),
        ("exponential", 51.354182238751406, 25.412790893987705, "0.5 ms"),
    ],
)
def test_a_brittle_joint_pushed_over_cracks_in_every_step(tmp_path, softening, energy, peak, finest_step):
    """Newton's corrections of the limits of several gaps go in a circle there; it dissipates G_f A."""
    found = result_of(
        tmp_path, peak=peak, energy=energy, softening=softening, finest_step=finest_step, duration=1.5
    )
    assert (found.opening[-1] > 1e-3).any()
    assert 0.8 * energy * AREA < float(found.dissipated_energy[-1].sum()) < 1.01 * energy * AREA
    assert np.abs(found.energy_residual.values).max() <= 1e-10 * np.abs(found.energy_input.values).max()


@pytest.mark.parametrize("modes", [2, pytest.param(15, marks=pytest.mark.slow)])
def test_the_statement_of_the_modes_holds_where_a_joint_cracks(tmp_path, modes):
    """Against all modes: 0.15 and 0.03 % of the openings are stated within a factor of two."""
    loud = {"plots": False, "error_estimate": True, "mesh_error": False, "output_interval": "2 ms"}
    cracked = result_of(tmp_path, peak=20.0, model={"modes": modes}, outputs=loud)
    every = result_of(tmp_path, peak=20.0, model={"modes": "all"}).opening.values
    true = np.linalg.norm(cracked.opening.values - every) / np.linalg.norm(every)
    stated = cracked.attrs["error_estimate_opening_l2"]
    assert true > 1e-4 and 0.5 < stated / true < 2.0


def test_gaps_farther_apart_than_the_process_zone_are_told(tmp_path):
    """E G_f / f_t^2 is 0.6 and 0.18 m, gaps are 0.35 m apart."""
    found = result_of(tmp_path, energy=20.0, transient={"finest_step": "2 ms", "duration": 0.1})
    assert "lift.fracture" not in str(found.attrs)
    found = result_of(tmp_path, energy=6.0, transient={"finest_step": "2 ms", "duration": 0.1})
    assert "joints.lift.fracture: gaps are" in str(found.attrs) and "0.18 m" in str(found.attrs)


@pytest.mark.slow
def test_a_second_run_goes_on_with_what_the_first_one_left_of_the_bond(tmp_path):
    """Cracked from the heel, closed again, and pulled off in a run of its own: both together take G_f A."""
    first = tmp_path / "first"
    first.mkdir()
    shaken = romdam.run(job(first, peak=29.0), out=first / "out").paths[0]
    before = romdam.open_result(shaken).dataset
    spent = float(before.dissipated_energy[-1].sum())
    assert 0.01 * G * AREA < spent < 0.5 * G * AREA
    for take in ("all", "joints"):
        loads = {"gravity": [0, 0, -9.81], "initial_state": {"result": str(shaken), "take": take}}
        after = result_of(tmp_path, along="z", peak=200.0, loads=loads)
        assert float(after.dissipated_energy[-1].sum()) + spent == pytest.approx(G * AREA, rel=0.01)


@pytest.mark.slow
def test_a_suite_varies_energies_and_strengths_and_no_words(tmp_path):
    key = {"path": "joints.lift.fracture.energy", "values": ["100 N/m", "300 N/m"]}
    suite = {"parameters": {"G": key}}
    romdam.run_suite(
        job(tmp_path, peak=29.0, pipeline="suite", suite=suite),
        tmp_path / "out",
        romdam.SuiteOptions(workers=1),
    )
    peaks = romdam.open_suite(tmp_path / "out").gap_peak_opening.max("gap").values.ravel()
    assert peaks.shape == (2,) and peaks[0] > 1.2 * peaks[1] > 0.0
    words = {"parameters": {"s": {"path": "joints.lift.fracture.softening", "values": [1, 2]}}}
    with pytest.raises(ConfigError, match="softening"):
        romdam.run_suite(job(tmp_path, pipeline="suite", suite=words), out=tmp_path / "other")
