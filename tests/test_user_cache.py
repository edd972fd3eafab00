"""Single jobs keep what they have reduced: the same bits at the next start, nothing stale or damaged."""

import logging
import os
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import h5py
import numpy as np
import pytest
import yaml
from test_cli import SMALL, call

import romdam
from romdam.core.files import hold
from romdam.core.sealed import is_sealed
from romdam.pipelines.check import check
from romdam.reduction import reductor
from romdam.reduction.methods.craig_bampton import CraigBampton
from romdam.reduction.storage import user_cache
from romdam.reduction.storage.user_cache import cache_folder, entries, open_store, remove

VARIABLES = ("opening", "normal_force", "reduced_coordinates", "energy_strain", "estimated_error_l2")


@pytest.fixture
def job(tmp_path):
    np.savetxt(tmp_path / "pulse.txt", np.sin(np.arange(20.0)))
    raw = yaml.safe_load(SMALL)
    raw["outputs"] = raw.get("outputs", {}) | {"mesh_error": False}  # whose meshes have blocks of their own
    (tmp_path / "job.yaml").write_text(yaml.safe_dump(raw))
    return romdam.load_config(tmp_path / "job.yaml")


@pytest.fixture
def counted(monkeypatch):
    """Names of the blocks that are reduced, one entry each time."""
    done, real = [], CraigBampton.reduce

    def reduce(self, substructure, *rest):
        done.extend(substructure.blocks)
        return real(self, substructure, *rest)

    monkeypatch.setattr(CraigBampton, "reduce", reduce)
    return done


def results(job, out: Path, cache: Path | None):
    (path,) = romdam.run(job, out, cache=cache).paths
    dataset = romdam.open_result(path).dataset
    return [dataset[name].values for name in VARIABLES if name in dataset]


def test_a_warm_start_reduces_nothing_and_gives_the_bits_of_a_cold_one(tmp_path, job, counted):
    plain = results(job, tmp_path / "plain", None)
    without = len(counted)
    cold = results(job, tmp_path / "cold", cache_folder())
    assert len(counted) == 2 * without > 0 and len(plain) >= 3
    warm = results(job, tmp_path / "warm", cache_folder())
    assert len(counted) == 2 * without
    for one, other, third in zip(plain, cold, warm, strict=True):
        assert np.array_equal(one, other) and np.array_equal(other, third)


def test_a_check_fills_it_for_the_run(tmp_path, job, counted):
    check(job, cache=cache_folder())
    before = list(counted)
    config = job.config.model_copy(
        update={"outputs": job.config.outputs.model_copy(update={"error_estimate": False})}
    )
    romdam.run(type(job)(config, job.path), tmp_path / "out", cache=cache_folder())
    assert counted == before != []


@pytest.mark.parametrize("finer", [pytest.param(False, marks=pytest.mark.slow), True])
@pytest.mark.parametrize(
    "damage",
    [
        "cut",
        "changed",
        pytest.param("empty", marks=pytest.mark.slow),
        pytest.param("text", marks=pytest.mark.slow),
    ],
)
def test_damaged_blocks_are_refused_by_their_seal_and_made_again(
    tmp_path, job, counted, caplog, damage, finer
):
    cold = results(job, tmp_path / "cold", cache_folder())
    made, every = len(counted), [entry.path for entry in entries(cache_folder())]
    blocks = [path for path in every if is_finer(path) == finer]
    assert 2 * len(blocks) == len(every)
    for path in blocks:
        whole = path.read_bytes()
        middle = len(whole) // 2
        path.write_bytes(
            {
                "cut": whole[:middle],
                "changed": whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :],
                "empty": b"",
                "text": b"not a block",
            }[damage]
        )
    again = results(job, tmp_path / "again", cache_folder())
    assert len(counted) == 2 * made
    assert all(str(path) in caplog.text for path in blocks) and "reducing again" in caplog.text
    assert all(np.array_equal(*pair) for pair in zip(cold, again, strict=True))
    assert all(is_sealed(path) for path in every)


def is_finer(path):
    with h5py.File(path) as file:
        return "mix" in file


def test_other_code_finds_nothing(tmp_path, job, counted, monkeypatch):
    romdam.run(job, tmp_path / "out", cache=cache_folder())
    made = len(counted)
    monkeypatch.setattr(reductor, "code_digest", lambda *rooms: "other")
    romdam.run(job, tmp_path / "out", cache=cache_folder())
    assert len(counted) == 2 * made and len(entries(cache_folder())) == 4 * made  # with the finer basis


@pytest.mark.slow
def test_other_code_finds_nothing_in_a_folder_that_was_named(tmp_path, job, counted, monkeypatch):
    """A suite's own `cache/` is one, too."""
    romdam.run(job, tmp_path / "out", cache=tmp_path / "cache")
    made = len(counted)
    romdam.run(job, tmp_path / "out", cache=tmp_path / "cache")
    assert len(counted) == made > 0
    monkeypatch.setattr(reductor, "code_digest", lambda *rooms: "other")
    romdam.run(job, tmp_path / "out", cache=tmp_path / "cache")
    assert len(counted) == 2 * made


