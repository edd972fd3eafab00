"""Displacements rebuilt from the basis file equal basis times coordinates, at any node and time."""

import os
from dataclasses import replace

import h5py
import numpy as np
import pytest
from gravity_dams import DIVISIONS, gravity_dam

import romdam
from romdam import open_result
from romdam.core import sealed
from romdam.core.errors import ResultError
from romdam.core.motion import GroundMotion
from romdam.reduction.basis import Dense, Product, Scaled
from romdam.results import fields
from romdam.results.dataset import build_dataset, write_dataset
from romdam.results.fields import write_model

from .conftest import make_basis, make_case


@pytest.mark.parametrize(("block", "columns"), [("left", slice(0, 3)), ("right", slice(3, 7))])
def test_field_is_basis_times_coordinates(result, case, block, columns):
    expected = case.history.q[:, columns] @ make_basis()[block].vectors.rows().T
    np.testing.assert_allclose(
        result.displacement(block).values.reshape(41, -1), expected, atol=2e-7 * np.abs(expected).max()
    )


def test_nodes_in_any_order_and_times_are_picked(result):
    whole = result.displacement("right")
    some = result.displacement("right", nodes=[5, 1, 5], times=[0.051, 1.0])
    np.testing.assert_allclose(some.values, whole.values[[1, 20]][:, [5, 1, 5]], atol=1e-14)
    assert list(some.point.values) == [5, 1, 5]
    part = result.displacement("right", nodes=2, times=slice(0.5, 1.0))
    assert part.sizes == {"time": 11, "point": 1, "component": 3}


@pytest.mark.parametrize("scaled", [False, True])
def test_a_basis_kept_as_a_product_gives_the_field_that_it_gives_formed(case, job, timing, tmp_path, scaled):
    """Of vectors that differ by a tenth, ten times the round-off of single precision."""
    rng, basis = np.random.default_rng(3), make_basis()
    left = rng.normal(size=(24, 1)) + 0.1 * rng.normal(size=(24, 6))
    product = Product(Dense(left), np.linalg.pinv(left) @ basis["right"].vectors.rows())
    vectors = Scaled(product, np.array([1.0, 2.0, 3.0, 4.0])) if scaled else product
    made = basis | {"right": replace(basis["right"], vectors=vectors)}
    name = write_model(tmp_path, case.scene, made)
    write_dataset(build_dataset(case, job, timing, name), tmp_path / "a.nc")
    expected = (case.history.q[:, 3:7] @ vectors.rows().T).reshape(41, -1, 3)
    with h5py.File(tmp_path / name) as file:
        assert file["blocks/right/basis"].shape == (8, 3, 6) and "mix" not in file["blocks/left"]
        assert fields.stored_digest(file) == file.attrs["content_sha256"]
    with open_result(tmp_path / "a.nc") as opened:
        for nodes in (slice(None), slice(2, 3)):
            found = opened.displacement("right", np.arange(8)[nodes]).values
            np.testing.assert_allclose(found, expected[:, nodes], atol=2e-6 * np.abs(expected).max())
        with pytest.raises(ResultError, match="from 0 to 7"):
            opened.displacement("right", 8)


def test_rock_is_left_out_unless_the_job_asks_for_it(case, job, timing, tmp_path):
    """The dam's displacement stays what it was; asked for that of rock, the remedy is said."""
    name = write_model(tmp_path, case.scene, make_basis(), left_out=["right"])
    dataset = build_dataset(case, job, timing, name).assign_attrs(rock_blocks='["right"]')
    write_dataset(dataset, tmp_path / "a.nc")
    with open_result(tmp_path / "a.nc") as opened:
        assert opened.blocks == ["left"]
        expected = case.history.q[:, :3] @ make_basis()["left"].vectors.rows().T
        disp = opened.displacement("left").values.reshape(41, -1)
        np.testing.assert_allclose(disp, expected, atol=2e-7 * np.abs(expected).max())
        with pytest.raises(ResultError, match=r"rock, of block 'right' too, was not kept; .*\{rock: true\}"):
            opened.displacement("right")


def test_a_run_keeps_the_dam_and_rock_where_it_is_asked_for(tmp_path):
    """Three monoliths on rock: the same displacement of the dam either way, and that of rock on request."""
    raw = gravity_dam(divisions=DIVISIONS | {"through": 1, "up": 2, "depth": 1, "banks": 1})
    raw |= {
        "damping": {"rayleigh": {"frequencies": [3.0, 20.0], "ratio": 0.05}},
        "loads": {"gravity": [0, 0, -9.81]},
        "model": {"modes": 2},
        "transient": {"finest_step": 0.01},
    }
    motion = GroundMotion.from_arrays("pulse", {"y": np.sin(np.linspace(0.0, 6.28, 21))}, 0.01)
    kept = {}
    for rock in (False, True):
        raw["outputs"] = {"plots": False, "error_estimate": False, "mesh_error": False, "rock": rock}
        outcome = romdam.run(raw, tmp_path / str(rock), motions=motion)
        kept[rock] = outcome.results[0]
    dam = [name for name in kept[True].blocks if not name.startswith("rock")]
    assert kept[False].blocks == dam and len(kept[True].blocks) == 2 * len(dam) + 2
    whole = kept[True].displacement("monolith_2").values
    assert np.abs(kept[True].displacement("rock_2").values).max() > 0.0
    np.testing.assert_array_equal(kept[False].displacement("monolith_2").values, whole)


