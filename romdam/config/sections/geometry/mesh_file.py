"""Solid elements read from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from romdam.config.base import Model
from romdam.config.quantities import Whole
from romdam.config.sections.geometry.refinement import Refinements
from romdam.config.sections.places import LengthUnit


class MeshFileConfig(Model):
    """A block read from a mesh file; the physical groups of its facets become its faces."""

    file: Path
    """Mesh file: gmsh .msh, MED .med, I-deas .unv, code_aster .mail, ANSYS .cdb, Nastran .bdf, Abaqus .inp or
    .vtu."""
    group: str | Whole | None = None
    """Group, set or component (or a number) of the cells; all of them where it is left out."""
    body: Annotated[Whole, Field(ge=1)] | None = None
    """Number of the one body among those that share no node, counted along x, then y, then z."""
    unit: LengthUnit = "m"
    """Unit of the coordinates."""
    refine: Refinements = 0
    """Number of times that every cell is cut into eight; edges of quadratic cells stay curved."""
