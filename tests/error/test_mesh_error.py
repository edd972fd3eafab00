"""The statement of the mesh's error: numbers by hand, the command, and a truth."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml
from arch_dams import PERIMETER, ROCK, ROCKS, arch_dam
from mesh_runs import mesh_run
from scipy.spatial import cKDTree
from test_cli import SMALL, call

import romdam
import romdam.pipelines.error.sibling as sibling_module
from romdam.config.load import load_config
from romdam.config.other_mesh import sibling_meshes
from romdam.core.errors import ConfigError, ResultError
from romdam.core.system import SLIP
from romdam.error.discretisation import (
    OVER_COARSER,
    OVER_COARSER_QUADRATIC,
    OVER_FINER,
    SiblingRun,
    discretisation,
)
from romdam.pipelines.error.verify import run_on_mesh
from romdam.pipelines.run import Clock, silent
from romdam.records.record_set import load_motions
from romdam.scene.build import build_scene
from romdam.timestepping import load_order

TIME = np.linspace(0.0, 4.0, 401)
ABOUT = {"record": "pulse", "seconds": 4.0}


def run_of(opening, slip=(0.0, 0.0, 0.0), force=(1.0, 1.0, 1.0), motion=1.0, every=1, spectrum=2.0, rest=0.0):
    """Three gaps, one in joint j and two in k; `every` further gaps lie between on a finer mesh.

    `rest` is the force of each gap at rest, half of it water's: the mean before the first row is zero.
    """
    shape = np.sin(3.0 * TIME)[:, None]
    jump = np.stack(
        [
            shape * np.array(opening),
            np.clip(TIME, 0.0, 1.0)[:, None] * np.array(slip),
            0.0 * shape * np.ones(3),
        ],
        axis=2,
    )
    force = np.stack([shape * np.array(force), *[0.0 * shape * np.ones(3)] * 2], axis=2)
    position = np.array([[0.0, 0.0, 1.0], [5.0, 0.0, 1.0], [5.0, 0.0, 2.0]])
    if every > 1:  # a gap more in each joint, which the other mesh has not
        jump, force = (np.insert(a, [1, 3], 7.0, axis=1) for a in (jump, 0.5 * force))
        jump[:, [1, 4], 1:] = 0.0
        grown = np.clip(TIME, 0.0, 1.0)
        jump[:, 1, 1], jump[:, 4, 1] = slip[0] * grown, np.mean(slip[1:]) * grown  # the joint's mean stays
        position = np.insert(position, [1, 3], [[0.0, 0.0, 1.5], [5.0, 0.0, 1.5]], axis=0)
        joints = {"j": slice(0, 2), "k": slice(2, 5)}
        force[:, 1, 0] = force[:, 0, 0]
        force[:, 4, 0] = force[:, 2, 0] + force[:, 3, 0]
    else:
        joints = {"j": slice(0, 1), "k": slice(1, 3)}
    disp = motion * shape * np.array([1.0, 0.5, 0.0])
    state = np.full(jump.shape[:2], SLIP)
    force[1:, :, 0] += rest
    traction, water = np.zeros_like(force), np.full(jump.shape[:2], 0.5 * rest)
    traction[:, :, 0] = force[:, :, 0] - water
    traction[0, :, 0] = 0.5 * rest
    forces = {"mean_traction": force, "traction": traction, "water": water}
    history = SimpleNamespace(time=TIME, jump=jump, disp=disp, acc=disp, state=state, **forces)
    area = np.ones(len(position))
    return mesh_run(history, position, area, joints, 30 * every, nodes=("top",), spectrum=spectrum)


def test_each_quantity_has_its_own_error_and_a_finer_mesh_one_and_a_half_times_the_difference():
    """Openings 10 % off in j and 20 % in k, forces twice as large, motion 5 %, spectra 25 %."""
    coarse = run_of([1.1, 1.2, 2.4], force=(2.0, 2.0, 4.0), motion=1.05, spectrum=2.5)
    fine = run_of([1.0, 1.0, 2.0], force=(1.0, 1.0, 2.0), every=2)
    stated = discretisation(coarse, fine, finer=True, about=ABOUT)
    opening = stated.errors["opening"]
    assert opening.joints["j"].l2 == pytest.approx(1.5 * 0.1)
    assert opening.joints["k"].l2 == pytest.approx(1.5 * 0.2) == opening.joints["k"].peak
    assert opening.l2 == pytest.approx(1.5 * np.sqrt((0.1**2 + 0.2**2 + 0.4**2) / 6.0))
    assert opening.peak == pytest.approx(1.5 * 0.2)
    force = stated.errors["joint_force"]
    assert force.joints["j"].l2 == force.joints["k"].l2 == pytest.approx(1.5)
    assert stated.errors["displacement"].l2 == pytest.approx(1.5 * 0.05)
    assert stated.errors["response_spectrum"].peak == pytest.approx(1.5 * 0.25)
    assert stated.details["nodes"]["top"]["displacement"]["peak"] == pytest.approx(1.5 * 0.05)
    assert stated.details["gaps_compared"] == 3 and stated.details["gaps_sibling"] == 5
    assert "; neither mesh resolves joint forces, joint pressures, response spectra: " in stated.sentence
    assert "displacements by 7.5 %" in stated.sentence and "(60 unknowns for 30)" in stated.sentence


def test_a_coarser_mesh_is_judged_by_the_own_one_and_half_of_the_difference_is_stated():
    own, coarser = run_of([1.0, 1.0, 2.0], every=2), run_of([1.1, 1.2, 2.4])
    stated = discretisation(own, coarser, finer=False, about=ABOUT)
    assert stated.errors["opening"].joints["k"].l2 == pytest.approx(0.5 * 0.2)
    assert "0.5 of the difference to elements of twice the size" in stated.sentence


def test_joint_forces_count_from_those_at_rest():
    """Forces move by 2 on the one mesh and by 1 on the other, about 1000 N at rest on a gap of each."""
    coarse = run_of([1.0, 1.0, 2.0], force=(2.0, 2.0, 4.0), rest=1000.0)
    fine = run_of([1.0, 1.0, 2.0], force=(1.0, 1.0, 2.0), rest=1000.0)
    errors = discretisation(coarse, fine, finer=True, about=ABOUT).errors
    for name in ("joint_force", "joint_pressure"):
        assert [errors[name].l2, errors[name].peak] == pytest.approx([1.5, 1.5])


def test_residual_slips_are_means_of_joints():
    """Slips left of 10 mm in j and of 20 and 40 mm in k are 8 mm, and 20 and 34 mm, on the finer mesh."""
    coarse = run_of([1.0, 1.0, 2.0], slip=(0.010, 0.020, 0.040))
    fine = run_of([1.0, 1.0, 2.0], slip=(0.008, 0.020, 0.034), every=2)
    left = discretisation(coarse, fine, finer=True, about=ABOUT).errors["residual_slip"]
    assert left.joints["j"].l2 == pytest.approx(1.5 * 0.25)
    assert left.joints["k"].l2 == pytest.approx(1.5 * 3.0 / 27.0)
    assert left.l2 == pytest.approx(1.5 * 3.0 / 27.0)


def test_meshes_without_a_common_gap_are_refused():
    own = run_of([1.0, 1.0, 2.0])
    moved = replace(own, position=own.position + 0.1)
    with pytest.raises(ResultError, match="no gap of the one mesh is at a gap of the other within 1 mm"):
        discretisation(own, moved, finer=True, about=ABOUT)


def test_the_command_states_it_in_the_results_and_info_sums_all_errors(tmp_path):
    time = np.arange(100) * 0.01
    np.savetxt(tmp_path / "pulse.txt", 6.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-2 * time))
    raw = yaml.safe_load(SMALL)
    raw["outputs"] = raw.get("outputs", {}) | {"mesh_error": False}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(raw))
    out = tmp_path / "out"
    assert call("run", tmp_path / "small.yaml", "--out", out, "--quiet")[0] == 0
    code, before, _ = call("info", out / "pulse.nc")
    assert code == 0 and "mesh           its error, often the largest, is not known" in before
    code, _, err = call("verify", tmp_path / "small.yaml", "--mesh", "finer", "--out", out, "--quiet")
    assert code == 0, err
    document = json.loads((out / "discretisation.json").read_text())
    assert (out / "discretisation.png").exists() and document["sibling"] == "finer"
    with xr.open_dataset(out / "pulse.nc", engine="h5netcdf") as dataset:
        attrs = dict(dataset.attrs)
    assert attrs["discretisation_opening_l2"] == document["error"]["opening"]["l2"] > 0.0
    assert attrs["discretisation_statement"] == document["statement"]
    parts = ("discretisation_opening_l2", "error_estimate_opening_l2", "solver_estimated_time_error")
    total = 100.0 * sum(float(attrs[name]) for name in parts if name in attrs)
    _, after, _ = call("info", out / "pulse.nc")
    assert f"total          of the openings in L2 at most {total:.2g} %: mesh " in after
    parts = "discretisation_opening_peak", "error_estimate_opening_peak", "solver_estimated_time_error_peaks"
    peaks = 100.0 * sum(float(attrs[name]) for name in parts if name in attrs)
    assert f"; of their peaks at most {peaks:.2g} %\n" in after
    assert call("run", tmp_path / "small.yaml", "--out", out, "--quiet")[0] == 0  # it finds it again
    with xr.open_dataset(out / "pulse.nc", engine="h5netcdf") as dataset:
        assert dataset.attrs["discretisation_statement"] == document["statement"]


@pytest.mark.parametrize("asked", ["finer", "coarser"])
def test_a_run_states_it_where_the_job_asks(tmp_path, asked):
    """As `romdam verify --mesh` states it of the same seconds."""
    time = np.arange(100) * 0.01
    np.savetxt(tmp_path / "pulse.txt", 6.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-2 * time))
    raw = yaml.safe_load(SMALL)
    for block in raw["blocks"].values():
        block["box"]["element_size"] = 2.5
    raw["model"] = {"modes": 4}
    plain = tmp_path / "plain.yaml"
    plain.write_text(yaml.safe_dump(raw))
    raw["outputs"] = raw.get("outputs", {}) | {"mesh_error": asked}
    (tmp_path / "asked.yaml").write_text(yaml.safe_dump(raw))
    code, _, err = call("run", tmp_path / "asked.yaml", "--out", tmp_path / "run", "--quiet")
    assert code == 0, err
    code, _, err = call("verify", plain, "--mesh", asked, "--out", tmp_path / "verify", "--quiet")
    assert code == 0, err
    document = json.loads((tmp_path / "verify" / "discretisation.json").read_text())
    with xr.open_dataset(tmp_path / "run" / "pulse.nc", engine="h5netcdf") as dataset:
        assert dataset.attrs["discretisation_opening_l2"] == document["error"]["opening"]["l2"] > 0.0
        assert json.loads(dataset.attrs["discretisation"])["error"] == document["error"]


def small_job(folder, element_size, **outputs):
    """Two blocks in a pulse of a second, in a file."""
    time = np.arange(100) * 0.01
    np.savetxt(folder / "pulse.txt", 6.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-2 * time))
    raw = yaml.safe_load(SMALL)
    for block in raw["blocks"].values():
        block["box"]["element_size"] = element_size
    raw["model"] = {"modes": 4}
    raw["outputs"] = raw.get("outputs", {}) | outputs
    (folder / "small.yaml").write_text(yaml.safe_dump(raw))
    return folder / "small.yaml"


def attributes_of(path):
    with xr.open_dataset(path, engine="h5netcdf") as dataset:
        return dict(dataset.attrs)


def test_every_run_states_it_from_a_coarser_mesh_unless_it_is_not_to(tmp_path):
    """By default as `coarser` does; `false` leaves it out; what another mesh has stated is not replaced."""
    stated = {}
    for key in ("auto", "coarser", False):
        path = small_job(tmp_path, 2.5, **({} if key == "auto" else {"mesh_error": key}))
        code, _, err = call("run", path, "--out", tmp_path / str(key), "--quiet")
        assert code == 0, err
        stated[key] = attributes_of(tmp_path / str(key) / "pulse.nc")
    assert json.loads(stated["auto"]["discretisation"])["sibling"] == "coarser"
    assert stated["auto"]["discretisation"] == stated["coarser"]["discretisation"]
    assert stated["auto"]["cpu_seconds_mesh_model"] > 0.0 and stated["auto"]["cpu_seconds_mesh"] > 0.0
    assert "discretisation" not in stated[False] and "cpu_seconds_mesh" not in stated[False]
    path, out = small_job(tmp_path, 2.5), tmp_path / "auto"
    assert call("verify", path, "--mesh", "finer", "--out", out, "--quiet")[0] == 0
    assert call("run", path, "--out", out, "--quiet")[0] == 0
    assert json.loads(attributes_of(out / "pulse.nc")["discretisation"])["sibling"] == "finer"


def test_a_mesh_without_a_coarser_one_is_judged_by_a_finer_one_while_it_is_small(tmp_path, monkeypatch):
    """Blocks of one element cannot have elements of twice the size; beyond the limits that is said."""
    path = small_job(tmp_path, 5.0)
    code, _, err = call("run", path, "--out", tmp_path / "out", "--quiet")
    assert code == 0, err
    attrs = attributes_of(tmp_path / "out" / "pulse.nc")
    assert json.loads(attrs["discretisation"])["sibling"] == "finer"
    assert attrs["discretisation_opening_l2"] > 0.0
    monkeypatch.setattr(sibling_module, "_MOST_UNKNOWNS", 100)
    assert call("run", path, "--out", tmp_path / "large", "--quiet")[0] == 0
    attrs = attributes_of(tmp_path / "large" / "pulse.nc")
    why = "has 1 elements along x, which cannot be halved; compare with a finer mesh instead"
    assert attrs["discretisation_statement"].startswith("What the mesh changes is unknown: blocks.")
    assert why in attrs["discretisation_statement"] and "discretisation_opening_l2" not in attrs
    assert "with `outputs: {mesh_error: finer}` only" in attrs["discretisation_statement"]
    code, out, _ = call("info", tmp_path / "large" / "pulse.nc")
    assert code == 0 and "mesh unknown" in out and str(tmp_path) not in attrs["discretisation_statement"]


def test_modes_that_a_coarser_mesh_has_not_are_all_of_its_modes(tmp_path):
    """60 modes are asked for; blocks of elements of twice the size have fewer unknowns than that."""
    path = small_job(tmp_path, 2.5)
    raw = yaml.safe_load(path.read_text())
    raw["model"] = {"modes": 60}
    path.write_text(yaml.safe_dump(raw))
    code, _, err = call("run", path, "--out", tmp_path / "out", "--quiet")
    assert code == 0, err
    attrs = attributes_of(tmp_path / "out" / "pulse.nc")
    assert json.loads(attrs["discretisation"])["sibling"] == "coarser"


def test_two_siblings_show_the_order_of_quadratic_elements():
    """Errors of 1, 8 and 64 %: an order of 3; of 1, 4 and 16 %: of 2, and a third of the difference."""
    for order in (3.0, 2.0):
        first, second, third = (run_of(1.0 + 0.01 * 2.0 ** (order * k) * np.ones(3)) for k in range(3))
        run = replace(first, quadratic=True)
        stated = discretisation(run, second, finer=False, about=ABOUT, second=third)
        difference = (2.0**order - 1.0) * 0.01 / 1.01
        got = stated.errors["opening"].l2
        if order == 2.0:
            shown = np.log2((12.0 / 1.04) / (3.0 / 1.01))
            assert got == pytest.approx(difference / (2.0**shown - 1.0), rel=1e-9)
            assert got == pytest.approx(0.01, rel=0.1)
            assert "as the difference to four times the size shows" in stated.sentence
        else:
            assert got == pytest.approx(0.01, rel=0.1)


def test_an_error_is_relative_to_what_moves():
    """Initial gaps of 1 m, and a displacement at rest of a metre, change no error."""
    run, sibling = run_of((1.0, 2.0, 3.0)), run_of((1.1, 2.2, 3.3), motion=1.1)

    def shifted(one):
        jump, by = one.jump.copy(), {"displacement": 1.0, "joint_force": 50.0, "joint_pressure": 50.0}
        jump[..., 0] += 1.0
        histories = dict(one.histories) | {name: one.histories[name] + rest for name, rest in by.items()}
        return replace(one, jump=jump, histories=histories)

    plain = discretisation(run, sibling, finer=True, about=ABOUT).errors
    with_rest = discretisation(shifted(run), shifted(sibling), finer=True, about=ABOUT).errors
    for name in ("opening", "slip", "joint_force", "joint_pressure", "displacement"):
        assert with_rest[name].l2 == pytest.approx(plain[name].l2, rel=1e-9, abs=1e-12), name
        assert with_rest[name].peak == pytest.approx(plain[name].peak, rel=1e-9, abs=1e-12), name


def test_what_is_left_of_a_joint_that_still_slides_is_not_stated():
    """Joint k slides by 0.1 mm a second at the end, with 0.3 mm on the mean behind it; joint j rests."""
    run, sibling = (
        run_of((1.0, 1.0, 1.0), slip=(0.01, 0.0, 0.0)),
        run_of((1.0, 1.0, 1.0), slip=(0.012, 0.0, 0.0)),
    )
    for one in (run, sibling):
        one.jump[:, 1:, 1] = 1e-4 * TIME[:, None]
    stated = discretisation(run, sibling, finer=True, about=ABOUT)
    assert set(stated.errors["residual_slip"].joints) == {"j"}
    assert stated.errors["residual_slip"].l2 == pytest.approx(1.5 * 0.002 / 0.012)
    assert stated.details["joints_still_sliding"] == ["k"]
    assert "the slip that is left in k is not stated, for it still slides" in stated.sentence


def test_fewer_contact_points_than_nodes_are_a_term_of_their_own():
    """Elements leave 1.5 of 2 %, contact points 10 %: the sum is stated of every quantity."""
    run, finer = run_of((1.02, 2.04, 3.06)), run_of((1.0, 2.0, 3.0))
    points = run_of((1.1, 2.2, 3.3)), run_of((1.0, 2.0, 3.0))
    stated = discretisation(run, finer, finer=True, about=ABOUT, points=points)
    assert stated.errors["opening"].l2 == pytest.approx(1.5 * 0.02 + 0.1)
    assert stated.errors["opening"].joints["k"].peak == pytest.approx(1.5 * 0.02 + 0.1)
    assert stated.details["contact_points"]["opening"]["l2"] == pytest.approx(0.1)
    assert stated.details["elements"]["opening"]["l2"] == pytest.approx(0.03)
    assert set(stated.details["contact_points"]["displacement"]) == {"l2", "peak"}  # nodes are no joints
    assert "and 10 % for contact points that are fewer than the nodes" in stated.sentence


def test_check_has_the_cost_of_the_mesh_statement(tmp_path):
    from romdam.pipelines.check import check

    costs = [check(small_job(tmp_path, 2.5, mesh_error=key)).costs["mesh"] for key in ("auto", False)]
    assert costs[0] > 50.0 * costs[1]


def test_what_moves_converges_faster_on_quadratic_elements():
    """Of 10 % to a coarser mesh 2 % are stated of openings and displacements, 5 % of forces."""
    numbers = {"opening": (0.9, 1.8, 2.7), "force": (0.9, 0.9, 0.9), "motion": 0.9, "spectrum": 1.8}
    run, sibling = run_of((1.0, 2.0, 3.0)), run_of(**numbers)
    stated = discretisation(replace(run, quadratic=True), sibling, finer=False, about=ABOUT)
    expected = {"opening": 0.02, "displacement": 0.02, "joint_force": 0.05, "response_spectrum": 0.05}
    for name, value in expected.items():
        assert stated.errors[name].l2 == pytest.approx(value, rel=1e-9)
    assert stated.details["nodes"]["top"]["displacement"]["l2"] == pytest.approx(0.02, rel=1e-9)
    assert stated.details["error_over_difference"] == 0.2 and "0.2 of the difference" in stated.sentence
    stated = discretisation(replace(sibling, quadratic=True), run, finer=True, about=ABOUT)
    for name in expected:  # 1.5 of it to a finer mesh, whatever the elements
        assert stated.errors[name].l2 == pytest.approx(0.15, rel=1e-9)


def test_errors_of_directions_add_up_as_squares():
    """Up 10 % of the run, along 5 % of that: 2 % and, from 3 to 2 elements, 1 / (1.5^2.585 - 1) of 5 %."""
    run, up = run_of((1.0, 2.0, 3.0), motion=1.0), run_of((1.1, 2.2, 3.3), motion=1.1)
    along = run_of((1.155, 2.31, 3.465), motion=1.1)
    run, up = replace(run, quadratic=True, unknowns=100), replace(up, quadratic=True, unknowns=60)
    siblings = [SiblingRun("up", 2.0, up), SiblingRun("along", 1.5, along)]
    stated = discretisation(run, siblings, finer=False, about=ABOUT)
    of_along = 0.05 / (1.5 ** np.log2(6.0) - 1.0)
    for error in (stated.errors["opening"], stated.errors["opening"].joints["k"]):
        assert error.l2 == pytest.approx(np.hypot(0.02, of_along)) == error.peak
    assert stated.errors["displacement"].l2 == pytest.approx(0.02)
    assert stated.details["nodes"]["top"]["displacement"]["l2"] == pytest.approx(0.02)
    directions = stated.details["directions"]
    assert directions["up"]["l2"] == pytest.approx(0.02)
    assert directions["along"]["joints"]["j"]["l2"] == pytest.approx(of_along)
    # 60 of 100 unknowns are left at half the divisions, so that twice of them have 180
    assert directions["up"]["times_unknowns_to_halve"] == pytest.approx(1.8)
    assert "up 2 % (half the size: 1.8 times the unknowns, 1 times the gaps), along 2.7 % " in stated.sentence


def test_finer_rock_below_a_coarser_dam_is_judged_by_the_difference_to_it():
    """Up 2 % as above; the rock changes 5 % of the coarser run, relative to finer rock, of order 2.6."""
    run, up, rock = (replace(run_of((k, 2.0 * k, 3.0 * k)), quadratic=True) for k in (1.0, 1.1, 1.1 / 0.95))
    up, rock = replace(up, unknowns=60), replace(rock, unknowns=150)
    chain = [SiblingRun("up", 2.0, up), SiblingRun("rock", 0.5, rock)]
    stated = discretisation(replace(run, unknowns=100), chain, finer=False, about=ABOUT)
    directions = stated.details["directions"]
    assert [part["l2"] for part in directions.values()] == pytest.approx([0.02, 1.2 * 0.05])
    assert directions["rock"]["times_unknowns_to_halve"] == pytest.approx(2.5)
    assert stated.errors["opening"].l2 == pytest.approx(np.hypot(0.02, 0.06))
    assert "from twice the size in the dam and half of it in the rock: up 2 % " in stated.sentence


def arch_job(folder, divisions, **dam):
    """A dam of three cantilevers without rock in a pulse of two seconds."""
    time = np.arange(200) * 0.01
    np.savetxt(folder / "pulse.txt", 6.0 * np.sin(2 * np.pi * 3.0 * time) * np.exp(-time))
    keys = {"element": "hex20", "divisions": divisions, "cantilevers": 3} | dam
    components = {axis: {"file": "pulse.txt"} for axis in "yx"}
    wet = [{"block": f"C{k}", "face": "upstream"} for k in (1, 2, 3)]
    raw = arch_dam(ground=False, **keys) | {
        "loads": {"gravity": [0, 0, -9.81], "hydrostatic": [{"level": 85.0, "faces": wet}]},
        "damping": {"rayleigh": {"frequencies": [2.0, 15.0], "ratio": 0.05}},
        "records": [
            {
                "name": "pulse",
                "unit": "m/s2",
                "dt": 0.01,
                "components": components,
            }
        ],
        "model": {"cutoff": 50.0, "residual_vectors": 10},
        "transient": {"finest_step": 1.25e-3, "duration": 2.0},
        "outputs": {"output_interval": 0.01, "plots": False},
    }
    path = folder / "arch.yaml"
    path.write_text(yaml.safe_dump(raw))
    return path


@pytest.mark.parametrize("element", ["hex8", "hex20"])
def test_siblings_of_a_dam_differ_in_one_more_direction_each(element, tmp_path):
    """What the dam stands on is finer below the last one: one layer, and odd numbers, have no half."""
    divisions = {"along": 3, "through": 2, "up": 3, "refine": 1, "growth": 2.25}
    rock = {"perimeter": 1, "rock": 5, "upstream": 3, "downstream": 4}
    raw = yaml.safe_load(arch_job(tmp_path, divisions | rock, element=element).read_text())
    raw["arch_dam"] |= {"perimeter": PERIMETER, "rock": ROCK}
    raw["materials"] |= ROCKS
    job = load_config(raw)
    chain = sibling_meshes(job)
    counts = [each.job.config.arch_dam.divisions for each in chain]
    of_dam = [(d.along, d.through, d.up) for d in counts]
    if element == "hex8":
        assert [(each.direction, each.times) for each in chain] == [("every direction", 2.0), ("rock", 0.5)]
        assert of_dam == 2 * [(3, 2, 3)]
    else:
        assert [(each.direction, each.times) for each in chain] == [
            ("up", 2.0), ("through", 2.0), ("along", 2.0), ("rock", 0.5)
        ]  # fmt: skip
        assert of_dam == [(6, 4, 3), (6, 2, 3), (3, 2, 3), (3, 2, 3)]
    assert {(d.perimeter, d.rock, d.upstream, d.downstream, d.growth) for d in counts[:-1]} == {
        (2, 10, 6, 8, 1.5)
    }
    finest = counts[-1]
    assert (finest.perimeter, finest.rock, finest.upstream, finest.downstream) == (4, 10, 6, 8)
    assert (finest.growth, finest.halved) == (1.5, 5)
    before, last = (build_scene(each.job.config, tmp_path, "job").blocks for each in chain[-2:])
    finer = cKDTree(np.concatenate([block.points for block in last.values()]))
    for name, block in before.items():  # layers in the ratio of the root: every other one is at its place
        corners = block.points[np.unique(block.cells[:, :8])]
        assert finer.query(corners)[0].max() < 1e-6
        times = {"C": 1, "p": 2}.get(name[0])  # cantilevers stay, the perimeter is of layers in one direction
        assert times is None or len(last[name].cells) == times * len(block.cells)


@pytest.mark.parametrize("divisions", [{"perimeter": 101}, {"rock": 101, "halved": 1}])
def test_layers_of_which_there_cannot_be_twice_as_many_are_refused(divisions, tmp_path):
    divisions = {"along": 2, "through": 2, "up": 2, "growth": 1.0} | divisions
    raw = yaml.safe_load(arch_job(tmp_path, divisions).read_text())
    raw["arch_dam"] |= {"perimeter": PERIMETER, "rock": ROCK}
    raw["materials"] |= ROCKS
    name = next(iter(divisions.keys() & {"perimeter", "rock"}))
    with pytest.raises(ConfigError, match=rf"arch_dam.divisions: more than 200 {name} are not meshed"):
        sibling_meshes(load_config(raw))


def test_siblings_of_odd_numbers_are_of_thirds_or_refused(tmp_path):
    odd = load_config(arch_job(tmp_path, {"along": 3, "through": 2, "up": 4}))
    assert [(each.direction, each.times) for each in sibling_meshes(odd)] == [
        ("up", 2.0), ("through", 2.0), ("along", 1.5)
    ]  # fmt: skip
    thirds = sibling_meshes(load_config(arch_job(tmp_path, {"along": 9, "through": 3, "up": 9})))
    assert [(each.direction, each.times) for each in thirds] == [
        ("up", 1.5), ("through", 1.5), ("along", 1.5)
    ]  # fmt: skip
    coarsest = thirds[-1].job.config.arch_dam.divisions
    assert (coarsest.along, coarsest.through, coarsest.up) == (6, 2, 6)
    with pytest.raises(ConfigError, match=r"arch_dam.divisions.through: is 5, of which neither half nor two"):
        sibling_meshes(load_config(arch_job(tmp_path, {"along": 2, "through": 5, "up": 4})))
    (every,) = sibling_meshes(load_config(arch_job(tmp_path, {}, element="hex8")))
    assert (every.direction, every.times) == ("every direction", 2.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("own", "halved"),
    [((3, 2, 8), (6, 4, 16)), ((3, 3, 9), (6, 6, 18))],
)
def test_what_a_dam_states_by_direction_is_within_a_factor_of_two_of_the_truth(own, halved, tmp_path):
    """Three cantilevers, the truth of elements of half the size; `romdam verify` states the same as the run.

    Of (3, 3, 9) two thirds are compared: 1.5 times the truth is stated in L2, 1.2 times at the peak.
    """
    own, halved = (dict(zip(("along", "through", "up"), each, strict=True)) for each in (own, halved))
    path = arch_job(tmp_path, own)
    code, _, err = call("run", path, "--out", tmp_path / "run", "--quiet")
    assert code == 0, err
    document = json.loads(attributes_of(tmp_path / "run" / "pulse.nc")["discretisation"])
    assert set(document["directions"]) == {"up", "through", "along"}
    code, _, err = call("verify", path, "--mesh", "coarser", "--out", tmp_path / "verify", "--quiet")
    assert code == 0, err
    verified = json.loads((tmp_path / "verify" / "discretisation.json").read_text())
    # the run's basis is made together with the finer one of its estimate
    assert verified["error"]["opening"]["l2"] == pytest.approx(document["error"]["opening"]["l2"], rel=1e-3)
    runs = []
    for divisions in (own, halved):
        job = load_config(arch_job(tmp_path, divisions))
        (motion,) = load_motions(job.config.records, job.folder)
        runs.append(run_on_mesh(job, motion, 2.0, Clock(silent), "run")[0])
    true = discretisation(*runs, finer=True, about=ABOUT).errors["opening"]
    stated = document["error"]["opening"]
    for measure in ("l2", "peak"):
        truth = getattr(true, measure) / OVER_FINER
        assert truth > 0.01
        assert 0.5 * truth <= stated[measure] <= 2.0 * truth, (measure, stated[measure], truth)


def test_a_coarser_mesh_that_resolves_nothing_shows_no_order_of_quadratic_elements():
    """The arch dam with one element through its thickness: 65 %, then 21 %: an order of 1.6."""
    run, sibling = run_of((1.0, 1.0, 1.0)), run_of((1.65, 1.65, 1.65))
    stated = discretisation(replace(run, quadratic=True), sibling, finer=False, about=ABOUT)
    assert stated.errors["opening"].l2 == pytest.approx(OVER_COARSER * 0.65)
    for off, factor in ((0.1, OVER_COARSER_QUADRATIC), (0.15, 0.2), (0.375, 0.35), (0.6, OVER_COARSER)):
        other = run_of((1.0 + off,) * 3)
        near = discretisation(replace(run, quadratic=True), other, finer=False, about=ABOUT)
        assert near.errors["opening"].l2 == pytest.approx(factor * off), off
        assert ("the truth is between 0.2 and 0.5 of it" in near.sentence) == (0.2 < factor < 0.5)


def test_peaks_that_agree_by_chance_are_those_of_all_places():
    """Both meshes open and move by 3 at most, at other places: root mean square of 1 and 1 over all."""
    one, other = run_of((1.0, 2.0, 3.0)), run_of((1.0, 3.0, 2.0))
    off = np.sqrt(2.0) / np.sqrt(14.0)
    opening = discretisation(one, other, finer=True, about=ABOUT).errors["opening"]
    assert opening.peak == pytest.approx(1.5 * off, rel=1e-3)
    assert opening.joints["k"].peak == pytest.approx(1.5 * np.sqrt(2.0) / np.sqrt(13.0), rel=1e-3)
    displacement = one.histories["displacement"][..., [1, 0, 2]]
    turned = replace(one, histories=dict(one.histories) | {"displacement": displacement})
    stated = discretisation(turned, one, finer=True, about=ABOUT)
    wanted = 1.5 * np.hypot(0.5, 0.5) / np.hypot(1.0, 0.5)
    assert stated.errors["displacement"].peak == pytest.approx(wanted, rel=1e-9)
    assert stated.details["nodes"]["top"]["displacement"]["peak"] == pytest.approx(wanted, rel=1e-9)


def test_joints_that_meet_are_compared_each_with_itself():
    """Two joints have a gap at one place, a third has none at the other mesh's: it is told, and no number."""
    run, sibling = run_of((1.0, 2.0, 3.0)), run_of((1.1, 2.2, 3.3))
    place = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [5.0, 0.0, 2.0]])
    joints = {"j": slice(0, 1), "k": slice(1, 2), "l": slice(2, 3)}
    run = replace(run, position=place, joints=joints)
    sibling = replace(sibling, position=place + np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0.5]]), joints=joints)
    stated = discretisation(run, sibling, finer=True, about=ABOUT)
    assert set(stated.errors["opening"].joints) == {"j", "k"}
    assert stated.details["joints_not_compared"] == ["l"] and stated.details["gaps_compared"] == 2
    for name in ("j", "k"):  # 0.1 of 1.1, of which 1.5 is stated
        assert stated.errors["opening"].joints[name].l2 == pytest.approx(1.5 / 11.0, rel=1e-12)


