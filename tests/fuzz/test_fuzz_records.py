"""Record files that lie or are damaged: each reads right, or is refused by name; nothing silently wrong.

The right answer is the motion of the honest file. "Silent" means: read without a warning that the honest file
does not have.
"""

from __future__ import annotations

import os
import signal
import warnings
from functools import partial
from pathlib import Path

import numpy as np
import obspy
import pytest
from bounded import bounded
from record_mutations import mutate
from record_traps import ENTRIES, READ, REFUSED, Trap, all_traps, honest

import samples  # isort: skip
from romdam.config.sections.motions.records import RecordConfig
from romdam.core.errors import RecordError, RomdamError
from romdam.core.motion import GroundMotion
from romdam.records.formats.registry import read_channels
from romdam.records.processing.resampling import resample
from romdam.records.record_set import load_motions, usable_apart

SECONDS = 10  # for one file; the slowest takes 0.05 s
BATCH = 250
DRIFT = ("the velocity ends", "the displacement ends")  # the honest motions drift
STATED_ONCE = {"AT2", "AT2-old"}  # nothing else in the file says dt
UNCOUNTED = {"single", "columns", "MSEED"}  # nothing says how many samples there were
TWO_ROWS = 16  # samples; what a row that is gone and another one twice can change, or a cut within numbers


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    return honest(tmp_path_factory.mktemp("honest"))


def load(path: Path, source: str, **settings: object) -> list[GroundMotion]:
    entry = {"file": path.name, "components": {"y": "each"}} | ENTRIES.get(source, {}) | settings
    try:
        config = RecordConfig.model_validate({k: v for k, v in entry.items() if v is not None})
    except ValueError as error:  # the command names file and key, see tests/config
        raise RecordError(f"{path.name}: {error}") from None
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        return load_motions([config], path.parent)


def told(motion: GroundMotion) -> list[str]:
    return [text for text in motion.warnings if not text.startswith(DRIFT)]


def same(found: list[GroundMotion], right: list[GroundMotion]) -> bool:
    return len(found) == len(right) and all(
        one.acc.shape == other.acc.shape
        and np.isclose(one.dt, other.dt, rtol=1e-9)
        and np.allclose(one.acc, other.acc, rtol=1e-6, atol=1e-9)
        for one, other in zip(found, right, strict=True)
    )


TRAPS = all_traps()


def sprung(trap: Trap, sources: dict[str, bytes], folder: Path) -> str:
    """What is wrong with how a trap ends, or nothing."""
    path = folder / "trap.record"
    path.write_bytes(sources[trap.source])
    right = load(path, trap.source)
    path.write_bytes(trap.edit(sources[trap.source]))
    try:
        found = load(path, trap.source, **trap.entry)
    except RomdamError as error:
        if path.name not in str(error):
            return f"no name in {error}"
        return f"refused: {error}" if trap.end == READ else ""
    if trap.end == REFUSED:
        return "read"
    if trap.end == READ:
        return "" if same(found, right) else "read wrongly"
    return "" if same(found, right) or all(told(one) for one in found) else "read wrongly without a word"


def spring(traps: list[Trap], sources: dict[str, bytes], folder: Path) -> list[str]:
    found = ((trap, sprung(trap, sources, folder)) for trap in traps)
    return [f"{trap.source}, {trap.name}: {what[:300]}" for trap, what in found if what]


def test_no_trap_is_read_wrongly_without_a_word(sources, tmp_path, cases):
    assert len(TRAPS) > 600 and len({(trap.source, trap.name) for trap in TRAPS}) == len(TRAPS)
    rng = np.random.default_rng(5)
    picked = rng.permutation(len(TRAPS))[: cases(150, len(TRAPS))]
    outcome = bounded(lambda: spring([TRAPS[i] for i in picked], sources, tmp_path), seconds=300.0)
    assert not outcome.crash and outcome.value == []


class TooSlow(BaseException):
    """Not an Exception, so that nothing takes it for a damaged file."""


def _too_slow(*_):
    raise TooSlow


def silent_and_wrong(name: str, found: list[GroundMotion], right: list[GroundMotion]) -> str:
    """How motions that were read without a word differ, beyond what no header can tell."""
    if len(found) != len(right):
        return "" if all(map(told, found)) else f"{len(found)} motions of {len(right)}"
    for one, other in zip(found, right, strict=True):
        if told(one):
            continue
        count, whole = one.acc.shape[1], other.acc.shape[1]
        if abs(one.dt - other.dt) > 1.5 / whole * other.dt and name not in STATED_ONCE:
            return f"dt {one.dt:g}, not {other.dt:g} s"
        if count != whole and (name not in UNCOUNTED or count > whole + TWO_ROWS):
            return f"{count} samples of {whole}"
        if (strange := _strangers(one.acc[1], other.acc[1])) > TWO_ROWS:
            return f"{strange} of {whole} samples are none of the motion's"
    return ""


def _strangers(found: np.ndarray, right: np.ndarray) -> int:
    """How many values are none of the right motion's, wherever rows that went or came twice moved them."""
    values = np.sort(right)
    near = np.clip(np.searchsorted(values, found), 1, values.size - 1)
    off = np.minimum(np.abs(values[near] - found), np.abs(values[near - 1] - found))
    return int(np.count_nonzero(off > 1e-6 * np.abs(found) + 1e-9))


