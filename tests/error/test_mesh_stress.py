"""What the mesh changes in stress on faces and in forces on sections: by hand, and against two runs."""

import copy
import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml
from mesh_runs import mesh_run
from test_cli import SMALL, call

from romdam.error.discretisation import discretisation
from romdam.error.mesh_stress import FaceStress, MeshStress

TIME = np.linspace(0.0, 4.0, 401)
ABOUT = {"record": "pulse", "seconds": 4.0}
PERCENTILES = (50.0, 90.0, 95.0, 98.0, 99.0)


def strip(size, factor, contact=(), ring=10.0):
    """Stress factor * (1 - z / 200 m) MPa on a strip of 100 m by 1 m, far more within 10 m of its foot."""
    z = np.arange(0.0, 100.1, size)
    area = np.full(len(z), size)
    area[[0, -1]] /= 2.0
    stress = factor * 1e6 * (1.0 - z / 200.0)
    stress[z <= 10.0] = 1e9 / size
    stress[np.isin(z, contact)] = 1e12
    points = np.stack([0.0 * z, 0.0 * z, z], axis=1)
    return FaceStress(
        points,
        area,
        np.isin(z, contact),
        {"principal": stress, "vertical": -0.5 * stress, "arch": np.full(len(z), np.nan)},
    )


def run_with(faces, sections=None, ring=10.0, unknowns=30):
    """A run with one gap; singular is the edge at z = 0, along x."""
    ends, shape = np.array([[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]]), np.sin(3.0 * TIME)[:, None]
    history = SimpleNamespace(
        time=TIME,
        jump=shape[:, :, None],
        mean_traction=shape[:, :, None],
        traction=shape[:, :, None],
        water=np.zeros((0, 0)),
        disp=0.0 * shape,
        acc=0.0 * shape,
    )
    forces = {name: shape * np.array(values) for name, values in (sections or {}).items()}
    stress = MeshStress(faces, ends, np.array([ring]), forces)
    return mesh_run(history, np.zeros((1, 3)), np.ones(1), {"j": slice(0, 1)}, unknowns, stress=stress)


def test_percentiles_of_a_face_are_compared_outside_the_ring_of_the_mesh_that_is_judged():
    """With elements of 10 m the values lie at z = 60 m (50 % of 85 m2) and 20 m (90 to 99 %).

    With 5 m and the same ring they lie at 55 m (50 % of 87.5 m2), 20 m (90 %: 77.5 of 78.75 m2 are not
    enough, so 20 m) and 15 m (95 to 99 %).
    """
    own, finer = run_with({"a": strip(10.0, 1.1)}), run_with({"a": strip(5.0, 1.0)}, ring=5.0, unknowns=60)
    stated = discretisation(own, finer, finer=True, about=ABOUT)
    values = 1.1 * (1.0 - np.array([60.0, 20.0, 20.0, 20.0, 20.0]) / 200.0)
    better = 1.0 - np.array([55.0, 20.0, 15.0, 15.0, 15.0]) / 200.0
    face = stated.details["faces"]["a"]["principal_stress"]
    for percent, value, wanted in zip(PERCENTILES, values, better, strict=True):
        assert face["percentiles"][f"{percent:g}"] == pytest.approx(1.5 * abs(value - wanted) / wanted)
    l2 = 1.5 * np.linalg.norm(values - better) / np.linalg.norm(better)
    assert stated.errors["principal_stress"].l2 == pytest.approx(l2) == face["l2"]
    assert l2 > face["percentiles"]["98"]  # which is no more than that by chance
    assert stated.errors["principal_stress"].peak == pytest.approx(l2) == face["peak"]
    assert "arch_stress" not in stated.errors and "arch_stress" not in stated.details["faces"]["a"]
    assert "the 98 % stress of faces by 11 %: 1.5 of the difference to elements of half" in stated.sentence
    assert stated.attributes["discretisation_principal_stress_peak"] == face["peak"]


def test_against_a_coarser_mesh_the_ring_is_that_of_the_finer_one():
    """The given mesh has 5 m and a ring of 10 m, the coarser one a ring of 30 m, which does not count."""
    own, coarser = run_with({"a": strip(5.0, 1.0)}), run_with({"a": strip(10.0, 1.1)}, ring=30.0)
    stated = discretisation(own, coarser, finer=False, about=ABOUT)
    percentiles = stated.details["faces"]["a"]["principal_stress"]["percentiles"]
    assert percentiles["98"] == pytest.approx(0.5 * (0.99 - 0.925) / 0.925)


