"""Fields of a result for ParaView: one .vtu a frame and a .pvd that lists them.

The meshes of all blocks stand in one file: point data `displacement` and, where the result has them, the six
components `stress` (NaN elsewhere) and the envelope `max_principal_stress`; cell data `block`, its number;
field data under the name of every block, that number: ParaView, PyVista and meshio tell by it which is which.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.files import replacing
from romdam.results.fields import Result
from romdam.results.series import Frames, frame_times
from romdam.results.vtu import mesh_of, write_vtu

Progress = Callable[[int, int], None]


def write_series(result: Result, folder: Path, stem: str, frames: Frames, progress: Progress) -> Path:
    """Write `folder`/`stem`-0000.vtu and so on, and at last `stem`.pvd, which ParaView opens.

    Raises
    ------
    ResultError
        for a full-order result, a window without written times, and where the disk refuses a file.
    """
    times, names = frame_times(result, frames), []
    dataset = result.dataset
    stressed = list(dict.fromkeys(dataset.stress_block.values.tolist())) if "stress_block" in dataset else []
    mesh = mesh_of((result.points(name), *result.cells(name)) for name in result.blocks)
    if "max_principal_stress" in dataset:
        envelope, block_of_node = dataset.max_principal_stress.values, dataset.stress_block.values
        of_blocks = {name: envelope[block_of_node == name] for name in stressed}
        mesh.point_data["max_principal_stress"] = _at_all_nodes(result, of_blocks)
    for k, time in enumerate(times.tolist()):
        moved = [result.displacement(name, times=time).values[0] for name in result.blocks]
        mesh.point_data["displacement"] = np.concatenate(moved)
        if "stress_file" in dataset.attrs:
            of_blocks = {name: result.stress(name, times=time).values[0] for name in stressed}
            mesh.point_data["stress"] = _at_all_nodes(result, of_blocks)
        names.append(f"{stem}-{k:04d}.vtu")
        write_vtu(mesh, result.blocks, folder / names[-1])
        progress(k + 1, len(times))
    rows = "\n".join(
        f'    <DataSet timestep="{time:.9g}" part="0" file="{name}"/>'
        for name, time in zip(names, times, strict=True)
    )
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">'
    path = folder / f"{stem}.pvd"
    with replacing(path) as unfinished:
        unfinished.write_text(
            f"{head}\n  <Collection>\n{rows}\n  </Collection>\n</VTKFile>\n", encoding="utf-8"
        )
    return path


def _at_all_nodes(result: Result, values: dict[str, Floats]) -> Floats:
    """Values of the stress nodes of every block as values of all nodes, NaN elsewhere."""
    numbers, block_of_node = result.dataset.stress_node_number.values, result.dataset.stress_block.values
    width = next(iter(values.values())).shape[1:]
    of_blocks = []
    for name in result.blocks:
        whole = np.full((len(result.points(name)), *width), np.nan)
        if name in values:
            whole[numbers[block_of_node == name]] = values[name]
        of_blocks.append(whole)
    if not of_blocks:
        raise ResultError(f"{result.path}: has no blocks")
    return np.concatenate(of_blocks)
