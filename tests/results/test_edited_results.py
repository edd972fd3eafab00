"""Results that another program has edited: what a command reads of them is checked first."""

import numpy as np
import pytest

from romdam.core.errors import ResultError
from romdam.results.dataset import build_dataset, open_run


@pytest.fixture
def dataset(case, job, timing):
    return build_dataset(case, job, timing, None)


@pytest.mark.parametrize("name", ["run_warnings", "configuration_doubts", "record_warnings", "rock_blocks"])
@pytest.mark.parametrize("value", ["open", "{}", "[1]", "null"])
def test_lists_that_are_none_are_refused(name, value, dataset, tmp_path):
    dataset.assign_attrs({name: value}).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(ResultError, match=f"a.nc: .* its attribute {name} must be a JSON list of texts"):
        open_run(tmp_path / "a.nc")


@pytest.mark.parametrize("area", [0.0, -1.0])
def test_areas_of_gaps_are_above_zero(area, dataset, tmp_path):
    values = dataset.gap_area.copy(data=np.full(dataset.gap_area.shape, area))
    dataset.assign_coords(gap_area=values).to_netcdf(tmp_path / "a.nc", engine="h5netcdf")
    with pytest.raises(ResultError, match=f"gap_area must be above 0 m2, got {area:g}"):
        open_run(tmp_path / "a.nc")