def test_mesh_comes_with_the_result(result, case):
    np.testing.assert_array_equal(result.points("left"), case.scene.blocks["left"].points)
    element, cells = result.cells("left")
    assert element == "hex8"
    np.testing.assert_array_equal(cells, case.scene.blocks["left"].cells)
    assert result.blocks == ["left", "right"]


def test_wrong_block_or_node_is_named(result):
    with pytest.raises(ResultError, match="no block 'middle'; there are left, right"):
        result.displacement("middle")
    with pytest.raises(ResultError, match="must be from 0 to 7, got 8"):
        result.displacement("left", nodes=8)
    with pytest.raises(ResultError, match="must be from 0 to 7, got -1"):
        result.displacement("left", nodes=-1)


def test_full_order_result_says_what_it_lacks(job, timing, tmp_path):
    write_dataset(build_dataset(make_case(reduced=False), job, timing, None), tmp_path / "a.nc")
    with open_result(tmp_path / "a.nc") as opened, pytest.raises(ResultError, match="full-order result"):
        opened.displacement("left")


def test_basis_is_written_once_and_rewritten_when_broken(case, tmp_path):
    name = write_model(tmp_path, case.scene, make_basis())
    written = (tmp_path / name).stat().st_mtime_ns
    assert write_model(tmp_path, case.scene, make_basis()) == name
    assert (tmp_path / name).stat().st_mtime_ns == written
    (tmp_path / name).write_bytes(b"broken")
    write_model(tmp_path, case.scene, make_basis())
    with h5py.File(tmp_path / name) as file:
        assert set(file["blocks"]) == {"left", "right"}


def test_a_file_of_the_same_model_is_taken_without_its_rows(case, tmp_path, monkeypatch):
    name = write_model(tmp_path, case.scene, make_basis())
    monkeypatch.setattr(fields, "rows_written", lambda *of: pytest.fail("asked for all rows"))
    assert write_model(tmp_path, case.scene, make_basis()) == name
    monkeypatch.undo()
    other = "model-0123456789ab.h5"
    (tmp_path / name).rename(tmp_path / other)
    assert write_model(tmp_path, case.scene, make_basis()) == name  # not the one that is named otherwise


def test_a_folder_of_many_models_is_not_read_whole(case, tmp_path, monkeypatch):
    """Each change of a configuration leaves a model in the folder of its results."""
    basis, names = make_basis(), []
    for _ in range(5):
        basis["left"].vectors.rows()[0, 0] += 1e-3
        names.append(write_model(tmp_path, case.scene, basis))
        os.utime(tmp_path / names[-1], ns=(len(names), len(names)))
    read = []
    examined = sealed.is_sealed
    monkeypatch.setattr(sealed, "is_sealed", lambda path: read.append(path.name) or examined(path))
    assert write_model(tmp_path, case.scene, basis) == names[-1] and read == [names[-1]]
    basis["left"].vectors.rows()[0, 0] += 1e-3
    read.clear()
    assert write_model(tmp_path, case.scene, basis) not in names and read == names[:-3:-1]


@pytest.mark.parametrize("changed", ["points", "cells", "omega2", "participation", "carried"])
def test_a_model_that_differs_in_anything_is_written(case, tmp_path, changed):
    basis, scene = make_basis(), case.scene
    carried = {name: np.zeros((3 * len(block.points), 2)) for name, block in scene.blocks.items()}
    names = {write_model(tmp_path, scene, basis, carried)}
    if changed == "carried":
        carried["left"][4, 1] = 1e-9
    elif changed in ("points", "cells"):
        array = getattr(scene.blocks["left"], changed).copy()
        array[0, 0] += 1
        block = replace(scene.blocks["left"], **{changed: array})
        scene = replace(scene, blocks=scene.blocks | {"left": block})
    else:
        array = getattr(basis["left"], changed) * (1.0 + 1e-15) + 1e-9
        basis["left"] = replace(basis["left"], **{changed: array})
    assert fields._model_digest(scene.blocks, basis, carried) != fields._model_digest(
        case.scene.blocks, make_basis(), {n: np.zeros_like(c) for n, c in carried.items()}
    )
    names.add(write_model(tmp_path, scene, basis, carried))
    assert len(names) == (1 if changed in ("omega2", "participation") else 2)  # the name is of what is read


def test_another_basis_has_another_name(case, tmp_path):
    other = make_basis()
    other["left"].vectors.rows()[0, 0] += 1e-3
    assert write_model(tmp_path, case.scene, other) != write_model(tmp_path, case.scene, make_basis())


def test_basis_file_outside_the_folder_is_never_opened(case, job, timing, tmp_path):
    (tmp_path / "inner").mkdir()
    name = write_model(tmp_path, case.scene, make_basis())
    write_dataset(build_dataset(case, job, timing, f"../{name}"), tmp_path / "inner" / "a.nc")
    with (
        open_result(tmp_path / "inner" / "a.nc") as opened,
        pytest.raises(ResultError, match="cannot be read"),
    ):
        opened.points("left")
