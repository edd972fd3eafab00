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
from romdam.core.display_units import SI, DisplayUnits
from romdam.core.scene import Block, Reservoir, Scene
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


def draw_scene(scene: Scene, path: Path, title: str = "", system: DisplayUnits = SI) -> Path:
    """Draw a scene from two sides, upstream first where the water says which that is.

    Where there is rock, the second panel leaves it out and shows the dam alone.

    Raises
    ------
    ResultError
        where 3-D pictures cannot be drawn, or the file not be written.
    """
    water = scene.find(Reservoir)
    rock, upstream = rock_blocks(scene), None if water is None else water.upstream
    dam = [name for name in scene.blocks if name not in rock]
    colours = {name: BLOCKS[k % len(BLOCKS)] for k, name in enumerate(dam)}
    colours |= {name: ROCK[k % len(ROCK)] for k, name in enumerate(rock)}
    before, behind = _DIRECTIONS
    if upstream is not None:  # from upstream and from downstream, a little from the side and from above
        aside, up = np.cross([0.0, 0.0, 1.0], upstream), np.array([0.0, 0.0, 0.6])
        before, behind = upstream + 0.5 * aside + up, -upstream + 0.5 * aside + up
    second = side_name(behind, upstream) + ("" if len(dam) == len(scene.blocks) else ", the dam alone")
    images = {
        side_name(before, upstream): _view(scene, colours, list(scene.blocks), before),
        second: _view(scene, colours, dam, behind),
    }

    labels = []
    for name, block in scene.blocks.items():
        material = block.material
        (rho, density), (E, stress) = system.suited("kg m-3", material.rho), system.suited("Pa", material.E)
        mass = f"{material.rho / rho:.0f} {density}" if material.rho > 0.0 else "massless"
        text = f"{name}: {block.element}, {material.E / E:.3g} {stress}, {mass}"
        labels.append((text, colours[name]))
    if len(labels) > _LEGEND:
        labels = [*labels[: _LEGEND - 1], (f"and {len(labels) - _LEGEND + 1} more blocks", "white")]
    lines = []
    if scene.joints:
        gaps = sum(len(joint.gap) for joint in scene.joints.values())
        lines.append((f"{len(scene.joints)} joint{'s' * (len(scene.joints) > 1)}, {gaps} gaps", JOINT))
    if water is not None:
        foot, length = system.foot
        lines.append((f"water to {water.level / foot:.4g} {length}", WATER))
    with mpl.rc_context(STYLE):
        figure, _ = image_panels(images, title)
        handles: list[Artist] = [Patch(facecolor=c, edgecolor=EDGES, label=text) for text, c in labels]
        handles += [Line2D([], [], color=c, lw=3, label=text) for text, c in lines]
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
    for joint in scene.joints.values():  # the outline of its face
        face = _facets_of(scene.blocks[joint.blocks[0]], joint.nodes[0])
        if face is not None:
            rim = face.extract_feature_edges(boundary_edges=True, feature_edges=False, manifold_edges=False)
            picture.add(rim, color=JOINT, line_width=8)
    water = scene.find(Reservoir)
    for water_face in water.faces if water else ():  # the water line on it
        wet = _facets_of(scene.blocks[water_face.block], np.unique(water_face.facets))
        low = 1e-6 * water.depth if water else 0.0
        line = wet.slice(normal="z", origin=(0.0, 0.0, water.level - low)) if wet and water else None
        if line is not None and line.n_points:
            picture.add(line, color=WATER, line_width=10)
    return picture.image()


def _facets_of(block: Block, nodes: NDArray[np.int64]) -> pyvista.PolyData | None:
    """The part of a block's surface whose corners are all among some nodes."""
    whole = surface(grid(block.element, block.points, block.cells, straight=True))
    piece = whole.extract_points(np.isin(whole["vtkOriginalPointIds"], nodes), adjacent_cells=False)
    return piece.extract_surface(algorithm=None) if piece.n_cells else None
