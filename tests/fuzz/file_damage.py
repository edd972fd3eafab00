"""What can happen to a file: its bytes, its place, and its content by the hand of another program."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import h5py
import numpy as np


def damage_bytes(path: Path, others: list[Path], rng: np.random.Generator) -> str:
    """Change the bytes of a file, or put something else in its place; what was done."""
    kind = str(rng.choice(BYTES))
    data = bytearray(path.read_bytes())
    at = int(rng.integers(len(data)))
    size = int(rng.choice([8, 64, 512, 4096]))
    if kind == "flips":
        for at in rng.integers(len(data), size=int(rng.integers(1, 9))):
            data[at] ^= 1 << int(rng.integers(8))
    elif kind == "zeros":
        data[at : at + size] = bytes(len(data[at : at + size]))
    elif kind == "zeros in the head":
        at = int(rng.integers(2048))
        data[at : at + size] = bytes(len(data[at : at + size]))
    elif kind == "noise":
        data[at : at + size] = rng.bytes(len(data[at : at + size]))
    elif kind == "moved":
        to = int(rng.integers(len(data)))
        data[to : to + size] = data[at : at + len(data[to : to + size])]
    elif kind == "cut":
        del data[at:]
    elif kind == "cut by little":
        del data[-int(rng.integers(1, 200)) :]
    elif kind == "appended":
        data += rng.bytes(size) if rng.random() < 0.5 else bytes(size)
    elif kind == "swapped":
        data = bytearray(others[int(rng.integers(len(others)))].read_bytes())
    elif kind == "empty":
        data = bytearray()
    elif kind == "text":
        data = bytearray(b"not a file of numbers\n" * int(rng.integers(1, 99)))
    path.write_bytes(data)
    return f"{kind} at {at}, {size}"


BYTES = ["flips", "zeros", "zeros in the head", "noise", "moved", "cut", "cut by little", "appended",
         "swapped", "empty", "text"]  # fmt: skip


def displace(path: Path, rng: np.random.Generator) -> str:
    """Put something that is no file of this kind into the file's place."""
    kind = str(rng.choice(["folder", "device", "pipe", "loop", "dangling", "gone", "full folder"]))
    path.unlink()
    if "folder" in kind:
        path.mkdir()
        if kind == "full folder":
            (path / "kept").touch()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "loop":
        path.symlink_to(path.name)
    elif kind == "dangling":
        path.symlink_to("nowhere")
    return kind


def rewrite(path: Path, rng: np.random.Generator) -> str:
    """Change the content as another program would, which drops the digest of the bytes; what was done."""
    with h5py.File(path, "r+") as file:
        places: list[h5py.Group | h5py.Dataset] = [file]
        file.visititems(lambda _, item: places.append(item))
        data = [item for item in places if isinstance(item, h5py.Dataset)]
        if rng.random() < 0.4:
            return _change_attribute(places[int(rng.integers(len(places)))], rng)
        return _change_dataset(file, data[int(rng.integers(len(data)))], rng)


def _change_attribute(item: h5py.Group | h5py.Dataset, rng: np.random.Generator) -> str:
    names = list(item.attrs)
    if not names:
        return f"nothing at {item.name}"
    name = names[int(rng.integers(len(names)))]
    values = [None, 7, -1, np.nan, "x", b"\xff\xfe", np.zeros((2, 3)), "{" * 200, h5py.Empty("f")]
    value = values[int(rng.integers(len(values)))]
    if value is None:
        del item.attrs[name]
    else:
        item.attrs[name] = value
    return f"attribute {name} of {item.name} to {value!r}"


def _change_dataset(file: h5py.File, data: h5py.Dataset, rng: np.random.Generator) -> str:
    name, shape, dtype = data.name, data.shape, data.dtype
    kind = str(rng.choice(DATASETS))
    if kind in ("NaN", "inf") and dtype.kind == "f":
        data[...] = np.where(rng.random(shape) < 0.5, np.nan if kind == "NaN" else np.inf, data[...])
        return f"{kind} in {name}"
    kind = "text" if kind in ("scalar", "longer") and shape == () else kind
    attributes = {k: data.attrs[k] for k in data.attrs if k in ("units", "element", "first", "long_name")}
    del file[name]
    if kind == "longer":
        file[name] = np.ones(tuple(n + 1 for n in shape))
    elif kind == "scalar":
        file[name] = 1.0
    elif kind == "text":
        file[name] = np.full(shape, "x", dtype=h5py.string_dtype())
    elif kind == "whole numbers":
        file[name] = np.ones(shape, dtype=np.uint16 if dtype.kind == "f" else np.float32)
    elif kind == "huge":
        huge = tuple(max(n, 20_000) for n in shape) or (3_000_000_000,)
        file.create_dataset(name, shape=huge, dtype="f8", chunks=tuple(min(n, 16) for n in huge))
    elif kind == "huge in one piece":
        space, plist = h5py.h5s.create_simple((3_000_000_000_000,)), h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        h5py.h5d.create(file.id, name.encode(), h5py.h5t.NATIVE_DOUBLE, space, plist)
    elif kind == "link to a file":
        file[name] = h5py.ExternalLink("/etc/hostname", "/x")
    elif kind == "link":
        file[name] = h5py.SoftLink("/nowhere")
    elif kind == "in other files":
        file.create_dataset(name, shape=(100,), dtype="f8", external=[("/dev/zero", 0, 800)])
    elif kind == "virtual":
        layout = h5py.VirtualLayout(shape=(100,), dtype="f8")
        layout[:] = h5py.VirtualSource("/nowhere.h5", "x", shape=(100,))
        file.create_virtual_dataset(name, layout)
    elif kind == "group":
        file.create_group(name)
    elif kind == "loop":
        file[name] = file["/"]
    if name in file and isinstance(file.get(name, getlink=True), h5py.HardLink) and kind != "loop":
        file[name].attrs.update(attributes)
    return f"{name}: {kind}"


DATASETS = ["gone", "NaN", "inf", "longer", "scalar", "text", "whole numbers", "huge", "huge in one piece",
            "link to a file", "link", "in other files", "virtual", "group", "loop"]  # fmt: skip


def put_back(path: Path, whole: Path) -> None:
    """Undo: a copy of the whole file in the damaged one's place."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
    shutil.copyfile(whole, path)
