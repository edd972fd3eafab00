"""The same scenes in OpenSees, CalculiX and Exudyn as in romdam: frequencies, openings, CPU, in one run.

    make peers
    python tests/benchmarks/peers.py [--out results/peers] [--peers PYTHON] [--seconds 3]
                                           [--only cantilevers]

Two cantilevers (elements of 5 m) and three monoliths with Koyna's section on fixed bases, without
friction, in the first seconds of a Northridge record. OpenSees and CalculiX run the decks of
`romdam export`; in another row CalculiX searches for contact (`searching_contact.py`). Exudyn integrates the
reduced blocks of `romdam export --to matrices` (`peers_exudyn.py`). Compared with: romdam's full order at
0.25 ms. CPU is that of the process that integrates, all of it (romdam: its integration, compiled before); a
record is 30 s. Where a code is missing or stops, its row says so. Writes OUT/peers.json, OUT/peers.md and a
picture of each scene; nothing here passes or fails.
"""

from __future__ import annotations

import argparse
import json
import logging
import re
import resource
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import yaml
from scipy.sparse import csr_matrix
from searching_contact import search_for_contact

import romdam
from romdam.core.errors import RomdamError
from romdam.error.metrics import opening_error
from romdam.pipelines.export import ExportOptions, export_deck, export_matrices
from romdam.pipelines.modes import ModesOptions, modes

ROOT = Path(__file__).parents[2]
RECORDS = ROOT / "data" / "records"
ROW, RECORD = 0.005, 30.0  # [s] written rows, and a whole record
STEPS = {"opensees": 0.001, "calculix": 0.001, "exudyn": 0.001}  # [s]
_STOPPED = 3600  # [s] of wall after which a peer is stopped


@dataclass(frozen=True)
class Run:
    """What one code made of a scene: times (nt,), openings (nt, ng), CPU, steps, and how far it came."""

    time: np.ndarray
    opening: np.ndarray
    cpu: float
    steps: int
    said: str


def cantilevers() -> dict[str, Any]:
    """configs/two_cantilevers.yaml with elements of 5 m."""
    raw = yaml.safe_load((ROOT / "configs" / "two_cantilevers.yaml").read_text())
    for block in raw["blocks"].values():
        block["box"]["element_size"] = "5 m"
    raw["records"][0]["file"] = str(RECORDS / Path(raw["records"][0]["file"]).name)
    return raw


def monoliths() -> dict[str, Any]:
    """Three monoliths of 12, 20 and 16 m on one level."""
    files = {"x": "northridge_mul279_g_dt0.01.txt", "y": "northridge_mul009_g_dt0.01.txt"}
    joint = {"normal_stiffness": "5 GPa/m"}
    return {
        "title": "Three monoliths with Koyna's section",
        "materials": {"concrete": {"E": "31.027 GPa", "nu": 0.2, "rho": 2643}},
        "gravity_dam": {
            "upstream": [[0, 0], [103, 0]], "downstream": [[0, 70], [66.5, 19.25], [103, 14.8]],
            "monoliths": [12, 20, 16], "base": 0, "material": "concrete", "rock": None,
            "divisions": {"along": 2, "through": 4, "up": 8},
            "joints": {"base": "tied", "contraction": joint},
        },
        "loads": {"initial_state": "undeformed"},
        "damping": {"rayleigh": {"frequencies": ["1.5 Hz", "15 Hz"], "ratio": "5 %"}},
        "records": [{
            "name": "northridge", "unit": "9.81 m/s2", "dt": "0.01 s",
            "components": {axis: {"file": str(RECORDS / name)} for axis, name in files.items()},
        }],
        "model": {"modes": 60, "residual_vectors": 20},
    }  # fmt: skip


SCENES = {"cantilevers": cantilevers, "monoliths": monoliths}


