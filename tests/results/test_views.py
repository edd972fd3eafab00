"""Pictures show what they should, series read back the same, refusals name the remedy."""

import csv
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import matplotlib as mpl
import meshio
import numpy as np
import pytest
import xarray as xr
from matplotlib.image import imread
from PIL import Image

from romdam.config import parse_config
from romdam.config.load import Job
from romdam.core.errors import ResultError
from romdam.geometry.elements import SOLIDS
from romdam.pipelines.views import PlotOptions, plot_result, show_scene
from romdam.postprocess.maxima import AS_DISPLACEMENT, HEAD, INSTANT, explained, maxima
from romdam.results import series
from romdam.results.export import write_series
from romdam.results.series import Frames, dam_blocks, frame_times, worst_displacement_time
from romdam.results.table import write_maxima
from romdam.results.vtu import mesh_of, write_vtu
from romdam.terminal.tables import peaks_table
from romdam.visual import field_views, rendering

pytest.importorskip("pyvista")


VOLUMES = {"hex8": 8.0, "tet4": 1 / 6, "wedge6": 1 / 2, "pyramid5": 4 / 3}


@pytest.mark.parametrize("element", SOLIDS.values(), ids=lambda element: element.name)
def test_every_element_is_a_cell_of_vtk(element):
    cells = np.arange(len(element.nodes))[None]
    for straight, own in ((False, element), (True, SOLIDS[element.linear])):
        grid = rendering.grid(element.name, element.nodes, cells, straight)
        assert grid.celltypes.tolist() == [own.cell.vtk] and grid.cells[0] == len(own.nodes)
        volume = grid.compute_cell_sizes()["Volume"][0]
        volume = abs(volume) if "wedge" in own.name else volume  # VTK before 9.7 has its sign the other way
        assert volume == pytest.approx(VOLUMES[element.linear])


@pytest.fixture(scope="module")
def drawable():
    """Skip where this machine has no OpenGL, with the reason that the command gives."""
    try:
        rendering.refuse_without_renderer()
    except ResultError as error:
        pytest.skip(str(error))


def colours(path, box=slice(None)):
    """Distinct colours of a picture, (n, 3) in 0 to 255."""
    pixels = (imread(path)[box, :, :3] * 255).round().astype(int)
    return np.unique(pixels.reshape(-1, 3), axis=0)


def near(path, colour, slack=40):
    """Pixels within a distance of a colour."""
    pixels = imread(path)[..., :3] * 255
    return int((np.abs(pixels - np.array(colour)).max(axis=-1) < slack).sum())


def job_of_two(**water):
    sizes = {"size": [2, 2, 4], "element_size": 1.0}
    faces = [{"block": b, "face": "xmin"} for b in ("left", "right")]
    raw = {
        "title": "two blocks",
        "materials": {"c": {"E": "30 GPa", "nu": 0.2, "rho": 2400}},
        "blocks": {
            "left": {"material": "c", "box": {"origin": [0, 0, 0], "element": "hex20", **sizes}},
            "right": {"material": "c", "box": {"origin": [0, 2, 0], "element": "hex20", **sizes}},
        },
        "supports": [{"block": b, "face": "zmin"} for b in ("left", "right")],
        "joints": {"j": {"between": ["left", "right"], "normal_stiffness": "16 GPa/m"}},
        "water": {"level": 3.2, "faces": faces, "model": "incompressible"},
        "records": [{"file": "none.txt", "unit": "g", "dt": 0.01, "components": {"y": 1}}],
        "model": {"modes": 5},
        "transient": {"finest_step": 0.01},
    }
    return Job(parse_config(raw | water, "two.yaml"), Path("two.yaml"))


def test_scene_shows_blocks_joint_and_water(drawable, tmp_path):
    path = show_scene(job_of_two(), tmp_path)
    assert path.name == "two-scene.png"
    top = imread(path).shape
    assert top[0] > 500 and top[1] > 1000
    assert near(path, (0, 114, 178)) > 5000, "the left block"
    assert near(path, (230, 159, 0)) > 5000, "the right block"
    assert near(path, (31, 111, 235), 25) > 100, "the water line"
    assert near(path, (0, 0, 0), 25) > 300, "the joint"
    assert not list(tmp_path.glob(".*")), "no temporary file is left"


def test_scene_without_water_has_no_water_line(drawable, tmp_path, monkeypatch):
    monkeypatch.setattr(rendering, "SIZE", (300, 240))
    path = show_scene(job_of_two(water=None), tmp_path)
    assert near(path, (31, 111, 235), 25) < 10


