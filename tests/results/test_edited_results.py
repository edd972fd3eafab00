"""Results that another program has edited: what a command reads of them is checked first."""

import shutil

import h5py
import pytest

from romdam.core.errors import ResultError
from romdam.results.dataset import Timing, build_dataset, open_run

from .conftest import make_case


@pytest.fixture(scope="module")
def written(job, tmp_path_factory):
    """A result that xarray has written again, without a digest."""
    path = tmp_path_factory.mktemp("written") / "a.nc"
    dataset = build_dataset(make_case(), job, Timing({"scene": 0.5}, {"scene": 0.4}), None)
    dataset.to_netcdf(path, engine="h5netcdf")
    open_run(path).close()
    return path


@pytest.fixture
def path(written, tmp_path):
    """A copy, to be edited."""
    return shutil.copy(written, tmp_path / "a.nc")


@pytest.mark.parametrize("name", ["run_warnings", "configuration_doubts", "record_warnings", "rock_blocks"])
@pytest.mark.parametrize("value", ["open", "{}", "[1]", "null"])
def test_lists_that_are_none_are_refused(name, value, path):
    with h5py.File(path, "r+") as file:
        file.attrs[name] = value
    with pytest.raises(ResultError, match=f"a.nc: .* its attribute {name} must be a JSON list of texts"):
        open_run(path)


@pytest.mark.parametrize("area", [0.0, -1.0])
def test_areas_of_gaps_are_above_zero(area, path):
    with h5py.File(path, "r+") as file:
        file["gap_area"][...] = area
    with pytest.raises(ResultError, match=f"gap_area must be above 0 m2, got {area:g}"):
        open_run(path)
