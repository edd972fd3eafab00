"""Measures of stress against LAPACK and closed forms; the summary and the file against whole histories."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import romdam
from romdam import open_result
from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.errors import ResultError
from romdam.core.scene import StressFace, StressNodes, StressSites
from romdam.pipelines import stresses
from romdam.postprocess.stress.summary import (
    DCR_LEVELS,
    StressHistory,
    duration_above,
    outer_histories,
    principal_stresses,
    stress_along,
    summarise,
)
from romdam.reduction import stress as reduction_stress

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


def tensor(stress):
    full = np.zeros((*stress.shape[:-1], 3, 3))
    for v, (k, l) in enumerate(PAIRS):
        full[..., k, l] = full[..., l, k] = stress[..., v]
    return full


def test_principal_stresses_are_eigenvalues():
    stress = np.random.default_rng(1).standard_normal((500, 6))
    expected = np.linalg.eigvalsh(tensor(stress))[:, ::-1]
    np.testing.assert_allclose(principal_stresses(stress), expected, atol=1e-12)


@pytest.mark.parametrize("values", [(0, 0, 0), (1, 1, 1), (2, 2, -1), (3, -1, -1), (1, 1 + 1e-9, 1)])
def test_equal_principal_stresses(values):
    Q, _ = np.linalg.qr(np.random.default_rng(2).standard_normal((3, 3)))
    full = Q @ np.diag(np.array(values, dtype=float)) @ Q.T
    stress = np.array([full[k, l] for k, l in PAIRS])
    np.testing.assert_allclose(principal_stresses(stress), sorted(values, reverse=True), atol=1e-7)


def test_stress_along_is_the_normal_component():
    rng = np.random.default_rng(3)
    stress, direction = rng.standard_normal((7, 4, 6)), rng.standard_normal((4, 3))
    expected = np.einsum("nk,tnkl,nl->tn", direction, tensor(stress), direction)
    np.testing.assert_allclose(stress_along(stress, direction), expected, atol=1e-12)


def test_duration_above_the_strength_of_a_sine_is_its_closed_form():
    """sigma = 2 f sin(2 pi t): above f for (pi - 2 asin(1/2)) / 2 pi = 1/3 of every period."""
    t = np.linspace(0.0, 5.0, 5001)
    sine = np.stack([2.0 * np.sin(2 * np.pi * t), np.full(t.shape, 3.0), np.full(t.shape, 0.5)], axis=1)
    found = duration_above(sine, 1.0, t[1])
    np.testing.assert_allclose(found, [5.0 / 3.0, 5.0, 0.0], rtol=1e-5)
    assert duration_above(sine, 2.1, t[1])[0] == 0.0


def test_duration_is_exact_for_straight_pieces():
    saw = np.array([[0.0], [2.0], [0.0], [-2.0], [4.0]])
    assert duration_above(saw, 1.0, 0.1)[0] == pytest.approx(0.1 * (0.5 + 0.5 + 0.5))


def test_outer_histories_are_exact_where_they_are_largest_smallest_or_exceed_a_level():
    rng, t = np.random.default_rng(7), np.linspace(0.0, 6.0, 400)[:, None, None, None]
    waves = np.sin((1.0 + 4.0 * rng.random((9, 5, 6))) * t) * rng.standard_normal((9, 5, 6))
    smooth = waves.sum(axis=2)
    exact, (major, minor) = principal_stresses(smooth)[..., [0, 2]], outer_histories(smooth, 1.5)
    for found, history in ((major, exact[..., 0]), (-minor, -exact[..., 1])):
        assert np.array_equal(found.argmax(axis=0), history.argmax(axis=0))
        assert np.array_equal(found.max(axis=0), history.max(axis=0))
        assert np.array_equal(found[0], history[0]) and (found <= history + 1e-12).all()
        assert 0.0 < (found != history).mean() < 1.0, "some are bounds"
    assert np.array_equal(duration_above(major, 1.5, 0.1), duration_above(exact[..., 0], 1.5, 0.1))


def sites_and_history():
    rng = np.random.default_rng(4)
    up, arch = np.tile([0.0, 0.0, 1.0], (5, 1)), np.tile([0.0, 1.0, 0.0], (5, 1))
    nodes = StressNodes(np.arange(5), up, arch)
    blank = StressNodes(np.array([1, 2]), up[:2], np.full((2, 3), np.nan))
    face = StressFace("a.top", "a", np.array([1, 3]), np.array([2.0, 3.0]))
    sites = StressSites({"a": nodes, "b": blank}, (face,), {"p": ("b", 1)}, 1.5)
    fields = {"a": rng.standard_normal((5, 6, 3)), "b": rng.standard_normal((2, 6, 4))}
    q = {"a": rng.standard_normal((40, 3)), "b": rng.standard_normal((40, 4))}
    offset = {"a": np.ones((5, 6)), "b": np.zeros((2, 6))}
    return sites, StressHistory(fields, q, offset)


def test_summary_is_that_of_the_whole_histories(monkeypatch):
    import romdam.postprocess.stress.summary as module

    monkeypatch.setattr(module, "_TENSORS", 80)  # two nodes at a time
    sites, history = sites_and_history()
    time = np.arange(40) * 0.5
    found = summarise(sites, history, time)
    whole = np.concatenate(
        [
            np.einsum("kvm,tm->tkv", history.fields[n], history.coordinates[n]) + history.offset[n]
            for n in "ab"
        ],
        axis=1,
    )
    principal = np.linalg.eigvalsh(tensor(whole))
    np.testing.assert_allclose(found.largest["principal"], principal[..., 2].max(axis=0))
    np.testing.assert_allclose(found.smallest["principal"], principal[..., 0].min(axis=0))
    np.testing.assert_allclose(found.largest["vertical"], whole[..., 2].max(axis=0))
    np.testing.assert_allclose(found.smallest["arch"][:5], whole[:, :5, 1].min(axis=0))
    assert np.isnan(found.largest["arch"][5:]).all()
    step = np.unravel_index(principal[..., 2].argmax(), principal.shape[:2])[0]
    assert found.worst_time["principal"] == time[step]
    np.testing.assert_allclose(found.tensor, whole[step])
    np.testing.assert_allclose(found.at_worst["principal"], principal[step, :, 2])
    np.testing.assert_allclose(found.probes[:, 0], whole[:, 6])
    expected = duration_above(principal[..., 2], DCR_LEVELS[3] * 1.5, 0.5)
    np.testing.assert_allclose(found.duration[:, 3], expected)


def test_durations_of_stress_that_exceeds_nothing_are_no_integers():
    sites, history = sites_and_history()
    found = summarise(replace(sites, strength=1e9), history, np.arange(40) * 0.5)
    for seconds in (found.duration, found.duration_of_change):
        assert seconds.dtype == np.float64 and not seconds.any()


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """Order -> result of two small blocks shaken for 0.2 s, stress everywhere in one of them."""
    return {order: shaken(order, tmp_path_factory.mktemp(order)) for order in ("reduced", "full")}


@pytest.fixture(params=["reduced", "full"])
def outcome(request, outcomes):
    return request.param, outcomes[request.param]


def shaken(order, folder, transient=None, modulus="30 GPa", loads=None):
    t = np.arange(0.0, 0.2001, 0.01)
    np.savetxt(folder / "pulse.txt", 5.0 * np.sin(2 * np.pi * 5 * t))
    sizes = {"size": ["2 m", "2 m", "8 m"], "element_size": 1.0, "element": "hex8"}
    raw = {
        "materials": {"c": {"E": modulus, "nu": 0.2, "rho": 2400, "expansion": 1e-5}},
        "blocks": {
            "left": {"material": "c", "box": {"origin": [0, -2, 0], **sizes}},
            "right": {"material": "c", "box": {"origin": [0, 0, 0], **sizes}},
        },
        "supports": [{"block": b, "face": "zmin"} for b in ("left", "right")],
        "joints": {"j": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}},
        "damping": {"rayleigh": {"frequencies": [5, 50], "ratio": 0.05}},
        "loads": {"gravity": [0, 0, -9.81]} | (loads or {}),
        "records": [
            {"name": "pulse", "file": "pulse.txt", "unit": "m/s2", "dt": 0.01, "components": {"y": 1}}
        ],
        "model": {"order": order} | ({"modes": "all"} if order == "reduced" else {}),
        "transient": {"finest_step": "1 ms"} | (transient or {}),
        "outputs": {
            "plots": False,
            "mesh_error": False,
            "output_interval": "0.01 s",
            "stress": {
                "blocks": ["left"],
                "faces": [{"block": "right", "face": "zmin"}],
                "nodes": {"heel": {"block": "left", "at": [1, -2, 0]}},
                "sections": {
                    "foot": {"blocks": ["left", "right"], "point": [0, 0, 0]},
                    "left": {"blocks": ["left"], "point": [0, 0, 4]},
                },
                "strength": "0.2 MPa",
            },
        },
    }
    job = Job(parse_config(raw, "s.yaml"), folder / "s.yaml")
    return romdam.run(job, folder).paths[0]


def test_result_holds_envelopes_ratios_and_areas(outcome):
    _, path = outcome
    with xr.open_dataset(path, engine="h5netcdf") as ds:
        assert ds.sizes["stress_node"] == 81 + 9 and ds.sizes["stress_face"] == 1
        assert float(ds.max_vertical_stress.max()) > 2e5
        np.testing.assert_allclose(ds.demand_capacity_ratio, ds.max_principal_stress / 2e5)
        assert ds.max_principal_stress.attrs["units"] == "Pa"
        heel = ds.sel(stress_probe="heel")
        number = (ds.stress_block == "left") & (abs(ds.stress_position - [1, -2, 0]).max("component") == 0)
        envelope = float(ds.max_vertical_stress[number.values][0])
        assert float(heel.vertical_stress.max()) == pytest.approx(envelope, rel=1e-12)
        np.testing.assert_allclose(heel.vertical_stress, heel.stress.sel(stress_component="zz"))
        over = ds.overstressed_area.sel(dcr_level=1.0).item()
        assert 0.0 < over <= ds.stress_face_area.item() == pytest.approx(4.0)
        assert (np.diff(ds.cumulative_inelastic_duration) <= 1e-15).all()
        assert float(ds.cumulative_inelastic_duration.max()) > 0.0


def test_history_of_any_node_comes_from_the_stress_file(outcome):
    order, path = outcome
    with open_result(path) as result:
        if order == "full":
            with pytest.raises(ResultError, match="no stress was kept"):
                result.stress("left")
            return
        number = int(result.dataset.stress_node_number[7])
        found = result.stress("left", nodes=[number, number]).values
        whole = result.stress("left").values
        np.testing.assert_array_equal(found[:, 0], found[:, 1])
        np.testing.assert_allclose(found[:, 0], whole[:, 7], rtol=1e-12, atol=1e-12 * np.abs(whole).max())
        envelope = principal_stresses(whole)[..., 0].max(axis=0)
        kept = result.dataset.max_principal_stress[result.dataset.stress_block == "left"]
        np.testing.assert_allclose(kept, envelope, atol=1e-6 * envelope.max())  # single precision
        with pytest.raises(ResultError, match=r"no stress was kept for node 80 .* of block 'right'"):
            result.stress("right", nodes=80)


def test_a_later_run_takes_the_stress_of_the_modes_from_the_file_where_it_is_that(tmp_path, monkeypatch):
    """Not from a damaged one, nor from that of another dam or of other code."""
    made, modal_stress = [], stresses.modal_stress

    def counted(*args):
        made.append(len(made))
        return modal_stress(*args)

    monkeypatch.setattr(stresses, "modal_stress", counted)
    first = xr.load_dataset(shaken("reduced", tmp_path), engine="h5netcdf")
    again = xr.load_dataset(shaken("reduced", tmp_path), engine="h5netcdf")
    assert len(made) == 1
    for name in first.data_vars:
        np.testing.assert_array_equal(first[name], again[name], err_msg=str(name))
    (path,) = tmp_path.glob("stress-*.h5")
    whole = path.read_bytes()
    path.write_bytes(whole[:5000] + bytes([whole[5000] ^ 1]) + whole[5001:])
    shaken("reduced", tmp_path)
    assert len(made) == 2 and path.read_bytes()[:5001] == whole[:5001]
    softer = xr.load_dataset(shaken("reduced", tmp_path, modulus="20 GPa"), engine="h5netcdf")
    assert len(made) == 3 and softer.attrs["stress_file"] != first.attrs["stress_file"]
    with open_result(shaken("reduced", tmp_path, loads={"temperature": [{"change": "-5 K"}]})) as cooler:
        assert len(made) == 4, "the same stress of the modes, with another offset"
        envelope = principal_stresses(cooler.stress("left").values)[..., 0].max(axis=0)
        kept = cooler.dataset.max_principal_stress[cooler.dataset.stress_block == "left"]
        np.testing.assert_allclose(kept, envelope, atol=1e-6 * envelope.max())  # single precision
    monkeypatch.setattr(reduction_stress, "code_digest", lambda *rooms: "other")
    shaken("reduced", tmp_path, modulus="20 GPa")
    assert len(made) == 5


def test_all_modes_give_the_stress_of_the_full_order(outcomes):
    """Two integrators at a step of 1 ms: peak principal stress of every node within 1 % of the largest."""
    peaks = {}
    for order, path in outcomes.items():
        with xr.open_dataset(path, engine="h5netcdf") as ds:
            peaks[order] = ds.max_principal_stress.values
    print(np.abs(peaks["reduced"] - peaks["full"]).max() / peaks["full"].max())
    assert np.abs(peaks["reduced"] - peaks["full"]).max() < 0.01 * peaks["full"].max()


def test_sections_bear_the_weight_at_rest_and_the_inertia_after(outcome):
    """Two blocks of 4 m2 and 8 m, and the upper half of one; without friction the joint bears no weight."""
    _, path = outcome
    with open_result(path) as result:
        force = result.dataset.section_force
        weight = 2400 * 9.81 * np.array([8.0 * 8.0, 4.0 * 4.0])
        np.testing.assert_allclose(force[0].sel(section_axis="normal"), -weight, rtol=1e-3)
        np.testing.assert_allclose(result.dataset.section_area, [8.0, 4.0], rtol=1e-12)
        at_rest = result.dataset.section_stress[0].sel(section="left")
        np.testing.assert_allclose(at_rest, -2400 * 9.81 * 4.0, rtol=0.02)
        # the pulse is along y, the second axis of the sections
        shear = abs(force.sel(section="foot")).max("time")
        assert float(shear[2]) > 20.0 * float(shear[1])


def test_all_modes_give_the_section_forces_of_the_full_order(outcomes, tmp_path):
    """By the same integrator, to round-off: the modes' forces on sections are the mesh's."""
    reduced = shaken("reduced", tmp_path, {"integrator": "generalized_alpha"})
    found, full = (
        xr.open_dataset(path, engine="h5netcdf").section_force.values for path in (reduced, outcomes["full"])
    )
    assert np.abs(found - full).max() < 1e-9 * np.abs(full).max()
