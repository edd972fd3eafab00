"""Stress of every reduced coordinate on disk, so that any node's history is a small product.

The file (HDF5, `stress-<first 12 of its content's SHA-256>.h5`, one per model, beside the results):

    /                             attributes: format, content_sha256, source, made_of
    /blocks/<name>/nodes          (k,) node numbers, ascending
    /blocks/<name>/fields         (k, 6, r) stress, xx yy zz xy yz xz [Pa kg-0.5], of the r combinations of
                                  reduced coordinates that make some
    /blocks/<name>/combinations   (r, m) of `reduced_coordinates`, and where supports move of
                                  `support_displacement` behind them, so many as attribute carried; attribute
                                  first: the block's first column of `reduced_coordinates`
    /blocks/<name>/offset         (k, 6) stress without displacement [Pa]

Fields and combinations are in single precision.

Files of romdam 0.1 have no combinations: their fields are (k, 6, m), with these attributes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.errors import ResultError
from romdam.core.fingerprint import fingerprint
from romdam.core.sealed import opened
from romdam.core.system import History
from romdam.results.companion import find_companion_file, in_order, open_companion_file, write_companion_file

FORMAT, BEFORE = "romdam-stress-2", "romdam-stress-1"
_ARRAYS = ("nodes", "fields", "combinations", "offset")
Nodes = int | Sequence[int] | NDArray[np.integer[Any]] | None


@dataclass(frozen=True)
class StressFields:
    """Stress of a block's nodes: fields @ combinations @ q[columns] + offset.

    Where supports move, their displacements follow q's.

    Attributes
    ----------
    nodes : (k,) node numbers
    fields : (k, 6, r) [Pa kg-0.5]
    combinations : (r, m) of the coordinates, see `romdam.linalg.dense`
    offset : (k, 6) [Pa]
    columns : the block's slice of q
    made_of : digest that differs where these do; empty where they were read
    sections, section_offset : (sections, 6, m), (sections, 6) the same of forces on sections; not in the file
    """

    nodes: NDArray[np.int64]
    fields: Floats
    combinations: Floats
    offset: Floats
    columns: slice
    made_of: str
    sections: Floats = field(default_factory=lambda: np.zeros((0, 6, 0)))
    section_offset: Floats = field(default_factory=lambda: np.zeros((0, 6)))

    @property
    def carried(self) -> int:
        """Number of the fields that are per displacement of a moving support."""
        return self.combinations.shape[1] - (self.columns.stop - self.columns.start)

    def coordinates(self, history: History) -> Floats:
        """Reduced coordinates, and displacements of moving supports, (nt, m): those that are combined."""
        assert history.q is not None
        q = history.q[:, self.columns]
        return np.hstack([q, history.supports]) if self.carried else q

    def combined(self, coordinates: Floats) -> Floats:
        """Factors (nt, r) of the fields, of coordinates (nt, m)."""
        return np.asarray(coordinates @ self.combinations.T)


def write_stress(folder: Path, blocks: Mapping[str, StressFields]) -> str:
    """Write the stress file of a model unless it is there; its name, made from its content.

    Raises
    ------
    ResultError
        where the folder or the disk refuses it.
    """

    def fill(file: h5py.File) -> str:
        for name, stress in blocks.items():
            group = file.create_group(f"blocks/{name}")
            for item in _ARRAYS:
                values = getattr(stress, item)
                group[item] = values.astype(np.float32) if item in ("fields", "combinations") else values
            group["combinations"].attrs["first"] = stress.columns.start
            if stress.carried:
                group["combinations"].attrs["carried"] = stress.carried
        return _stored_digest(file)

    size = sum(stress.fields.nbytes // 2 + stress.combinations.nbytes for stress in blocks.values())
    made_of = _made_of({name: stress.made_of for name, stress in blocks.items()})
    return write_companion_file(folder, ("stress", FORMAT), fill, size, made_of)


def kept_stress(folder: Path, made_of: Mapping[str, str]) -> dict[str, tuple[Floats, Floats]]:
    """Fields and combinations of blocks as an earlier run left them in a folder; none where it did not.

    Parameters
    ----------
    made_of : block name -> digest of what they are made of
    """
    path = find_companion_file(folder, ("stress", FORMAT), _made_of(made_of))
    if path is None:
        return {}
    with opened(path) as file:
        blocks = file["blocks"]
        return {
            name: tuple(blocks[name][item].astype(np.float64)[()] for item in ("fields", "combinations"))
            for name in made_of
        }


def _made_of(blocks: Mapping[str, str]) -> str:
    return fingerprint((FORMAT, list(blocks.items())))


def _stored_digest(file: h5py.File) -> str:
    """SHA-256 of the blocks of a stress file: name, first column, and arrays."""
    written = in_order(file)
    combined = all("combinations" in group for _, group in written)
    content = hashlib.sha256((FORMAT if combined else BEFORE).encode())
    for name, group in written:
        first = int(group["combinations" if "combinations" in group else "fields"].attrs["first"])
        content.update(f"{name} {first} {group['fields'].shape}".encode())
        for item in _ARRAYS:
            if item in group:
                content.update(np.ascontiguousarray(group[item][()]).data)
    return content.hexdigest()


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
    with open_companion_file(result, name, ("stress", FORMAT, BEFORE), _stored_digest) as file:
        blocks = file["blocks"]
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
        fields, offset = group["fields"].astype(np.float64)[rows][back], group["offset"][rows][back]
        by_coordinate = group["combinations" if "combinations" in group else "fields"]
        first, count = int(by_coordinate.attrs["first"]), by_coordinate.shape[-1]
        combinations = (
            group["combinations"].astype(np.float64)[()] if "combinations" in group else np.eye(count)
        )
        columns = slice(first, first + count - int(by_coordinate.attrs.get("carried", 0)))
        return StressFields(chosen, fields, combinations, offset, columns, "")
