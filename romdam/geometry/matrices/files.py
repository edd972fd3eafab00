"""The files of `blocks.<name>.matrices`: which reader is whose, and what they give together."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.sparse import csr_matrix

from romdam.config.sections.geometry.matrices import MatricesConfig
from romdam.core.arrays import Floats
from romdam.core.errors import MeshError, ResultError
from romdam.core.files import check_file
from romdam.geometry.matrices import hdf5, matlab, nastran, text
from romdam.geometry.matrices.data import Entries, MatrixUnknowns, from_labels, sparse
from romdam.geometry.matrices.frames import in_basic, turned, turned_vectors, with_frames
from romdam.geometry.meshes.data import Numbered
from romdam.geometry.meshes.files import FORMATS, read_mesh_file

LARGEST = 4e9  # bytes of a file
UNITS = {
    "m-kg-s": (1.0, 1.0, 1.0),
    "mm-t-s": (1e-3, 1e3, 1.0),
    "mm-kg-ms": (1e-3, 1.0, 1e-3),
    "mm-kg-s": (1e-3, 1.0, 1.0),
    "in-lbf-s": (0.0254, 4.4482216152605 / 0.0254, 1.0),  # a pound-force is 4.4482216152605 N
    "ft-lbf-s": (0.3048, 4.4482216152605 / 0.3048, 1.0),
    "ft-slug-s": (0.3048, 4.4482216152605 / 0.3048, 1.0),
}
"""Length [m], mass [kg] and time [s] of each system of units."""

log = logging.getLogger(__name__)

T = TypeVar("T")
_NASTRAN = (".op4", ".pch")  # whose rows are along the axes that GRID gives to a node
_NAMED = (".op4", ".pch", ".h5", ".hdf5", ".mat")  # files that may hold several matrices
_MATRICES: dict[str, Callable[[Path, str, str], Entries]] = {
    **dict.fromkeys((".mtx", ".mmf", ".sti", ".mas", ".dam", ".txt"), text.read_text),
    **dict.fromkeys((".h5", ".hdf5"), hdf5.read_hdf5),
    **dict.fromkeys(_NASTRAN, nastran.read_nastran),
    ".mat": matlab.read_matlab,
}
_UNKNOWNS: dict[str, Callable[[Path, str], MatrixUnknowns]] = {
    ".dof": text.read_dof,
    ".csv": text.read_csv,
    **dict.fromkeys((".h5", ".hdf5"), hdf5.read_unknowns),
    **dict.fromkeys((".pch", ".asm"), nastran.read_external),
}


@dataclass(frozen=True)
class FileMatrices:
    """Content of the files of a block, in SI.

    Attributes
    ----------
    unknowns : of every row, with the positions of all that move, along x, y, z
    K, M, C : (n, n) symmetric; C None without
    inertia : (n, 3), or None
    force : (n,)
    """

    unknowns: MatrixUnknowns
    K: csr_matrix
    M: csr_matrix
    C: csr_matrix | None
    inertia: Floats | None
    force: Floats


def read_matrices(config: MatricesConfig, folder: Path, mesh: Numbered | None, location: str) -> FileMatrices:
    """Read all files of a block.

    Parameters
    ----------
    folder : where relative paths start
    mesh : numbered nodes of the block's mesh file, where it has one
    location : file and key, for messages

    Raises
    ------
    MeshError, ResultError
        where a file cannot be read, or does not fit the others.
    """
    reader = _Reader(config, folder, location)
    stiffness = reader.entries("stiffness")
    unknowns = reader.unknowns(stiffness, mesh)
    first = int(min(stiffness.row.min(initial=1), stiffness.column.min(initial=1)) > 0)
    length, mass, time = UNITS[config.units]
    basic, R = in_basic(unknowns, reader.at("stiffness" if config.unknowns is None else "unknowns"))
    unit = np.where(unknowns.motion < 3, 1.0 / length, 1.0)  # displacement in the file's unit of one in SI
    energy = mass * length**2 / time**2

    def matrix(key: str, entries: Entries, factor: float) -> csr_matrix:
        values = sparse(entries, unknowns, first, reader.at(key))
        scaled = csr_matrix(values.multiply(unit[:, None]).multiply(energy * factor * unit[None, :]))
        return turned(scaled, R)

    def vectors(key: str, width: int, factor: float) -> Floats | None:
        values = reader.columns(key, (len(unknowns), width))
        if values is None:
            return None
        return turned_vectors(np.asarray(energy * factor * unit[:, None] * values), R)

    force = vectors("force", 1, 1.0)
    return FileMatrices(
        basic,
        matrix("stiffness", stiffness, 1.0),
        matrix("mass", reader.entries("mass"), time**2),
        None if config.damping is None else matrix("damping", reader.entries("damping"), time),
        vectors("inertia", 3, time**2 / length),
        np.zeros(len(unknowns)) if force is None else force[:, 0],
    )


@dataclass(frozen=True)
class _Reader:
    """The paths of a block's files."""

    config: MatricesConfig
    folder: Path
    location: str

    def at(self, key: str) -> str:
        """A key and its file, for messages."""
        return f"{self.location}.{key}: {self.path(key)}"

    def path(self, key: str) -> Path:
        """The file of a key."""
        return self.folder / getattr(self.config, key)

    def entries(self, key: str) -> Entries:
        """The matrix of a key."""
        read = self._opened(key, _MATRICES)
        return read(self.path(key), self.name(key) or key, self.at(key))

    def name(self, key: str) -> str:
        """The name that the configuration gives to the matrix of a key; empty where it gives none."""
        name = str(getattr(self.config.names, key))
        if name and self.path(key).suffix.lower() not in _NAMED:
            raise MeshError(
                f"{self.location}.names.{key}: {self.path(key)} holds one matrix, which has no name; files "
                f"with names are {', '.join(_NAMED)}; leave it out"
            )
        return name

    def columns(self, key: str, shape: tuple[int, int]) -> Floats | None:
        """The vectors of a key (n, k); None where it is not there."""
        if getattr(self.config, key) is None:
            return None
        self._opened(key, _MATRICES)
        path, location = self.path(key), self.at(key)
        ending, name = path.suffix.lower(), self.name(key) or key
        if ending in (".h5", ".hdf5"):
            columns = hdf5.read_columns(path, name, location)
        elif ending == ".mat":
            columns = matlab.read_matlab_columns(path, name, location)
        else:
            columns = text.read_columns(path, location)
        if columns.shape != shape or not np.isfinite(columns).all():
            raise MeshError(
                f"{location}: is {columns.shape[0]} by {columns.shape[1]}, expected {shape[0]} by "
                f"{shape[1]} finite numbers"
            )
        return columns

    def unknowns(self, stiffness: Entries, mesh: Numbered | None) -> MatrixUnknowns:
        """The unknowns, with their positions."""
        if self.config.unknowns is not None:
            location = self.at("unknowns")
            unknowns = self._opened("unknowns", _UNKNOWNS)(self.path("unknowns"), location)
        elif stiffness.labels is not None:
            location = self.at("stiffness")
            unknowns = from_labels(stiffness.labels)
        else:
            raise MeshError(
                f"{self.at('stiffness')}: numbers its rows and does not say what they are; give "
                f"{self.location}.unknowns (node and direction of every row), CalculiX's .dof or a .csv"
            )
        if not len(unknowns):
            raise MeshError(f"{location}: has no unknowns; write it anew")
        moving = np.flatnonzero(unknowns.motion < 6)
        _, first, counts = np.unique(unknowns.labels[moving], axis=0, return_index=True, return_counts=True)
        if (counts > 1).any():
            k = int(moving[first[np.argmax(counts > 1)]])
            raise MeshError(
                f"{location}: {np.count_nonzero(counts > 1)} unknowns are given twice, the first is "
                f"{unknowns.name(k)}, limit once; number nodes and directions anew"
            )
        unknowns = replace(unknowns, position=unknowns.position * UNITS[self.config.units][0])
        return self._placed(unknowns, mesh, location)

    def _placed(self, unknowns: MatrixUnknowns, mesh: Numbered | None, location: str) -> MatrixUnknowns:
        """With positions of all unknowns that are displacements or rotations."""
        lacking = (unknowns.motion < 6) & np.isnan(unknowns.position).any(axis=1)
        numbered = self._nodes() if self.config.nodes is not None else mesh
        position = unknowns.position.copy()
        if numbered is not None and unknowns.axes is None and self._along_frames():
            unknowns = with_frames(unknowns, numbered.frames, location)
        if lacking.any() and numbered is not None:
            number, points, _ = numbered
            order = np.argsort(number, kind="stable")
            at = np.minimum(np.searchsorted(number[order], unknowns.node), len(number) - 1)
            same = lacking & (number[order][at] == unknowns.node)
            position[same] = points[order[at[same]]]
            lacking &= np.isnan(position).any(axis=1)
        if lacking.any():
            k = int(np.flatnonzero(lacking)[0])
            raise MeshError(
                f"{location}: {np.count_nonzero(lacking)} of {len(unknowns)} unknowns have no coordinates, "
                f"the first is {unknowns.name(k)}; give {self.location}.nodes, with these numbers, or call "
                "what has no place `internal`"
            )
        return replace(unknowns, position=position)

    def _along_frames(self) -> bool:
        """Tell whether the matrices' rows are along the frames of a mesh file: Nastran's, without GRID."""
        rows = self.config.unknowns
        external = rows is not None and rows.suffix.lower() in (".pch", ".asm")
        return self.path("stiffness").suffix.lower() in _NASTRAN and not external

    def _nodes(self) -> Numbered:
        path, length = self.path("nodes"), UNITS[self.config.units][0]
        if path.suffix.lower() in FORMATS:
            file = read_mesh_file(path, f"{self.location}.nodes")
            for remark in file.remarks:
                log.warning("%s: %s", path, remark)
            return Numbered(file.tags, file.points * length, file.frames)
        if path.suffix.lower() != ".csv":
            raise MeshError(f"{self.at('nodes')}: known endings are .csv, {', '.join(FORMATS)}")
        check_file(path, LARGEST, MeshError)
        number, points = text.read_nodes(path, self.at("nodes"))
        return Numbered(number, points * length)

    def _opened(self, key: str, formats: dict[str, T]) -> T:
        path = self.path(key)
        read = formats.get(path.suffix.lower())
        if read is None:
            raise MeshError(f"{self.at(key)}: is of no known format; known endings are {', '.join(formats)}")
        try:
            check_file(path, LARGEST, MeshError)
        except (MeshError, ResultError) as error:
            raise MeshError(f"{self.location}.{key}: {error}") from None
        return read
