"""A suite edited, killed and damaged again and again ends in the bits of one that was made at once.

Every sequence draws edits of a tiny suite: records exchanged, copied, renamed, removed and altered; scales
and samples added in front, reordered, repeated and removed; parameters renamed; what is kept, how many march
together, the joints and the step. Each edit is run in a process of its own, killed at a random moment or let
end, and now and then a file is damaged after it; the last is let end. Left out of the comparison are the
seconds that runs took and the time of writing.
"""

from __future__ import annotations

import copy
import os
import random
import signal
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from suite_jobs import BASE, pulse

import romdam
from romdam.pipelines.suites.folder import clean
from romdam.pipelines.suites.run import SuiteOptions, run_suite
from romdam.results.suite.journal import JOURNAL

SEED = 20260
# ends of names that tell of this run's making
CLOCK = ("_seconds", "date_created", "history", "configuration_folder")


def small() -> dict:
    """Two blocks of two elements high, six gaps, half a second."""
    raw = copy.deepcopy(BASE)
    for block in raw["blocks"].values():
        block["box"]["size"][2] = 10
    raw["model"] = {"order": "reduced", "modes": 3}
    raw["transient"] = {"finest_step": "10 ms"}
    raw["records"] = []
    raw["outputs"] |= {"plots": False, "nodes": {"top": {"block": "right", "at": [0, 0, 10]}}}
    return raw


class Edited:
    """A suite under edit: its records, and its configuration."""

    def __init__(self, draw: random.Random, folder: Path) -> None:
        self.draw, self.folder, self.raw = draw, folder, small()
        self.files = [self._new_file() for _ in range(4)]
        self.records = [(f"r{i}", self.files[i]) for i in range(2)]
        self.scales, self.samples, self.names = [1.0], [(0.3, 0.05)], ["mu", "gap"]
        self.suite: dict = {"keep": draw.choice(["full", "peaks"])}

    def _new_file(self) -> str:
        name = f"f{len(list(self.folder.glob('f*.txt')))}.txt"
        acc = self.draw.uniform(1.0, 3.0) * pulse(self.draw.randrange(8))[:40]
        if self.draw.random() < 0.3:
            acc = np.column_stack([acc, 0.5 * acc[::-1]])  # shaken along two axes
        np.savetxt(self.folder / name, acc)
        return name

    def edit(self) -> str:
        """Make one edit at random; its name."""
        edits = [name for name in dir(self) if name.startswith("edit_")]
        name = self.draw.choice(edits)
        getattr(self, name)()
        return name.removeprefix("edit_")

    def edit_exchange_names(self) -> None:
        names, files = zip(*self.records, strict=True)
        self.records = list(zip(self.draw.sample(names, len(names)), files, strict=True))

    def edit_rename(self) -> None:
        i = self.draw.randrange(len(self.records))
        self.records[i] = (f"n{self.draw.randrange(1000)}", self.records[i][1])

    def edit_add_record(self) -> None:
        if len(self.records) < 3:
            new = (f"a{self.draw.randrange(1000)}", self.draw.choice(self.files))  # often one that is there
            self.records.insert(self.draw.randrange(len(self.records) + 1), new)

    def edit_remove_record(self) -> None:
        if len(self.records) > 1:
            self.records.pop(self.draw.randrange(len(self.records)))

    def edit_alter_record(self) -> None:
        path = self.folder / self.draw.choice(self.files)
        np.savetxt(path, 1.1 * np.loadtxt(path))

    def edit_reorder_records(self) -> None:
        self.draw.shuffle(self.records)

    def edit_scales(self) -> None:
        self.scales = self.draw.sample([0.25, 0.5, 1.0, 2.0], self.draw.randint(1, 2))

    def edit_add_sample(self) -> None:
        if len(self.samples) < 2:
            new = (self.draw.choice([0.0, 0.3, 0.6]), self.draw.choice([0.03, 0.05]))
            self.samples.insert(self.draw.randrange(len(self.samples) + 1), new)

    def edit_remove_sample(self) -> None:
        if len(self.samples) > 1:
            self.samples.pop(self.draw.randrange(len(self.samples)))

    def edit_reorder_samples(self) -> None:
        self.draw.shuffle(self.samples)

    def edit_parameter_names(self) -> None:
        names = ["mu", "gap", "joint", "record", "run_key", "peak_opening", "scale"]
        self.names = self.draw.sample(names, 2)

    def edit_keep(self) -> None:
        self.suite["keep"] = self.draw.choice(["full", "peaks", "peaks", {"output_interval": "0.04 s"}])

    def edit_batch(self) -> None:
        self.suite["batch"] = self.draw.choice([1, 2, 3, 8])

    def edit_joint(self) -> None:
        self.raw["joints"]["gap"]["normal_stiffness"] = self.draw.choice(["16 GPa/m", "4 GPa/m"])

    def edit_step(self) -> None:
        self.raw["transient"] = self.draw.choice([{"finest_step": "10 ms"}, {"finest_step": "5 ms"}])

    def edit_title(self) -> None:
        self.raw["title"] = f"title {self.draw.randrange(9)}"

    def write(self) -> Path:
        """The configuration, its records and samples as they are now."""
        paths = ("joints.gap.friction", "damping.rayleigh.ratio")
        parameters = {name: {"path": path} for name, path in zip(self.names, paths, strict=True)}
        lines = [",".join(self.names), *(f"{mu},{ratio}" for mu, ratio in self.samples)]
        (self.folder / "samples.csv").write_text("\n".join(lines))
        about = {"unit": "m/s2", "dt": "0.01 s"}
        records = []
        for name, file in self.records:
            two = np.loadtxt(self.folder / file).ndim == 2
            records.append({"name": name, "file": file, "components": {"y": 1, "x": 2} if two else {"y": 1}})
            records[-1] |= about
        suite = self.suite | {
            "scales": list(self.scales),
            "parameters": parameters,
            "design": {"table": "samples.csv"},
        }
        path = self.folder / "suite.yaml"
        path.write_text(yaml.safe_dump(self.raw | {"records": records, "suite": suite}))
        return path