def test_what_was_used_longest_ago_goes_but_never_a_jobs_own(tmp_path, job, monkeypatch):
    romdam.run(job, tmp_path / "out", cache=cache_folder())
    own = entries(cache_folder())
    old = [cache_folder() / "0123456789ab" / f"block-{number}.h5" for number in range(3)]
    old[0].parent.mkdir()
    for number, path in enumerate(old):
        path.write_bytes(bytes(1000))
        os.utime(path, (number, number))
    size = sum(entry.size for entry in own)
    monkeypatch.setattr(user_cache, "LIMIT", size + 1000)
    romdam.run(job, tmp_path / "out", cache=cache_folder())
    assert [path.exists() for path in old] == [False, False, True]
    monkeypatch.setattr(user_cache, "LIMIT", 10.0)
    romdam.run(job, tmp_path / "out", cache=cache_folder())
    assert {entry.path for entry in entries(cache_folder())} == {entry.path for entry in own}


def test_finding_a_block_counts_as_use(tmp_path, job):
    romdam.run(job, tmp_path / "out", cache=cache_folder())
    for entry in entries(cache_folder()):
        os.utime(entry.path, (1.0, 1.0))
    romdam.run(job, tmp_path / "out", cache=cache_folder())
    assert all(entry.used > time.time() - 60.0 for entry in entries(cache_folder()))


def test_a_block_that_is_being_written_is_not_removed():
    path = cache_folder() / ".block-abc.columns"
    path.parent.mkdir(parents=True)
    lock = hold(path)
    (entry,) = entries(cache_folder())
    assert not remove(entry) and path.exists()
    os.close(lock)
    assert remove(entry) and not path.exists()


@pytest.mark.slow
def test_jobs_at_once_share_it(tmp_path, job):
    with ThreadPoolExecutor(4) as threads:
        made = [threads.submit(results, job, tmp_path / str(k), cache_folder()) for k in range(6)]
    first, *others = [one.result() for one in made]
    for other in others:
        assert all(np.array_equal(*pair) for pair in zip(first, other, strict=True))
    assert all(is_sealed(entry.path) for entry in entries(cache_folder()))


def test_where_it_cannot_be_the_job_goes_on(tmp_path, job, monkeypatch, caplog):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert open_store(cache_folder()) is None
    assert "reduced blocks cannot be kept there" in caplog.text and "--no-cache" in caplog.text
    assert romdam.run(job, tmp_path / "out", cache=cache_folder()).paths


def test_a_full_disk_costs_the_block_and_not_the_job(tmp_path, job, monkeypatch, caplog):
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 0})())
    store = open_store(cache_folder())
    assert store is not None
    with caplog.at_level(logging.WARNING):
        check(job, cache=cache_folder())
    assert "the reduced block is not kept" in caplog.text and not entries(cache_folder())


def test_a_relative_folder_of_the_environment_does_not_count(monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", "cache")
    monkeypatch.setenv("HOME", "/home/anna")
    assert cache_folder() == Path("/home/anna/.cache/romdam")


def test_without_a_home_nothing_is_kept(tmp_path, monkeypatch, caplog):
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    monkeypatch.chdir(tmp_path)
    assert open_store(cache_folder()) is None
    assert "no home folder is known" in caplog.text and not list(tmp_path.iterdir())


def test_the_command_lists_and_clears(tmp_path, job):
    assert call("cache") == (0, f"0 reduced blocks, 0 MB of at most 10.0 GB, in {cache_folder()}\n", "")
    assert call("run", job.path, "--out", tmp_path / "out", "--no-cache", "--quiet")[0] == 0
    assert not entries(cache_folder())
    assert call("check", job.path, "--quiet")[0] == 0
    kept = [entry.path for entry in entries(cache_folder())]
    assert kept
    _, text, _ = call("cache", "list")
    assert all(str(path) in text for path in kept) and f"{len(kept)} reduced blocks" in text
    code, text, _ = call("cache", "clear")
    assert code == 0 and text.startswith(f"removed: {len(kept)} reduced blocks")
    assert not entries(cache_folder()) and call("cache", "burn")[0] == 2


def test_options_that_exclude_each_other(tmp_path, job):
    code, _, text = call("run", job.path, "--out", tmp_path / "o", "--cache", tmp_path / "c", "--no-cache")
    assert code == 2 and "--no-cache" in text


def test_what_another_job_is_writing_is_not_looked_into(tmp_path, monkeypatch):
    """Its folder may be gone between two looks; those of single codes, of before, are looked into."""
    for folder in (tmp_path / ".romdam-abc.part", tmp_path / "e293a10905a5"):
        folder.mkdir()
        (folder / "block-0.h5").write_bytes(b"1")
    (tmp_path / "block-1.h5").write_bytes(b"1")
    found = user_cache.entries(tmp_path)
    assert {entry.path.relative_to(tmp_path).as_posix() for entry in found} == {
        "block-1.h5",
        "e293a10905a5/block-0.h5",
    }
    assert all(map(user_cache.remove, found))
    assert tmp_path.is_dir() and not (tmp_path / "e293a10905a5").exists()
    assert user_cache.entries(tmp_path / "nowhere") == []
