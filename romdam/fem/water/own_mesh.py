"""Water of a separate mesh, whose facets on dam and rock need not match theirs: segments couple them."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_matrix

from romdam.core.scene import Block, Ints, Reservoir
from romdam.fem.assembly import cell_geometry
from romdam.fem.water.body import WaterBody, WaterSection, scattered, section_of
from romdam.fem.water.coupling import wall_couplings, yielding_of_rock
from romdam.fem.water.prism import prism_body
from romdam.geometry.elements import facet_element
from romdam.geometry.facets import area_elements, area_vectors, row_numbers
from romdam.geometry.meshes.kinds import chunks_of
from romdam.scene.mortar.surface import MortarSurface

_CHUNK = 4096  # cells at a time


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
    couplings: dict[str, csr_matrix] = {}
    for role, faces in (("dam", water.faces), ("rock", water.rock)):
        walls = MortarSurface(mesh.name, mesh.points, mesh.faces[role])
        for name, Q in wall_couplings(walls, faces, blocks).items():
            couplings[name] = csr_matrix(couplings[name] + Q) if name in couplings else Q
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
        section=_section(mesh, end, water, blocks),
    )


def _section(mesh: Block, nodes: Ints, water: Reservoir, blocks: dict[str, Block]) -> WaterSection:
    """The end's plane, over `nodes` of it."""
    facets = mesh.faces["end"]
    outward = area_vectors(mesh.points, facets).sum(axis=(0, 1)) * [1.0, 1.0, 0.0]
    outward /= max(float(np.linalg.norm(outward)), np.finfo(float).tiny)
    axes = np.stack([np.cross([0.0, 0.0, 1.0], outward), [0.0, 0.0, 1.0]])
    every, local = np.unique(facets, return_inverse=True)
    # edges that bottom and rock have too, (n, 2), or (n, 3) with the node in their middle
    element = facet_element(facets)
    table = np.array([(*e, element.corners + k) for k, e in enumerate(element.edges)])
    table = table[:, : 3 if element.quadratic else 2]
    walls = MortarSurface(mesh.name, mesh.points, np.concatenate([mesh.faces["bottom"], mesh.faces["rock"]]))
    absorbs = np.repeat([1.0, 0.0], [len(mesh.faces["bottom"]), len(mesh.faces["rock"])])
    yields = (1.0 - absorbs) * yielding_of_rock(walls, water.rock, blocks)
    edges, others = (rows[:, table].reshape(-1, table.shape[1]) for rows in (facets, walls.facets))
    number = row_numbers(np.sort(np.concatenate([edges, others])[:, :2], axis=1))
    known, place = np.unique(number, return_inverse=True)
    shares = []  # of each edge of the end, of which a wall of either kind has one at most
    for of_wall in (absorbs, yields):
        most = np.zeros(len(known))
        np.maximum.at(most, place[len(edges) :], np.repeat(of_wall, len(table)))
        shares.append(most[place[: len(edges)]])
    common = (shares[0] > 0.0) | (shares[1] > 0.0)
    whole = section_of(
        flat=mesh.points[every] @ axes.T,
        axes=axes,
        faces=[(element, local.reshape(facets.shape))],
        edges=np.searchsorted(every, edges[common]),
        absorbs=shares[0][common],
        yields=shares[1][common],
    )
    return whole.of(np.searchsorted(every, nodes))
