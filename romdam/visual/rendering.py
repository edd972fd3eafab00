"""Off-screen 3-D pictures with PyVista (extra `view`), and whether this machine can draw them."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ResultError
from romdam.geometry.elements import ELEMENTS
from romdam.geometry.meshes.kinds import kinds_of

if TYPE_CHECKING:
    import pyvista


Image = NDArray[np.uint8]
Bounds = tuple[Floats, Floats]

SIZE = (1000, 900)
EDGES = "#404040"
_PROBE = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderWindow

window = vtkRenderWindow()
window.SetOffScreenRendering(True)
window.Render()
raise SystemExit(not window.SupportsOpenGL())
"""  # of PyVista itself it would take 1.1 CPU-s for 0.4
_LIBRARIES = (
    "install Mesa's, on Debian and Ubuntu with: apt-get install libegl1 libgl1 libgl1-mesa-dri libxrender1, "
    "or run under xvfb-run"
)
_FAR = 2.0  # distance of the eye, in sizes of the model


@cache
def refuse_without_renderer() -> None:
    """Raise where 3-D pictures cannot be drawn; a library that VTK misses would end the process.

    Raises
    ------
    ResultError
        with what to install.
    """
    try:
        import pyvista  # noqa: F401
    except ImportError as error:
        missing = error.name == "pyvista"
        remedy = "install it with: pip install 'romdam[view]'" if missing else _LIBRARIES
        raise ResultError(f"3-D pictures need PyVista ({error}); {remedy}") from error
    if not sys.platform.startswith("linux") or os.environ.get("DISPLAY"):
        return
    tried = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, check=False)
    if tried.returncode != 0:
        raise ResultError(f"3-D pictures need OpenGL without a display, and VTK found none; {_LIBRARIES}")


def grid(element: str, points: Floats, cells: Ints, straight: bool = False) -> pyvista.UnstructuredGrid:
    """A block's mesh for PyVista; `straight` takes its corner nodes only."""
    import pyvista

    kinds = [
        (ELEMENTS[kind.linear] if straight else kind, cells_of)
        for kind, _, cells_of in kinds_of(element, cells)
    ]
    return pyvista.UnstructuredGrid(
        {kind.cell.vtk: cells_of[:, : kind.cell.nodes] for kind, cells_of in kinds}, points
    )


class Picture:
    """One off-screen window, looked at from one direction; an image in the end.

    Parameters
    ----------
    bounds : two corners of what is shown
    direction : (3,) towards the eye
    size : in pixels, SIZE if not given
    """

    def __init__(self, bounds: Bounds, direction: Floats, size: tuple[int, int] | None = None) -> None:
        refuse_without_renderer()
        size = size or SIZE
        import pyvista

        with pyvista.vtk_verbosity("off"):
            self.plotter: Any = pyvista.Plotter(off_screen=True, window_size=list(size), border=False)
        self.plotter.set_background("white")
        self.plotter.enable_anti_aliasing("ssaa")
        self.plotter.add_axes(color="black", line_width=3)
        low, high = bounds
        middle, far = (low + high) / 2.0, _FAR * float(np.linalg.norm(high - low))
        eye = middle + far * direction / np.linalg.norm(direction)
        self.plotter.camera_position = [tuple(eye), tuple(middle), (0.0, 0.0, 1.0)]
        self.plotter.camera.parallel_projection = True
        tall, wide = _half_sizes(low, high, direction)
        self.plotter.camera.parallel_scale = float(1.06 * max(tall, wide * size[1] / size[0]))
        self.plotter.camera.clipping_range = (0.01 * far, 3.0 * far)

    def add(self, mesh: pyvista.DataSet, **look: Any) -> None:
        """Show a mesh, lit so that faces turned away from the lamp keep their colour; lines lie on top."""
        look = {"ambient": 0.45, "diffuse": 0.6, "show_scalar_bar": False} | look
        mapper = self.plotter.add_mesh(mesh, **look).mapper
        mapper.SetResolveCoincidentTopologyToPolygonOffset()
        mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(2.0, 2.0)
        mapper.SetRelativeCoincidentTopologyLineOffsetParameters(-2.0, -2.0)

    def image(self) -> Image:
        """The picture (rows, columns, 3); closes the window."""
        import pyvista

        camera = self.plotter.camera.copy()
        with pyvista.vtk_verbosity("off"):
            self.plotter.camera = camera
            pixels = np.asarray(self.plotter.screenshot(None, return_img=True))[:, :, :3]
        self.plotter.close()
        return pixels


def fitting_size(bounds: Bounds, direction: Floats, pixels: int) -> tuple[int, int]:
    """Size of a picture that a box fills, with so many pixels on the longer side."""
    tall, wide = _half_sizes(*bounds, direction)
    shorter = max(pixels // 2, round(pixels * min(tall, wide) / max(tall, wide)))
    return (pixels, shorter) if wide > tall else (shorter, pixels)


def _half_sizes(low: Floats, high: Floats, direction: Floats) -> tuple[float, float]:
    """Half of what a box measures up and across, seen from a direction."""
    ahead = direction / np.linalg.norm(direction)
    across = np.cross([0.0, 0.0, 1.0], ahead)
    across /= np.linalg.norm(across)
    half = np.abs(high - low) / 2.0
    return float(np.abs(np.cross(ahead, across)) @ half), float(np.abs(across) @ half)


def surface(mesh: pyvista.UnstructuredGrid) -> pyvista.PolyData:
    """The outer surface, quadratic facets as several flat ones.

    `vtkOriginalPointIds` are node numbers on straight meshes only: VTK numbers them anew on quadratic ones.
    """
    return mesh.extract_surface(algorithm=None, pass_pointid=True, nonlinear_subdivision=1)