def damage(first: int, count: int, sources: dict[str, bytes], folder: Path) -> tuple[int, int, list[str]]:
    """Read damaged files number `first` on; how many are refused and told, and what is silently wrong."""
    signal.signal(signal.SIGALRM, _too_slow)
    names, path = list(sources), folder / "damaged.record"
    right = {}
    for name in names:
        path.write_bytes(sources[name])
        right[name] = load(path, name)
    refused, spoken, wrong = 0, 0, []
    for number in range(first, first + count):
        name = names[number % len(names)]
        path.write_bytes(mutate(sources[name], np.random.default_rng([7, number])))
        signal.alarm(SECONDS)
        try:
            found = load(path, name)
            what = silent_and_wrong(name, found, right[name])
            spoken += any(told(one) for one in found)
        except RecordError as error:
            refused += 1
            what = "" if path.name in str(error) else f"no name in {error}"
        except BaseException as error:
            what = f"{type(error).__name__}: {error}"
        finally:
            signal.alarm(0)
        wrong += [f"{name}, damage {number}: {what[:300]}"] if what else []
    return refused, spoken, wrong


def test_no_damaged_file_is_read_wrongly_without_a_word(sources, tmp_path, cases, record_property):
    count = cases(250, 20_000)
    refused, spoken, wrong = 0, 0, []
    for first in range(0, count, BATCH):
        outcome = bounded(partial(damage, first, BATCH, sources, tmp_path), seconds=120.0)
        assert not outcome.crash, f"damages from {first} on: {outcome.crash}"
        assert outcome.grown < 1e9
        refused, spoken, wrong = (a + b for a, b in zip((refused, spoken, wrong), outcome.value, strict=True))
    print(f"{count} damaged files: {refused} refused, {spoken} read with a warning, {len(wrong)} wrong")
    assert wrong == []
    assert refused > count / 2  # most damage must be noticed; what is read has a changed digit or title


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


def _no_file(folder: Path) -> list[tuple[str, dict[str, object]]]:
    """Names of what is no record, or none that can be meant, and the settings to read it with."""
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    with (folder / "huge").open("wb") as file:
        file.truncate(10_000_000_000)
    at2 = "PEER\nE, S, 090\nACCELERATION TIME SERIES IN UNITS OF G\nNPTS= {}, DT= .005 SEC\n 0.1 0.2\n"
    (folder / "counted").write_text(at2.format("1000000000000"))
    (folder / "digits").write_text(at2.format("9" * 5000))
    cosmos = samples.cosmos_cgs(samples.motion()).replace("     603 acc", "99999999999 acc")
    (folder / "announced").write_text(cosmos)
    (folder / "good").write_text("\n".join(f"{value:.6f}" for value in samples.motion()))
    names = ["/dev/zero", "/dev/random", "pipe", "folder", "huge", "counted", "digits", "announced"]
    names += ["a\0b", "", 300 * "x"]
    pad = {"correction": [{"pad": {"length": "1e7 s"}}]}
    return [*((name, {}) for name in names), ("good", pad)]


def test_what_is_no_record_is_refused_before_it_is_read(tmp_path):
    for name, settings in _no_file(tmp_path):
        entry = {"file": name, "unit": "m/s2", "dt": 0.005, "components": {"y": "each"}} | settings
        config = RecordConfig.model_validate(entry)
        outcome = bounded(lambda c=config: load_motions([c], tmp_path), seconds=10.0)
        assert outcome.refusal and not outcome.crash, (name, outcome)
        assert outcome.seconds < 5.0 and outcome.grown < 200e6, (name, outcome)


def test_one_bad_record_takes_no_other_with_it(sources, tmp_path):
    """Every trap and every thing that is no record beside two good ones: both good ones are there."""
    traps = [trap for trap in TRAPS if trap.end == REFUSED and not trap.entry][::25]
    entries = [{"file": name} | settings for name, settings in _no_file(tmp_path)]
    for number, trap in enumerate(traps):
        (tmp_path / f"trap{number}").write_bytes(trap.edit(sources[trap.source]))
        entries.append({"file": f"trap{number}"} | ENTRIES.get(trap.source, {}))
    good = {"file": "good"}
    common = {"unit": "m/s2", "dt": 0.005, "components": {"y": "each"}}
    entries = [good | {"name": "first"}, *entries, {"manifest": "none.csv"}, good | {"name": "last"}]
    whole = [{k: v for k, v in (common | entry).items() if v is not None} for entry in entries]
    configs = [RecordConfig.model_validate(entry) for entry in whole]

    def read() -> list[tuple[str, bool]]:
        return [(one.name, one.motion is not None) for one in usable_apart(configs, tmp_path)]

    outcome = bounded(read, seconds=60.0)
    assert not outcome.crash
    assert [name for name, read in outcome.value if read] == ["first", "last"]
    assert len(outcome.value) == len(entries)


@pytest.mark.parametrize("method", ["linear", "fourier"])
def test_a_step_that_makes_too_many_samples_is_refused(method):
    acc = np.zeros((3, 3000))
    outcome = bounded(lambda: resample(acc, 0.01, 2.5e-9, method), seconds=10.0)
    assert "1.2e+10 samples, the limit is 2e+07" in outcome.refusal and outcome.grown < 50e6
