"""Reduced blocks on disk: one layout for the cache and for the basis file beside the results.

A block is an HDF5 group; a cache file `block-<first 16 of its key>.h5` holds one as its root, the basis file
`model-<...>.h5` one for each block under /blocks (see `romdam.outputs.fields`):

    points          (n, 3) node positions [m]
    cells           (nc, nodes per cell) node numbers, VTK order; attribute element
    basis           (n, 3, m) open-joint modes, M-orthonormal, zero at supports [kg-0.5];
                    attribute first: the block's first column of the reduced coordinates (0 in a cache file)
    omega2          (m,) [1/s2]
    participation   (m, 3) basis^T M r for r a unit translation along x, y, z [kg0.5]
    attributes      layout, key, content_sha256 (of the three arrays and the report), report (JSON)

The key is the SHA-256 of everything the basis depends on: mesh, element, material, supports, the DOFs that
the joints retain (with their turned frames), the choice of modes, the versions of romdam and of this layout.
Stiffness and friction of joints, gaps, damping, loads and records are not. A file that is not whole, not ours
or does not match its own checksum counts as none.
"""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

import romdam
from romdam.errors import ResultError
from romdam.files import replacing
from romdam.fingerprint import fingerprint
from romdam.reduction.craig_bampton import ModeChoice
from romdam.reduction.interface import Interface
from romdam.scene.model import Block, Bools

log = logging.getLogger(__name__)

LAYOUT = "romdam-block-1"
Floats = NDArray[np.float64]
_CHUNK_BYTES = 1 << 20


@dataclass(frozen=True)
class BlockBasis:
    """A reduced block; its displacement is u = matrix @ q[columns].

    Attributes
    ----------
    matrix : (3 n, m) open-joint modes, M-orthonormal, zero at supports [1/sqrt(kg)]
    columns : the block's slice of q
    omega2 : (m,) ascending [1/s2]
    participation : (m, 3) matrix^T M r for unit translations r along x, y, z [sqrt(kg)]
    report : numbers on the reduction, plain JSON values
    """

    matrix: Floats
    columns: slice
    omega2: Floats
    participation: Floats
    report: dict[str, object]


def block_key(block: Block, fixed: Bools, interface: Interface, choice: ModeChoice) -> str:
    """SHA-256 of what the basis of a block depends on."""
    elastic = (block.material.E, block.material.nu, block.material.rho)
    mesh = (block.element, block.points, block.cells, elastic)
    return fingerprint((LAYOUT, romdam.__version__, mesh, fixed, interface, choice.basis))


def write_block(group: h5py.Group, block: Block, basis: BlockBasis) -> None:
    """Write a block into a group of an open file."""
    matrix = basis.matrix.reshape(len(block.points), 3, -1)
    group["points"] = block.points
    group["cells"] = block.cells
    group["cells"].attrs["element"] = block.element
    rows = max(1, min(len(matrix), _CHUNK_BYTES // max(1, 3 * 8 * matrix.shape[2])))
    chunks = (rows, *matrix.shape[1:]) if matrix.size else None
    group.create_dataset("basis", data=matrix, chunks=chunks)
    group["basis"].attrs["first"] = basis.columns.start
    group["omega2"] = basis.omega2
    group["participation"] = basis.participation
    group.attrs.update(layout=LAYOUT, report=json.dumps(basis.report), content_sha256=_checksum(basis))


def read_block(group: h5py.Group) -> BlockBasis:
    """Read a block from a group of an open file.

    Raises
    ------
    ResultError
        where it has another layout or does not match its checksum.
    """
    if group.attrs.get("layout") != LAYOUT:
        raise ResultError(f"layout {group.attrs.get('layout')!r}, expected {LAYOUT!r}")
    matrix, first = group["basis"][()], int(group["basis"].attrs["first"])
    basis = BlockBasis(
        matrix=np.ascontiguousarray(matrix.reshape(3 * matrix.shape[0], -1)),
        columns=slice(first, first + matrix.shape[2]),
        omega2=group["omega2"][()],
        participation=group["participation"][()],
        report=json.loads(group.attrs["report"]),
    )
    if group.attrs.get("content_sha256") != _checksum(basis):
        raise ResultError("the arrays do not match their checksum")
    return basis


class BlockStore:
    """A folder of reduced blocks.

    Parameters
    ----------
    folder : made when the first block is written
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, key: str) -> Path:
        """Where the block of a key is."""
        return self.folder / f"block-{key[:16]}.h5"

    def read(self, key: str) -> BlockBasis | None:
        """The block of a key; None where there is none, or the file is damaged or foreign."""
        path = self.path(key)
        if not path.is_file():
            return None
        try:
            with h5py.File(path, "r") as file:
                if file.attrs.get("key") != key:
                    raise ResultError(f"made for key {file.attrs.get('key')!r}")
                return read_block(file)
        except (OSError, KeyError, ValueError, TypeError, RuntimeError, ResultError) as error:
            log.warning("%s: not a usable reduced block (%s); reducing again", path, error)
            return None

    def write(self, key: str, block: Block, basis: BlockBasis) -> None:
        """Keep a block under its key.

        Raises
        ------
        ResultError
            where the folder or the disk refuses it.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ResultError(f"{self.folder}: the cache folder cannot be made ({error})") from error
        with replacing(self.path(key), basis.matrix.nbytes) as part, h5py.File(part, "w") as file:
            file.attrs.update(key=key, source=f"romdam {romdam.__version__}")
            write_block(file, block, basis)


def _checksum(basis: BlockBasis) -> str:
    return fingerprint((json.dumps(basis.report), basis.matrix, basis.omega2, basis.participation))