def test_a_job_without_the_mesh_it_asks_for_is_refused(tmp_path):
    raw = yaml.safe_load(SMALL)
    name = next(iter(raw["blocks"]))
    raw["blocks"][name]["box"]["element_size"] = raw["blocks"][name]["box"]["size"]
    raw["outputs"] = raw.get("outputs", {}) | {"mesh_error": "coarser"}
    np.savetxt(tmp_path / "pulse.txt", np.ones(100))
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(raw))
    said = [
        call("run", tmp_path / "small.yaml", "--out", tmp_path / "out", "--quiet"),
        call("check", tmp_path / "small.yaml"),
    ]
    for code, _, err in said:
        assert code == 2 and f"outputs.mesh_error: no coarser mesh: {tmp_path}" in err.replace("\n", " ")


def test_a_suite_states_it_once_at_its_largest_and_smallest_scale(tmp_path):
    """Of two records at two scales the stronger one; at each scale as `run` states it of that record."""
    raw = yaml.safe_load(SMALL)
    raw["model"] = {"modes": 4}
    time = np.arange(100) * 0.01
    pulse = np.sin(2 * np.pi * 5.0 * time) * np.exp(-2 * time)
    np.savetxt(tmp_path / "pulse.txt", 6.0 * pulse)
    np.savetxt(tmp_path / "weak.txt", 2.0 * pulse)
    (entry,) = raw["records"]
    weak = {key: value for key, value in entry.items() if key != "name"} | {"file": "weak.txt"}
    stress = {"faces": [{"block": "left", "face": "ymin"}]}
    raw["outputs"] = raw.get("outputs", {}) | {"mesh_error": "finer", "stress": stress}
    stated = {}
    for scale in (1.0, 1.5):
        (tmp_path / "run.yaml").write_text(yaml.safe_dump(raw | {"records": [entry | {"scale": scale}]}))
        code, _, err = call("run", tmp_path / "run.yaml", "--out", tmp_path / f"run{scale}", "--quiet")
        assert code == 0, err
        (path,) = (tmp_path / f"run{scale}").glob("pulse*.nc")
        with xr.open_dataset(path, engine="h5netcdf") as dataset:
            stated[scale] = json.loads(dataset.attrs["discretisation"])["error"]
    suite = raw | {"records": [weak, entry], "pipeline": "suite", "suite": {"scales": [1.0, 1.5]}}
    (tmp_path / "suite.yaml").write_text(yaml.safe_dump(suite))
    code, _, err = call("run", tmp_path / "suite.yaml", "--out", tmp_path / "suite", "--quiet")
    assert code == 0, err
    with xr.open_dataset(tmp_path / "suite" / "summary.nc", engine="h5netcdf") as summary:
        document = json.loads(summary.attrs["discretisation"])
    assert document["error"]["opening"]["l2"] == pytest.approx(stated[1.5]["opening"]["l2"], rel=1e-9)
    assert [entry["scale_factor"] for entry in document["scales"]] == [1.0, 1.5]
    for entry in document["scales"]:
        for quantity in ("opening", "principal_stress"):
            wanted = stated[entry["scale_factor"]][quantity]["l2"]
            assert entry[quantity]["l2"] == pytest.approx(wanted, rel=1e-9) != 0.0


