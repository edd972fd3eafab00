"""Time and memory of reducing one large block, against unknowns and gaps, direct and factorisation-free.

    python tests/benchmarks/bench_large.py OUT                  against unknowns (an hour up to a million)
    python tests/benchmarks/bench_large.py OUT --only gaps      against gaps; with both measured, a picture
    python tests/benchmarks/bench_large.py OUT --block 16 16 60 300 pardiso

A tet10 block of 20 x 20 x 80 m, its foot held, normal gaps over one face, modes below 60 Hz. Every case is a
process of its own; CPU seconds and peak resident memory are the operating system's. Writes
OUT/bench_large_*.json and OUT/bench_large.png.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

SIZE = (20.0, 20.0, 80.0)
CUTOFF = 60.0
# divisions along x, y, z of the growth against unknowns, with 100 gaps
MESHES = [(4, 4, 18), (6, 6, 26), (9, 9, 36), (12, 12, 46), (16, 16, 60), (22, 22, 82)]
MOST = {"superlu": 110_000, "pardiso": 450_000, "pardiso_single": 450_000, "multigrid": 1_200_000}
GAPS = [100, 300, 1000, 2000]
GAPS_MESH = (16, 2, 32)  # a face with room for 2,000 gaps
MOST_GAPS = {"pardiso": 2000, "pardiso_single": 2000, "multigrid": 1000}


def block_of(divisions: tuple[int, ...]):
    from romdam.config.models import BoxConfig
    from romdam.scene.boxes import box_block
    from romdam.scene.model import Material

    edges = tuple(s / n for s, n in zip(SIZE, divisions, strict=True))
    box = BoxConfig(origin=(0.0, 0.0, 0.0), size=SIZE, element_size=edges, element="tet10")
    return box_block("b", box, Material(30e9, 0.2, 2400.0), "bench")


def reduce_one(divisions: tuple[int, ...], gaps: int, solver: str, folder: Path) -> dict[str, object]:
    """Reduce one block in this process and tell what it took."""
    import logging

    from scipy.sparse import eye_array

    from romdam.linalg.solvers import Solving
    from romdam.reduction.craig_bampton import ModeChoice
    from romdam.reduction.interface import Interface
    from romdam.reduction.large import LargeBlock, reduce_large
    from romdam.reduction.store import BlockStore, block_key, read_block_file

    logging.basicConfig(level=logging.INFO, format="%(relativeCreated)8d ms  %(message)s")
    block = block_of(divisions)
    fixed = np.repeat((block.points[:, 2] == 0.0)[:, None], 3, axis=1)
    face = np.flatnonzero((block.points[:, 1] == 0.0) & (block.points[:, 2] > 0.0))
    chosen = face[np.round(np.linspace(0, len(face) - 1, gaps)).astype(int)]
    retained = np.zeros(fixed.shape, dtype=bool)
    retained[chosen, 1] = True
    interface = Interface(eye_array(fixed.size, format="csr"), retained.ravel())
    choice = ModeChoice(cutoff=CUTOFF, solving=Solving(solver, 20e9))
    store = BlockStore(folder / solver)
    key = block_key(block, fixed, interface, choice)
    start, cpu = time.perf_counter(), time.process_time()
    made = reduce_large(LargeBlock(block, fixed, interface, True), choice, store, key)
    found: dict[str, object] = {
        "unknowns": int((~fixed).sum()), "gaps": gaps, "solver": solver,
        "wall_s": time.perf_counter() - start, "cpu_s": time.process_time() - cpu,
        "peak_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        "modes": made.report["fixed_interface_modes"], "residual": made.report["eigenvalue_residual"],
        "file": str(store.path(key)), "file_gb": store.path(key).stat().st_size / 1e9,
    }  # fmt: skip
    start = time.perf_counter()
    again = read_block_file(store.path(key))
    again.matrix[retained.ravel()].sum()
    return found | {"open_s": time.perf_counter() - start}


def distance(divisions: tuple[int, ...], one: Path, other: Path) -> dict[str, float]:
    """How far the space that one basis spans is from another's (M-norm), and their open-joint omega^2."""
    from romdam.fem.assembly import assemble
    from romdam.reduction.store import read_block_file

    M = assemble(block_of(divisions))[1]
    X, Y = read_block_file(one), read_block_file(other)
    off = 0.0
    for first in range(0, X.matrix.shape[1], 64):
        x = np.ascontiguousarray(X.matrix[:, first : first + 64])
        rest = x - Y.matrix @ (Y.matrix.T @ (M @ x))
        off = max(off, float(np.sqrt((rest * (M @ rest)).sum(axis=0).max())))
    return {"basis": off, "omega2": float(np.abs(X.omega2 / Y.omega2 - 1.0).max())}


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


