"""A suite that is edited and run again gives every run its own numbers; its folder, and damage to it."""

import os

import numpy as np
import pytest
import yaml
from suite_jobs import BASE, MU, differing, edited, made, named_records, pulse, summary, write_job

import romdam
from romdam.core.errors import ConvergenceError
from romdam.pipelines.suites import runs as suite_runs
from romdam.results.suite.journal import JOURNAL


def as_fresh(config, folder, calls):
    """Run in the folder of before: how many runs that makes, and that a new folder has the same bits."""
    again = made(config, folder / "out")
    fresh = made(config, folder / f"fresh{len(list(folder.iterdir()))}")
    assert again.made == calls
    assert differing(again.summary, fresh.summary) == [] and again.failures == fresh.failures
    assert differing(summary(folder / "out"), fresh.summary) == []
    return again


@pytest.mark.slow
def test_a_scale_added_in_front_moves_no_number(tmp_path):
    config = write_job(tmp_path, records=1, suite={"scales": [0.25, 1, 2]})
    before = made(config, tmp_path / "out").summary.peak_opening.values.ravel()
    edited(config, scales=[0.25, 0.5, 1, 2])
    after = as_fresh(config, tmp_path, calls=1).summary.peak_opening.values.ravel()
    assert after[[0, 2, 3]].tolist() == before.tolist() and np.isfinite(after).all()


def test_scales_and_samples_are_reordered_and_removed_for_nothing(tmp_path):
    config = write_job(tmp_path, records=2, suite={"scales": [0.5, 1, 2], "parameters": MU})
    made(config, tmp_path / "out")
    edited(config, scales=[2, 0.5], parameters={"mu": MU["mu"] | {"values": [0.6, 0.2]}})
    as_fresh(config, tmp_path, calls=0)
    edited(config, parameters={"other": MU["mu"] | {"values": [0.4, 0.6]}})
    as_fresh(config, tmp_path, calls=4)


@pytest.mark.slow
def test_records_exchange_names_and_go(tmp_path):
    config = write_job(tmp_path, records=3, suite={"keep": "full"})
    named_records(config, a=0, b=1, c=2)
    made(config, tmp_path / "out")
    for files in ({"b": 0, "a": 1, "c": 2}, {"c": 2, "new": 0}, {"x": 2}):
        named_records(config, **files)
        as_fresh(config, tmp_path, calls=0)
        tree = romdam.open_suite(tmp_path / "out")
        assert sorted(tree["runs"]) == sorted(f"{name}__0__0" for name in files)
        for name, number in files.items():
            result = tree[f"runs/{name}__0__0"]
            assert result.attrs["record"] == f"{name}__0__0"
            assert f'"suite_record": "{name}"' in result.attrs["record_provenance"]
            assert f"r{number}.txt" in result.attrs["record_provenance"]
            assert result.attrs["configuration_sha256"] == romdam.load_config(config).digest


def test_two_records_of_one_file_are_both_there_at_every_start(tmp_path):
    config = write_job(tmp_path, records=1, suite={"keep": "full"})
    named_records(config, one=0, two=0)
    first = made(config, tmp_path / "out")
    assert first.made == 1 and not first.summary.status.values.any()
    as_fresh(config, tmp_path, calls=0)
    assert len(list((tmp_path / "out" / "runs").glob("*.nc"))) == 1
    assert len(set(first.summary.file.values.ravel())) == 1


def test_a_sample_with_friction_changes_the_basis_of_the_others(tmp_path):
    smooth = {"mu": MU["mu"] | {"values": [0.0]}}
    config = write_job(tmp_path, records=1, suite={"parameters": smooth})
    alone = float(made(config, tmp_path / "out").summary.peak_opening[0, 0, 0, 0])
    edited(config, parameters={"mu": MU["mu"] | {"values": [0.0, 0.6]}})
    both = as_fresh(config, tmp_path, calls=2).summary
    assert float(both.peak_opening[0, 0, 0, 0]) != alone  # its basis has the tangential directions by now


@pytest.mark.slow
def test_parameters_that_say_what_was_so_before_change_no_bit(tmp_path):
    joints = {"gap": BASE["joints"]["gap"] | {"friction": 0.3}}
    config = write_job(tmp_path, records=2, suite={"keep": "full"}, joints=joints)
    made(config, tmp_path / "out")
    ratio = {"path": "damping.rayleigh.ratio", "values": ["5 %"]}
    edited(config, parameters={"mu": MU["mu"] | {"values": [0.3]}, "ratio": ratio})
    as_fresh(config, tmp_path, calls=0)
    edited(config, parameters={})
    as_fresh(config, tmp_path, calls=0)


