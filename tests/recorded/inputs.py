"""Records and tables of the recorded jobs, by formulas: short, of three unlike components."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

DT = 0.01  # s


def shaking(samples: int = 61, shift: float = 0.0) -> np.ndarray:
    """(samples, 3) accelerations that begin and end in rest [m/s2]."""
    time = np.arange(samples) * DT
    window = np.sin(np.pi * time / time[-1]) ** 2
    parts = ((4.1, 3.3, 0.2), (6.7, 4.7, 1.1), (2.3, 7.9, 2.3))
    return np.stack(
        [a * window * np.sin(2.0 * np.pi * (f + shift) * time + phase) for a, f, phase in parts], axis=1
    )


def from_rest_to_rest(samples: int = 61, shift: float = 0.0) -> np.ndarray:
    """(samples, 3) accelerations of displacements that come back [m/s2]."""
    time = np.arange(samples) * DT
    window = np.sin(np.pi * time / time[-1]) ** 6
    parts = ((0.011, 3.3, 0.2), (0.017, 2.7, 1.1), (0.007, 4.9, 2.3))
    disp = [a * window * np.sin(2.0 * np.pi * (f + shift) * time + phase) for a, f, phase in parts]
    return np.stack([np.gradient(np.gradient(d, DT), DT) for d in disp], axis=1)


def write(folder: Path) -> None:
    """Write what jobs name, where a job has not brought its own."""
    tables = {
        "shake.txt": shaking(),
        "second.txt": 1.3 * shaking(73, 0.7),
        "third.txt": 0.8 * shaking(67, -0.9),
        "calm.txt": from_rest_to_rest(),
        "calmer.txt": 0.7 * from_rest_to_rest(65, 0.4),
    }
    for name, values in tables.items():
        np.savetxt(folder / name, values, fmt="%.9g")


def write_formats(folder: Path) -> None:
    """A file of every format of records, and a long record that needs a correction."""
    import samples
    import vintages

    formats = folder / "formats"
    formats.mkdir()
    samples.write_all(formats)
    motion = samples.motion(5)
    (formats / "geonet.V1A").write_text(vintages.geonet(motion))
    (formats / "raw.v1").write_text(vintages.csmip_v1(motion))
    rows = [f"{0.005 * i:.3f};{100 * a:.4f};{-70 * a:.4f}".replace(".", ",") for i, a in enumerate(motion)]
    (formats / "german.csv").write_text("\n".join(["a station", "t;x;y", *rows]) + "\n")
    time = np.arange(601) * DT
    noise = np.random.default_rng(7).normal(size=(len(time), 3)) * [170.0, 130.0, 60.0]
    window = np.where(time > 2.0, (time - 2.0) * np.exp(-1.7 * (time - 2.0)), 2e-4)
    ramp = (0.003 + 0.002 * time)[:, None]
    np.savetxt(folder / "long.txt", noise * window[:, None] + ramp, fmt="%.9g")


def write_meshes(folder: Path) -> None:
    """Mesh files of every format, matrices of CalculiX, a surface that cuts, and a reservoir."""
    from reservoir_meshes import box, written

    data = Path(__file__).parents[1] / "geometry" / "data"
    own = Path(__file__).parents[2] / "data" / "meshes" / "two_monoliths.msh"
    for path in [*data.glob("*.*"), *(data / "calculix").iterdir(), own]:
        shutil.copy(path, folder)
    (folder / "README.md").unlink()
    corners = [(5.9, -1, -1), (6.4, 5, -1), (6.7, 5, 7), (6.1, -1, 7)]
    facets = [[corners[k] for k in ks] for ks in ((0, 1, 2), (0, 2, 3))]
    lines = ["solid s"]
    for facet in facets:
        lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x} {y} {z}" for x, y, z in facet)]
        lines += ["endloop", "endfacet"]
    (folder / "cut.stl").write_text("\n".join([*lines, "endsolid s"]) + "\n")
    written(folder / "reservoir.msh", box([0, -7, 0], [9, 7, 5], [3.0, 3.5, 2.5], "hex8"))
