"""Displacement anywhere in a block, rebuilt from the basis file and the reduced coordinates.

The basis file (HDF5, `model-<first 12 of its content's SHA-256>.h5`, one per model, beside the results):

    /                       attributes: format, content_sha256, source
    /blocks/<name>          one group for each block, as `romdam.reduction.storage.model_file` describes it
    /blocks/<name>/carried  (n, 3, k) displacement per `support_displacement`, where supports move
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
import xarray as xr
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.basis import BlockBasis
from romdam.core.errors import ResultError
from romdam.core.files import Unkept
from romdam.core.html.card import card
from romdam.core.scene import Block, Scene
from romdam.postprocess.record_measures import peak_text, stated_warnings
from romdam.postprocess.stress.summary import COMPONENTS
from romdam.reduction.storage.model_file import rows_written
from romdam.results.beside import in_order, open_beside, write_beside
from romdam.results.dataset import open_run
from romdam.results.stress.file import read_stress

FORMAT = "romdam-model-1"
_STATED = ("error_statement", "certificate_statement", "error_estimate")  # of the error, best first
_PEAKS = 8  # joints whose opening a notebook shows
_ROWS = 4096  # of an array at a time


def write_model(
    folder: Path, scene: Scene, basis: Mapping[str, BlockBasis], carried: Mapping[str, Floats] | None = None
) -> str:
    """Write the basis file of a model unless it is there; its name, made from its content.

    Parameters
    ----------
    carried : block name -> (3 n, k) displacement that moving supports make; None without any

    Raises
    ------
    WriteError
        where the folder or the disk refuses it.
    """

    def written(file: h5py.File, name: str, block: Block) -> Iterator[NDArray[Any]]:
        group = file.create_group(f"blocks/{name}")
        yield from rows_written(group, block, basis[name])
        if carried is not None:
            group["carried"] = carried[name].reshape(len(block.points), 3, -1)
            yield carried[name]

    def fill(file: h5py.File) -> str:
        return _digest(
            (
                f"{name} {block.element} {basis[name].columns.start} {basis[name].vectors.shape}",
                chain(_pieces(block.points), _pieces(block.cells)),
                written(file, name, block),
            )
            for name, block in scene.blocks.items()
        )

    size = sum(own.vectors.nbytes for own in basis.values())
    return write_beside(folder, ("model", FORMAT), fill, size, _made_of(scene, basis, carried))


def _made_of(scene: Scene, basis: Mapping[str, BlockBasis], carried: Mapping[str, Floats] | None) -> str:
    """SHA-256 of all but the basis, and of what a random force does on it, whose bytes need not be made.

    On an arch dam of 66,390 unknowns (a file of 122 MB) that takes 0.1 s of CPU, all bytes 1.6.
    """
    content = hashlib.sha256(FORMAT.encode())
    for name, block in scene.blocks.items():
        own = basis[name]
        columns = f"{own.columns.start}:{own.columns.stop}"
        content.update(f"{name} {block.element} {columns} {own.vectors.shape}".encode())
        force = np.random.default_rng(0).standard_normal(own.vectors.shape[0])
        answer = own.vectors.project(force)
        for piece in (block.points, block.cells, own.omega2, own.participation, answer):
            content.update(np.ascontiguousarray(piece).data)
        if carried is not None:
            content.update(np.ascontiguousarray(carried[name]).data)
    return content.hexdigest()


def _digest(blocks: Iterable[tuple[str, Iterable[NDArray[Any]], Iterable[NDArray[Any]]]]) -> str:
    """SHA-256 of blocks: name, element, first column and shape of the basis; points and cells; basis."""
    content = hashlib.sha256(FORMAT.encode())
    for about, mesh, basis in blocks:
        content.update(about.encode())
        for piece in chain(mesh, basis):
            content.update(np.ascontiguousarray(piece).data)
    return content.hexdigest()


def _slices(count: int) -> Iterator[slice]:
    return (slice(first, first + _ROWS) for first in range(0, count, _ROWS))


def _pieces(array: Any) -> Iterator[NDArray[Any]]:
    """Rows of an array or a dataset, some at a time."""
    return (array[rows] for rows in _slices(array.shape[0]))


def stored_digest(file: h5py.File) -> str:
    """SHA-256 of the content of a basis file."""
    return _digest(
        (
            f"{name} {group['cells'].attrs['element']} {int(group['basis'].attrs['first'])} "
            f"{(3 * group['basis'].shape[0], group['basis'].shape[2])}",
            chain(_pieces(group["points"]), _pieces(group["cells"])),
            chain(_pieces(group["basis"]), _pieces(group["carried"]) if "carried" in group else ()),
        )
        for name, group in in_order(file)
    )


class Result:
    """A result file and its basis file, both read only where asked.

    Attributes
    ----------
    path : the NetCDF file; one that goes with this object where the run had no folder
    dataset : xarray.Dataset, lazy; in memory where the run had no folder
    """

    def __init__(self, path: str | Path, unkept: Unkept | None = None) -> None:
        self.path = Path(path)
        self._whole = self.path.absolute()  # what lies beside it is opened later
        self.dataset: xr.Dataset = open_run(self.path)
        self._model: h5py.File | None = None
        self._unkept = unkept
        if unkept is not None:
            self.dataset = self.dataset.load()
            self.dataset.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        attrs = self.dataset.attrs
        return f"Result({self._place!r}): {attrs['title']}, record {attrs['record']}"

    def _repr_html_(self) -> str:
        attrs = self.dataset.attrs
        seconds = float(self.dataset.time[-1]) if self.dataset.time.size else 0.0
        rows = {
            "record": f"dt {attrs['record_dt']:g} s, peak {peak_text(attrs)}",
            "run": f"{seconds:.4g} s, {attrs['model_order']} order, {attrs['integrator']}",
            "peak opening": self.peaks,
            "error": "; ".join(str(attrs[name]) for name in _STATED if name in attrs),
            "warnings": "; ".join(stated_warnings(attrs)),
            "file": self._place,
        }
        return card(str(attrs["title"]), f"Result, record {self.record}", rows)

    @property
    def record(self) -> str:
        """Name of the ground motion."""
        return str(self.dataset.attrs["record"])

    @property
    def peaks(self) -> str:
        """Peak opening of every joint, the largest first, not of all of many."""
        if "peak_opening" not in self.dataset:
            return "no joints"
        named = self.dataset.peak_opening.to_series().sort_values(ascending=False)
        some = [f"{name} {1e3 * value:.3g} mm" for name, value in named.head(_PEAKS).items()]
        return ", ".join(some) + (f" and {len(named) - _PEAKS} more" if len(named) > _PEAKS else "")

    @property
    def _place(self) -> str:
        return str(self.path) if self._unkept is None else "in memory"

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
        group = self._block(block)
        matrix = group["basis"]
        chosen = self._nodes(matrix.shape[0], block, nodes)
        first, count = int(matrix.attrs["first"]), matrix.shape[2]
        q = self._coordinates(times, slice(first, first + count))
        rows, back = np.unique(chosen, return_inverse=True)
        field = np.einsum("ncm,tm->tnc", matrix[rows][back], q.values, optimize=True)
        if "carried" in group:
            field += np.einsum(
                "ncm,tm->tnc", group["carried"][rows][back], self._supports(times), optimize=True
            )
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
        kept = read_stress(self._whole, str(self.dataset.attrs.get("stress_file", "")), block, nodes)
        q = self._coordinates(times, kept.columns)
        supports = self._supports(times) if kept.carried else np.zeros((len(q), 0))
        combined = kept.combined(np.hstack([q.values, supports]))
        return xr.DataArray(
            np.einsum("ncr,tr->tnc", kept.fields, combined, optimize=True) + kept.offset,
            dims=("time", "point", "stress_component"),
            coords={"time": q.time.values, "point": kept.nodes, "stress_component": list(COMPONENTS)},
            name="stress",
            attrs={"units": "Pa", "long_name": f"stress of block {block}, tension positive"},
        )

    def _coordinates(self, times: float | Sequence[float] | slice | None, columns: slice) -> xr.DataArray:
        q = self.dataset.get("reduced_coordinates")
        modes = 0 if q is None else q.sizes["mode"]
        if q is None or columns.stop > modes:
            raise ResultError(
                f"{self.path}: has {modes} reduced coordinates, the files beside it are of {columns.stop} or "
                "more, of another model; run it again"
            )
        return _at_times(q, times)[:, columns]

    def _supports(self, times: float | Sequence[float] | slice | None) -> Floats:
        """Displacement of moving supports, (nt, 3 supports) [m]."""
        if "support_displacement" not in self.dataset:
            raise ResultError(
                f"{self.path}: has no support_displacement, and the files beside it are of a model whose "
                "supports move; run it again"
            )
        values = _at_times(self.dataset.support_displacement, times).values
        return np.asarray(values.reshape(len(values), -1))

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
            self._model = _open_model(self._whole, str(self.dataset.attrs.get("model_file", "")))
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
    return open_beside(result, name, ("model", FORMAT), stored_digest)
