"""Result files keep to CF, open elsewhere, and give the gaps of a joint by its name."""

import shutil
import subprocess
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from cf_files import CHECKER, errors_of_the_checker, flaws

from romdam.results.dataset import build_dataset, open_dataset, write_dataset
from romdam.results.renamed import UNITS


@pytest.fixture
def path(opened, tmp_path):
    """A file of its own: tests write into it."""
    return Path(shutil.copy(opened.path, tmp_path / "a.nc"))


def test_a_result_keeps_to_cf(path):
    assert list(flaws(path)) == []


def test_the_walk_finds_what_is_wrong(path):
    with netCDF4.Dataset(path, "r+") as file:
        file["reduced_coordinates"].units = "m kg0.5"
        file["gap_joint"].units = "1"
        file["peak_opening"].delncattr("long_name")
        file.delncattr("title")
    assert list(flaws(path)) == [
        "no attribute title",
        "reduced_coordinates: units m kg0.5",
        "peak_opening: no long_name",
        "gap_joint: units 1",
    ]


@pytest.mark.skipif(CHECKER is None, reason="no compliance-checker on PATH")
def test_the_checker_of_cf_finds_no_error(path, tmp_path):
    assert errors_of_the_checker(path, tmp_path / "report.json") == []


def test_xarray_has_times_in_seconds_as_numbers(path, case):
    with xr.open_dataset(path) as found:
        assert found.time.dtype == np.float64 and found.time.units == "s"
        np.testing.assert_array_equal(found.time, case.history.time)


def test_gaps_of_a_joint_by_its_name(path, case):
    """One line where xarray alone opens the file."""
    wanted = case.history.jump[:, 2:, 0]
    with open_dataset(path) as found:
        np.testing.assert_array_equal(found.opening.sel(gap_joint="J2"), wanted)
        assert found.sel(gap_joint="J2", joint="J2").sizes["gap"] == 3
        assert float(found.sel(gap_joint="J2").opening.max()) == wanted.max()
        with pytest.raises(KeyError):
            found.opening.sel(gap_joint="J3")
    with xr.open_dataset(path) as found:
        np.testing.assert_array_equal(found.set_xindex("gap_joint").opening.sel(gap_joint="J2"), wanted)


def test_gaps_of_joints_that_alternate_are_found_too(case, job, timing, tmp_path):
    mixed = build_dataset(case, job, timing, None).isel(gap=[0, 2, 1, 3, 4])
    write_dataset(mixed, tmp_path / "a.nc")
    with open_dataset(tmp_path / "a.nc") as found:
        np.testing.assert_array_equal(
            found.opening.sel(gap_joint="J2"), case.history.jump[:, 2:, 0], strict=True
        )


def test_results_lie_side_by_side(path, opened):
    with open_dataset(path) as one, open_dataset(opened.path) as other:
        both = xr.concat([one.opening, other.opening], dim="record")
        assert both.sizes == {"record": 2, "time": 41, "gap": 5}
        assert both.sel(gap_joint="J1").sizes["gap"] == 2
        assert not (one.opening - other.opening).any()


def test_units_of_before_are_restated_with_a_warning(path, caplog):
    assert UNITS == {"m kg0.5": "m"}
    with netCDF4.Dataset(path, "r+") as file:
        file["reduced_coordinates"].units = "m kg0.5"
    with open_dataset(path) as found:
        assert found.reduced_coordinates.units == "m"
    assert "read m kg0.5 as m" in caplog.text


@pytest.mark.skipif(shutil.which("ncdump") is None, reason="no ncdump")
def test_ncdump_tells_names_and_units(path):
    told = subprocess.run(["ncdump", "-h", path], capture_output=True, text=True, check=True).stdout
    assert 'string opening:units = "m" ;' in told and "double time(time) ;" in told
    names = subprocess.run(["ncdump", "-v", "joint", path], capture_output=True, text=True, check=True).stdout
    assert '"J1",\n  "J2" ;' in names


@pytest.mark.parametrize("names", [["Süd", "日本"], ["a", ""], []], ids=["utf-8", "empty", "none"])
@pytest.mark.parametrize("dtype", [str, object])  # as made, and as read from a file
@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_names_come_back_as_they_were(engine, dtype, names, tmp_path):
    dataset = xr.Dataset({"x": ("joint", np.zeros(len(names)))}, {"joint": np.array(names, dtype=dtype)})
    write_dataset(dataset, tmp_path / "a.nc")
    with netCDF4.Dataset(tmp_path / "a.nc") as file:
        assert file["joint"].dtype == "S1" or not names
    with xr.open_dataset(tmp_path / "a.nc", engine=engine) as found:
        assert found.joint.values.tolist() == names


@pytest.mark.parametrize("gaps", [100, 1000, 4000])
@pytest.mark.parametrize("rigid", [False, True])
def test_openings_of_thirty_seconds_are_twenty_tasks_at_most(gaps, rigid, tmp_path):
    """Of rigid joints too, whose openings are mostly zero and compressed."""
    opening = np.random.default_rng(0).normal(size=(3000, gaps))
    dataset = xr.Dataset({"opening": (("time", "gap"), np.maximum(opening, 1.0) - 1.0 if rigid else opening)})
    write_dataset(dataset, tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf", chunks={}) as lazy:
        assert len(lazy.opening.__dask_graph__()) <= 20
        assert max(lazy.opening.data.chunksize) <= 16 << 20
        np.testing.assert_array_equal(lazy.opening[:, 7], dataset.opening[:, 7])
