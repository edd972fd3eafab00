"""Solid elements read from a file."""

from __future__ import annotations

from pathlib import Path

from romdam.config.base import Model
from romdam.config.quantities import Whole
from romdam.config.sections.places import LengthUnit


class MeshFileConfig(Model):
    """A block read from a mesh file; the physical groups of its facets become its faces."""

    file: Path
    """gmsh .msh, Nastran .bdf, Abaqus .inp or .vtu."""
    group: str | Whole | None = None
    """Physical group (or its number) of the cells; all of them where there is one only."""
    unit: LengthUnit = "m"
    """Of the coordinates."""
