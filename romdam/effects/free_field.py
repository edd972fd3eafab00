"""Waves that come up through the rock: effective forces on its viscous boundary, and their histories.

Without a dam the rock would move as a column of its layers does (`romdam.fem.column`), whose free surface
moves as the record says. All displacement is relative to that surface's, so that the ground's acceleration
acts on every mass, rock and dam alike, and the rock at depth moves by w(z, t) against it. The boundary
passes on what the rock beyond does in this free field: its tractions, and the forces of the dashpots and
springs that its motion leaves unstrained,

    F = int N sigma(w + beta w') n dA + C_b w' + K_b (w + beta w'),

beta that of the rock's material at each place, the bottom's traction being that on the column's lower end. A
box of rock alone then moves as the column does; with a dam and a valley in it the boundary acts on what they
scatter. w follows from the record's acceleration by its values up to a wave's travel time before and after,
so that no drift of the record's displacement matters, and the rock begins to move before the record does: so
does the integration.

Motion that the mesh cannot carry (fewer than about three elements to a wavelength) has no such field: it is
left out of the record. So is what damping would amplify on the way down beyond a limit: the surface hardly
tells what came up there, and round-off, the end of the record and its noise would be most of the motion at
depth. What is left out, and how far the column is from continuous layers, is said in the result.

References
----------
Løkke, Chopra, Earthq. Eng. Struct. Dyn. 46 (2017) 1257 and 47 (2018) 1309 (direct method).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_matrix, diags_array, eye_array, hstack, kron

from romdam.config.effects import FREE_FIELD_WITH_RATIOS
from romdam.config.sections.job import DampingConfig
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.motion import Motion
from romdam.core.scene import Block, FreeField, Scene
from romdam.core.system import Complex, Histories, PseudoStatic, Rates, System
from romdam.effects.effect import EffectCoordinates
from romdam.fem.absorbing import boundary_dashpots, boundary_springs
from romdam.fem.column import layer_motion, respond, shapes, slopes, wave_moduli
from romdam.fem.damping import material_coefficients, rayleigh_coefficients
from romdam.fem.material import lame
from romdam.geometry.elements import facet_element
from romdam.geometry.facets import area_elements

PASSED, LEFT_OUT = 2.4, 3.1  # phase across an element up to which motion passes, and from which none does
RINGING = 2.0  # travel times of the slowest wave before the record from which integration begins
AMPLIFIED = (
    5.0,
    10.0,
)  # motion at depth over the surface's up to which motion passes, and from which none does
_SAID = 1e-3  # share of the record left out, in L2, from which on it is said
_OFF = 0.02  # distance of the column's motion from continuous layers', in L2, from which on it is said
_SAFE = 0.7  # of it: accelerations that generalised-alpha writes lag by a few hundredths of a step besides
_UPRIGHT = 0.5  # vertical component of a facet's normal: the scene has sides, with none, and a bottom, with 1


@dataclass(frozen=True)
class Deconvolution:
    """Histories of the free field from a record of its surface.

    Attributes
    ----------
    field : the layers
    damping : alpha [1/s], beta [s] of materials without damping of their own
    """

    field: FreeField
    damping: tuple[float, float]
    whole_record: ClassVar[bool] = True

    def drive(self, histories: Histories, dt: float, rates: Rates) -> Histories:
        """Add the motion of the column, its rate and the traction on its lower end, see `boundary_load`.

        They begin before the record does, and with them all motions; what the mesh cannot carry is left out
        of the base's acceleration, which has nothing beyond the record's Nyquist frequency.
        """
        acc = histories.rows[Motion.BASE]
        from scipy.fft import irfft, next_fast_len, rfft, rfftfreq  # here: few scenes have a free field

        height = -np.diff(self.field.levels)
        moduli = np.array([wave_moduli(material) for material in self.field.materials])
        speed = np.sqrt(moduli / np.array([[material.rho] for material in self.field.materials]))
        lead = int(np.ceil(RINGING * (height / speed[:, 0]).sum() / dt))
        total = lead + acc.shape[1]
        size = next_fast_len(total + 3 * lead, real=True)
        ended = np.pad(acc, ((0, 0), (0, lead)), mode="linear_ramp")  # a record that is cut off would ring
        spectrum = rfft(np.pad(ended, ((0, 0), (lead, size - total - lead))))
        freq = rfftfreq(size)
        symbols = rates(2.0 * np.pi * freq)
        columns = [
            self._component(k, spectrum[k], symbols, freq / dt, float((height / speed[:, k]).max()))
            for k in range(3)
        ]
        by_kind = [
            np.stack(kind, axis=1).reshape(-1, len(freq))
            for kind in zip(*(column.spectra for column in columns), strict=True)
        ]
        kinds = Motion.BASE, Motion.FREE_FIELD, Motion.FREE_FIELD_RATE, Motion.FREE_FIELD_TRACTION
        motions = {kind: irfft(rows, size)[:, :total] for kind, rows in zip(kinds, by_kind, strict=True)}
        rest = {kind: np.pad(rows, ((0, 0), (lead, 0))) for kind, rows in histories.rows.items()}
        warnings = tuple(_warnings(acc, motions[Motion.BASE][:, lead:], columns))
        return Histories(rest | motions, histories.lead + lead, (*histories.warnings, *warnings))

    def _component(
        self, k: int, acc: Complex, symbols: tuple[Complex, Complex], freq: Floats, crossing: float
    ) -> _Component:
        """One component; `freq` of the lines [Hz], `crossing` of the slowest element [s]."""
        phase = np.sqrt(np.abs(symbols[0])) * crossing
        count = int(np.argmax(phase >= LEFT_OUT)) if (phase >= LEFT_OUT).any() else len(phase)
        acceleration, velocity = (symbol[:count] for symbol in symbols)
        answer = respond(self.field, k, (acceleration, velocity), self.damping)
        moved = 1.0 + acceleration[:, None] * answer.motion
        amplified = np.maximum.accumulate(np.abs(moved).max(axis=1))
        passed = np.zeros(len(acc))
        passed[:count] = taper(phase[:count], PASSED, LEFT_OUT) * taper(np.log(amplified), *np.log(AMPLIFIED))
        acc = acc * passed
        motion = np.zeros((answer.motion.shape[1], len(acc)), dtype=complex)
        motion[:, :count] = answer.motion.T * acc[:count]
        traction = np.zeros((1, len(acc)), dtype=complex)
        traction[0, :count] = answer.traction * acc[:count]
        rate = symbols[1] * motion
        exact = layer_motion(self.field, k, 2.0 * np.pi * freq[1:count], self.damping)
        off, size = (
            np.sqrt(np.cumsum(np.abs(ratio * acc[1:count, None]) ** 2, axis=0))
            for ratio in (moved[1:] - exact, exact)
        )
        wrong = (off / np.maximum(size, np.finfo(float).tiny)).max(axis=1)
        return _Component(
            spectra=(acc[None], motion, rate, traction),
            cut=float(freq[np.argmax(passed < 1.0)]) if (passed < 1.0).any() else np.inf,
            amplified=bool((amplified > AMPLIFIED[0]).any()),
            off=float(wrong[-1]) if acc.any() else 0.0,
            right=float(freq[1 + int(np.argmax(wrong > _SAFE * _OFF))]),
        )


@dataclass(frozen=True)
class _Component:
    """A component of the free field.

    Attributes
    ----------
    spectra : (rows, frequencies) of the acceleration, of the motion, of its rate and of the traction on the
        lower end
    cut : frequency from which on the record is left out, gradually [Hz]
    amplified : whether damping is among the reasons
    off : largest distance of a depth's motion from that in continuous layers, in L2
    right : frequency below which this is less than `_OFF` [Hz]
    """

    spectra: tuple[Complex, Complex, Complex, Complex]
    cut: float
    amplified: bool
    off: float
    right: float


def taper(value: Floats, full: float, none: float) -> Floats:
    """1 up to `full`, 0 from `none` on."""
    return np.asarray(np.cos(0.5 * np.pi * np.clip((value - full) / (none - full), 0.0, 1.0)) ** 2)


def _warnings(acc: Floats, passed: Floats, columns: Sequence[_Component]) -> Iterator[str]:
    tiny = np.finfo(float).tiny
    share = np.linalg.norm(acc - passed, axis=1) / max(float(np.linalg.norm(acc)), tiny)
    cut = [k for k in range(3) if share[k] > _SAID]
    if cut:
        why = "waves are shorter there than about three of the rock's elements, or steps"
        if any(columns[k].amplified for k in cut):
            why += (
                f", or its damping makes the motion at depth more than {AMPLIFIED[0]:g} times the surface's"
            )
        where = ", ".join(f"{'xyz'[k]} above {columns[k].cut:.3g} Hz ({100 * share[k]:.2g} %)" for k in cut)
        yield (
            f"free field: left out of the record's acceleration: {where} in L2 of it; {why}. Take smaller "
            "elements, a finer step or less damping, or low-pass the record"
        )
    off = [k for k in range(3) if columns[k].off > _OFF]
    if off:
        where = ", ".join(
            f"{'xyz'[k]} {100 * columns[k].off:.2g} % (within {100 * _OFF:g} % below "
            f"{columns[k].right:.3g} Hz)"
            for k in off
        )
        yield (
            f"free field: acceleration at depth differs from that of plane waves in continuous layers by "
            f"{where} in L2, since elements and steps slow waves down; take smaller elements or a finer step"
        )


@dataclass(frozen=True)
class IncomingWaves:
    """Waves that come up through a scene's rock, as an effect.

    Attributes
    ----------
    drive : of their histories
    forces : block name -> (3 nodes, columns) see `boundary_load`; blocks with absorbing faces alone
    """

    drive: Deconvolution
    forces: Mapping[str, csr_matrix]

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add the effective forces on absorbing faces."""
        load, nodes = (
            -coordinates.press(self.forces),
            3 * self.drive.field.order * len(self.drive.field.materials),
        )
        kinds = {
            Motion.FREE_FIELD: load[:, :nodes],
            Motion.FREE_FIELD_RATE: load[:, nodes : 2 * nodes],
            Motion.FREE_FIELD_TRACTION: load[:, 2 * nodes :],
        }
        return replace(system.loaded(kinds), drives=(*system.drives, self.drive)), coordinates

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """None here: a part with a viscous boundary answers each node of the column, see `merged_part`."""
        return {}


