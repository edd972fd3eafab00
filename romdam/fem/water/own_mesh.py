"""Water of a separate mesh, whose facets on the dam need not match the dam's: segments couple them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import Block, Ints, Reservoir
from romdam.fem.assembly import cell_geometry
from romdam.fem.water.body import Section, WaterBody, scattered, section_of, vector_operator
from romdam.fem.water.prism import prism_body
from romdam.geometry.elements import facet_element
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
    size = len(mesh.points)
    H, G, rigid = csr_matrix((size, size)), csr_matrix((size, size)), np.zeros((size, 3))
    for element, rows, cells in chunks_of(mesh, _CHUNK):
        gradient, shape, volume = cell_geometry(mesh, element, cells, rows)
        stiff = np.einsum("nqka,nqkb,nq->nab", gradient, gradient, volume, optimize=True)
        H = H + scattered(stiff, cells, size)
        G = G + scattered(np.einsum("qa,qb,nq->nab", shape, shape, volume, optimize=True), cells, size)
        np.add.at(rigid, cells, -np.einsum("nqka,nq->nak", gradient, volume, optimize=True))
    np.add.at(rigid, mesh.faces["end"], area_vectors(mesh.points, mesh.faces["end"]))  # which stays
    bottom = mesh.faces["bottom"]  # the faces that take waves up
    element = facet_element(bottom)
    xi, weight = element.rule
    area = np.linalg.norm(area_elements(mesh.points, bottom, xi), axis=2) * weight
    shape = element.shape(xi)
    floor = scattered(np.einsum("qa,qb,nq->nab", shape, shape, area, optimize=True), bottom, size)
    under = np.setdiff1d(np.arange(size), mesh.faces["surface"])
    couplings = _couplings(water, mesh, blocks)
    touched = [np.flatnonzero(np.diff(Q.indptr)) for Q in couplings.values()]
    wet = np.intersect1d(under, np.concatenate(touched))
    end = np.intersect1d(under, mesh.faces["end"])
    return WaterBody(
        H=csr_matrix(H)[under][:, under],
        G=csr_matrix(G)[under][:, under],
        floor=floor[under][:, under],
        rigid=rigid[under],
        wet=np.searchsorted(under, wet),
        coupling={name: Q[wet] for name, Q in couplings.items()},
        end=np.searchsorted(under, end),
        section=_section(mesh, end),
    )


def _section(mesh: Block, nodes: Ints) -> Section:
    """The end's plane, over `nodes` of it."""
    facets = mesh.faces["end"]
    outward = area_vectors(mesh.points, facets).sum(axis=(0, 1)) * [1.0, 1.0, 0.0]
    outward /= max(float(np.linalg.norm(outward)), np.finfo(float).tiny)
    axes = np.stack([np.cross([0.0, 0.0, 1.0], outward), [0.0, 0.0, 1.0]])
    every, local = np.unique(facets, return_inverse=True)
    # edges that the bottom has too, (n, 2), or (n, 3) with the node in their middle
    element = facet_element(facets)
    table = np.array([(*e, element.corners + k) for k, e in enumerate(element.edges)])
    table = table[:, : 3 if element.quadratic else 2]
    edges, others = (rows[:, table].reshape(-1, table.shape[1]) for rows in (facets, mesh.faces["bottom"]))
    number = row_numbers(np.sort(np.concatenate([edges, others])[:, :2], axis=1))
    common = np.asarray(edges[np.isin(number[: len(edges)], number[len(edges) :])])
    flat = mesh.points[every] @ axes.T
    whole = section_of(flat, axes, [(element, local.reshape(facets.shape))], np.searchsorted(every, common))
    return whole.of(np.searchsorted(every, nodes))


def _couplings(water: Reservoir, mesh: Block, blocks: dict[str, Block]) -> dict[str, csr_matrix]:
    """(nodes, 3 * nodes of the block) of every block: int N n . N_u dA, with n into the water [m2]."""
    face = Surface(mesh.name, mesh.points, mesh.faces["dam"])
    couplings: dict[str, csr_matrix] = {}
    for wet in water.faces:
        dam = Surface(wet.block, blocks[wet.block].points, wet.facets)
        degree = integrand_degree(face, dam, face.element.name)
        at, shape = samples(face, dam, lying_on(face, dam), degree), (len(face.points), len(dam.points))
        total = csr_matrix((shape[0], 3 * shape[1]))
        for first in range(0, len(at.slave), _CHUNK):
            some = slice(first, first + _CHUNK)
            rows, nodes = face.facets[at.slave[some]], dam.facets[at.master[some]]
            xi, xi_dam = at.xi_slave[some], at.xi_master[some]
            pressure = face.element.shape(xi.reshape(-1, 2)).reshape(*xi.shape[:2], -1)
            motion = dam.element.shape(xi_dam.reshape(-1, 2)).reshape(*xi_dam.shape[:2], -1)
            slope = face.element.gradient(xi.reshape(-1, 2)).reshape(*xi.shape[:2], 2, -1)
            tangents = np.einsum("nqda,nak->nqdk", slope, face.points[rows], optimize=True)
            normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
            into = -np.asarray(normal / np.linalg.norm(normal, axis=2, keepdims=True))
            values = np.einsum("nq,nqa,nqb,nqk->nabk", at.weight[some], pressure, motion, into, optimize=True)
            total = total + vector_operator(rows[:, :, None], nodes[:, None, :], values, shape)
        Q = csr_matrix(total)
        couplings[wet.block] = couplings[wet.block] + Q if wet.block in couplings else Q
    return couplings
