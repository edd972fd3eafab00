"""Stiffness and mass of a block from files of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from romdam.config.base import Model
from romdam.config.quantities import Mass
from romdam.config.sections.places import Tolerance

UnitSystem = Literal["m-kg-s", "mm-t-s", "mm-kg-ms", "mm-kg-s", "in-lbf-s", "ft-lbf-s", "ft-slug-s"]


class MatrixNames(Model):
    """Names of matrices and vectors in files that hold several (.op4, .pch, .mat, .h5)."""

    stiffness: str = ""
    """K, such as KXX of Nastran's EXTSEOUT; the only one, or only one K..., where it is left out."""
    mass: str = ""
    """M, such as MXX; the only one, or only one M..., where it is left out."""
    damping: str = ""
    """C, such as BXX; the only one, or only one B..., where it is left out."""
    inertia: str = ""
    """M r in an .h5 file; `inertia` where it is left out."""
    force: str = ""
    """Static force in an .h5 file; `force` where it is left out."""


class MatricesConfig(Model):
    """K and M of a block that are read, not assembled; its mesh is where its faces and nodes are.

    Files are Matrix Market (.mtx, ANSYS' .mmf) or Abaqus text (.mtx), CalculiX's (.sti, .mas, .dof),
    Nastran's (.op4, and .pch with DMIG), MATLAB's (.mat), and HDF5 (.h5), in which every key reads what has
    its name.
    """

    stiffness: Path
    """K, symmetric; preferably without supports, which `supports` then gives."""
    mass: Path
    """M, symmetric and positive."""
    damping: Path | None = None
    """C, in place of Rayleigh damping of this block; it couples the modes."""
    unknowns: Path | None = None
    """Node and direction of every row (.dof, .csv, .h5, Nastran's .pch or .asm with EXTRN); not needed where
    the matrices' text has them."""
    names: MatrixNames = MatrixNames()
    """Names of the matrices in files that hold several."""
    nodes: Path | None = None
    """Coordinates of numbered nodes (.csv, or a mesh file); the block's mesh file, if neither gives them."""
    inertia: Path | None = None
    """M r for unit accelerations along x, y, z; needed for reduced blocks on supports."""
    force: Path | None = None
    """Static force on every unknown, besides the loads of this file."""
    units: UnitSystem = "m-kg-s"
    """Units of all these files: mm-t-s has N and MPa, mm-kg-ms kN and GPa, mm-kg-s mN and kPa; in-lbf-s has
    masses of lbf s2/in, ft-lbf-s and ft-slug-s have slugs."""
    total_mass: Annotated[Mass, Field(gt=0.0)] | None = None
    """Mass that the block should have, in every direction; checked within a tenth."""
    tolerance: Tolerance = 1e-3
    """Distance up to which a node of these files is a node of the mesh."""
