"""Matrices of Nastran's whose nodes move along coordinate systems of their own, turned by hand."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import mmwrite

from romdam.core.arrays import Floats, Ints
from romdam.core.scene import Block

SYSTEMS = {3: "CORD2R", 5: "CORD2C", 8: "CORD2S"}


def directions(kind: str, A: Floats, Q: Floats, point: Floats) -> Floats:
    """Axes at a point, one a row: how it moves as each of its coordinates grows.

    Q has the x, y and z axis of the system in its rows.
    """
    x, y, z = Q @ (point - A)
    if kind == "CORD2R" or np.hypot(x, y) < 1e-9:
        return Q
    phi, r = np.arctan2(y, x), np.hypot(x, y)
    if kind == "CORD2C":
        at = np.array([r, phi, z])

        def place(c: Floats) -> Floats:
            return A + np.array([c[0] * np.cos(c[1]), c[0] * np.sin(c[1]), c[2]]) @ Q
    else:
        at = np.array([np.hypot(r, z), np.arctan2(r, z), phi])

        def place(c: Floats) -> Floats:
            out = c[0] * np.sin(c[1])
            return A + np.array([out * np.cos(c[2]), out * np.sin(c[2]), c[0] * np.cos(c[1])]) @ Q

    moves = np.array([place(at + step) - place(at - step) for step in 1e-3 * np.eye(3)])
    return moves / np.linalg.norm(moves, axis=1)[:, None]


def wide(name: str, *fields: float | int | None) -> str:
    """An entry in large fields; numbers with twelve decimals, blanks as None."""
    words = ["" if f is None else f"{f:16.12f}" if isinstance(f, float) else str(f) for f in fields]
    lines = [words[k : k + 4] for k in range(0, len(words), 4)]
    return "\n".join(
        (f"{name}*" if k == 0 else "*").ljust(8) + "".join(w.rjust(16) for w in line)
        for k, line in enumerate(lines)
    )


def frames_of(points: Floats, seed: int = 3) -> tuple[list[str], Ints, Floats]:
    """Bulk data of a system of each kind, and of every node: its system, its axes (0: x, y, z)."""
    rng, lines, made = np.random.default_rng(seed), [], {}
    for number, kind in SYSTEMS.items():
        Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        Q[2] *= np.sign(np.linalg.det(Q))  # right-handed
        A = rng.uniform(-3.0, 3.0, 3)
        if number == 8:
            A = points[4] - 2.5 * Q[2]  # its fifth node is on the z axis: the rectangular axes count
        made[number] = kind, A, Q
        corners = A, A + 2.0 * Q[2], A + 3.0 * Q[0] + 1.7 * Q[2]
        lines.append(wide(kind, number, 0, *np.concatenate(corners).tolist()))
    system = np.arange(len(points)) % 4
    system[4] = 3
    system = np.array([0, *SYSTEMS])[system]
    axes = [
        np.eye(3) if s == 0 else directions(*made[s], p) for s, p in zip(system.tolist(), points, strict=True)
    ]
    return lines, system, np.array(axes)


def in_frames(axes: Floats, *arrays: Floats) -> list[Floats]:
    """Matrices and vectors with every node's three rows along its axes: u_local = T u, T^T T = 1."""
    n = 3 * len(axes)
    T = np.zeros((n, n))
    for k, own in enumerate(axes):
        T[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = own
    assert np.abs(T @ T.T - np.eye(n)).max() < 1e-12
    return [T @ array @ T.T if array.shape == (n, n) else T @ array for array in arrays]


def write_frames(
    folder: Path, block: Block, K: Floats, M: Floats, C: Floats, force: Floats, place: str = "pch"
) -> dict[str, str]:
    """A block with a frame at three nodes of four, as Nastran writes it: files, and their keys.

    Parameters
    ----------
    place : of GRID and CORD2*: `pch`, with EXTRN; or `bdf`, a mesh file, beside unknowns as .csv
    """
    op4 = pytest.importorskip("pyyeti.nastran.op4")
    lines, system, axes = frames_of(block.points)
    K, M, C, force = in_frames(axes, K, M, C, force)
    op4.write(str(folder / "km.op4"), {"KXX": K, "MXX": M, "BXX": C})
    mmwrite(folder / "f.mtx", force[:, None], precision=17)
    number = (10 * (np.arange(len(block.points)) + 1)).tolist()
    lines.append("GRDSET,,,,,,3")  # the displacement system of a GRID whose own is blank
    for n, s, p in zip(number, system.tolist(), block.points.tolist(), strict=True):
        lines.append(wide("GRID", n, 0, *p, None if s == 3 else s))
    keys = dict.fromkeys(("stiffness", "mass", "damping"), "km.op4") | {"force": "f.mtx"}
    if place == "pch":
        pairs = [word for n in number for word in (str(n), "123")]
        lines.append("EXTRN," + "\n,".join(",".join(pairs[k : k + 8]) for k in range(0, len(pairs), 8)))
        (folder / "km.pch").write_text("\n".join([*lines, ""]))
        return keys | {"unknowns": "km.pch"}
    for k, cell in enumerate(block.cells):
        first, second = (",".join(str(number[n]) for n in part) for part in (cell[:6], cell[6:]))
        lines.append(f"CHEXA,{k + 1},1,{first}\n,{second}")
    (folder / "nodes.bdf").write_text("\n".join([*lines, "ENDDATA", ""]))
    rows = [f"{n},{direction}" for n in number for direction in "xyz"]
    (folder / "u.csv").write_text("\n".join(["node,direction", *rows, ""]))
    return keys | {"unknowns": "u.csv", "nodes": "nodes.bdf"}
