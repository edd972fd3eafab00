"""Damaged files: each reads, or is refused with a RecordError that names file and line; no hang."""

import re
import signal
import warnings

import numpy as np
import obspy
import pytest
import samples
from mutations import mutate

from romdam.errors import RecordError
from romdam.records.channel import check_channel
from romdam.records.formats import Declared, read_channels

SECONDS = 10  # for one file; the slowest sample takes 0.02 s
PLACE = re.compile(r"line \d+|channel \S+")


def originals(folder):
    paths = samples.write_all(folder)
    trace = obspy.Trace(samples.motion().astype(np.float32), {"delta": 0.005, "channel": "HNN"})
    for name in ("SAC", "MSEED"):
        paths[name] = folder / f"sample.{name}"
        trace.write(str(paths[name]), name)
    return {name: path.read_bytes() for name, path in paths.items()}


def _too_slow(*_):
    raise TimeoutError(f"one file took more than {SECONDS} s")


def run(folder, count, seed):
    """Return how many of `count` damaged files were read and how many refused."""
    rng = np.random.default_rng(seed)
    sources = originals(folder)
    names = list(sources)
    path = folder / "damaged.record"
    read = refused = 0
    before = signal.signal(signal.SIGALRM, _too_slow)
    try:
        for number in range(count):
            name = names[number % len(names)]
            path.write_bytes(mutate(sources[name], rng))
            signal.alarm(SECONDS)
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    for channel in read_channels(path, Declared(dt=0.01)):
                        check_channel(channel, f"{path}")
                read += 1
            except RecordError as error:
                assert str(path) in str(error) and PLACE.search(str(error)), f"{name} {number}: {error}"
                refused += 1
            except Exception as error:
                kept = folder / f"bad_{name}_{number}"
                kept.write_bytes(path.read_bytes())
                raise AssertionError(f"{name}, file {number} ({kept}): {error!r}") from error
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)
    return read, refused


def test_a_file_that_crashes_obspy_is_refused(tmp_path):
    """GSE2's decompressor writes beyond its buffer when the count is wrong; the process must survive."""
    trace = obspy.Trace(np.round(1e4 * samples.motion()).astype(np.int32), {"delta": 0.005, "channel": "HNN"})
    path = tmp_path / "x.gse2"
    trace.write(str(path), "GSE2")
    assert read_channels(path)[0].data.size == trace.data.size
    text = path.read_bytes()
    path.write_bytes(text.replace(b"     603 ", b"99999603 ").replace(b"DAT2\n", b"DAT2\n" + 4000 * b"z"))
    with pytest.raises(RecordError, match=r"x\.gse2: line 1"):
        read_channels(path)


def test_damaged_files(tmp_path):
    read, refused = run(tmp_path, 1000, seed=1)
    assert read + refused == 1000
    assert refused > 500  # most damage must be noticed; what is read has a changed digit or title


@pytest.mark.slow
def test_twenty_thousand_damaged_files(tmp_path):
    read, refused = run(tmp_path, 20_000, seed=2)
    assert read + refused == 20_000
    assert refused > 10_000
