"""The dataset holds what was computed, with signs, units and provenance, and reads with xarray alone."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from romdam.config import parse_config
from romdam.core.errors import ResultError
from romdam.core.files import prepare_folder, replacing
from romdam.postprocess.record_measures import stated_warnings
from romdam.results.dataset import SINGLE, build_dataset, open_dataset, write_dataset
from romdam.results.variables import COORDINATES, VARIABLES
from romdam.terminal.documents import info_document

from .conftest import make_case


def test_signs_follow_the_conventions(case, job, timing):
    ds, history = build_dataset(case, job, timing, None), case.history
    np.testing.assert_array_equal(ds.opening, history.jump[:, :, 0])
    np.testing.assert_array_equal(ds.slip, history.jump[:, :, 1:])
    np.testing.assert_array_equal(ds.normal_force, -history.traction[:, :, 0])
    np.testing.assert_array_equal(ds.shear_force, history.traction[:, :, 1:])
    np.testing.assert_array_equal(ds.mean_normal_force, -history.mean_traction[:, :, 0])
    np.testing.assert_array_equal(ds.mean_shear_force, history.mean_traction[:, :, 1:])
    np.testing.assert_array_equal(ds.dissipated_energy, history.dissipated_energy)
    assert ds.normal_force.max() <= 0.0, "compression is negative"


def test_probe_motions_are_split_by_node_and_component(case, job, timing):
    ds = build_dataset(case, job, timing, None)
    np.testing.assert_array_equal(ds.velocity.sel(node="top_right", component="y"), case.history.vel[:, 4])
    np.testing.assert_array_equal(ds.node_position.sel(node="top_left"), [1.0, 0.0, 1.0])
    assert list(ds.node_block.values) == ["left", "right"]


def test_peaks_are_taken_joint_by_joint(case, job, timing):
    ds, peaks = build_dataset(case, job, timing, None), case.history.peaks
    for joint, gaps in (("J1", slice(0, 2)), ("J2", slice(2, 5))):
        row = ds.sel(joint=joint)
        widest = peaks["opening"][gaps].argmax()
        assert float(row.peak_opening) == peaks["opening"][gaps].max()
        assert float(row.peak_opening_time) == peaks["opening_time"][gaps][widest]
        assert float(row.peak_compression) == -peaks["compression"][gaps].max()
        assert float(row.peak_compressive_stress) == -peaks["compression"][gaps].max() / 0.5
        assert float(row.peak_slip) == peaks["slip"][gaps].max()
    assert list(ds.gap_joint.values) == ["J1"] * 2 + ["J2"] * 3


def test_frictionless_scene_has_no_tangential_variables(job, timing):
    ds = build_dataset(make_case(mu=0.0), job, timing, None)
    assert not {"slip", "shear_force", "mean_shear_force", "peak_slip"} & set(ds.variables)
    assert "opening" in ds


def test_scene_without_joints_or_coordinates_still_has_a_dataset(job, timing):
    ds = build_dataset(make_case(joints=False, reduced=False), job, timing, None)
    assert "opening" not in ds and "reduced_coordinates" not in ds
    assert ds.displacement.sizes == {"time": 41, "node": 2, "component": 3}


def test_every_variable_has_its_shape_name_and_unit(case, job, timing):
    ds = build_dataset(case, job, timing, None)
    for name, variable in (VARIABLES | COORDINATES).items():
        assert ds[name].dims == variable.dims, name
        assert ds[name].attrs["long_name"], name
        assert ds[name].dtype.kind == "U" or ds[name].attrs["units"], name


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_file_reads_back_the_same_with_xarray_alone(engine, case, job, timing, tmp_path):
    ds = build_dataset(case, job, timing, "model-x.h5")
    write_dataset(ds, tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc", engine=engine) as back:
        for name in ds.variables:
            single = name in SINGLE
            known = ds[name].values.astype(np.float32) if single else ds[name].values
            np.testing.assert_array_equal(back[name].values, known)
        assert back.joint_state.attrs["flag_meanings"].split() == ["open", "stick", "slip"]
        assert list(back.joint_state.attrs["flag_values"]) == [0, 1, 2]
        assert back.attrs["model_file"] == "model-x.h5"
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"], "no temporary file is left"


def test_thirty_seconds_are_few_tasks_to_dask_and_only_what_shrinks_is_compressed(tmp_path):
    opening = np.random.default_rng(0).normal(size=(3000, 100))
    histories = {"opening": opening, "force": np.minimum(opening, -2.0) + 2.0, "state": np.sign(opening)}
    histories["state"] = histories["state"].astype(np.int8)
    dataset = xr.Dataset({name: (("time", "gap"), values) for name, values in histories.items()})
    dataset = dataset.assign(none=("nothing", np.zeros(0)))
    write_dataset(dataset, tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf", chunks={}) as lazy:
        assert {name: lazy[name].encoding.get("zlib", False) for name in histories} == {
            "opening": False,
            "force": True,
            "state": True,
        }
        assert all(len(lazy[name].max("gap").__dask_graph__()) <= 20 for name in histories)
        xr.testing.assert_equal(lazy.load(), dataset)
    assert (tmp_path / "a.nc").stat().st_size < 1.2 * opening.nbytes  # 2.1 of them uncompressed


def test_attributes_rebuild_the_configuration_and_tell_where_it_came_from(case, job, timing):
    attrs = build_dataset(case, job, timing, None).attrs
    assert parse_config(json.loads(attrs["configuration"]), "attribute") == job.config
    assert attrs["configuration_sha256"] == job.digest
    assert json.loads(attrs["record_provenance"])["sha256"] == "abc"
    assert json.loads(attrs["record_warnings"]) == ["a warning"]
    assert stated_warnings(attrs)[-1] == "a warning"
    doubted = xr.Dataset(attrs=attrs | {"configuration_doubts": json.dumps(["a doubt"])})
    assert info_document(doubted, Path("a.nc"))["warnings"][-2:] == ["a doubt", "a warning"]
    assert attrs["wall_seconds_scene"] == 0.5 and attrs["cpu_seconds_scene"] == 0.4
    assert attrs["solver_steps"] == 40.0
    assert "numpy" in json.loads(attrs["versions"])


def test_interrupted_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "a.nc"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), replacing(path) as part:
        part.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ResultError, match="file/results: the output folder cannot be made"):
        prepare_folder(tmp_path / "file" / "results")


def test_what_is_no_result_is_refused(tmp_path):
    with pytest.raises(ResultError, match="no such result file"):
        open_dataset(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("not a file of ours")
    with pytest.raises(ResultError, match=r"text\.nc: is not a NetCDF-4 file"):
        open_dataset(tmp_path / "text.nc")
    xr.Dataset({"a": 1}).to_netcdf(tmp_path / "foreign.nc", engine="h5netcdf")
    with pytest.raises(ResultError, match="was not written by romdam"):
        open_dataset(tmp_path / "foreign.nc")