def test_failures_follow_their_records(tmp_path, monkeypatch):
    """The shorter record's run fails, under whatever name."""
    marching = suite_runs.simulate_motions

    def failing(job, prepared, motions, *rest):
        for motion in motions:
            if motion.acc.shape[1] == 60:
                raise ConvergenceError(f"record {motion.name}: step 3 did not converge")
        return marching(job, prepared, motions, *rest)

    monkeypatch.setattr(suite_runs, "simulate_motions", failing)
    config = write_job(tmp_path, records=2, suite={"keep": "full", "scales": [1]})
    named_records(config, one=0, other=1)
    assert list(made(config, tmp_path / "out").failures) == ["one__0__0"]
    named_records(config, other=0, one=1)
    again = as_fresh(config, tmp_path, calls=0)
    assert again.failures == {"other__0__0": "its record: step 3 did not converge"}


def test_what_is_kept_is_believed_by_its_bytes(tmp_path, caplog):
    config = write_job(tmp_path, records=3, suite={"keep": "full"})
    before = made(config, tmp_path / "out")
    paths = sorted((tmp_path / "out" / "runs").glob("*.nc"))
    whole = [path.read_bytes() for path in paths]
    changed = bytearray(whole[0])
    changed[len(changed) // 2] ^= 4
    paths[0].write_bytes(changed)
    paths[1].write_bytes(bytes(len(whole[1])))
    paths[2].unlink()
    os.mkfifo(paths[2])
    again = made(config, tmp_path / "out")
    assert again.made == 3 and differing(before.summary, again.summary) == []
    assert all(path.name in caplog.text for path in paths)


@pytest.mark.parametrize("seed", range(6))
def test_damaged_rows_are_never_believed(tmp_path, whole_suite, seed):
    config, journal, before = whole_suite
    out, draw = tmp_path / "out", np.random.default_rng(seed)
    out.mkdir()
    data = bytearray(journal)
    kind = ("bits", "zeroed", "cut", "swapped", "foreign", "words")[seed]
    if kind == "bits":
        for at in draw.integers(0, len(data), 40):
            data[at] ^= 1 << int(draw.integers(8))
    elif kind == "zeroed":
        data[len(data) // 3 : len(data) // 2] = bytes(len(data) // 2 - len(data) // 3)
    elif kind == "cut":
        del data[len(data) // 2 :]
    elif kind == "swapped":
        data = bytearray(data.replace(b'"peak_opening"', b'"peak_OPENING"'))
    elif kind == "foreign":
        data = bytearray(b'{"key": 1}\n\x00\xff\n' + b"0" * 64 + b" {}\n")
    else:
        data = bytearray(data.replace(b"e-05", b"e-04").replace(b"[", b"[NaN, ", 3))
    (out / JOURNAL).write_bytes(data)
    found = made(config, out)
    assert found.made > 0 and differing(found.summary, before) == []


@pytest.fixture(scope="module")
def whole_suite(tmp_path_factory):
    """A configuration, the bytes of its rows, its summary."""
    folder = tmp_path_factory.mktemp("whole")
    config = write_job(folder, suite={"scales": [0.5, 1.0]})
    found = made(config, folder / "out")
    return config, (folder / "out" / JOURNAL).read_bytes(), found.summary


@pytest.mark.parametrize(
    "batch",
    [
        pytest.param(1, marks=pytest.mark.slow),
        pytest.param(2, marks=pytest.mark.slow),
        3,
        pytest.param(7, marks=pytest.mark.slow),
    ],
)
def test_whom_a_run_marches_with_does_not_change_its_bits(tmp_path, batch):
    """Records of one and of two axes, samples with and without friction."""
    parameters = {"mu": MU["mu"] | {"values": [0.0, 0.4]},
                  "ratio": {"path": "damping.rayleigh.ratio", "values": ["3 %", "5 %"]}}  # fmt: skip
    config = write_job(tmp_path, records=2, suite={"parameters": parameters})
    np.savetxt(tmp_path / "records" / "both.csv", np.column_stack([pulse(1), pulse(1)[::-1]]))
    raw = yaml.safe_load(config.read_text())
    raw["records"].append({**BASE["records"][0], "files": "records/both.csv", "components": {"x": 1, "y": 2}})
    config.write_text(yaml.safe_dump(raw))
    together = made(config, tmp_path / "together").summary
    edited(config, batch=batch)
    assert differing(together, made(config, tmp_path / "out").summary) == []
