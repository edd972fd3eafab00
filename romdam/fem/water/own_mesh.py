"""Water of a mesh of its own, whose facets on the dam need not match the dam's: segments couple them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import Block, Ints, Reservoir
from romdam.fem.assembly import cell_geometry
from romdam.fem.water.body import Section, WaterBody, scattered, section_of, vector_operator
from romdam.fem.water.prism import prism_body
from romdam.geometry.elements import Floats, facet_element
from romdam.geometry.facets import area_elements, area_vectors, row_numbers
from romdam.geometry.meshes.kinds import chunks_of
from romdam.scene.mortar.segments import integrand_degree, samples
from romdam.scene.mortar.surface import Surface
from romdam.scene.reservoir.reservoir_mesh import lying_on

_CHUNK = 4096  # cells, or triangles, at a time


def water_body(water: Reservoir, blocks: dict[str, Block], longest: float = np.inf) -> WaterBody:
    """Integrate over a reservoir's own mesh, or over a prism whose layers are up to `longest` thick [m]."""
    return (
        prism_body(water, blocks, longest) if water.mesh is None else meshed_body(water, water.mesh, blocks)
    )


def meshed_body(water: Reservoir, mesh: Block, blocks: dict[str, Block]) -> WaterBody:
    """Integrate over a reservoir's own mesh."""
    H, G, rigid = _volumes(mesh)
    np.add.at(rigid, mesh.faces["end"], area_vectors(mesh.points, mesh.faces["end"]))  # which stays
    under = np.setdiff1d(np.arange(len(mesh.points)), mesh.faces["surface"])
    couplings = _couplings(water, mesh, blocks)
    touched = [np.flatnonzero(np.diff(Q.indptr)) for Q in couplings.values()]
    wet = np.intersect1d(under, np.concatenate(touched))
    end = np.intersect1d(under, mesh.faces["end"])
    return WaterBody(
        H=H[under][:, under],
        G=G[under][:, under],
        floor=_floor(mesh)[under][:, under],
        rigid=rigid[under],
        wet=np.searchsorted(under, wet),
        coupling={name: Q[wet] for name, Q in couplings.items()},
        end=np.searchsorted(under, end),
        section=_section(mesh, end),
    )


def _volumes(mesh: Block) -> tuple[csr_matrix, csr_matrix, Floats]:
    """Laplacian [m], int N N dV [m3], and the flux (nodes, 3) of all faces' unit rigid motions [m2]."""
    size = len(mesh.points)
    H, G, rigid = csr_matrix((size, size)), csr_matrix((size, size)), np.zeros((size, 3))
    for element, rows, cells in chunks_of(mesh, _CHUNK):
        gradient, shape, volume = cell_geometry(mesh, element, cells, rows)
        stiff = np.einsum("nqka,nqkb,nq->nab", gradient, gradient, volume, optimize=True)
        H = H + scattered(stiff, cells, size)
        G = G + scattered(np.einsum("qa,qb,nq->nab", shape, shape, volume, optimize=True), cells, size)
        np.add.at(rigid, cells, -np.einsum("nqka,nq->nak", gradient, volume, optimize=True))
    return csr_matrix(H), csr_matrix(G), rigid


def _floor(mesh: Block) -> csr_matrix:
    """int N N dA over the faces that take waves up [m2]."""
    facets = mesh.faces["bottom"]
    element = facet_element(facets)
    xi, weight = element.rule
    area = np.linalg.norm(area_elements(mesh.points, facets, xi), axis=2) * weight
    shape = element.shape(xi)
    return scattered(np.einsum("qa,qb,nq->nab", shape, shape, area, optimize=True), facets, len(mesh.points))


def _section(mesh: Block, nodes: Ints) -> Section:
    """The end's plane, over `nodes` of it."""
    facets = mesh.faces["end"]
    outward = area_vectors(mesh.points, facets).sum(axis=(0, 1)) * [1.0, 1.0, 0.0]
    outward /= max(float(np.linalg.norm(outward)), np.finfo(float).tiny)
    axes = np.stack([np.cross([0.0, 0.0, 1.0], outward), [0.0, 0.0, 1.0]])
    every, local = np.unique(facets, return_inverse=True)
    numbered = np.searchsorted(every, _common_edges(facets, mesh.faces["bottom"]))
    flat = mesh.points[every] @ axes.T
    whole = section_of(flat, axes, [(facet_element(facets), local.reshape(facets.shape))], numbered)
    return whole.of(np.searchsorted(every, nodes))


def _common_edges(facets: Ints, others: Ints) -> Ints:
    """Edges of some facets that others have too, (n, 2), or (n, 3) with the node in their middle."""
    element = facet_element(facets)
    table = np.array([(*e, element.corners + k) for k, e in enumerate(element.edges)])
    table = table[:, : 3 if element.quadratic else 2]
    own, theirs = (rows[:, table].reshape(-1, table.shape[1]) for rows in (facets, others))
    number = row_numbers(np.sort(np.concatenate([own, theirs])[:, :2], axis=1))
    return np.asarray(own[np.isin(number[: len(own)], number[len(own) :])])


def _couplings(water: Reservoir, mesh: Block, blocks: dict[str, Block]) -> dict[str, csr_matrix]:
    """(nodes, 3 * nodes of the block) of every block: int N n . N_u dA, with n into the water [m2]."""
    own = Surface(mesh.name, mesh.points, mesh.faces["dam"])
    found: dict[str, csr_matrix] = {}
    for face in water.faces:
        dam = Surface(face.block, blocks[face.block].points, face.facets)
        Q = _coupling(own, dam)
        found[face.block] = found[face.block] + Q if face.block in found else Q
    return found


def _coupling(own: Surface, dam: Surface) -> csr_matrix:
    degree = integrand_degree(own, dam, own.element.name)
    at, shape = samples(own, dam, lying_on(own, dam), degree), (len(own.points), len(dam.points))
    total = csr_matrix((shape[0], 3 * shape[1]))
    for first in range(0, len(at.slave), _CHUNK):
        some = slice(first, first + _CHUNK)
        rows, nodes = own.facets[at.slave[some]], dam.facets[at.master[some]]
        pressure, motion = (
            face.element.shape(xi[some].reshape(-1, 2)).reshape(*xi[some].shape[:2], -1)
            for face, xi in ((own, at.xi_slave), (dam, at.xi_master))
        )
        into = -_normals(own, rows, at.xi_slave[some])
        values = np.einsum("nq,nqa,nqb,nqk->nabk", at.weight[some], pressure, motion, into, optimize=True)
        total = total + vector_operator(rows[:, :, None], nodes[:, None, :], values, shape)
    return csr_matrix(total)


def _normals(face: Surface, facets: Ints, xi: Floats) -> Floats:
    """Unit normals at xi (n, q, 2) of facets (n, nodes), one by one."""
    slope = face.element.gradient(xi.reshape(-1, 2)).reshape(*xi.shape[:2], 2, -1)
    tangents = np.einsum("nqda,nak->nqdk", slope, face.points[facets], optimize=True)
    normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return np.asarray(normal / np.linalg.norm(normal, axis=2, keepdims=True))