def own(raw: dict[str, Any], folder: Path, keys: dict[str, Any], order: str) -> Run:
    """romdam's own openings."""
    folder.mkdir(parents=True, exist_ok=True)
    path, before = folder / "job.yaml", time.process_time()
    raw = raw | {"transient": raw["transient"] | keys, "model": raw["model"] | {"order": order}}
    path.write_text(yaml.safe_dump(raw))
    outcome = romdam.run(romdam.load_config(path), folder)
    data = romdam.open_result(outcome.paths[0]).dataset
    cpu = time.process_time() - before
    said = f"the whole command {cpu:.1f} CPU-s" if order == "reduced" else ""
    loop, steps = data.attrs["cpu_seconds_integration"], data.attrs["solver_steps"]
    return Run(data.time.values, data.opening.values, float(loop), int(steps), said)


def peer(command: list[str], folder: Path) -> tuple[float, str]:
    """CPU of a process [s], and how it ended."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        with (folder / "log.txt").open("w") as log:
            code = subprocess.run(command, cwd=folder, stdout=log, stderr=log, timeout=_STOPPED).returncode
        said = "" if code == 0 else (folder / "log.txt").read_text().strip().splitlines()[-1][-80:]
    except subprocess.TimeoutExpired:
        said = f"stopped after {_STOPPED} s"
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, said


class Lacking(Exception):
    """What a program lacks, so that it has no row."""


def refuse_unfit(python: Path, module: str) -> None:
    """Import a module in the peers' Python, and say what keeps it from that.

    Raises
    ------
    Lacking
    """
    if not python.exists():
        raise Lacking(f"there is no Python at {python}; make peers installs it")
    done = subprocess.run([python, "-c", f"import {module}"], capture_output=True, text=True, timeout=300)
    if done.returncode == 0:
        return
    said = (done.stderr or done.stdout).strip().splitlines()
    library = next((m[1] for line in said if (m := re.search(r"(\S+\.so\S*): cannot open", line))), "")
    package = {"libblas.so.3": "libblas3", "liblapack.so.3": "liblapack3"}.get(library, "")
    if library:
        remedy = f"apt-get install {package}" if package else "install what it is of"
        raise Lacking(f"{module} lacks the system's library {library}; {remedy}")
    raise Lacking(f"{module} cannot be imported in {python}: {said[-1] if said else 'no message'}")


def openings(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Times, and openings of all gaps; whole rows of a file that may end within one."""
    head, *rows = path.read_text().splitlines()
    names = head.split(",")
    table = np.array([row.split(",") for row in rows if row.count(",") == len(names) - 1], dtype=float)
    return table[:, 0], table[:, [k for k, name in enumerate(names) if name.startswith("opening:")]]


def deck(
    code: str, path: Path, folder: Path, python: Path, *, searches: bool = False
) -> tuple[Run, np.ndarray]:
    """Run an exported deck, with springs or with contact that `searches`; also its frequencies [Hz]."""
    if code == "opensees":
        refuse_unfit(python, "openseespy.opensees")
    elif shutil.which("ccx") is None:
        raise Lacking("ccx is not on the PATH; Debian: apt-get install calculix-ccx")
    job = romdam.load_config(path)
    export_deck(job, folder, ExportOptions(code, dt=STEPS[code]))
    if searches:
        joints = (joint.model_dump() for joint in job.config.every_joint.values())
        search_for_contact(folder, {float(joint["normal_stiffness"]) for joint in joints}.pop())
    if code == "opensees":
        cpu, said = peer([str(python), "deck.py"], folder)
    else:
        peer(["ccx", "frequencies"], folder)
        cpu, said = peer(["ccx", "deck"], folder)
        peer([sys.executable, "openings.py"], folder)
    if not (folder / "frequencies.csv").exists():
        raise Lacking(f"{code} ended before its frequencies: {said}; {folder / 'log.txt'}")
    table = np.loadtxt(folder / "frequencies.csv", delimiter=",", skiprows=1)
    times, gaps = openings(folder / "openings.csv")
    steps = round(times[-1] / STEPS[code])
    if code == "calculix":  # which may take smaller ones
        steps = int((folder / "deck.sta").read_text().split("\n")[-2].split()[1])
    return Run(times, gaps, cpu, steps, said), table[:, 1]


