"""A statement of error lands in the results that it is about."""

import json

import h5py

from romdam.error.metrics import RelativeError
from romdam.error.statement import ErrorStatement, read_verification, write_verification
from romdam.results.dataset import build_dataset, write_dataset


def test_statement_lands_in_results_of_the_same_configuration_only(case, job, timing, tmp_path):
    write_dataset(build_dataset(case, job, timing, None), tmp_path / "same.nc")
    other = build_dataset(case, job, timing, None)
    other.attrs["configuration_sha256"] = "other"
    write_dataset(other, tmp_path / "other.nc")
    about = {"configuration_sha256": job.digest, "l2_error": 0.001}
    errors = {"opening": RelativeError(0.001, 0.002)}
    write_verification(tmp_path, ErrorStatement("verification", "0.1 % off", errors, about))
    with h5py.File(tmp_path / "same.nc") as file:
        assert file.attrs["error_statement"] == "0.1 % off"
        stated = json.loads(file.attrs["verification"])
        assert stated["l2_error"] == stated["error"]["opening"]["l2"] == 0.001
        assert file.attrs["verification_opening_peak"] == 0.002
        assert "error stated by romdam" in file.attrs["history"].splitlines()[1]
    with h5py.File(tmp_path / "other.nc") as file:
        assert "error_statement" not in file.attrs and len(file.attrs["history"].splitlines()) == 1
    assert read_verification(tmp_path, job.digest)["error_statement"] == "0.1 % off"
    assert read_verification(tmp_path, "other") == {}
