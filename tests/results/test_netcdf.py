"""Files over HDF5 objects that are remembered hold what h5netcdf by itself writes and reads."""

import io
import pickle

import h5netcdf
import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr
from xarray.backends import H5NetCDFStore
from xarray.testing import assert_identical

from romdam.results.netcdf import netcdf_file, open_lazily, write_netcdf


@pytest.fixture
def dataset():
    """Coordinates that replace what stands for their dimension, and a dimension without one."""
    time, joint = np.arange(5.0), ["J1", "J2", "J3"]
    return xr.Dataset(
        {
            "opening": (("time", "joint"), np.arange(15.0).reshape(5, 3), {"units": "m"}),
            "state": (("time", "gap"), np.arange(20, dtype=np.uint8).reshape(5, 4)),
            "factor": ((), 1.5),
        },
        {"time": ("time", time, {"units": "s"}), "joint": joint, "place": ("gap", np.arange(4))},
        {"title": "a dam", "levels": np.array([1.0, 2.5])},
    )


ENCODING = {"state": {"compression": "gzip", "compression_opts": 1, "chunksizes": (2, 4)}}


def objects(stream):
    """Every object of an HDF5 file, in order: its kind, shape, type, chunks, values and attributes."""
    found = []
    with h5py.File(stream, "r") as file:

        def of(path, item):
            attributes = {}
            for name, value in item.attrs.items():
                references = {"DIMENSION_LIST": lambda v: [r for row in v for r in row],
                              "REFERENCE_LIST": lambda v: [row[0] for row in v]}.get(name)  # fmt: skip
                attributes[name] = (
                    [file[r].name for r in references(value)] if references else np.asarray(value).tolist()
                )
            layout = ()
            if isinstance(item, h5py.Dataset):
                values = np.asarray(item[()]).tolist()
                layout = item.shape, str(item.dtype), item.chunks, item.maxshape, values
            found.append(repr((path, layout, attributes)))  # of which NaN is like NaN

        of("/", file)
        file.visititems(of)
    return found


def add_group(file):
    """A group of a dimension of its own with a variable of that name, and one of the file's."""
    group = file.create_group("final")
    group.dimensions["row"] = 2
    group.create_variable("row", ("row",), float, data=np.array([3.0, 4.0]))
    group.create_variable("moved", ("row", "gap"), float, data=np.ones((2, 4)))
    group.attrs["law"] = "friction"


def test_what_is_written_is_what_h5netcdf_writes(dataset, tmp_path):
    theirs, ours = io.BytesIO(), io.BytesIO()
    with h5netcdf.File(theirs, "w") as file:
        dataset.dump_to_store(H5NetCDFStore(file), encoding=ENCODING)
        add_group(file)
    with netcdf_file(ours, "w") as file:
        write_netcdf(dataset, file, ENCODING)
        add_group(file)
    assert len(objects(theirs)) > 10 and objects(ours) == objects(theirs)
    (tmp_path / "a.nc").write_bytes(ours.getvalue())
    with netCDF4.Dataset(tmp_path / "a.nc") as plain:
        np.testing.assert_array_equal(plain["final/row"][:], [3.0, 4.0])
        np.testing.assert_array_equal(plain["state"][:], dataset.state)


def test_what_is_read_is_what_xarray_reads_and_can_be_sent(dataset, tmp_path):
    path = tmp_path / "a.nc"
    dataset.to_netcdf(path, engine="h5netcdf", encoding=ENCODING)
    with xr.open_dataset(path, engine="h5netcdf") as theirs, open_lazily(path) as ours:
        sent = pickle.loads(pickle.dumps(ours))
        assert_identical(ours, theirs)
        assert_identical(sent, theirs)
        assert ours.encoding["source"] == theirs.encoding["source"]
        for name in theirs.variables:
            assert repr(ours[name].encoding) == repr(theirs[name].encoding), name
        sent.close()
    with h5py.File(path, "r+"):  # nothing holds it any more
        pass


def test_no_object_is_looked_up_twice(dataset, tmp_path, monkeypatch):
    path, looked_up = tmp_path / "a.nc", []
    dataset.to_netcdf(path, engine="h5netcdf")
    look_up = h5py.Group.__getitem__

    def counting(group, name):
        looked_up.append(name)
        return look_up(group, name)

    monkeypatch.setattr(h5py.Group, "__getitem__", counting)
    with open_lazily(path) as ours:
        ours.load()
    names = [name.strip("/") for name in looked_up if isinstance(name, str)]
    assert {*dataset.variables} <= {*names} and len(names) == len({*names})
    looked_up.clear()
    with netcdf_file(io.BytesIO(), "w") as file:
        write_netcdf(dataset, file, {})
        add_group(file)
    of_group = [name for name in looked_up if isinstance(name, str) and "moved" in name]
    assert len(of_group) == 1, "those in a group neither, while they are written"


def test_what_is_no_hdf5_is_an_error_and_no_more(tmp_path, capsys):
    (tmp_path / "a.nc").write_text("no")
    with pytest.raises(OSError, match="signature"):
        open_lazily(tmp_path / "a.nc")
    assert capsys.readouterr() == ("", "")