@pytest.mark.slow
def test_plot_makes_figures_fields_series_and_animation(drawable, result, tmp_path, monkeypatch):
    monkeypatch.setattr(rendering, "SIZE", (240, 200))
    monkeypatch.setattr(field_views, "_FRAME_SIZE", (160, 120))
    wanted = PlotOptions(fields=True, vtu=True, animation=True, frames=3, window=(0.5, 1.5))
    paths = plot_result(result, tmp_path / "out", wanted)
    names = {p.name.removeprefix("quake") for p in paths}
    assert {f"-field_{n}.png" for n in ("displacement", "principal_stress", "vertical_stress")} <= names
    assert {".pvd", "-motion.gif", "-maxima.csv", "-stress.png", "-stress_damage.png"} <= names
    assert all(p.stat().st_size > 0 for p in paths)
    red_or_blue = colours(tmp_path / "out" / "quake-field_principal_stress.png")
    assert (np.ptp(red_or_blue, axis=1) > 60).sum() > 20, "the field has colours"
    with Image.open(tmp_path / "out" / "quake-motion.gif") as gif:
        assert gif.n_frames == 3 and gif.size == (160, 120)


def test_series_holds_the_displacement_of_every_node_at_every_frame(result, tmp_path):
    write_series(result, tmp_path, "quake", Frames(4, (0.5, 1.5)), lambda done, total: None)
    rows = ElementTree.parse(tmp_path / "quake.pvd").getroot().findall("./Collection/DataSet")
    times = frame_times(result, Frames(4, (0.5, 1.5)))
    assert [float(row.get("timestep")) for row in rows] == pytest.approx(list(times))
    mesh = meshio.read(tmp_path / rows[2].get("file"))
    expected = [result.displacement(b, times=times[2]).values[0] for b in result.blocks]
    np.testing.assert_allclose(mesh.point_data["displacement"], np.concatenate(expected))
    np.testing.assert_allclose(mesh.points, np.concatenate([result.points(b) for b in result.blocks]))
    assert mesh.point_data["max_principal_stress"].shape == (16,)
    assert np.isnan(mesh.point_data["max_principal_stress"][8:]).all(), "the right block has no stress"
    assert [len(c.data) for c in mesh.cells] == [2] or [len(c.data) for c in mesh.cells] == [1, 1]


def test_series_names_its_blocks_where_readers_find_them(result, tmp_path):
    """By meshio and by VTK; a name may have what XML must not."""
    import pyvista

    path = tmp_path / "quake.vtu"
    numbers = [np.full(1, k) for k in range(2)]
    mesh = mesh_of((result.points(name), *result.cells(name)) for name in result.blocks)
    write_vtu(mesh, ['left & "first"', "right"], path)
    for fields in (meshio.read(path).field_data, pyvista.read(path).field_data):
        found = {name: int(np.ravel(values)[0]) for name, values in fields.items()}
        assert found == {'left & "first"': 0, "right": 1}
    np.testing.assert_array_equal(pyvista.read(path).cell_data["block"], np.concatenate(numbers))
    for k, name in enumerate(result.blocks):  # each block's cells have its own points
        cells = pyvista.read(path).threshold((k, k), scalars="block")
        points = result.points(name)
        np.testing.assert_allclose(cells.bounds, np.ravel([points.min(axis=0), points.max(axis=0)], "F"))
    write_series(result, tmp_path, "quake", Frames(1), lambda done, total: None)
    assert list(meshio.read(tmp_path / "quake-0000.vtu").field_data) == result.blocks


def test_maxima_tell_round_off_and_instants(result):
    """Displacement along x is round-off of that along y; impacts are beside their means."""
    dataset = result.dataset.load().copy(deep=True)
    largest = float(abs(dataset.displacement.sel(component="y")).max())
    dataset.peak_displacement.loc[{"component": "x"}] = 1e-17
    dataset.peak_displacement.loc[{"component": "z"}] = 2e-8 * largest
    dataset["peak_compressive_stress"] = -0.0 * dataset.peak_compressive_stress
    rows = {(row.quantity, row.where): row for row in maxima(dataset)}
    tiny = next(row for (name, _), row in rows.items() if name == "displacement x")
    assert repr(tiny.value) == "0.0" and tiny.note.startswith("below ") and tiny.note.endswith(" m")
    assert not tiny.where and not tiny.when
    follows = next(row for (name, _), row in rows.items() if name == "acceleration x")
    assert follows[1:] == (0.0, "m s-2", "", "", AS_DISPLACEMENT)
    moves = next(row for (name, _), row in rows.items() if name == "acceleration z")
    assert moves.value != 0.0 and moves.where and moves.when and moves.note == INSTANT
    limit = float(tiny.note.split()[1])
    assert limit > 1e-17 and limit == pytest.approx(1e-8 * max(largest, dataset.peak_slip.max()), rel=0.5)
    small = next(row for (name, _), row in rows.items() if name == "displacement z")
    assert small.value == pytest.approx(2e-8 * largest) and not small.note
    instant = rows["joint compression", "J1"]
    assert instant.note == INSTANT and repr(instant.value) == "0.0", "no -0"
    mean = rows["joint compression, mean of 0.05 s", "J1"]
    forces = dataset.mean_normal_force[:, dataset.gap_joint.values == "J1"]
    assert mean.value == pytest.approx(float(forces.min()) / 0.5) and not mean.note
    cells = {column.header: list(column.cells) for column in peaks_table({"quake": dataset}).columns}
    assert cells["compression, mean of a writing interval [MPa]"][0] == f"{1e-6 * mean.value:.2f}"
    before = dataset.drop_vars("peak_mean_compressive_stress")
    assert list(peaks_table({"quake": before}).columns[4].cells) == ["-", "-"]
    told = explained(list(rows.values()))
    assert any("depends on the step" in line for line in told) and any("1e-08" in line for line in told)


