"""Shape functions, facets and quadrature of every element in the table."""

from itertools import product
from math import factorial
from typing import get_args

import numpy as np
import pytest
from meshio._common import num_nodes_per_cell

from romdam.config.sections.job import BoxConfig
from romdam.config.sections.places import ElementName
from romdam.core.scene import Material
from romdam.geometry.boxes import box_block
from romdam.geometry.elements import CELLS, ELEMENTS, SOLIDS, jacobians
from romdam.geometry.facets import area_vectors, boundary_facets, facet_areas, facet_normals, row_numbers
from romdam.geometry.meshes.quadrature import simplex_rule
from romdam.geometry.meshes.simplex_rules import TABLE

CONCRETE = Material(30e9, 0.18, 2440.0)


def mesh(element, size=(1.0, 1.0, 1.0), element_size=0.5):
    config = BoxConfig(origin=(0, 0, 0), size=size, element_size=element_size, element=element)
    return box_block("box", config, CONCRETE, "s.yaml: blocks.box.box")


def test_configuration_knows_every_solid():
    assert get_args(ElementName) == tuple(SOLIDS)


@pytest.mark.parametrize("cell", CELLS.values(), ids=lambda cell: cell.name)
def test_cells_are_those_of_other_codes(cell):
    """Numbers of types and of nodes as meshio has them, for Gmsh and for VTK."""
    from meshio._mesh import topological_dimension
    from meshio._vtk_common import meshio_to_vtk_type
    from meshio.gmsh.common import _meshio_to_gmsh_type

    assert cell.dim == topological_dimension.get(cell.name, 3)
    assert cell.nodes == num_nodes_per_cell.get(cell.name, cell.nodes)
    assert cell.gmsh == _meshio_to_gmsh_type[cell.name]
    assert cell.vtk in (meshio_to_vtk_type.get(cell.name), None)
    for order in cell.orders.values():
        assert sorted(order) == list(range(cell.nodes))


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=lambda element: element.name)
def test_nodes_are_in_the_order_of_vtk(element):
    vtk = pytest.importorskip("vtk")
    theirs = vtk.vtkGenericCell.InstantiateCell(element.cell.vtk)
    count, d = element.nodes.shape
    if element.linear == "pyramid5":  # VTK's is a hexahedron whose top is one point
        for k in range(count):
            theirs.GetPointIds().SetId(k, k)
        edges = []
        for k in range(8):  # one object for all edges
            ids = theirs.GetEdge(k).GetPointIds()
            edges.append(tuple(ids.GetId(i) for i in range(ids.GetNumberOfIds())))
        middles = [(5 + k,) if element.quadratic else () for k in range(8)]
        ours = [(*edge, *middle) for edge, middle in zip(element.edges, middles, strict=True)]
        assert {frozenset(edge) for edge in edges} == {frozenset(edge) for edge in ours}
        return
    xi = np.array([theirs.GetParametricCoords()[k] for k in range(3 * count)]).reshape(-1, 3)[:, :d]
    assert np.array_equal(xi * 2 - 1 if element.box else xi, element.nodes)


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=lambda element: element.name)
def test_shape_functions_interpolate_and_sum_to_one(element):
    assert np.abs(element.shape(element.nodes) - np.eye(len(element.nodes))).max() < 1e-13
    xi = np.random.default_rng(1).uniform(0, 0.3, (5, element.nodes.shape[1]))
    assert np.abs(element.shape(xi).sum(axis=1) - 1).max() < 1e-13
    assert np.abs(element.gradient(xi).sum(axis=2)).max() < 1e-13


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=lambda element: element.name)
def test_gradient_is_the_derivative(element):
    d = element.nodes.shape[1]
    xi = np.random.default_rng(2).uniform(0, 0.3, (4, d))
    h = 1e-6
    for axis in range(d):
        step = h * np.eye(d)[axis]
        difference = (element.shape(xi + step) - element.shape(xi - step)) / (2 * h)
        assert np.abs(element.gradient(xi)[:, axis] - difference).max() < 1e-9


RULES = sorted({tuple(int(one) for one in row.split(",")[:2]) for row in TABLE.split()})


