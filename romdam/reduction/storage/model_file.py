"""Reduced blocks on disk: one layout for the cache and for the basis file beside the results.

A block is an HDF5 group; a cache file `block-<first 16 of its key>.h5` holds one as its root, the basis file
`model-<...>.h5` one for each block under /blocks (see `romdam.results.fields`):

    points          (n, 3) node positions [m]
    cells           (nc, nodes per cell) node numbers, VTK order; attribute element
    basis           (n, 3, m) open-joint modes, M-orthonormal, zero at supports [kg-0.5], in single precision
                    in the basis file; attribute first: the block's first column of the reduced coordinates
                    (0 in a cache file)
    mix             (k + r, m) where `basis` has vectors (n, 3, r) that the modes are made of: the modes in
                    terms of those of another file (k) and of these; attribute of: fingerprint of the other's,
                    where there is one. In double precision in the basis file too
    omega2          (m,) [1/s2]
    participation   (m, 3) basis^T M r for r a unit translation along x, y, z [kg0.5]
    attributes      layout, key, report (JSON), massless: how many of the last modes have no mass

A cache file whose bytes are not those that were written (`romdam.core.sealed`), or of another key (see
`keys.py`), counts as none. The basis file is named by its content instead: it is what results need of a
model, after the water, whichever way it was made.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.basis import Basis, BlockBasis
from romdam.core.errors import ResultError, quote
from romdam.core.files import sweep_parts
from romdam.core.fingerprint import fingerprint
from romdam.core.scene import Block
from romdam.core.sealed import creating, reading, text_of
from romdam.core.version import SOURCE
from romdam.reduction.basis import Augmented, Dense, Mapped, Product, factored

log = logging.getLogger(__name__)

LAYOUT = "romdam-block-2"
_CHUNK_BYTES = 1 << 20  # bytes of an HDF5 chunk
_MAPPED = 64e6  # bytes of a basis from which on its file is mapped


def write_block(group: h5py.Group, block: Block, basis: BlockBasis) -> None:
    """Write a block into a group of an open file, of one that contains another what it has besides."""
    if isinstance(vectors := basis.vectors, Augmented):
        _write_mix(group, vectors.inner, vectors.mix)
        basis = replace(basis, vectors=Dense(vectors.more))
    for _ in rows_written(group, block, basis):
        pass


def _write_mix(group: h5py.Group, inner: BlockBasis | None, mix: Floats) -> None:
    group["mix"] = mix
    if inner is not None:
        group["mix"].attrs["of"] = _fingerprint(inner)


def _fingerprint(basis: BlockBasis) -> str:
    """Of a reduction: another machine's modes have other last bits, or other signs."""
    return fingerprint((basis.omega2, basis.participation))


def written(basis: Basis) -> tuple[Basis, Floats | None]:
    """What stands in a file of a basis: its vectors, or others and the mix that makes it of them."""
    return factored(basis) or (basis, None)