def test_each_face_is_measured_by_itself_and_all_by_the_largest():
    """1 and 4 MPa are 2 and 10 % off; 1 kPa is 10 kPa off, measured by 1 % of the largest."""
    factors = {"a": (1.02, 1.0), "b": (4.4, 4.0), "c": (0.011, 0.001)}
    own, finer = (
        run_with({name: strip(5.0, pair[k], contact=(15.0,)) for name, pair in factors.items()})
        for k in (0, 1)
    )
    stated = discretisation(own, finer, finer=True, about=ABOUT)
    faces = stated.details["faces"]
    assert faces["a"]["principal_stress"]["peak"] == pytest.approx(1.5 * 0.02)
    assert faces["b"]["vertical_stress"]["peak"] == pytest.approx(1.5 * 0.1)
    largest = 4.0 * (1.0 - 20.0 / 200.0)  # at 20 m: the node at 15 m is that of a contact
    assert faces["c"]["principal_stress"]["peak"] == pytest.approx(1.5 * 0.01 * 0.9 / (0.01 * largest))
    assert stated.errors["principal_stress"].peak == pytest.approx(1.5 * 0.4 / 4.0)
    assert stated.errors["principal_stress"].l2 == pytest.approx(
        1.5 * np.sqrt((0.02**2 + 0.4**2 + 0.01**2) / (1.0 + 4.0**2 + 0.001**2))
    )


def test_a_face_that_the_ring_covers_has_no_number():
    own, finer = (run_with({"a": strip(5.0, f), "b": strip(5.0, f)}, ring=10.0) for f in (1.3, 1.0))
    covered = strip(5.0, 1.3, contact=tuple(np.arange(0.0, 101.0, 5.0)))
    own.stress.faces["b"] = covered
    stated = discretisation(own, finer, finer=True, about=ABOUT)
    assert stated.details["faces"]["b"] == {}
    assert ", stress of b unknown: no node of one mesh is outside the ring; neither" in stated.sentence
    assert "principal_stress" in stated.details["not_resolved"]
    assert "neither mesh resolves principal stresses, vertical stresses: " in stated.sentence


def test_forces_of_sections_are_compared_as_vectors_and_section_by_section():
    """N, V and M of the foot are 10, 20 and 30 % off; the top has no shear but noise, 1 % of N at least."""
    foot, top = [100.0, 0.0, 50.0, 7.0, 24.0, 0.0], [10.0, 0.001, 0.0, 0.0, 0.0, 2.0]
    better = {"foot": foot, "top": top}
    judged = {
        "foot": np.multiply(foot, [1.1, 1, 1.2, 1.3, 1.3, 1]),
        "top": np.multiply(top, [1, 11, 1, 1, 1, 1]),
    }
    stated = discretisation(run_with({}, judged), run_with({}, better), finer=True, about=ABOUT)
    sections = stated.details["sections"]
    for name, off in (("normal_force", 0.1), ("shear_force", 0.2), ("moment", 0.3)):
        for measure in ("l2", "peak"):
            assert sections["foot"][name][measure] == pytest.approx(1.5 * off)
    assert sections["top"]["shear_force"]["l2"] == pytest.approx(1.5 * 0.01 / (0.01 * 10.0) / np.sqrt(2.0))
    force = np.linalg.norm([10.0, 10.0, 0.01]) / np.linalg.norm([100.0, 50.0, 10.0, 0.001])
    assert stated.errors["section_force"].l2 == pytest.approx(1.5 * force)
    assert stated.errors["section_force"].peak == pytest.approx(1.5 * force), "of all places, not of N alone"
    moment = 0.3 * np.linalg.norm([7.0, 24.0]) / np.linalg.norm([7.0, 24.0, 2.0])
    assert stated.errors["section_moment"].l2 == pytest.approx(1.5 * moment)
    assert "section forces by 19 %" in stated.sentence and "stress" not in stated.sentence
    quadratic = replace(run_with({}, better), quadratic=True)
    stated = discretisation(quadratic, run_with({}, judged), finer=False, about=ABOUT)
    assert stated.errors["section_moment"].l2 == pytest.approx(0.2 * moment), "as displacements"


STRESS = {
    "faces": [{"block": "left", "face": "ymin"}, {"block": "right", "face": "ymax"}],
    "sections": {
        "foot": {"blocks": ["left", "right"], "point": [0, 0, 0]},
        "left": {"blocks": ["left"], "point": [0, 0, 9]},
    },
}