def incoming_waves(scene: Scene, damping: DampingConfig) -> IncomingWaves | None:
    """The free field of a scene as an effect; None without one. Raises as `deconvolution` does."""
    field = scene.find(FreeField)
    drive = deconvolution(field, damping)
    if field is None or drive is None or field.inclined:
        return None
    absorbing = {name: block for name, block in scene.blocks.items() if block.absorbing}
    forces = {
        name: boundary_load(block, field, material_coefficients(block, damping.rayleigh)[1])
        for name, block in absorbing.items()
    }
    return IncomingWaves(drive, forces)


def deconvolution(field: FreeField | None, damping: DampingConfig) -> Deconvolution | None:
    """Input of a scene with a free field; None without one.

    Raises
    ------
    ConfigError
        for modal damping, which the free field of a column has not.
    """
    if field is None:
        return None
    if damping.modal is not None:
        raise ConfigError(FREE_FIELD_WITH_RATIOS)
    return Deconvolution(field, rayleigh_coefficients(damping.rayleigh))


def field_shapes(block: Block, field: FreeField) -> csr_matrix:
    """Motion of a block that moves as the free field, (3 n, 3 nodes of the column)."""
    return csr_matrix(kron(shapes(field, block.points[:, 2]), eye_array(3)))


def field_motions(block: Block, field: FreeField) -> csr_matrix:
    """Motions of a block that those of the field are sums of while all is slow, (3 n, columns).

    Those of the column; of inclined waves these times the distance along the travel, its
    square and its cube.
    """
    moving = field_shapes(block, field)
    if not field.inclined:
        return moving
    along = (block.points[:, :2] - field.origin) @ np.array(field.slowness)
    along = np.repeat(along / np.hypot(*field.slowness) / -np.diff(field.levels[[0, -1]]), 3)
    return csr_matrix(hstack([diags_array(along**power) @ moving for power in range(4)]))


