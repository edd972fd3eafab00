"""The page and the window show the dam's surface, its motion and its stress; refusals name the remedy."""

import base64
import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from romdam.cli import app
from romdam.core.errors import ResultError
from romdam.geometry.elements import SOLIDS
from romdam.pipelines.views import view_result
from romdam.postprocess.stress.summary import principal_stresses
from romdam.results.series import Frames, frame_times
from romdam.visual.view.moving import _corner_facets, moving
from romdam.visual.view.page import MISSING, MOST

FRAMES = Frames(5, (0.5, 1.5))


@pytest.fixture
def result(result):
    result.dataset.attrs["title"] = "left < right & </script>"
    return result


def unpacked(text, kind, *shape):
    return np.frombuffer(base64.b64decode(text), kind).reshape(*shape)


def read_page(path):
    text = path.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    return text, json.loads(found.group(1))


def test_page_holds_the_motion_of_every_corner(result, tmp_path):
    path = view_result(result, tmp_path / "new" / "dam.html", FRAMES)
    text, data = read_page(path)
    times = frame_times(result, FRAMES)
    assert data["times"] == pytest.approx(list(times)) and len(times) == 5
    expected = np.concatenate(
        [result.displacement(b, times=list(times)).values for b in result.blocks], axis=1
    )
    found = unpacked(data["moved"], "<i2", 5, 16, 3) * data["most"] / MOST
    np.testing.assert_allclose(found, expected, atol=0.51 * data["most"] / MOST)
    points = np.concatenate([result.points(b) for b in result.blocks])
    np.testing.assert_allclose(unpacked(data["points"], "<f4", 16, 3), points)
    assert [block["name"] for block in data["blocks"]] == ["left", "right"]
    size = np.linalg.norm(expected, axis=2).max()
    assert data["fields"][0]["high"] == pytest.approx(size) and data["fields"][0]["low"] == 0.0
    assert data["title"] == "left < right & </script>", "texts neither end the data nor the page"
    assert "<title>left &lt; right &amp; &lt;/script&gt;" in text


def test_page_needs_no_network(result, tmp_path):
    text, _ = read_page(view_result(result, tmp_path / "dam.html", FRAMES))
    for outside in ("http:", "https:", "<link", " src=", "url(", "@import", "import(", "fetch(", "{{"):
        assert outside not in text


def test_page_holds_the_stress_where_it_is_known(result, tmp_path):
    _, data = read_page(view_result(result, tmp_path / "dam.html", FRAMES))
    names = [field["name"] for field in data["fields"]]
    assert names[:4] == ["displacement relative to the base", *(f"displacement along {x}" for x in "xyz")]
    if "stress_file" not in result.dataset.attrs:
        assert len(names) == 4


def test_stress_of_nodes_without_any_is_missing(result, monkeypatch, tmp_path):
    """The left block has stress at its nodes 0 to 3 alone; the right one has none."""
    rng, known = np.random.default_rng(5), np.arange(4)
    result.dataset.attrs["stress_file"] = "there"
    kept = np.isin(result.dataset.stress_node_number.values, known)
    result.dataset = result.dataset.isel(stress_node=kept)
    six = rng.normal(size=(5, 4, 6)) * 1e6
    monkeypatch.setattr(
        type(result), "stress", lambda self, block, nodes, times: type("Array", (), {"values": six})()
    )
    shown = moving(result, FRAMES).fields[-1]
    assert shown.name == "major principal stress" and shown.signed
    np.testing.assert_allclose(shown.values[:, :4], principal_stresses(six)[..., 0])
    assert np.isnan(shown.values[:, 4:]).all()
    _, data = read_page(view_result(result, tmp_path / "dam.html", FRAMES))
    field = data["fields"][-1]
    values = unpacked(field["values"], "<i2", 5, 16)
    assert (values[:, 4:] == MISSING).all()
    np.testing.assert_allclose(
        values[:, :4] * field["most"] / MOST, shown.values[:, :4], atol=field["most"] / MOST
    )


