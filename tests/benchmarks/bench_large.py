"""Time and memory of reducing one large block, against unknowns and gaps, direct and factorisation-free.

    python tests/benchmarks/bench_large.py OUT                  against unknowns (an hour up to a million)
    python tests/benchmarks/bench_large.py OUT --only gaps      against gaps; with both measured, a picture,
                                                                with the dam of bench_large_dam.py OUT in it
    python tests/benchmarks/bench_large.py OUT --block 16 16 60 300 pardiso

A tet10 block of 20 x 20 x 80 m, its foot held, normal gaps over one face, modes below 60 Hz. Every case is a
process of its own; CPU seconds and peak resident memory are the operating system's. Writes
OUT/bench_large_*.json, goes on where those end, and OUT/growth.png.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from romdam.core.scene import Block

SIZE = (20.0, 20.0, 80.0)
CUTOFF = 60.0
# divisions along x, y, z of the growth against unknowns, with 100 gaps
MESHES = [(4, 4, 18), (6, 6, 26), (9, 9, 36), (12, 12, 46), (16, 16, 60), (22, 22, 82)]
NAMES = {
    "superlu": "SuperLU",
    "pardiso": "PARDISO",
    "pardiso_single": "PARDISO, single precision",
    "multigrid": "multigrid, no factors",
}
QUANTITIES = {"cpu_s": "CPU [s]", "peak_gb": "peak memory [GB]"}
MOST = {"superlu": 110_000, "pardiso": 450_000, "pardiso_single": 450_000, "multigrid": 1_200_000}
GAPS = [100, 300, 1000, 2000]
GAPS_MESH = (16, 2, 32)  # a face with room for 2,000 gaps
SOLVERS_OF_GAPS = ("pardiso", "pardiso_single", "multigrid")


def block_of(divisions: tuple[int, ...]) -> Block:
    from romdam.config.sections.job import BoxConfig
    from romdam.core.scene import Material
    from romdam.geometry.boxes import box_block

    x, y, z = (s / n for s, n in zip(SIZE, divisions, strict=True))
    box = BoxConfig(origin=(0.0, 0.0, 0.0), size=SIZE, element_size=(x, y, z), element="tet10")
    return box_block("b", box, Material(30e9, 0.2, 2400.0), "bench")


def reduce_one(divisions: tuple[int, ...], gaps: int, solver: str, folder: Path) -> dict[str, object]:
    """Reduce one block in this process and tell what it took."""
    import logging

    from scipy.sparse import csr_matrix

    from romdam.core.scene import Scene
    from romdam.fem.assembly import Assembly
    from romdam.linalg.solvers import Solving
    from romdam.reduction.methods.out_of_core import CraigBamptonOutOfCore
    from romdam.reduction.mode_choice import ModeChoice
    from romdam.reduction.reductor import basis_keys, reduce_substructure
    from romdam.reduction.storage.model_file import BlockStore, read_block_file
    from romdam.reduction.substructure import BlockLoads, Substructure
    from romdam.scene.ties import scene_parts

    logging.basicConfig(level=logging.INFO, format="%(relativeCreated)8d ms  %(message)s")
    block = block_of(divisions)
    fixed = np.repeat((block.points[:, 2] == 0.0)[:, None], 3, axis=1)
    face = np.flatnonzero((block.points[:, 1] == 0.0) & (block.points[:, 2] > 0.0))
    chosen = face[np.round(np.linspace(0, len(face) - 1, gaps)).astype(int)]
    columns = 3 * chosen + 1  # normal gaps along y
    entries = np.ones(gaps), (np.arange(gaps), columns)
    operator, none = csr_matrix(entries, shape=(gaps, fixed.size)), np.zeros((fixed.size, 0))
    scene = Scene({"b": block}, {}, {"b": fixed})
    loads = BlockLoads({"b": operator}, {"b": np.zeros(fixed.size)}, {"b": none}, 1, {"b": none})
    substructure = Substructure(scene_parts(scene)["b"], scene, loads, Assembly(scene.blocks))
    choice = ModeChoice(cutoff=CUTOFF, solving=Solving(solver, 20e9))
    store, reductor = BlockStore(folder / solver), CraigBamptonOutOfCore()
    key = basis_keys(reductor, substructure, choice)["b"]
    start, cpu = time.perf_counter(), time.process_time()
    made = reduce_substructure(reductor, substructure, [choice], store)[0]["b"]
    found: dict[str, object] = {
        "unknowns": int((~fixed).sum()), "gaps": gaps, "solver": solver,
        "wall_s": time.perf_counter() - start, "cpu_s": time.process_time() - cpu,
        "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        "modes": made.report["fixed_interface_modes"], "residual": made.report["eigenvalue_residual"],
        "file": str(store.path(key)), "file_gb": store.path(key).stat().st_size / 1e9,
    }  # fmt: skip
    start = time.perf_counter()
    again = read_block_file(store.path(key))
    again.vectors.rows()[columns].sum()
    return found | {"open_s": time.perf_counter() - start}


def distance(divisions: tuple[int, ...], one: Path, other: Path) -> dict[str, float]:
    """How far the space that one basis spans is from another's (M-norm), and their open-joint omega^2."""
    from romdam.fem.assembly import assemble
    from romdam.reduction.storage.model_file import read_block_file

    M = assemble(block_of(divisions))[1]
    bases = [read_block_file(path) for path in (one, other)]
    X, Y = (basis.vectors.rows() for basis in bases)
    off = 0.0
    for first in range(0, X.shape[1], 64):
        x = np.ascontiguousarray(X[:, first : first + 64])
        rest = x - Y @ (Y.T @ (M @ x))
        off = max(off, float(np.sqrt((rest * (M @ rest)).sum(axis=0).max())))
    return {"basis": off, "omega2": float(np.abs(bases[0].omega2 / bases[1].omega2 - 1.0).max())}


