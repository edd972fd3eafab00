"""Displacement anywhere in a block, rebuilt from the basis file and the reduced coordinates.

The basis file (HDF5, `model-<first 12 of its content's SHA-256>.h5`, one per model, beside the results):

    /                       attributes: format, content_sha256, source
    /blocks/<name>          one group for each block, as `romdam.reduction.store` describes it
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
import xarray as xr
from numpy.typing import NDArray

import romdam
from romdam.errors import ResultError
from romdam.files import replacing
from romdam.outputs.dataset import open_dataset
from romdam.outputs.stress import COMPONENTS
from romdam.outputs.stress_file import read_stress
from romdam.reduction.store import BlockBasis, write_block
from romdam.scene.model import Scene

FORMAT = "romdam-model-1"
_ROWS = 4096  # of an array at a time
Floats = NDArray[np.float64]


def write_model(folder: Path, scene: Scene, basis: Mapping[str, BlockBasis]) -> str:
    """Write the basis file of a model unless it is there; its name, made from its content.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """
    digest = _digest(scene, basis)
    path = folder / f"model-{digest[:12]}.h5"
    if not _is_written(path, digest):
        with replacing(path) as part, h5py.File(part, "w") as file:
            file.attrs.update(format=FORMAT, content_sha256=digest, source=f"romdam {romdam.__version__}")
            for name, block in scene.blocks.items():
                write_block(file.create_group(f"blocks/{name}"), block, basis[name])
    return path.name


def _digest(scene: Scene, basis: Mapping[str, BlockBasis]) -> str:
    content = hashlib.sha256(FORMAT.encode())
    for name, block in scene.blocks.items():
        part = basis[name]
        content.update(f"{name} {block.element} {part.columns.start} {part.matrix.shape}".encode())
        for array in (block.points, block.cells, part.matrix):
            for first in range(0, array.shape[0], _ROWS):
                content.update(np.ascontiguousarray(array[first : first + _ROWS]).data)
    return content.hexdigest()


def _is_written(path: Path, digest: str) -> bool:
    """Whether the file is there and whole: a foreign or broken one is written again."""
    if not path.is_file():
        return False
    try:
        with h5py.File(path, "r") as file:
            return bool(file.attrs.get("content_sha256") == digest)
    except OSError:
        return False


class Result:
    """A result file and its basis file, both read only where asked.

    Attributes
    ----------
    path : the NetCDF file
    dataset : xarray.Dataset, lazy
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.dataset: xr.Dataset = open_dataset(self.path)
        self._model: h5py.File | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        attrs = self.dataset.attrs
        return f"Result({str(self.path)!r}): {attrs['title']}, record {attrs['record']}"

    def close(self) -> None:
        """Close both files."""
        self.dataset.close()
        if self._model is not None:
            self._model.close()
            self._model = None

    @property
    def blocks(self) -> list[str]:
        """Names of the blocks."""
        return list(self._file()["blocks"])

    def points(self, block: str) -> Floats:
        """Node positions of a block, (n, 3) [m]."""
        return np.asarray(self._block(block)["points"])

    def cells(self, block: str) -> tuple[str, NDArray[np.int64]]:
        """Element name of a block and its cells, node numbers in the VTK order."""
        cells = self._block(block)["cells"]
        return str(cells.attrs["element"]), np.asarray(cells)

    def displacement(
        self,
        block: str,
        nodes: int | Sequence[int] | NDArray[np.integer[Any]] | None = None,
        times: float | Sequence[float] | slice | None = None,
    ) -> xr.DataArray:
        """Displacement relative to the base of nodes of a block.

        Only the asked rows of the basis and of the reduced coordinates are read.

        Parameters
        ----------
        block : its name
        nodes : node numbers in the block; None is all
        times : seconds, the nearest written time is taken; or a slice of seconds; None is all

        Returns
        -------
        DataArray with dims time, point, component [m]; `point` holds the node numbers

        Raises
        ------
        ResultError
            for an unknown block, a node number out of range, or a full-order result.
        """
        matrix = self._block(block)["basis"]
        chosen = self._nodes(matrix.shape[0], block, nodes)
        first, count = int(matrix.attrs["first"]), matrix.shape[2]
        q = _at_times(self.dataset.reduced_coordinates, times)[:, first : first + count]
        rows, back = np.unique(chosen, return_inverse=True)
        field = np.einsum("ncm,tm->tnc", matrix[rows][back], q.values, optimize=True)
        return xr.DataArray(
            field,
            dims=("time", "point", "component"),
            coords={"time": q.time.values, "point": chosen, "component": ["x", "y", "z"]},
            name="displacement",
            attrs={"units": "m", "long_name": f"displacement of block {block} relative to the base"},
        )

    def stress(
        self,
        block: str,
        nodes: int | Sequence[int] | NDArray[np.integer[Any]] | None = None,
        times: float | Sequence[float] | slice | None = None,
    ) -> xr.DataArray:
        """Stress of nodes of a block, those that `outputs.stress` names.

        Parameters
        ----------
        block : its name
        nodes : node numbers in the block; None is all that have stress
        times : as in `displacement`

        Returns
        -------
        DataArray with dims time, point, stress_component [Pa]; `point` holds the node numbers

        Raises
        ------
        ResultError
            for an unknown block, a node without stress, or a full-order result.
        """
        kept = read_stress(self.path, str(self.dataset.attrs.get("stress_file", "")), block, nodes)
        q = _at_times(self.dataset.reduced_coordinates, times)[:, kept.columns]
        return xr.DataArray(
            np.einsum("ncm,tm->tnc", kept.fields, q.values, optimize=True) + kept.offset,
            dims=("time", "point", "stress_component"),
            coords={"time": q.time.values, "point": kept.nodes, "stress_component": list(COMPONENTS)},
            name="stress",
            attrs={"units": "Pa", "long_name": f"stress of block {block}, tension positive"},
        )

    def _nodes(self, count: int, block: str, nodes: Any) -> NDArray[np.int64]:
        chosen = np.arange(count) if nodes is None else np.atleast_1d(np.asarray(nodes, dtype=np.int64))
        if chosen.size and not (chosen.min() >= 0 and chosen.max() < count):
            raise ResultError(
                f"{self.path}: nodes of block {block!r} must be from 0 to {count - 1}, "
                f"got {chosen.min()} to {chosen.max()}"
            )
        return chosen

    def _block(self, name: str) -> h5py.Group:
        blocks = self._file()["blocks"]
        if name not in blocks:
            raise ResultError(f"{self.path}: no block {name!r}; there are {', '.join(blocks)}")
        return blocks[name]

    def _file(self) -> h5py.File:
        if self._model is None:
            self._model = _open_model(self.path, str(self.dataset.attrs.get("model_file", "")))
        return self._model


def open_result(path: str | Path) -> Result:
    """Open a result that `romdam run` wrote; also a context manager.

    Raises
    ------
    ResultError
        where there is no such file, or it is not a romdam result.
    """
    return Result(path)


def _at_times(q: xr.DataArray, times: float | Sequence[float] | slice | None) -> xr.DataArray:
    if times is None:
        return q
    if isinstance(times, slice):
        return q.sel(time=times)
    return q.sel(time=np.atleast_1d(np.asarray(times, dtype=float)), method="nearest")


def _open_model(result: Path, name: str) -> h5py.File:
    if not name:
        raise ResultError(
            f"{result}: a full-order result keeps displacements at its output nodes only; "
            "name more under outputs.nodes, or run with model.order: reduced"
        )
    path = result.with_name(Path(name).name)  # a result never points outside its own folder
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise ResultError(f"{path}: the basis file of {result.name} cannot be read ({error})") from error
    if file.attrs.get("format") != FORMAT:
        file.close()
        raise ResultError(f"{path}: is not a basis file of this version ({FORMAT})")
    return file
