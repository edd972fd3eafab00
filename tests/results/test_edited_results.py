"""Results that another program has edited: what a command reads of them is checked first."""

import shutil

import h5py
import numpy as np
import pytest

from romdam.core.errors import ResultError
from romdam.results.dataset import Timing, build_dataset, open_run
from romdam.results.stored_run import read_run

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
def dataset(case, job, timing):
    return build_dataset(case, job, timing, None)


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


@pytest.mark.parametrize("name", ["normal_force", "shear_force", "mean_normal_force", "mean_shear_force"])
def test_a_certificate_needs_the_forces_of_the_joints(name, dataset, tmp_path):
    dataset.drop_vars(name).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(ResultError, match=rf"a.nc: holds no joint forces \({name}\)"):
        read_run(tmp_path / "a.nc")


def test_a_certificate_needs_the_coordinates_of_the_model(dataset, tmp_path):
    dataset.drop_vars("reduced_coordinates").to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(ResultError, match=r"a\.nc: holds no reduced_coordinates"):
        read_run(tmp_path / "a.nc")


@pytest.mark.parametrize("name", ["stress_arch", "crack_at_rest", "max_arch_stress"])
def test_a_variable_without_a_number_somewhere_is_read(name, dataset, tmp_path):
    """As romdam writes it of a horizontal face, or of a joint whose uplift is not redrawn."""
    values = np.array(dataset[name].values, dtype=float)
    values.flat[0] = np.nan
    changed = dataset[name].copy(data=values)
    edited = dataset.assign_coords if name in dataset.coords else dataset.assign
    edited({name: changed}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with open_run(tmp_path / "a.nc") as read:
        assert np.isnan(read[name].values.flat[0])


def test_what_states_floor_spectra_stands_beside_them(dataset, tmp_path):
    del dataset.attrs["floor_spectrum_statement"]
    dataset.to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(ResultError, match="floor_spectrum_statement is missing, which stands beside floor"):
        open_run(tmp_path / "a.nc")