def draw(grown: dict[str, list[dict[str, object]]], path: Path) -> None:
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    figure = Figure(figsize=(10, 7), layout="constrained")
    axes = figure.subplots(2, 2)
    for row, (along, of_all) in enumerate((("unknowns", grown["unknowns"]), ("gaps", grown["gaps"]))):
        for column, (of, label) in enumerate((("cpu_s", "CPU [s]"), ("peak_gb", "peak memory [GB]"))):
            ax = axes[row, column]
            for k, solver in enumerate(MOST):
                rows = [r for r in of_all if r["solver"] == solver]
                if len(rows) > 1:
                    name = f"{solver}, exponent {exponent(rows[-3:], along, of):.2f}"
                    ax.loglog([r[along] for r in rows], [r[of] for r in rows], f"C{k}o-", label=name)
            ax.set(xlabel=along, ylabel=label)
            for axis in (ax.xaxis, ax.yaxis):
                axis.set_minor_formatter(NullFormatter())
                axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
                axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,.10g}"))
            ax.grid(True, which="both", alpha=0.3)
            ax.legend()
    axes[0, 0].set_title("one tet10 block, 100 gaps, modes below 60 Hz", loc="left", fontsize=10)
    axes[1, 0].set_title(f"{grown['gaps'][0]['unknowns']:,} unknowns", loc="left", fontsize=10)
    figure.savefig(path, dpi=130)


def against_unknowns(out: Path, most: int) -> list[dict[str, object]]:
    found = []
    for divisions in MESHES:
        unknowns = 3 * (2 * divisions[0] + 1) * (2 * divisions[1] + 1) * 2 * divisions[2]
        rows = [
            in_a_process((*divisions, 100, solver), out)
            for solver in MOST
            if unknowns <= min(MOST[solver], most)
        ]
        if len(rows) > 1:
            direct = next(row for row in reversed(rows) if row["solver"] in ("pardiso", "superlu"))
            for row in rows[rows.index(direct) + 1 :]:
                row |= distance(divisions, Path(str(row["file"])), Path(str(direct["file"])))
                print(f"{row['solver']:>14} from {direct['solver']}: basis {row['basis']:.1e}, "
                      f"omega2 {row['omega2']:.1e}", flush=True)  # fmt: skip
        found += rows
        remove(rows)
    return found


def against_gaps(out: Path) -> list[dict[str, object]]:
    found = []
    for gaps in GAPS:
        rows = [
            in_a_process((*GAPS_MESH, gaps, solver), out) for solver in MOST_GAPS if gaps <= MOST_GAPS[solver]
        ]
        found += rows
        remove(rows)
    return found


def growth(out: Path, only: str, most: int) -> None:
    """Run the cases, remove their bases, write what was measured and the picture of all of it."""
    path = out / f"bench_large_{only}.json"
    path.write_text(
        json.dumps(against_gaps(out) if only == "gaps" else against_unknowns(out, most), indent=1)
    )
    grown = {
        along: json.loads(file.read_text())
        for along in ("unknowns", "gaps")
        if (file := out / f"bench_large_{along}.json").is_file()
    }
    if len(grown) == 2:
        draw(grown, out / "bench_large.png")
    for along, every in grown.items():
        for solver in MOST:
            rows = [r for r in every if r["solver"] == solver]
            if len(rows) > 2:
                print(f"{solver}: CPU grows with {along}^{exponent(rows[-3:], along, 'cpu_s'):.2f}, "
                      f"memory with {along}^{exponent(rows[-3:], along, 'peak_gb'):.2f}")  # fmt: skip


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
