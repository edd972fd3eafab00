"""NetCDF-4 files as xarray reads and writes them, with each HDF5 object looked up once.

h5netcdf keeps no object of HDF5. It looks each up by its name for every attribute that it is asked for, some
40 times for a variable that is written and 30 times for one that is read, which is half the time of both.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5netcdf
import h5py
import xarray as xr
from xarray.backends import CachingFileManager, H5NetCDFStore


def netcdf_file(source: Any, mode: str = "r") -> NetCDFFile:
    """Open a path, or a stream, in mode "r" or "w"."""
    order = {"track_order": True} if mode == "w" else {}  # NetCDF-4 asks for it
    return NetCDFFile(_RememberingFile(source, mode, **order), mode)


class NetCDFFile(h5netcdf.File):  # type: ignore[misc]
    """A NetCDF-4 file over an HDF5 file that remembers its objects, and is closed with it."""

    def __init__(self, hdf5: _RememberingFile, mode: str) -> None:
        self._remembering = hdf5
        super().__init__(hdf5, mode, phony_dims="access" if mode == "r" else None, decode_vlen_strings=True)

    def close(self) -> None:
        """Close both."""
        super().close()
        self._remembering.close()


class _RememberingFile(h5py.File):  # type: ignore[misc]
    """An HDF5 file that looks up each of its objects once, those in groups too."""

    def __init__(self, source: Any, mode: str, **options: Any) -> None:
        self._objects: dict[str, Any] = {}
        super().__init__(source, mode, **options)

    def __getitem__(self, name: Any) -> Any:
        """Return the object of a path or of a reference."""
        key = name.strip("/") if isinstance(name, str) else ""
        if name == "/":  # what is deleted from the root group is forgotten
            return self
        if not key:
            return super().__getitem__(name)
        if key not in self._objects:
            found = super().__getitem__(name)
            self._objects[key] = _RememberedGroup(found.id, self) if isinstance(found, h5py.Group) else found
        return self._objects[key]

    def __delitem__(self, name: str) -> None:
        """Delete an object."""
        self.forget(name)
        super().__delitem__(name)

    def forget(self, path: str) -> None:
        """Look an object up again when it is asked for next."""
        self._objects.pop(path.strip("/"), None)

    def close(self) -> None:
        """Close the file."""
        self._objects.clear()
        super().close()


class _RememberedGroup(h5py.Group):  # type: ignore[misc]
    """A group of such a file, which forgets what is deleted from it."""

    def __init__(self, bind: Any, file: _RememberingFile) -> None:
        super().__init__(bind)
        self._forget = file.forget

    def __delitem__(self, name: str) -> None:
        """Delete an object."""
        self._forget(f"{self.name}/{name}")
        super().__delitem__(name)


def write_netcdf(dataset: xr.Dataset, file: NetCDFFile, encoding: dict[Any, dict[str, Any]]) -> None:
    """Write a dataset into a new file."""
    dataset.dump_to_store(H5NetCDFStore(file), encoding=encoding)


def open_lazily(path: Path) -> xr.Dataset:
    """Open a file, whose values are read when they are asked for."""
    manager = CachingFileManager(netcdf_file, str(path), mode="r")
    dataset = xr.open_dataset(H5NetCDFStore(manager, mode="r"))
    dataset.encoding["source"] = str(path)
    return dataset