def small_job(tmp_path, size, order, **stress):
    raw = yaml.safe_load(SMALL)
    for block in raw["blocks"].values():
        block["box"]["element_size"] = size
    raw["model"] = {"order": "full"} if order == "full" else {"modes": 4}
    raw["outputs"] = raw["outputs"] | {"stress": copy.deepcopy(STRESS) | stress}
    time = np.arange(60) * 0.01
    np.savetxt(tmp_path / "pulse.txt", 6.0 * np.sin(2 * np.pi * 5.0 * time) * np.exp(-2 * time))
    return raw


def result_of(tmp_path, raw, name):
    (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(raw))
    code, _, err = call("run", tmp_path / f"{name}.yaml", "--out", tmp_path / name, "--quiet")
    assert code == 0, err
    return xr.load_dataset(tmp_path / name / "pulse.nc", engine="h5netcdf")


@pytest.mark.parametrize(
    ("order", "size"), [pytest.param("reduced", 2.5, marks=pytest.mark.slow), ("full", 5.0)]
)
def test_a_run_states_what_two_runs_say(tmp_path, order, size):
    """The ring of one element is as long in the run on half the size: 2.5 m, or 5 m at full order."""
    raw = small_job(tmp_path, size, order)
    raw["outputs"]["mesh_error"] = "finer"
    own = result_of(tmp_path, raw, "own")
    finer_raw = small_job(tmp_path, size / 2.0, order, ring={"edges": size})
    finer = result_of(tmp_path, finer_raw, "finer")
    document = json.loads(own.attrs["discretisation"])
    assert set(document["faces"]) == {"left.ymin", "right.ymax"}

    table = {
        name: d.face_principal_stress.sel(area_percentile=list(PERCENTILES))
        for name, d in (("own", own), ("finer", finer))
    }
    off = table["own"].values - table["finer"].values
    for k, face in enumerate(own.stress_face.values):
        stated = document["faces"][str(face)]["principal_stress"]
        wanted = 1.5 * np.abs(off[k]) / table["finer"].values[k]
        np.testing.assert_allclose(list(stated["percentiles"].values()), wanted, rtol=1e-6)
    headline = PERCENTILES.index(98.0)
    l2 = 1.5 * np.linalg.norm(off) / np.linalg.norm(table["finer"])
    peak = max(l2, 1.5 * np.abs(off[:, headline]).max() / table["finer"].values[:, headline].max())
    assert own.attrs["discretisation_principal_stress_peak"] == pytest.approx(peak, rel=1e-6)
    assert own.attrs["discretisation_principal_stress_l2"] == pytest.approx(l2, rel=1e-6)

    for name in ("force", "moment"):
        values, better = own[f"section_{name}"].values, finer[f"section_{name}"].values
        l2 = 1.5 * np.linalg.norm(values - better) / np.linalg.norm(better)
        assert own.attrs[f"discretisation_section_{name}_l2"] == pytest.approx(l2, rel=1e-6)
        largest, wanted = np.abs(values).max(axis=0), np.abs(better).max(axis=0)  # over time
        off = np.linalg.norm(largest - wanted) / np.linalg.norm(wanted)
        peak = 1.5 * max(abs(largest.max() / wanted.max() - 1.0), off)
        assert own.attrs[f"discretisation_section_{name}_peak"] == pytest.approx(peak, rel=1e-4)
    normal = [d.section_force.sel(section="foot", section_axis="normal").values for d in (own, finer)]
    l2 = 1.5 * np.linalg.norm(normal[0] - normal[1]) / np.linalg.norm(normal[1])
    assert document["sections"]["foot"]["normal_force"]["l2"] == pytest.approx(l2, rel=1e-6)

    code, lines, err = call("verify", tmp_path / "finer.yaml", "--mesh", "coarser", "--out", tmp_path / "v")
    assert code == 0, err
    coarser = json.loads((tmp_path / "v" / "discretisation.json").read_text())
    for face, quantities in document["faces"].items():
        wanted = quantities["principal_stress"]["peak"] / 3.0  # 0.5 of the difference in place of 1.5
        stated = coarser["faces"][face]["principal_stress"]["peak"]
        assert stated == pytest.approx(wanted, rel=1e-6)
    assert "principal stress" in lines and "section moment" in lines


def test_sections_alone_are_stated(tmp_path):
    """Nodes, whose histories are not compared, need not be nodes of the other mesh."""
    raw = small_job(tmp_path, 2.5, "reduced", faces=[], nodes={"n": {"block": "left", "at": [2.5, -5, 2.5]}})
    raw["outputs"]["mesh_error"] = "coarser"
    document = json.loads(result_of(tmp_path, raw, "own").attrs["discretisation"])
    assert document["faces"] == {} and document["sections"]["foot"]["moment"]["l2"] > 0.0
    assert "principal_stress" not in document["error"]
