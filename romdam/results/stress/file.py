"""Stress of every reduced coordinate on disk, so that any node's history is a small product.

The file (HDF5, `stress-<first 12 of its content's SHA-256>.h5`, one per model, beside the results):

    /                       attributes: format, content_sha256, source
    /blocks/<name>/nodes    (k,) node numbers, ascending
    /blocks/<name>/fields   (k, 6, m) stress per reduced coordinate, xx yy zz xy yz xz [Pa kg-0.5];
                            attribute first: the block's first column of `reduced_coordinates`; where supports
                            move those per `support_displacement` behind, so many as attribute carried
    /blocks/<name>/offset   (k, 6) stress without displacement [Pa]
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.system import History
from romdam.results.beside import in_order, open_beside, write_beside

FORMAT = "romdam-stress-1"
Nodes = int | Sequence[int] | NDArray[np.integer[Any]] | None


@dataclass(frozen=True)
class StressFields:
    """Stress of a block's nodes: fields @ q[columns] + offset, displacements of moving supports behind q's.

    Attributes
    ----------
    nodes : (k,) node numbers
    fields : (k, 6, m) [Pa kg-0.5]
    offset : (k, 6) [Pa]
    columns : the block's slice of q
    sections, section_offset : (sections, 6, m), (sections, 6) the same of forces on sections; not in the file
    """

    nodes: NDArray[np.int64]
    fields: Floats
    offset: Floats
    columns: slice
    sections: Floats = field(default_factory=lambda: np.zeros((0, 6, 0)))
    section_offset: Floats = field(default_factory=lambda: np.zeros((0, 6)))

    @property
    def carried(self) -> int:
        """Number of the fields that are per displacement of a moving support."""
        return self.fields.shape[2] - (self.columns.stop - self.columns.start)

    def coordinates(self, history: History) -> Floats:
        """Factors of the fields: reduced coordinates, and displacements of moving supports, (nt, m)."""
        assert history.q is not None
        q = history.q[:, self.columns]
        return np.hstack([q, history.supports]) if self.carried else q


def write_stress(folder: Path, blocks: Mapping[str, StressFields]) -> str:
    """Write the stress file of a model unless it is there; its name, made from its content.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """

    digest = _digest(
        (name, part.columns.start, (part.nodes, part.fields, part.offset)) for name, part in blocks.items()
    )

    def fill(file: h5py.File) -> str:
        for name, part in blocks.items():
            group = file.create_group(f"blocks/{name}")
            group["nodes"], group["fields"], group["offset"] = part.nodes, part.fields, part.offset
            group["fields"].attrs["first"] = part.columns.start
            if part.carried:
                group["fields"].attrs["carried"] = part.carried
        return digest

    size = sum(part.fields.nbytes + part.offset.nbytes for part in blocks.values())
    return write_beside(folder, ("stress", FORMAT), fill, size, digest)


def _digest(blocks: Iterable[tuple[str, int, tuple[NDArray[Any], Floats, Floats]]]) -> str:
    """SHA-256 of blocks: name, first column; nodes, fields and offset."""
    content = hashlib.sha256(FORMAT.encode())
    for name, first, arrays in blocks:
        content.update(f"{name} {first} {arrays[1].shape}".encode())
        for array in arrays:
            content.update(np.ascontiguousarray(array).data)
    return content.hexdigest()


def _stored_digest(file: h5py.File) -> str:
    """The same of what stands in a stress file."""
    return _digest(
        (
            name,
            int(group["fields"].attrs["first"]),
            (group["nodes"][()], group["fields"][()], group["offset"][()]),
        )
        for name, group in in_order(file)
    )


def read_stress(result: Path, name: str, block: str, nodes: Nodes) -> StressFields:
    """Read the fields of some nodes of a block, or of all that have them.

    Parameters
    ----------
    result : the result
    name : of its stress file, empty without

    Raises
    ------
    ResultError
        where there is no such file, block or node.
    """
    if not name:
        raise ResultError(
            f"{result}: no stress was kept of every node; name blocks, faces or nodes under outputs.stress, "
            "and run again with model.order: reduced"
        )
    with open_beside(result, name, ("stress", FORMAT), _stored_digest) as file:
        return _read_block(file["blocks"], result, block, nodes)


def _read_block(blocks: h5py.Group, result: Path, block: str, nodes: Nodes) -> StressFields:
    known = np.asarray(blocks[block]["nodes"]) if block in blocks else np.zeros(0, dtype=np.int64)
    chosen = known if nodes is None else np.atleast_1d(np.asarray(nodes, dtype=np.int64))
    missing = np.setdiff1d(chosen, known)
    if missing.size or not known.size:
        what = f"node {missing[0]} ({missing.size} nodes in all)" if missing.size else "any node"
        raise ResultError(
            f"{result}: no stress was kept for {what} of block {block!r}, which has it at {known.size} "
            "nodes; name the block, a face or the node under outputs.stress, and run again"
        )
    group = blocks[block]
    rows, back = np.unique(np.searchsorted(known, chosen), return_inverse=True)
    fields = group["fields"][rows][back]
    about = group["fields"].attrs
    first, modes = int(about["first"]), fields.shape[2] - int(about.get("carried", 0))
    return StressFields(chosen, fields, group["offset"][rows][back], slice(first, first + modes))