def rows_written(
    group: h5py.Group, block: Block, basis: BlockBasis, dtype: type[np.floating[Any]] = np.float64
) -> Iterator[NDArray[Any]]:
    """What is written of a block's basis, its rows some at a time, then its mix; see `write_block`.

    Parameters
    ----------
    dtype : precision that the basis is written in
    """
    vectors, mix = written(basis.vectors)
    nodes, columns = len(block.points), vectors.shape[1]
    step = max(1, min(nodes, _CHUNK_BYTES // max(1, 3 * np.dtype(dtype).itemsize * columns)))
    small = vectors.nbytes < _MAPPED
    chunks = (step, 3, columns) if small and vectors.nbytes else None
    data = group.create_dataset("basis", shape=(nodes, 3, columns), dtype=dtype, chunks=chunks)
    for first in range(0, nodes if columns else 0, step):
        some = vectors.rows(slice(3 * first, 3 * (first + step))).astype(dtype, copy=False)
        data[first : first + step] = some.reshape(-1, 3, columns)
        yield some
    if mix is not None:
        _write_mix(group, None, mix)
        yield mix
    group.file.flush()
    _write_mesh_and_frequencies(group, block, basis)


def _write_mesh_and_frequencies(group: h5py.Group, block: Block, basis: BlockBasis) -> None:
    """Write mesh, frequencies and report beside the basis."""
    group["points"] = block.points
    group["cells"] = block.cells
    group["cells"].attrs["element"] = block.element
    group["basis"].attrs["first"] = basis.columns.start
    group["omega2"] = basis.omega2
    group["participation"] = basis.participation
    group.attrs.update(layout=LAYOUT, report=json.dumps(basis.report), massless=basis.massless)


def read_block(group: h5py.Group, inner: BlockBasis | None = None) -> BlockBasis:
    """Read a block from a group of an open file.

    Parameters
    ----------
    inner : the basis that a finer one contains

    Raises
    ------
    ResultError
        where it has another layout, its arrays do not fit each other, or it contains another basis.
    """
    if text_of(group, "layout") != LAYOUT:
        raise ResultError(f"layout {quote(text_of(group, 'layout'))}, expected {LAYOUT!r}")
    data, first = group["basis"], int(group["basis"].attrs["first"])
    nodes, _, columns = data.shape
    omega2, participation = group["omega2"], group["participation"]
    if "mix" in group:
        _, columns = group["mix"].shape
    shapes = (data.shape[:2], group["points"].shape, omega2.shape, participation.shape)
    expected = ((nodes, 3), (nodes, 3), (columns,), (columns, 3))
    if shapes != expected or data.dtype.kind != "f":
        raise ResultError(f"its basis {data.shape} does not fit its mesh and frequencies {omega2.shape}")
    vectors: Basis = _vectors(data)
    if "mix" in group:
        mix, contains = group["mix"], "of" in group["mix"].attrs
        if contains and (inner is None or text_of(mix, "of") != _fingerprint(inner)):
            raise ResultError("the basis that it contains is of another reduction")
        size, rows = (len(inner.omega2), inner.vectors.shape[0]) if contains and inner else (0, 3 * nodes)
        if len(mix) != size + data.shape[2] or 3 * nodes != rows:
            raise ResultError(f"its basis {data.shape} does not fit the vectors that it is made of")
        if contains and inner:
            vectors = Augmented(inner, _vectors(data).array, np.asarray(mix[()]))
        else:
            vectors = Product(vectors, np.asarray(mix[()]))
    return BlockBasis(
        vectors=vectors,
        columns=slice(first, first + columns),
        omega2=omega2[()],
        participation=participation[()],
        report=json.loads(group.attrs["report"]),
        massless=int(group.attrs.get("massless", 0)),  # files of 0.2 have none
    )


def read_block_file(path: Path, key: str | None = None, inner: BlockBasis | None = None) -> BlockBasis:
    """Read the block of a cache file; see `read_block`.

    Parameters
    ----------
    key : what it must be of; not asked if not given
    inner : the basis that a finer one contains

    Raises
    ------
    ResultError
        where the file is damaged, or of another key.
    """
    with reading(path, only_sealed=True) as file:
        if key not in (None, text_of(file, "key")):
            raise ResultError(f"made for key {quote(text_of(file, 'key'))}")
        return read_block(file, inner)


def _vectors(data: h5py.Dataset) -> Dense:
    """The basis of a dataset (n, 3, m); a large one in one piece is mapped."""
    offset, shape = data.id.get_offset(), (3 * data.shape[0], data.shape[2])
    if data.nbytes < _MAPPED or offset is None or data.dtype != np.float64:
        return Dense(np.asarray(data[()], np.float64).reshape(shape))
    return Mapped.of(data.file.filename, offset, shape)


@dataclass(frozen=True)
class StreamedBasis:
    """The basis of a block of n nodes that is written as its rows come.

    Attributes
    ----------
    omega2 : (m,) [1/s2]
    rows : the basis (3 n, m), or the r vectors that it is made of, (3 n, r): some rows of whole nodes at a
        time, from the first node to the last
    inertia : (3 n, 3) M r for unit translations r [kg]
    report : numbers of the reduction, plain values
    mix : (k + r, m) the basis in terms of the k vectors of the one that it contains and of r more; None where
        `rows` are those of the basis
    contained : the basis that it contains; None where it contains none
    massless : how many of the last vectors have no mass
    """

    omega2: Floats
    rows: Iterator[Floats]
    inertia: Floats
    report: dict[str, object]
    mix: Floats | None = None
    contained: BlockBasis | None = None
    massless: int = 0


class BlockStore:
    """A folder of reduced blocks.

    Parameters
    ----------
    folder : made when the first block is written
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._folder: TemporaryDirectory[str] | None = None

    @classmethod
    def passing(cls) -> BlockStore:
        """A store that goes with the last reference to it; what is mapped from it stays readable."""
        folder = TemporaryDirectory(prefix="romdam-")
        store = cls(Path(folder.name))
        store._folder = folder
        return store

    def scratch(self, key: str) -> Path:
        """Path of the unfinished block of a key.

        Raises
        ------
        ResultError
            where the folder cannot be made.
        """
        self._prepare()
        return self.folder / f".block-{key[:16]}.columns"

    def path(self, key: str) -> Path:
        """Path of the block of a key."""
        return self.folder / f"block-{key[:16]}.h5"

    def read(self, key: str, inner: BlockBasis | None = None) -> BlockBasis | None:
        """The block of a key; None where there is none, or the file is damaged or foreign.

        Parameters
        ----------
        inner : the basis that a finer one contains
        """
        path = self.path(key)
        if not path.is_file():
            return None
        try:
            return read_block_file(path, key, inner)
        except ResultError as error:
            log.warning("%s: not a usable reduced block (%s); reducing again", path, error)
            return None

    def read_part(self, keys: list[dict[str, str]]) -> list[dict[str, BlockBasis]]:
        """The bases of a part's blocks, as far as the store has them of every block, of one reduction.

        Two machines that share a store may each leave some blocks of a part: their modes have other signs.

        Parameters
        ----------
        keys : of the basis, and of a finer one that may contain it: block name -> key
        """
        levels: list[dict[str, BlockBasis]] = []
        for of_level in keys:
            bases = {}
            for name, key in of_level.items():
                basis = self.read(key, levels[0][name] if levels else None)
                if basis is None:
                    return levels
                bases[name] = basis
            if len({basis.omega2.tobytes() for basis in bases.values()}) > 1:
                log.warning("%s: blocks of one part are of different reductions; reducing again", self.folder)
                return levels
            levels.append(bases)
        return levels

    def write(self, key: str, block: Block, basis: BlockBasis) -> BlockBasis:
        """Keep a block under its key; the same block, mapped from its file where it is large.

        Raises
        ------
        ResultError
            where the folder or the disk refuses it.
        """
        self._prepare()
        with creating(self.path(key), basis.vectors.nbytes) as file:
            file.attrs.update(key=key, source=SOURCE)
            write_block(file, block, basis)
        if isinstance(basis.vectors, Dense) and basis.vectors.nbytes >= _MAPPED:
            return replace(basis, vectors=self._written(key))
        return basis

    def write_streamed(self, key: str, block: Block, streamed: StreamedBasis) -> BlockBasis:
        """Keep a block whose basis comes some rows at a time, and map it.

        Raises
        ------
        ResultError
            where the folder or the disk refuses it.
        """
        omega2, mix, contained = streamed.omega2, streamed.mix, streamed.contained
        columns = len(omega2) if mix is None else len(mix)
        columns -= 0 if contained is None else len(contained.omega2)
        size = (len(block.points), 3, columns)
        participation, first = np.zeros((size[2], 3)), 0
        with creating(self.path(key), 8 * int(np.prod(size)) + (0 if mix is None else mix.nbytes)) as file:
            data = file.create_dataset("basis", shape=size, dtype="f8")
            for piece in streamed.rows:
                last = first + len(piece) // 3
                data[first:last] = piece.reshape(last - first, 3, size[2])
                participation += piece.T @ streamed.inertia[3 * first : 3 * last]
                first = last
            if contained is not None:
                participation = np.vstack([contained.participation, participation])
            if mix is not None:
                _write_mix(file, contained, mix)
                participation = mix.T @ participation
            basis = BlockBasis(
                vectors=Dense(np.zeros((0, 0))),
                columns=slice(0, len(omega2)),
                omega2=omega2,
                participation=participation,
                report=streamed.report,
                massless=streamed.massless,
            )
            file.attrs.update(key=key, source=SOURCE)
            _write_mesh_and_frequencies(file, block, basis)
        vectors: Basis = self._written(key)
        if mix is not None:
            whole = vectors.rows()
            vectors = Product(vectors, mix) if contained is None else Augmented(contained, whole, mix)
        return replace(basis, vectors=vectors)

    def _written(self, key: str) -> Dense:
        """The basis in a file that this store has just written."""
        with h5py.File(self.path(key), "r") as file:
            return _vectors(file["basis"])

    def _prepare(self) -> None:
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ResultError(f"{self.folder}: the cache folder cannot be made ({error})") from error
        sweep_parts(self.folder)