def exudyn(path: Path, folder: Path, python: Path, seconds: float) -> Run:
    """Reduced blocks of romdam in Exudyn."""
    refuse_unfit(python, "exudyn")
    paths = export_matrices(romdam.load_config(path), folder)
    names = [p.stem for p in paths if p.suffix == ".h5" and p.stem != "system"]
    model: dict[str, Any] = {"blocks": len(names), "stride": round(ROW / STEPS["exudyn"])}
    seen = []
    for k, name in enumerate(names):
        with h5py.File(folder / f"{name}.h5") as file:
            for key, short in (("mass", "M"), ("stiffness", "K"), ("damping", "C")):
                model[f"{short}{k}"] = matrix(file[key]).toarray()
            model[f"inertia{k}"], model[f"force{k}"] = file["inertia"][:], file["force"][:, 0]
            seen.append(matrix(file["gaps"]))
    with h5py.File(folder / "system.h5") as file:
        law = {key: file["law"][key][:] for key in ("K_n", "gap")}
    model["gaps"] = [pair(seen, k, law) for k in range(len(law["gap"]))]
    ground = np.loadtxt(folder.parent / "opensees" / "record.csv", delimiter=",", skiprows=1)
    model["ground"] = ground[:, -3:]
    np.savez(folder / "model.npz", **model)
    script = Path(__file__).with_name("peers_exudyn.py")
    cpu, said = peer([str(python), str(script), "model.npz", str(STEPS["exudyn"]), "openings.csv"], folder)
    times, gaps = openings(folder / "openings.csv")
    return Run(times, gaps, cpu, round(seconds / STEPS["exudyn"]), said)


def matrix(group: Any) -> csr_matrix:
    """A sparse matrix of romdam's HDF5."""
    if isinstance(group, h5py.Dataset):
        return csr_matrix(group[:])
    return csr_matrix((group["data"][:], group["indices"][:], group["indptr"][:]), shape=group.attrs["shape"])


def pair(seen: list[csr_matrix], gap: int, law: dict[str, np.ndarray]) -> list[float]:
    """Block and coordinate of both ends of a gap along an axis, its gap and its stiffness."""
    ends: dict[float, list[float]] = {}
    for block, rows in enumerate(seen):
        row = rows[gap].tocoo()
        for coordinate, sign in zip(row.col, row.data, strict=True):
            if abs(sign) > 1e-9:
                ends[round(float(sign), 9)] = [block, int(coordinate)]
    return [*ends[-1.0], *ends[1.0], float(law["gap"][gap]), float(law["K_n"][gap])]


def compared(run: Run, right: Run) -> tuple[float, float]:
    """L2 and peak error of a run up to where it came, on its own rows."""
    rows = run.time <= right.time[-1] + 1e-9
    exact = np.stack([np.interp(run.time[rows], right.time, one) for one in right.opening.T], axis=1)
    return opening_error(run.opening[rows], exact).l2, opening_error(run.opening[rows], exact).peak