def boundary_load(block: Block, field: FreeField, beta: float) -> csr_matrix:
    """Effective forces on a block's absorbing faces, (3 n, 6 nodes of the column + 3).

    For unit motion and unit rate of every node of the column below the surface along x, y, z, and for unit
    traction on its lower end.

    Parameters
    ----------
    beta : of the block's damping [s]
    """
    moving, points, size = field_shapes(block, field), block.points, len(block.points)
    lam, mu = lame(block.material)
    up, identity = np.eye(3)[2], eye_array(3)
    side, bottom = csr_matrix(moving.shape), csr_matrix((moving.shape[0], 3))
    for face in block.absorbing:
        element = facet_element(face.facets)
        xi, weight = element.rule
        shape, vectors = element.shape(xi), area_elements(points, face.facets, xi)
        outward = vectors.sum(axis=1)
        upright = np.abs(outward[:, 2]) <= _UPRIGHT * np.linalg.norm(outward, axis=1)
        # on vertical facets int N_a sigma n dA of the strain of the column
        facets, normal = face.facets[upright], vectors[upright]
        z, tractions = points[facets][..., 2] @ shape.T, csr_matrix(moving.shape)
        for q in range(len(weight) if len(facets) else 0):
            n = weight[q] * normal[:, q]
            across = lam * n[:, :, None] * up + mu * up[:, None] * n[:, None, :]
            across += mu * n[:, 2, None, None] * np.eye(3)
            forces = shape[q][None, :, None, None] * across[:, None]
            tractions = tractions + _over_nodes(facets, forces, size) @ kron(slopes(field, z[:, q]), identity)
        side = side + tractions
        # on the others int N_a dA for each component
        facets, normal = face.facets[~upright], vectors[~upright]
        if len(facets):
            area = (weight * np.linalg.norm(normal, axis=2)) @ shape
            whole = _over_nodes(facets, area[:, :, None, None] * np.eye(3), size)
            bottom = bottom + csr_matrix(whole @ kron(np.ones((len(facets), 1)), identity))
    follow = side + boundary_springs(block) @ moving
    return csr_matrix(hstack([follow, boundary_dashpots(block) @ moving + beta * follow, bottom]))


def _over_nodes(facets: Ints, forces: Floats, nodes: int) -> csr_matrix:
    """Forces (nf, nodes per facet, 3, 3) of what happens on each facet, (3 n, 3 nf)."""
    rows = (3 * facets[:, :, None] + np.arange(3))[..., None]
    columns = (3 * np.arange(len(facets))[:, None] + np.arange(3))[:, None, None, :]
    where = [np.broadcast_to(index, forces.shape).ravel() for index in (rows, columns)]
    return csr_matrix((forces.ravel(), tuple(where)), shape=(3 * nodes, 3 * len(facets)))