def test_matrices_of_other_programs_have_no_finer_mesh(tmp_path):
    raw = yaml.safe_load(SMALL)
    name = next(iter(raw["blocks"]))
    raw["blocks"][name]["matrices"] = {"stiffness": "K.mtx", "mass": "M.mtx"}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(raw))
    for mesh in ("finer", "coarser"):
        code, _, err = call("verify", tmp_path / "small.yaml", "--mesh", mesh, "--out", tmp_path / "out")
        assert code == 2 and f"blocks.{name}.matrices" in err and "Traceback" not in err


def test_stiffnesses_of_single_gaps_have_no_other_mesh(tmp_path):
    """Four times as many gaps would make a joint four times as stiff, as if that were the mesh's error."""
    raw = yaml.safe_load(SMALL)
    raw["joints"]["gap"]["normal_stiffness"] = {"per_gap": "1 GN/m"}
    (tmp_path / "small.yaml").write_text(yaml.safe_dump(raw))
    code, _, err = call("verify", tmp_path / "small.yaml", "--mesh", "finer", "--out", tmp_path / "out")
    assert code == 2 and "normal_stiffness of joint gap is 1e+09 N/m of each gap" in " ".join(err.split())


def test_what_is_stated_is_within_a_factor_of_two_of_the_truth():
    """Two cantilevers of hex8, 5 m, against hex20 of 2.5 m: openings, motion, stress of faces, sections."""
    from mesh_truth import RECORDS, limit_of, make_job

    from romdam.config.other_mesh import on_finer_mesh
    from romdam.pipelines.error.verify import run_on_mesh
    from romdam.pipelines.run import Clock, silent
    from romdam.records.record_set import load_motions

    assert "northridge" in RECORDS
    job = make_job("cantilevers hex8 5 m", "northridge", 4.0)
    (motion,) = load_motions(job.config.records, job.folder)
    own, finer, limit = (
        run_on_mesh(one, motion, 4.0, Clock(silent), "run")[0]
        for one in (job, on_finer_mesh(job), limit_of(job))
    )
    statements = [discretisation(own, one, finer=True, about=ABOUT) for one in (finer, limit)]
    for face in statements[1].details["faces"]:
        for measure in ("principal_stress", "vertical_stress"):
            stated, true = (one.details["faces"][face][measure] for one in statements)
            truth = true["percentiles"]["98"] / 1.5
            assert truth > 0.02
            assert 0.5 * truth <= stated["peak"] <= 2.0 * truth
    stated, true = (one.errors for one in statements)
    assert 0.5 <= 1.5 * stated["section_moment"].l2 / true["section_moment"].l2 <= 2.0
    for name in ("opening", "displacement"):
        for measure in ("l2", "peak"):
            truth = getattr(true[name], measure) / 1.5
            assert truth > 0.02
            assert 0.5 * truth <= getattr(stated[name], measure) <= 2.0 * truth