def in_a_process(case: tuple[int | str, ...], folder: Path) -> dict[str, object]:
    command = [sys.executable, __file__, str(folder), "--block", *map(str, case)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{case}: {done.stderr[-2000:]}")
    found = json.loads(done.stdout.splitlines()[-1])
    print(f"{found['solver']:>14} {found['unknowns']:>9} unknowns {found['gaps']:>5} gaps "
          f"{found['modes']:>3} modes  {found['cpu_s']:7.1f} s CPU  {found['peak_gb']:5.2f} GB",
          flush=True)  # fmt: skip
    return dict(found)


def exponent(rows: list[dict[str, object]], along: str, of: str) -> float:
    """Slope of log(of) against log(along)."""
    x, y = (np.log([float(str(row[key])) for row in rows]) for key in (along, of))
    return float(np.polyfit(x, y, 1)[0])


def draw(grown: dict[str, list[dict[str, object]]], dam: dict[str, object] | None, path: Path) -> None:
    """Time and memory against unknowns and gaps, solvers side by side; the arch dam where it was run."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7.5), layout="constrained")
    axes = figure.subplots(2, 2)
    for row, (along, every) in zip(axes, grown.items(), strict=True):
        for ax, (of, label) in zip(row, QUANTITIES.items(), strict=True):
            for k, (solver, name) in enumerate(NAMES.items()):
                rows = [r for r in every if r["solver"] == solver]
                if len(rows) > 2:
                    name += f"  $\\sim n^{{{exponent(rows[-3:], along, of):.2f}}}$"
                if rows:
                    ax.loglog([r[along] for r in rows], [r[of] for r in rows], f"C{k}o-", ms=4, label=name)
            if dam and along == "unknowns":
                k = list(NAMES).index("pardiso_single")
                ax.loglog(dam[along], dam[of], f"C{k}*", ms=14, mec="k", label="arch dam on rock, 189 gaps")
            plain_ticks(ax)
            ax.set(xlabel=f"{along} $n$", ylabel=label)
            ax.legend(fontsize=8, loc="upper left")
    axes[0, 0].set_title("one tet10 block, 100 gaps, modes below 60 Hz", loc="left", fontsize=10)
    axes[0, 1].set_title("exponents are of the last three points", loc="left", fontsize=10)
    axes[1, 0].set_title(f"the block with {grown['gaps'][0]['unknowns']:,} unknowns", loc="left", fontsize=10)
    figure.savefig(path, dpi=110)


def plain_ticks(ax: Axes) -> None:
    """Numbers as they are written; room for the legend above the lines."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = ax.get_ylim()
    ax.set_ylim(low, high * (high / low) ** 0.4)
    for axis in (ax.xaxis, ax.yaxis):
        low, high = axis.get_view_interval()
        axis.set_minor_formatter(NullFormatter())
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 30.0 * low else (1.0, 3.0)))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
    ax.grid(True, which="major", alpha=0.3)