@pytest.mark.parametrize(("dimension", "degree"), RULES)
def test_simplex_rule_is_exact_to_its_degree_and_no_further(dimension, degree):
    """int x^a y^b z^c = a! b! c! / (a + b + c + d)!, to what a table of 15 digits is good for."""
    points, weights = simplex_rule(degree, dimension)
    assert (weights > 0.0).all() and (points >= 0.0).all() and (points.sum(axis=1) <= 1.0).all()
    wrong = np.zeros(degree + 2)
    for powers in product(range(degree + 2), repeat=dimension):
        if (total := sum(powers)) < len(wrong):
            exact = np.prod([factorial(k) for k in powers]) / factorial(total + dimension)
            found = weights @ np.prod(points ** np.array(powers), axis=1)
            wrong[total] = max(wrong[total], abs(found / exact - 1.0))
    assert wrong[:-1].max() < 2e-12
    assert wrong[-1] > 1e-6, "it is exact to a higher degree than it says"


@pytest.mark.parametrize("name", SOLIDS)
def test_facets_look_outward_and_close(name):
    """Divergence theorem on curved cells: int n dA = 0 and int x . n dA = 3 V."""
    element = ELEMENTS[name]
    rng = np.random.default_rng(3)
    points = element.nodes + 0.05 * rng.standard_normal(element.nodes.shape)
    cells = np.arange(len(points))[None]
    facets = boundary_facets(cells, name)
    assert len(facets) == len(element.facets)
    vectors = area_vectors(points, facets)
    assert np.abs(vectors.sum(axis=(0, 1))).max() < 1e-13
    xi, weight = element.rule
    straight = element.nodes  # on flat facets x lies in the space of N, so int x . n dA is a nodal sum
    flux = np.einsum("fjk,fjk->", area_vectors(straight, facets), straight[facets])
    volume = np.linalg.det(jacobians(straight, cells, element, xi))[0] @ weight
    assert flux == pytest.approx(3 * volume, rel=1e-13)


@pytest.mark.parametrize("columns", [1, 2, 3, 4, 10])
@pytest.mark.parametrize("most", [3, 2_000_000, 2**40])
def test_rows_are_numbered_as_numpy_sorts_them(columns, most):
    rng = np.random.default_rng(4)
    rows = rng.integers(0, most, (40, columns))[rng.integers(0, 40, 300)]
    rows[:50, -1] = rng.integers(0, most, 50)  # equal but in the last
    found = np.unique(row_numbers(rows), return_inverse=True)[1]
    assert np.array_equal(found, np.unique(rows, axis=0, return_inverse=True)[1].ravel())
    assert row_numbers(rows[:0]).shape == (0,)


@pytest.mark.parametrize("name", SOLIDS)
def test_boundary_of_a_box(name):
    block = mesh(name, size=(1.0, 1.5, 2.0))
    facets = boundary_facets(block.cells, name)
    assert facet_areas(block.points, facets).sum() == pytest.approx(2 * (1.5 + 2.0 + 3.0), rel=1e-13)
    centre = block.points[facets].mean(axis=1) - [0.5, 0.75, 1.0]
    assert (np.einsum("fk,fk->f", centre, facet_normals(block.points, facets)) > 0).all()
    named = {k: facet_areas(block.points, v).sum() for k, v in block.faces.items()}
    expected = {"xmin": 3, "xmax": 3, "ymin": 2, "ymax": 2, "zmin": 1.5, "zmax": 1.5}
    assert named == pytest.approx(expected, rel=1e-13)
    assert np.abs(facet_normals(block.points, block.faces["ymax"]) - [0, 1, 0]).max() < 1e-13


@pytest.mark.parametrize("name", SOLIDS)
def test_nodes_of_a_box_are_foreseen(name):
    """By `refuse_large`, before a box is made."""
    from romdam.geometry.meshes.sizes import grid_nodes

    block = mesh(name, size=(1.0, 1.5, 2.0))
    assert grid_nodes([2, 3, 4], name) == pytest.approx(len(block.points), rel=1e-14)
