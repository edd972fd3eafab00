"""A statement of error lands in the results that it is about."""

import json

import h5py
import pytest

from romdam.core.scene_digest import scene_digest
from romdam.error.metrics import RelativeError
from romdam.error.statement import ErrorStatement, read_verification, write_verification
from romdam.results.dataset import build_dataset, write_dataset


def of(case, job):
    """What a result of the case says that it is of."""
    digests = {"configuration_sha256": job.digest, "scene_sha256": scene_digest(case.scene)}
    return digests | {"record": case.motion.name, "record_sha256": case.motion.digest}


def stated(about):
    errors = {"opening": RelativeError(0.001, 0.002)}
    return ErrorStatement("verification", "0.1 % off", errors, {"l2_error": 0.001, **about})


def test_statement_lands_in_results_of_the_same_configuration_only(case, job, timing, tmp_path):
    write_dataset(build_dataset(case, job, timing, None), tmp_path / "same.nc")
    other = build_dataset(case, job, timing, None)
    other.attrs["configuration_sha256"] = "other"
    write_dataset(other, tmp_path / "other.nc")
    write_verification(tmp_path, stated(of(case, job)))
    with h5py.File(tmp_path / "same.nc") as file:
        assert file.attrs["error_statement"] == "0.1 % off"
        written = json.loads(file.attrs["verification"])
        assert written["l2_error"] == written["error"]["opening"]["l2"] == 0.001
        assert file.attrs["verification_opening_peak"] == 0.002
        assert "error stated by romdam" in file.attrs["history"].splitlines()[1]
    with h5py.File(tmp_path / "other.nc") as file:
        assert "error_statement" not in file.attrs and len(file.attrs["history"].splitlines()) == 1
    assert read_verification(tmp_path, of(case, job))["error_statement"] == "0.1 % off"
    assert read_verification(tmp_path, of(case, job) | {"configuration_sha256": "other"}) == {}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"scene_sha256": "other"}, "of another scene"),
        ({"record_sha256": "other"}, "of other samples of that record"),
        ({"record": "b", "record_sha256": "other"}, ""),  # the sentence names the record that it is of
    ],
)
def test_statement_is_not_that_of_other_contents_under_the_same_names(
    changed, said, case, job, timing, tmp_path, caplog
):
    """The configuration is the same in all of them: it names files, and does not say what is in them."""
    write_verification(tmp_path, stated(of(case, job)))
    found = read_verification(tmp_path, of(case, job) | changed)
    assert bool(found) == (not said) and said in caplog.text and len(caplog.records) == bool(said)
    result = build_dataset(case, job, timing, None)
    result.attrs.update(changed)
    write_dataset(result, tmp_path / "other.nc")
    write_verification(tmp_path, stated(of(case, job)))
    with h5py.File(tmp_path / "other.nc") as file:
        assert ("error_statement" in file.attrs) == (not said)


def test_statement_of_before_that_names_no_contents_is_left_out_and_said(case, job, tmp_path, caplog):
    write_verification(tmp_path, stated({"configuration_sha256": job.digest}))
    assert read_verification(tmp_path, of(case, job)) == {}
    assert "does not say of which mesh" in caplog.text and "romdam verify" in caplog.text