STANDING = """
materials: {concrete: {E: 20 GPa, nu: 0.2, rho: 2400 kg/m3}}
blocks:
  rock:
    material: concrete
    mass: false
    weight: false
    box: {origin: [0, 0, -4], size: [8, 8, 4], element_size: 2 m}
  dam: {material: concrete, box: {origin: [0, 0, 0], size: [8, 8, 12], element_size: 2 m}}
supports: [{block: rock, face: zmin}]
joints:
  base: {between: [rock, dam], normal_stiffness: 10 GPa/m, shear_stiffness: 5 GPa/m, friction: 0.8}
loads:
  gravity: [0, 0, -9.81]
  hydrostatic: [{level: 6 m, faces: [{block: dam, face: ymin}]}]
records: [{file: pulse.txt, unit: m/s2, dt: 0.01 s, components: {y: 1}}]
model: {modes: 6}
transient: {finest_step: 5 ms}
outputs: {plots: false}
"""


@pytest.mark.slow
def test_runs_on_other_meshes_do_not_look_for_the_range_of_states_at_rest(tmp_path, monkeypatch):
    """The run itself does, once; nobody reads the warnings of the others."""
    reversed_orders, find = [], load_order.static_equilibrium

    def counting(*given, reverse=False):
        reversed_orders.append(reverse)
        return find(*given, reverse=reverse)

    monkeypatch.setattr(load_order, "static_equilibrium", counting)
    np.savetxt(tmp_path / "pulse.txt", 3.0 * np.sin(np.arange(40) / 3.0), fmt="%.5f")
    (tmp_path / "job.yaml").write_text(STANDING)
    outcome = romdam.run(romdam.load_config(tmp_path / "job.yaml"), tmp_path / "out")
    with romdam.open_result(outcome.paths[0]) as result:
        assert float(result.dataset.attrs["discretisation_opening_l2"]) > 0.0
    assert reversed_orders == [True]