def scene(name: str, raw: dict[str, Any], out: Path, python: Path, seconds: float) -> list[dict[str, Any]]:
    """Rows of the table of one scene."""
    raw = raw | {"transient": {"duration": seconds}}
    raw["outputs"] = {"output_interval": ROW, "plots": False}
    for order, step in (("full", {"finest_step": "0.25 ms"}), ("reduced", {"accuracy": "1 %"})):
        own(raw, out / "compiled", step | {"duration": 1.0}, order)
    right = own(raw, out / "full", {"finest_step": "0.25 ms"}, "full")
    runs = {
        "romdam, reduced": own(raw, out / "reduced", {"accuracy": "1 %"}, "reduced"),
        "romdam, full order": right,
    }
    path = out / "reduced" / "job.yaml"
    exact = modes(
        romdam.load_config(path), out / "modes", ModesOptions(joints="open", count=10)
    ).dataset.frequency.values
    off: dict[str, float] = {}
    for label, code, searches in (
        ("OpenSees", "opensees", False),
        ("CalculiX", "calculix", False),
        ("CalculiX, searching contact", "calculix", True),
    ):
        try:
            folder = out / (f"{code}_contact" if searches else code)
            runs[label], frequencies = deck(code, path, folder, python, searches=searches)
            off[label] = float(np.abs(frequencies[: len(exact)] / exact[: len(frequencies)] - 1.0).max())
        except (Lacking, RomdamError, OSError, ValueError, IndexError) as error:
            print(f"{name}, {label}: {error}", file=sys.stderr)
    try:
        runs["Exudyn, romdam's blocks"] = exudyn(path, out / "exudyn", python, seconds)
    except (Lacking, RomdamError, OSError, ValueError, IndexError) as error:
        print(f"{name}, Exudyn: {error}", file=sys.stderr)
    rows = []
    for label, run in runs.items():
        l2, peak = compared(run, right) if run is not right else (0.0, 0.0)
        rows.append({
            "scene": name, "code": label, "frequencies_off": off.get(label), "reached_s": float(run.time[-1]),
            "steps": run.steps, "l2": l2, "peak": peak, "cpu_s": run.cpu,
            "ms_per_step": 1e3 * run.cpu / max(run.steps, 1),
            "record_cpu_s": run.cpu * RECORD / float(run.time[-1]), "said": run.said,
        })  # fmt: skip
    draw(name, runs, out.parent)
    return rows


def draw(name: str, runs: dict[str, Run], folder: Path) -> None:
    """Opening of the gap that opens widest, all codes on top of one another."""
    from matplotlib.figure import Figure

    gap = int(np.abs(runs["romdam, full order"].opening).max(axis=0).argmax())
    figure = Figure(figsize=(9, 4), layout="constrained")
    axes = figure.subplots()
    for k, (label, run) in enumerate(runs.items()):
        axes.plot(run.time, 1e3 * run.opening[:, gap], label=label, lw=2.5 - 0.4 * k, ls=("-", "--")[k % 2])
    axes.set(xlabel="time [s]", ylabel="opening [mm]", title=name)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    figure.savefig(folder / f"peers_{name}.png", dpi=110)


def table(rows: list[dict[str, Any]]) -> str:
    """The rows as Markdown."""
    lines = [
        "| scene | code | frequencies off | reached | steps | L2 | peak | CPU | a step | 30 s | |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        off = "" if row["frequencies_off"] is None else f"{row['frequencies_off']:.0e}"
        lines.append(
            f"| {row['scene']} | {row['code']} | {off} | {row['reached_s']:.2f} s | {row['steps']:,} "
            f"| {100 * row['l2']:.2g} % | {100 * row['peak']:.2g} % | {row['cpu_s']:.3g} s "
            f"| {row['ms_per_step']:.3g} ms | {row['record_cpu_s']:.3g} s | {row['said']} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run all codes on both scenes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("results/peers"))
    parser.add_argument("--peers", type=Path, default=ROOT / ".venv-peers" / "bin" / "python")
    parser.add_argument("--seconds", type=float, default=3.0)
    parser.add_argument("--only", choices=list(SCENES), help="one scene")
    args = parser.parse_args()
    logging.basicConfig(level=logging.ERROR)
    out, python = args.out.resolve(), args.peers.absolute()
    rows = [
        row
        for name in ([args.only] if args.only else SCENES)
        for row in scene(name, SCENES[name](), out / name, python, args.seconds)
    ]
    (out / "peers.json").write_text(json.dumps(rows, indent=1))
    (out / "peers.md").write_text(table(rows))
    print(table(rows))


if __name__ == "__main__":
    main()