def test_components_follow_the_stream(result):
    result.dataset.attrs["upstream"] = np.array([0.0, 1.0, 0.0])
    shown = moving(result, FRAMES)
    down = next(field for field in shown.fields if field.name == "displacement downstream")
    np.testing.assert_allclose(down.of(shown.moved[2], 2), -1e3 * shown.moved[2][:, 1])
    assert down.low == pytest.approx(min(0.0, -shown.moved[..., 1].max()))


def area(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def test_surface_of_a_cube_is_six_squares(result):
    for one in moving(result, FRAMES).surfaces:
        assert area(one.points, one.triangles) == pytest.approx(6.0)
        assert len(one.edges) == 12


@pytest.mark.parametrize("element", SOLIDS.values(), ids=lambda element: element.name)
def test_every_element_has_its_facets(element):
    facets = _corner_facets(element.name, np.arange(len(element.nodes))[None])
    assert len(facets) == len(SOLIDS[element.linear].facets) and facets.max() < element.corners
    normals = []
    for facet in facets:
        corners = element.nodes[list(dict.fromkeys(facet.tolist()))]
        a, b, c = corners[0], corners[1], corners[2]
        normals.append(np.cross(b - a, c - a) @ (corners.mean(axis=0) - element.nodes.mean(axis=0)))
    assert (np.array(normals) > 0.0).all(), "outward"


def test_two_cells_that_touch_have_no_facet_between(result, monkeypatch):
    cube = np.array([[0, 1, 2, 3, 4, 5, 6, 7], [4, 5, 6, 7, 8, 9, 10, 11]])
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float)
    points = np.concatenate([np.c_[square, np.full(4, z)] for z in (0.0, 1.0, 2.0)])
    from romdam.visual.view import moving as module

    monkeypatch.setattr(type(result), "cells", lambda self, name: ("hex8", cube))
    monkeypatch.setattr(type(result), "points", lambda self, name: points)
    surface, nodes = module._surface(result, "left")
    assert area(surface.points, surface.triangles) == pytest.approx(10.0)
    np.testing.assert_array_equal(nodes, np.arange(12))


def test_no_display_is_told_what_to_do_instead(result, monkeypatch):
    pytest.importorskip("pyvista")
    from romdam.visual.view import window

    monkeypatch.setattr(window, "refuse_without_renderer", lambda: None)
    monkeypatch.setattr(window.sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(ResultError, match=r"quake.nc: a window needs a display, .* --html FILE, .* xvfb-run"):
        view_result(result, None, FRAMES)


def test_window_steps_through_times_and_fields(result):
    pytest.importorskip("pyvista")
    from romdam.visual import rendering
    from romdam.visual.view.window import Window

    try:
        rendering.refuse_without_renderer()
    except ResultError as error:
        pytest.skip(str(error))
    shown = moving(result, FRAMES)
    window = Window(shown, off_screen=True)
    window.move_to(shown.times[1] + 0.001)
    np.testing.assert_allclose(window.surface.points, shown.points + shown.scale * shown.moved[1], rtol=1e-5)
    np.testing.assert_allclose(
        window.surface["values"], 1e3 * np.linalg.norm(shown.moved[1], axis=1), rtol=1e-6
    )
    for axis in range(3):
        window.next_field()
        np.testing.assert_allclose(window.surface["values"], 1e3 * shown.moved[1][:, axis], rtol=1e-6)
        assert len(window.plotter.scalar_bars) == 1
    window.plotter.close()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--window", "3", "1"], "goes from a first to a later second"),
        (["--frames", "0"], "--frames"),  # what follows differs by the version of typer
    ],
)
def test_wrong_options_are_refused(result, options, words):
    answer = CliRunner().invoke(app, ["view", str(result.path), "--html", "x.html", *options])
    assert answer.exit_code == 2 and words in answer.output


def test_command_writes_the_page(result, tmp_path):
    answer = CliRunner().invoke(app, ["view", str(result.path), "--html", str(tmp_path / "dam.html")])
    assert answer.exit_code == 0 and "dam.html" in answer.output.replace("\n", "")
    assert (tmp_path / "dam.html").stat().st_size > 10_000
