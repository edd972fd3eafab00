"""Displacement and stress at any node of a block, from a result and its companion files.

A result file has the reduced coordinates q(t), the basis file the reduced basis, so that u(t) = basis q(t).
It is an HDF5 file in the folder of the result, `model-<first 12 digits of the SHA-256 of its content>.h5`,
one for each model:

    /                       attributes: format, content_sha256, source
    /blocks/<name>          one group for each block, as `romdam.reduction.storage.model_file` describes it:
                            its modes, or vectors and a mix that makes the modes of them
    /blocks/<name>/carried  (n, 3, k) displacement for unit displacements of k support components; only if
                            supports move differently from the base
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
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
from romdam.core.printable import one_line
from romdam.core.scene import Block, Scene
from romdam.core.sealed import text_of
from romdam.postprocess.record_measures import peak_text, stated_warnings
from romdam.postprocess.stress.summary import COMPONENTS
from romdam.reduction.storage.model_file import rows_written, written
from romdam.results.companion import in_order, open_companion_file, write_companion_file
from romdam.results.dataset import open_run
from romdam.results.stress.file import read_stress

FORMAT, BEFORE = "romdam-model-2", "romdam-model-1"  # before 2 no block had a mix
_ERROR_STATEMENTS = ("error_statement", "certificate_statement", "error_estimate")  # best first
_SHOWN_JOINTS = 8  # joints whose peak opening a notebook shows
_ROWS = 4096  # rows of an array that are read or hashed at a time


def write_model(
    folder: Path,
    scene: Scene,
    basis: Mapping[str, BlockBasis],
    carried: Mapping[str, Floats] | None = None,
    left_out: Collection[str] = (),
) -> str:
    """Write the basis file of a model in single precision, unless the folder has it already.

    Parameters
    ----------
    carried : block name -> (3 n, k) displacement for unit displacements of moving supports; None without any
    left_out : names of blocks whose displacement is not kept

    Returns
    -------
    str, the name of the file, which follows from its content

    Raises
    ------
    WriteError
        if the file cannot be written.
    """

    def write_block(file: h5py.File, name: str, block: Block) -> Iterator[NDArray[Any]]:
        """Write the basis of a block and yield its rows as they are written, for the digest."""
        group = file.create_group(f"blocks/{name}")
        yield from rows_written(group, block, basis[name], np.float32)
        if carried is not None:
            group["carried"] = carried[name].reshape(len(block.points), 3, -1)
            yield carried[name]

    def write_blocks(file: h5py.File) -> str:
        return _content_digest(
            (
                f"{name} {block.element} {basis[name].columns.start} {parts[name][0].shape}",
                chain(_row_chunks(block.points), _row_chunks(block.cells)),
                write_block(file, name, block),
            )
            for name, block in blocks.items()
        )

    blocks = {name: block for name, block in scene.blocks.items() if name not in left_out}
    parts = {name: written(basis[name].vectors) for name in blocks}
    size = sum(vectors.nbytes // 2 + (0 if mix is None else mix.nbytes) for vectors, mix in parts.values())
    return write_companion_file(
        folder, ("model", FORMAT), write_blocks, size, _model_digest(blocks, basis, carried)
    )


def _model_digest(
    blocks: Mapping[str, Block], basis: Mapping[str, BlockBasis], carried: Mapping[str, Floats] | None
) -> str:
    """Compute a SHA-256 that tells models apart without forming the bases, which may be large.

    The basis enters by its projection of a random force.
    """
    content = hashlib.sha256(FORMAT.encode())
    for name, block in blocks.items():
        of_block = basis[name]
        columns = f"{of_block.columns.start}:{of_block.columns.stop}"
        content.update(f"{name} {block.element} {columns} {of_block.vectors.shape}".encode())
        force = np.random.default_rng(0).standard_normal(of_block.vectors.shape[0])
        projected = of_block.vectors.project(force)
        for array in (block.points, block.cells, of_block.omega2, of_block.participation, projected):
            content.update(np.ascontiguousarray(array).data)
        if carried is not None:
            content.update(np.ascontiguousarray(carried[name]).data)
    return content.hexdigest()


def _content_digest(
    blocks: Iterable[tuple[str, Iterable[NDArray[Any]], Iterable[NDArray[Any]]]], layout: str = FORMAT
) -> str:
    """Compute the SHA-256 of the content of a basis file.

    Parameters
    ----------
    blocks : for each block a header (name, element, first column and shape of the basis), the chunks of its
        points and cells, and those of its basis
    layout : format of the file
    """
    content = hashlib.sha256(layout.encode())
    for header, mesh, basis in blocks:
        content.update(header.encode())
        for chunk in chain(mesh, basis):
            content.update(np.ascontiguousarray(chunk).data)
    return content.hexdigest()


def _row_chunks(array: Any) -> Iterator[NDArray[Any]]:
    """Iterate over the rows of an array or a dataset, `_ROWS` at a time."""
    return (array[first : first + _ROWS] for first in range(0, array.shape[0], _ROWS))


def stored_digest(file: h5py.File) -> str:
    """Compute the SHA-256 of the content of an open basis file."""
    blocks = [
        (
            f"{name} {group['cells'].attrs['element']} {int(group['basis'].attrs['first'])} "
            f"{(3 * group['basis'].shape[0], group['basis'].shape[2])}",
            chain(_row_chunks(group["points"]), _row_chunks(group["cells"])),
            chain(*(_row_chunks(group[item]) for item in ("basis", "mix", "carried") if item in group)),
        )
        for name, group in in_order(file)
    ]
    return _content_digest(blocks, text_of(file, "format"))


class Result:
    """A result file and its companion files, which are read only as far as they are needed.

    Parameters
    ----------
    path : of the NetCDF file
    unkept : the temporary folder of a run without an output folder; it exists as long as this object. None
        for a run with one

    Attributes
    ----------
    path : of the NetCDF file
    dataset : xarray.Dataset; lazy, but in memory for a run without an output folder
    """

    def __init__(self, path: str | Path, unkept: Unkept | None = None) -> None:
        self.path = Path(path)
        self._absolute_path = self.path.absolute()  # companion files are opened later, perhaps elsewhere
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
        name = f"{attrs['title']}, record {attrs['record']}"
        return one_line(f"Result({self._location!r}): {name}; peak opening: {self.opening_text}")

    def _repr_html_(self) -> str:
        attrs = self.dataset.attrs
        seconds = float(self.dataset.time[-1]) if self.dataset.time.size else 0.0
        rows = {
            "record": f"dt {attrs['record_dt']:g} s, peak {peak_text(attrs)}",
            "run": f"{seconds:.4g} s, {attrs['model_order']} order, {attrs['integrator']}",
            "peak opening": self.opening_text,
            "error": "; ".join(str(attrs[name]) for name in _ERROR_STATEMENTS if name in attrs),
            "warnings": "; ".join(stated_warnings(attrs)),
            "file": self._location,
        }
        return card(str(attrs["title"]), f"Result, record {self.record}", rows)

    @property
    def record(self) -> str:
        """Name of the ground motion."""
        return str(self.dataset.attrs["record"])

    @property
    def peaks(self) -> xr.Dataset:
        """Largest values of the run, in memory, over joint: peak_opening [m], peak_slip [m] and the others.

        `peaks.to_dataframe()` is a table of them.
        """
        names = [
            name
            for name, values in self.dataset.data_vars.items()
            if str(name).startswith("peak_") and values.dims == ("joint",)
        ]
        return self.dataset[names].load()

    @property
    def opening_text(self) -> str:
        """The peak openings of at most `_SHOWN_JOINTS` joints as a text, the largest first."""
        if "peak_opening" not in self.dataset:
            return "no joints"
        openings = self.dataset.peak_opening.to_series().sort_values(ascending=False)
        peaks_text = [f"{name} {1e3 * value:.3g} mm" for name, value in openings.head(_SHOWN_JOINTS).items()]
        left = len(openings) - len(peaks_text)
        return ", ".join(peaks_text) + (f" and {left} more" if left else "")

    @property
    def _location(self) -> str:
        return str(self.path) if self._unkept is None else "in memory"

    def close(self) -> None:
        """Close the result file and the basis file."""
        self.dataset.close()
        if self._model is not None:
            self._model.close()
            self._model = None

    @property
    def blocks(self) -> list[str]:
        """Names of the blocks."""
        return list(self._basis_file()["blocks"])

    def points(self, block: str) -> Floats:
        """Return the node positions of a block, (n, 3) [m].

        Raises
        ------
        ResultError
            for an unknown block or a full-order result.
        """
        return np.asarray(self._block_group(block)["points"])

    def cells(self, block: str) -> tuple[str, NDArray[np.int64]]:
        """Return the element of a block, such as "hex8", and its cells (nc, nodes of a cell) in VTK order.

        Raises
        ------
        ResultError
            for an unknown block or a full-order result.
        """
        cells = self._block_group(block)["cells"]
        return str(cells.attrs["element"]), np.asarray(cells)

    def displacement(
        self,
        block: str,
        nodes: int | Sequence[int] | NDArray[np.integer[Any]] | None = None,
        times: float | Sequence[float] | slice | None = None,
    ) -> xr.DataArray:
        """Compute the displacement of nodes of a block, relative to the base.

        Only these nodes of the basis, and these times of the reduced coordinates, are read.

        Parameters
        ----------
        block : name of the block
        nodes : node numbers in the block, from 0; None for all
        times : one or more times, for each of which the nearest written time is taken; or a slice, for all
            written times between its ends; None for all [s]

        Returns
        -------
        DataArray with dims time, point, component [m]; `point` holds the node numbers

        Raises
        ------
        ResultError
            for an unknown block, a node number out of range, or a full-order result.
        """
        group = self._block_group(block)
        basis = group["basis"]
        numbers = self._node_numbers(basis.shape[0], block, nodes)
        first, count = int(basis.attrs["first"]), group.get("mix", basis).shape[-1]
        q = self._reduced_coordinates(times, slice(first, first + count))
        rows, back = np.unique(numbers, return_inverse=True)  # h5py reads ascending rows only
        shapes = basis[rows][back].astype(np.float64, copy=False)
        mix = [group["mix"][()]] if "mix" in group else []
        # of one node the mix comes first, of one instant last
        disp = np.linalg.multi_dot([shapes.reshape(-1, basis.shape[2]), *mix, q.values.T])
        disp = np.moveaxis(disp.reshape(len(numbers), 3, len(q)), 2, 0)
        if "carried" in group:
            supports = self._support_displacement(times)
            disp += np.einsum("ncm,tm->tnc", group["carried"][rows][back], supports, optimize=True)
        return xr.DataArray(
            disp,
            dims=("time", "point", "component"),
            coords={"time": q.time.values, "point": numbers, "component": ["x", "y", "z"]},
            name="displacement",
            attrs={"units": "m", "long_name": f"displacement of block {block} relative to the base"},
        )

    def stress(
        self,
        block: str,
        nodes: int | Sequence[int] | NDArray[np.integer[Any]] | None = None,
        times: float | Sequence[float] | slice | None = None,
    ) -> xr.DataArray:
        """Compute the stress of nodes of a block; `outputs.stress` of the job says which nodes have stress.

        Parameters
        ----------
        block : name of the block
        nodes : node numbers in the block, from 0; None for all that have stress
        times : as in `displacement`

        Returns
        -------
        DataArray with dims time, point, stress_component [Pa], tension positive; `point` holds the node
        numbers

        Raises
        ------
        ResultError
            for an unknown block, a node without stress, or a full-order result.
        """
        stored = read_stress(
            self._absolute_path, str(self.dataset.attrs.get("stress_file", "")), block, nodes
        )
        q = self._reduced_coordinates(times, stored.columns)
        supports = self._support_displacement(times) if stored.carried else np.zeros((len(q), 0))
        combined = stored.combined(np.hstack([q.values, supports]))
        return xr.DataArray(
            np.einsum("ncr,tr->tnc", stored.fields, combined, optimize=True) + stored.offset,
            dims=("time", "point", "stress_component"),
            coords={"time": q.time.values, "point": stored.nodes, "stress_component": list(COMPONENTS)},
            name="stress",
            attrs={"units": "Pa", "long_name": f"stress of block {block}, tension positive"},
        )

    def _reduced_coordinates(
        self, times: float | Sequence[float] | slice | None, columns: slice
    ) -> xr.DataArray:
        """Return the reduced coordinates of a block, (nt, m) [m].

        Raises
        ------
        ResultError
            if the result has fewer than its companion files.
        """
        q = self.dataset.get("reduced_coordinates")
        modes = 0 if q is None else q.sizes["mode"]
        if q is None or columns.stop > modes:
            raise ResultError(
                f"{self.path}: has {modes} reduced coordinates, but its companion files need {columns.stop} "
                "or more: they are of another model; run it again"
            )
        return _at_times(q, times)[:, columns].astype(np.float64, copy=False)

    def _support_displacement(self, times: float | Sequence[float] | slice | None) -> Floats:
        """Return the displacement of moving supports, (nt, 3 supports) [m].

        Raises
        ------
        ResultError
            if the result has none.
        """
        if "support_displacement" not in self.dataset:
            raise ResultError(
                f"{self.path}: has no support_displacement, but its companion files are of a model whose "
                "supports move; run it again"
            )
        values = _at_times(self.dataset.support_displacement, times).values
        return np.asarray(values.reshape(len(values), -1))

    def _node_numbers(self, count: int, block: str, nodes: Any) -> NDArray[np.int64]:
        """Return node numbers as an array, all if None; raise a ResultError for one out of range."""
        numbers = np.arange(count) if nodes is None else np.atleast_1d(np.asarray(nodes, dtype=np.int64))
        if numbers.size and not (numbers.min() >= 0 and numbers.max() < count):
            raise ResultError(
                f"{self.path}: nodes of block {block!r} must be from 0 to {count - 1}, "
                f"got {numbers.min()} to {numbers.max()}"
            )
        return numbers

    def _block_group(self, name: str) -> h5py.Group:
        """Return the group of a block in the basis file; raise a ResultError for an unknown block."""
        blocks = self._basis_file()["blocks"]
        if name in json.loads(str(self.dataset.attrs.get("rock_blocks", "[]"))) and name not in blocks:
            raise ResultError(
                f"{self.path}: the displacement of rock, of block {name!r} too, was not kept; give outputs: "
                "{rock: true}, and run again"
            )
        if name not in blocks:
            raise ResultError(f"{self.path}: no block {name!r}; there are {', '.join(blocks)}")
        return blocks[name]

    def _basis_file(self) -> h5py.File:
        """Return the basis file, opened at the first call; a full-order result has none."""
        if self._model is None:
            result, name = self._absolute_path, str(self.dataset.attrs.get("model_file", ""))
            if not name:
                raise ResultError(
                    f"{result}: a full-order result keeps displacements at its output nodes only; "
                    "name more under outputs.nodes, or run with model.order: reduced"
                )
            self._model = open_companion_file(result, name, ("model", FORMAT, BEFORE), stored_digest)
        return self._model


def open_result(path: str | Path) -> Result:
    """Open a result that `romdam run` wrote, also in a `with` statement.

    Raises
    ------
    ResultError
        if there is no such file, or it is not a result of romdam.
    """
    return Result(path)


def _at_times(history: xr.DataArray, times: float | Sequence[float] | slice | None) -> xr.DataArray:
    """Select times of a history, as `Result.displacement` describes them."""
    if times is None:
        return history
    if isinstance(times, slice):
        return history.sel(time=times)
    return history.sel(time=np.atleast_1d(np.asarray(times, dtype=float)), method="nearest")
