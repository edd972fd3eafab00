"""Read everything of an HDF5 file that nobody vouches for: `trial.py FILE`, a process of its own.

Prints one JSON object: `refused`, why the file is not to be opened, or the names of the variables with values
that are not numbers. HDF5 may die over a damaged file, or never come to an end; the caller sees to that.
"""

from __future__ import annotations

import json
import math
import sys

import h5py
import numpy as np

_MEMORY = 4 << 30  # bytes of address space
_RATIO = 1100  # deflate makes at most 1032 bytes of one
_SPARE = 64 << 20  # bytes of a dataset that need not stand in the file, as those of a mere dimension do not
_TOGETHER = 32 << 20  # bytes read at a time
_ATTRIBUTE = 64 << 20  # bytes of an attribute


def trial(path: str) -> dict[str, object]:
    """Read a file; what `main` prints."""
    no_numbers: dict[str, list[str]] = {"undefined": [], "infinite": []}
    with h5py.File(path, "r") as file:
        try:
            _read_group(file, no_numbers, set())
        except ValueError as error:
            return {"refused": str(error)}
    return dict(no_numbers)


def _read_group(group: h5py.Group, no_numbers: dict[str, list[str]], seen: set[object]) -> None:
    _read_attributes(group)
    for name in group:
        link = group.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            raise ValueError(f"{group.name}/{name} is a link; only what stands in the file itself is read")
        item = group[name]
        address = h5py.h5o.get_info(item.id).addr
        if address in seen:
            raise ValueError(f"{group.name}/{name} stands in two places")
        seen.add(address)
        if isinstance(item, h5py.Group):
            _read_group(item, no_numbers, seen)
        elif isinstance(item, h5py.Dataset):
            _read_attributes(item)
            _read_dataset(item, no_numbers)


def _read_attributes(item: h5py.Group | h5py.Dataset) -> None:
    for name in item.attrs:
        attribute = item.attrs.get_id(name)
        if math.prod(attribute.shape) * attribute.dtype.itemsize > _ATTRIBUTE:
            raise ValueError(f"the attribute {name} of {item.name} states a size that cannot be meant")
        item.attrs[name]


def _read_dataset(data: h5py.Dataset, no_numbers: dict[str, list[str]]) -> None:
    if data.shape is None:
        return
    if data.is_virtual or data.external:
        raise ValueError(f"{data.name} stands in other files; only what is in the file itself is read")
    stored = min(data.id.get_storage_size(), data.file.id.get_filesize())
    if math.prod(data.shape) * data.dtype.itemsize > _RATIO * stored + _SPARE:
        raise ValueError(f"{data.name} states a size of {data.shape}, and holds {stored} bytes")
    pieces: list[object] = [()]
    if data.shape:  # whole rows of chunks
        row = max(1, math.prod(data.shape[1:]) * data.dtype.itemsize)
        step = max(1, _TOGETHER // row)
        if data.chunks:
            step = max(1, step // data.chunks[0]) * data.chunks[0]
        pieces = [slice(k, k + step) for k in range(0, data.shape[0], step)]
    for piece in pieces:
        values = data[piece]
        if data.dtype.kind == "f" and not np.isfinite(values).all():
            kinds = {"undefined": np.isnan(values).any(), "infinite": np.isinf(values).any()}
            for kind, there in kinds.items():
                if there and data.name.lstrip("/") not in no_numbers[kind]:
                    no_numbers[kind].append(data.name.lstrip("/"))


def main() -> None:
    """Print what is found; a file that HDF5 itself refuses is refused with its words."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (ImportError, ValueError, OSError):  # Windows, or a lower limit is set
        pass
    try:
        answer = trial(sys.argv[1])
    except Exception as error:  # whatever HDF5 and xarray raise of bytes that nobody vouches for
        answer = {"refused": f"is damaged, HDF5 cannot read it ({error})"}
    sys.stdout.write(json.dumps(answer))


if __name__ == "__main__":
    main()