def run_here(config: Path, out: Path) -> None:
    """What the child processes and the last run do."""
    run_suite(romdam.load_config(config), out, SuiteOptions(workers=1))


def in_child(config: Path, out: Path, seconds: float | None) -> None:
    """Run a suite in a process of its own, killed after so many seconds."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            run_here(config, out)
            code = 0
        finally:
            os._exit(code)
    if seconds is not None:
        time.sleep(seconds)
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if seconds is None:
        assert status == 0, "a suite that was let run failed"


def damage(draw: random.Random, out: Path) -> str:
    """Change the rows or a kept result: some bits, a stretch of zeros, or its end; which."""
    paths = [path for path in (out / JOURNAL, *(out / "runs").glob("*.nc")) if path.exists()]
    if not paths:
        return "nothing to damage"
    path, kind = draw.choice(sorted(paths)), draw.choice(["bits", "zeros", "cut"])
    data = bytearray(path.read_bytes())
    at = draw.randrange(len(data))
    if kind == "bits":
        for place in draw.choices(range(len(data)), k=8):
            data[place] ^= 1 << draw.randrange(8)
    elif kind == "zeros":
        data[at : at + 2000] = bytes(len(data[at : at + 2000]))
    else:
        del data[at:]
    path.write_bytes(data)
    return f"{kind} of {path.name}"


def attributes(dataset: xr.Dataset) -> dict[str, str]:
    kept = {str(name): value for name, value in dataset.attrs.items() if not str(name).endswith(CLOCK)}
    return {name: repr(np.asarray(value).tolist()) for name, value in kept.items()}


def parts(out: Path) -> dict[str, object]:
    """Every number, name and attribute of a suite and its kept results."""
    tree, found = romdam.open_suite(out), {}
    for node in tree.subtree:
        dataset = node.to_dataset(inherit=False)
        found[node.path] = attributes(dataset)
        for name, values in dataset.variables.items():
            if not str(name).endswith(CLOCK):
                data = values.values
                bits = data.tolist() if data.dtype.kind in "OUS" else data.tobytes()
                found[f"{node.path}:{name}"] = (values.dims, str(data.dtype.kind), bits, attributes(values))
        dataset.close()
    tree.close()
    return found


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """Kernels of all kinds, and how long a suite takes; the children find them here."""
    edited = Edited(random.Random(1), tmp_path_factory.mktemp("warm"))
    edited.samples = [(0.0, 0.05), (0.3, 0.05)]
    config = edited.write()
    run_here(config, edited.folder / "out")
    begun = time.perf_counter()
    run_here(config, edited.folder / "again")
    return time.perf_counter() - begun


def sequence(number: int, folder: Path, usual: float) -> None:
    """One sequence of edits and kills, and what it has to end in."""
    draw = random.Random(SEED + number)
    edited = Edited(draw, folder)
    told = []
    for _ in range(draw.randint(2, 5)):
        killed = draw.random() < 0.6
        in_child(edited.write(), folder / "out", draw.uniform(0.0, 1.2 * usual) if killed else None)
        told += ["killed" if killed else "ended", *(edited.edit() for _ in range(draw.randint(1, 3)))]
        if draw.random() < 0.25:
            told.append(damage(draw, folder / "out"))
    config = edited.write()
    if draw.random() < 0.3:
        run_here(config, folder / "out")
        clean(romdam.load_config(config), folder / "out", remove=True)
        told.append("cleaned")
    run_here(config, folder / "out")
    run_here(config, folder / "fresh")
    ends, fresh = parts(folder / "out"), parts(folder / "fresh")
    other = [name for name in ends.keys() | fresh.keys() if ends.get(name) != fresh.get(name)]
    assert not other, f"sequence {number}: {told}: {sorted(other)[:8]}"
    names = {path.name for path in (folder / "fresh" / "runs").glob("*.nc")}
    assert names <= {path.name for path in (folder / "out" / "runs").glob("*.nc")}


@pytest.mark.slow
def test_edits_and_kills_end_in_the_bits_of_a_fresh_run(cases, compiled, tmp_path):
    for number in range(cases(1, 200)):
        folder = tmp_path / str(number)
        folder.mkdir()
        sequence(number, folder, compiled)