def test_views_are_named_and_colours_end_where_values_do(result):
    """White stays at zero: the colour of a value depends on the larger end alone."""
    from matplotlib.colors import Normalize

    assert list(field_views._sides(result)) == ["from -y, and -x", "from +y, and +x"]
    result.dataset.attrs["upstream"] = np.array([1.0, 0.0, 0.0])
    sides = field_views._sides(result)
    assert list(sides) == ["from upstream", "from downstream"] and sides["from upstream"][0] > 0.0
    field = field_views._stress(result, "worst_principal_stress", 0.5)
    values = xr.DataArray(np.linspace(-1.0, 4.0, 1001))
    norm, beyond = field_views._norm(values, field)
    assert (norm.vmin, norm.vmax, beyond) == (pytest.approx(-0.95), pytest.approx(3.95), "both")
    whole, cut = mpl.colormaps["RdBu_r"], field.colormap(Normalize(-1.0, 4.0))
    np.testing.assert_allclose(cut(1.0), whole(1.0))
    np.testing.assert_allclose(cut(0.2), whole(0.5), atol=0.02)
    np.testing.assert_allclose(cut(0.0), whole(0.375), atol=0.02)
    assert field_views._norm(values + 2.0, field)[0].vmin == 0.0, "zero is within"


def test_rock_is_no_part_of_the_dam_even_where_a_joint_touches_it(result):
    assert dam_blocks(result) == ["left", "right"]
    result.dataset.attrs["rock_blocks"] = '["right"]'
    assert dam_blocks(result) == ["left"]


def test_worst_time_is_that_of_the_largest_displacement(result):
    size = [np.linalg.norm(result.displacement(b).values, axis=2).max(axis=1) for b in result.blocks]
    step = int(np.max(size, axis=0).argmax())
    assert worst_displacement_time(result) == result.dataset.time.values[step]


@pytest.mark.parametrize("count", range(1, 8))
@pytest.mark.parametrize("window", [None, (0.4, 1.7)])
def test_frames_show_the_largest_displacement(result, count, window, monkeypatch):
    """Of every node, though two of a block are looked at first."""
    monkeypatch.setattr(series, "_SAMPLES", 2)
    monkeypatch.setattr(series, "_NUMBERS", 50)
    moved = [result.displacement(b) for b in result.blocks]
    inside = slice(None) if window is None else slice(*window)
    largest = max(float(np.linalg.norm(one.sel(time=inside), axis=2).max()) for one in moved)
    times = frame_times(result, Frames(count, window))
    assert len(times) == count and (np.diff(times) > 0.0).all()
    shown = [result.displacement(b, times=list(times)).values for b in result.blocks]
    assert max(float(np.linalg.norm(one, axis=2).max()) for one in shown) == largest


def test_window_without_times_is_refused(result):
    with pytest.raises(ResultError, match=r"no written time lies between 5 and 6 s, the result has 0 to 2 s"):
        frame_times(result, Frames(4, (5.0, 6.0)))


def test_maxima_are_those_of_the_dataset(result, tmp_path):
    dataset = result.dataset
    table = {(row.quantity, row.where): row.value for row in maxima(dataset)}
    assert table["joint opening", "J2"] == float(dataset.peak_opening.sel(joint="J2"))
    largest = float(dataset.max_principal_stress.max())
    assert any(name == "largest principal stress" and value == largest for (name, _), value in table.items())
    write_maxima(dataset, tmp_path, "quake")
    with (tmp_path / "quake-maxima.csv").open() as file:
        rows = list(csv.reader(file))
    assert tuple(rows[0]) == HEAD and len(rows) == len(maxima(dataset)) + 1


def test_machine_without_opengl_is_told_what_to_install(monkeypatch):
    rendering.refuse_without_renderer.cache_clear()
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr(rendering.sys, "platform", "linux")
    crash = subprocess.CompletedProcess([], -11)
    monkeypatch.setattr(rendering.subprocess, "run", lambda *a, **k: crash)
    with pytest.raises(ResultError, match=r"VTK found none; .* apt-get install libegl1"):
        rendering.refuse_without_renderer()


def test_missing_pyvista_is_told_how_to_install(monkeypatch):
    import builtins

    real = builtins.__import__

    def without(name, *rest, **keys):
        if name == "pyvista":
            raise ImportError("No module named 'pyvista'", name="pyvista")
        return real(name, *rest, **keys)

    rendering.refuse_without_renderer.cache_clear()
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ResultError, match=r"pip install 'romdam\[view\]'"):
        rendering.refuse_without_renderer()
