"""A picture of a scene: blocks in colours, joints and water marked, materials in the legend."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from romdam.core.arrays import Floats
from romdam.core.scene import Block, Scene
from romdam.results.case import rock_blocks
from romdam.visual.plots import save_figure
from romdam.visual.rendering import EDGES, Image, Picture, grid, surface
from romdam.visual.style import STYLE, image_panels, side_name

if TYPE_CHECKING:
    import pyvista


# Okabe and Ito's palette and lighter tints of it: neighbours differ in colour and in lightness
BLOCKS = ("#0072B2", "#E69F00", "#56B4E9", "#D55E00", "#9FD3C7", "#CC79A7", "#F0E442", "#8DA0CB")
ROCK = ("#8C8C8C", "#B3A394", "#6F7F73", "#A9A9B8")
JOINT, WATER = "#000000", "#1F6FEB"
_DIRECTIONS = (np.array([-1.0, -1.6, 0.9]), np.array([1.0, 1.6, 0.9]))
_LEGEND = 16  # entries that a legend can take


def draw_scene(scene: Scene, path: Path, title: str = "") -> Path:
    """Draw a scene from two sides, upstream first where the water says which that is.

    Where there is rock, the second panel leaves it out and shows the dam alone.

    Raises
    ------
    ResultError
        where 3-D pictures cannot be drawn, or the file not be written.
    """
    colours = _colours(scene)
    before, behind = _directions(scene)
    dam = [name for name in scene.blocks if name not in rock_blocks(scene)]
    upstream = scene.reservoir.upstream if scene.reservoir else None
    names = side_name(before, upstream), side_name(behind, upstream)
    images = {
        names[0]: _view(scene, colours, list(scene.blocks), before),
        names[1] + ("" if len(dam) == len(scene.blocks) else ", the dam alone"): _view(
            scene, colours, dam, behind
        ),
    }
    with mpl.rc_context(STYLE):
        figure, _ = image_panels(images, title)
        handles: list[Artist] = [
            Patch(facecolor=colour, edgecolor=EDGES, label=text) for text, colour in _legend(scene, colours)
        ]
        handles += [Line2D([], [], color=c, lw=3, label=text) for text, c in _marks(scene)]
        figure.legend(handles=handles, loc="outside lower center", ncols=min(3, len(handles)))
    return save_figure(figure, path)


def _view(scene: Scene, colours: dict[str, str], names: list[str], direction: Floats) -> Image:
    points = np.concatenate([scene.blocks[name].points for name in names])
    picture, rock = Picture((points.min(axis=0), points.max(axis=0)), direction), rock_blocks(scene)
    for name in names:
        block = scene.blocks[name]
        shell = surface(grid(block.element, block.points, block.cells, straight=True))
        opacity = 0.35 if name in rock else 1.0
        picture.add(
            shell, color=colours[name], opacity=opacity, show_edges=True, edge_color=EDGES, line_width=0.5
        )
    _add_joints(picture, scene)
    _add_water(picture, scene)
    return picture.image()


def _directions(scene: Scene) -> tuple[Floats, Floats]:
    """From where to look: from upstream and from downstream, a little from the side and from above."""
    if scene.reservoir is None:
        return _DIRECTIONS
    along = scene.reservoir.upstream
    aside = np.cross([0.0, 0.0, 1.0], along)
    up = np.array([0.0, 0.0, 0.6])
    return along + 0.5 * aside + up, -along + 0.5 * aside + up


def _colours(scene: Scene) -> dict[str, str]:
    rock = rock_blocks(scene)
    dam = [name for name in scene.blocks if name not in rock]
    return {name: BLOCKS[k % len(BLOCKS)] for k, name in enumerate(dam)} | {
        name: ROCK[k % len(ROCK)] for k, name in enumerate(rock)
    }


def _add_joints(picture: Picture, scene: Scene) -> None:
    """The outline of every joint's face."""
    for joint in scene.joints.values():
        face = _facets_of(scene.blocks[joint.blocks[0]], joint.nodes[0])
        if face is not None:
            rim = face.extract_feature_edges(boundary_edges=True, feature_edges=False, manifold_edges=False)
            picture.add(rim, color=JOINT, line_width=8)


def _facets_of(block: Block, nodes: NDArray[np.int64]) -> pyvista.PolyData | None:
    """The part of a block's surface whose corners are all among some nodes."""
    whole = surface(grid(block.element, block.points, block.cells, straight=True))
    piece = whole.extract_points(np.isin(whole["vtkOriginalPointIds"], nodes), adjacent_cells=False)
    return piece.extract_surface(algorithm=None) if piece.n_cells else None


def _add_water(picture: Picture, scene: Scene) -> None:
    """The water line on the wet faces."""
    water = scene.reservoir
    for face in water.faces if water else ():
        wet = _facets_of(scene.blocks[face.block], np.unique(face.facets))
        low = 1e-6 * water.depth if water else 0.0
        line = wet.slice(normal="z", origin=(0.0, 0.0, water.level - low)) if wet and water else None
        if line is not None and line.n_points:
            picture.add(line, color=WATER, line_width=10)


def _legend(scene: Scene, colours: dict[str, str]) -> list[tuple[str, str]]:
    entries = [(f"{name}: {_material(block)}", colours[name]) for name, block in scene.blocks.items()]
    if len(entries) > _LEGEND:
        entries = [*entries[: _LEGEND - 1], (f"and {len(entries) - _LEGEND + 1} more blocks", "white")]
    return entries


def _marks(scene: Scene) -> list[tuple[str, str]]:
    """Text and colour of what is drawn as lines."""
    marks = []
    if scene.joints:
        gaps = sum(len(joint.gap) for joint in scene.joints.values())
        marks.append((f"{len(scene.joints)} joint{'s' * (len(scene.joints) > 1)}, {gaps} gaps", JOINT))
    if scene.reservoir is not None:
        marks.append((f"water to {scene.reservoir.level:g} m", WATER))
    return marks


def _material(block: Block) -> str:
    material = block.material
    density = f"{material.rho:.0f} kg/m³" if material.rho > 0.0 else "massless"
    return f"{block.element}, {material.E / 1e9:.3g} GPa, {density}"