def cases(only: str, most: int) -> list[list[tuple[int | str, ...]]]:
    """Divisions, gaps and solver of every case, mesh by mesh or number of gaps by number of gaps."""
    if only == "gaps":
        return [[(*GAPS_MESH, gaps, s) for s in SOLVERS_OF_GAPS] for gaps in GAPS]
    found: list[list[tuple[int | str, ...]]] = []
    for x, y, z in MESHES:
        unknowns = 3 * (2 * x + 1) * (2 * y + 1) * 2 * z
        found.append([(x, y, z, 100, s) for s in MOST if unknowns <= min(MOST[s], most)])
    return found


def compared(divisions: tuple[int, ...], rows: list[dict[str, object]]) -> None:
    """Put the distance from the direct solution into the rows of the other solvers."""
    direct = next((row for row in reversed(rows) if row["solver"] in ("pardiso", "superlu")), None)
    if direct is None:
        return
    for row in rows[rows.index(direct) + 1 :]:
        row |= distance(divisions, Path(str(row["file"])), Path(str(direct["file"])))
        print(f"{row['solver']:>14} from {direct['solver']}: basis {row['basis']:.1e}, "
              f"omega2 {row['omega2']:.1e}", flush=True)  # fmt: skip


def measured(out: Path, only: str, most: int) -> None:
    """Run the cases that are not in the file yet, remove their bases."""
    path = out / f"bench_large_{only}.json"
    found = json.loads(path.read_text()) if path.is_file() else []
    done = {tuple(row["case"]) for row in found}
    for some in cases(only, most):
        if done.issuperset(some):
            continue
        rows = [in_a_process(case, out) | {"case": case} for case in some]
        if only == "unknowns":
            compared(tuple(map(int, some[0][:3])), rows)
        remove(rows)
        found += rows
        path.write_text(json.dumps(found, indent=1))


def growth(out: Path, only: str, most: int) -> None:
    """Measure, and draw the picture of all that was measured."""
    measured(out, only, most)
    grown = {
        along: json.loads(file.read_text())
        for along in ("unknowns", "gaps")
        if (file := out / f"bench_large_{along}.json").is_file()
    }
    if len(grown) == 2:
        draw(grown, of_the_dam(out), out / "growth.png")
    for along, every in grown.items():
        for solver in MOST:
            rows = [r for r in every if r["solver"] == solver]
            if len(rows) > 2:
                print(f"{solver}: CPU grows with {along}^{exponent(rows[-3:], along, 'cpu_s'):.2f}, "
                      f"memory with {along}^{exponent(rows[-3:], along, 'peak_gb'):.2f}")  # fmt: skip


def of_the_dam(out: Path) -> dict[str, object] | None:
    """The largest arch dam that `bench_large_dam.py OUT` has reduced, if any."""
    file = out / "bench_large_dam.json"
    rows = [row["made"] for row in json.loads(file.read_text())] if file.is_file() else []
    return max(rows, key=lambda row: row["unknowns"], default=None)


def remove(rows: list[dict[str, object]]) -> None:
    for row in rows:
        Path(str(row["file"])).unlink()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--block", nargs=5, metavar=("X", "Y", "Z", "GAPS", "SOLVER"))
    parser.add_argument("--most", type=int, default=1_200_000, help="unknowns of the largest case")
    parser.add_argument("--only", choices=["unknowns", "gaps"], default="unknowns", help="what grows")
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    if given.block is None:
        growth(given.out, given.only, given.most)
        return
    *divisions, gaps, solver = given.block
    print(json.dumps(reduce_one(tuple(map(int, divisions)), int(gaps), solver, given.out)))


if __name__ == "__main__":
    main()
