"""Waves that come up through the rock at an angle: forces on its viscous boundary, as histories.

The field is that of `romdam.fem.inclined`: level layers without a dam, whose surface moves as the record at
one place, and elsewhere later by the slowness times the distance along the direction of travel. The boundary
of the rock that is meshed gets the forces that let the field pass, as in `romdam.effects.free_field`,

    F = int N sigma n dA + C_b w' + K_b (w + beta w'),

with w the displacement of the field relative to the base, its stress sigma, and the dashpots C_b and springs
K_b of the boundary. Here sigma n is that of the whole field on every facet, sides and bottom alike. The
forces are computed at every frequency from the spectrum of the record and brought back to time. They differ
from node to node in time as well, so each force has a history: those on the boundary's nodes, or on the
coordinates of a reduced model where these are fewer.

The ground's acceleration u_b'' acts on every mass, and mass-proportional damping alpha on the velocity w', so
that div sigma = rho (w'' + u_b'' + alpha w'). At frequency omega the field

    w + c u_b,   c = omega^2 / (omega^2 - i alpha omega),

is a wave of layers with that drag, and w = 0 at the record's place of the surface. So the surface of the wave
moves by c u_b, and w is the wave less c u_b.

w drifts as the record's velocity does, times the delay: w begins at zero, and what a record has at frequency
zero (a velocity that does not end at zero) is left out of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_matrix, hstack

from romdam.config.effects import FREE_FIELD_WITH_RATIOS
from romdam.config.sections.job import DampingConfig
from romdam.core.arrays import Floats, Ints
from romdam.core.errors import ConfigError
from romdam.core.motion import Motion
from romdam.core.scene import Block, FreeField, Scene
from romdam.core.system import Complex, Histories, PseudoStatic, Rates, System
from romdam.effects.effect import EffectCoordinates
from romdam.effects.free_field import AMPLIFIED, LEFT_OUT, PASSED, RINGING, taper
from romdam.fem.absorbing import boundary_dashpots, boundary_springs
from romdam.fem.column import wave_moduli
from romdam.fem.damping import material_coefficients, rayleigh_coefficients
from romdam.fem.inclined import InclinedField
from romdam.geometry.elements import facet_element
from romdam.geometry.facets import area_elements

_SAID = 1e-3  # share of the record left out, in L2, from which on a run warns
_SAME = 1e-9  # relative difference of two alphas that count as one
_TOGETHER = 4_000_000  # complex numbers of a field at a time, 64 MB


@dataclass(frozen=True)
class BoundarySide:
    """The absorbing faces of a block, as an inclined field meets them.

    Attributes
    ----------
    nodes : (n,) nodes of the faces
    points : (n, 3) their positions [m]
    dashpots, springs : (3 n, 3 n) C_b and K_b, sparse [N s/m], [N/m]
    beta : of the block's damping [s]
    at, normals : (q, 3) quadrature points, and the outward normal times the area of each [m], [m2]
    shares : (n, q) sparse, shape function of each node at each quadrature point
    """

    nodes: Ints
    points: Floats
    dashpots: csr_matrix
    springs: csr_matrix
    beta: float
    at: Floats
    normals: Floats
    shares: csr_matrix

    @classmethod
    def of(cls, block: Block, beta: float) -> BoundarySide:
        """Take the absorbing faces of a block, whose damping has `beta` [s]."""
        at, normals, shares, size = [], [], [], len(block.points)
        for face in block.absorbing:
            element = facet_element(face.facets)
            xi, weight = element.rule
            shape = element.shape(xi)
            vectors = area_elements(block.points, face.facets, xi) * weight[:, None]
            at.append(np.einsum("qa,fak->fqk", shape, block.points[face.facets]).reshape(-1, 3))
            normals.append(vectors.reshape(-1, 3))
            count = len(face.facets) * len(weight)
            column = np.arange(count).reshape(len(face.facets), len(weight), 1)
            row, value = face.facets[:, None, :], np.broadcast_to(shape, (len(face.facets), *shape.shape))
            where = [np.broadcast_to(index, value.shape).ravel() for index in (row, column)]
            shares.append(csr_matrix((value.ravel(), tuple(where)), shape=(size, count)))
        nodes = np.unique(np.concatenate([face.facets.ravel() for face in block.absorbing]))
        dof = (3 * nodes[:, None] + np.arange(3)).ravel()
        C, K = (csr_matrix(make(block)[dof][:, dof]) for make in (boundary_dashpots, boundary_springs))
        together = csr_matrix(csr_matrix(hstack(shares))[nodes])
        return cls(
            nodes, block.points[nodes], C, K, beta, np.concatenate(at), np.concatenate(normals), together
        )

    def force(self, waves: InclinedField, base: Complex) -> Complex:
        """Spectrum F (3 n, nf) of the forces of a field.

        Parameters
        ----------
        base : (3, nf) c u_b, the displacement by which w is less than that of the waves
        """
        inside = waves.layer_at(self.at[:, 2])
        stress = waves.traction(self.at, self.normals, inside)
        stress[self.at[:, 2] > waves.field.levels[0]] = 0.0  # ground above the layers' level surface
        traction = (self.shares @ stress.reshape(len(self.at), -1)).reshape(len(self.nodes), 3, -1)
        w = (waves.displacement(self.points) - base).reshape(3 * len(self.nodes), -1)
        rate = 1j * waves.omega * w
        of_springs = self.springs @ (w + self.beta * rate)
        return np.asarray(traction.reshape(w.shape) + self.dashpots @ rate + of_springs)


@dataclass(frozen=True)
class InclinedDrive:
    """Histories of the forces of an inclined field from a record of its surface.

    Attributes
    ----------
    field : the layers
    damping : alpha [1/s], beta [s] of materials without damping of their own
    sides : block name -> its boundary
    onto : (rows, 3 nodes of all sides) what takes the forces to the rows of the load; None where these are
        the forces themselves
    """

    field: FreeField
    damping: tuple[float, float]
    sides: Mapping[str, BoundarySide]
    onto: Floats | None
    whole_record: ClassVar[bool] = True

    def drive(self, histories: Histories, dt: float, rates: Rates) -> Histories:
        """Add the forces; they begin before the record does, and with them all motions.

        The lead is the time that the waves take through the layers and along the boundary, with `RINGING`.
        Left out of the record are frequencies whose waves the mesh does not resolve, frequency zero, and
        those at which the depth would move far more than the surface (`_not_amplified`).
        """
        from scipy.fft import irfft, next_fast_len, rfft, rfftfreq  # here: few scenes have a free field

        acc = histories.rows[Motion.BASE]
        height = -np.diff(self.field.levels)
        slow = np.array([np.sqrt(m.rho / wave_moduli(m)[0]) for m in self.field.materials])
        lead = int(np.ceil((RINGING * (height @ slow) + self._longest_delay()) / dt))
        total = lead + acc.shape[1]

        # spectrum of the record after the lead, and before time for what rings on
        size = next_fast_len(total + 3 * lead, real=True)
        ended = np.pad(acc, ((0, 0), (0, lead)), mode="linear_ramp")  # a record that is cut off would ring
        spectrum = rfft(np.pad(ended, ((0, 0), (lead, size - total - lead))))
        omega = 2.0 * np.pi * rfftfreq(size, dt)

        # share of it that passes, by the phase across a layer, which is one element high
        passed = taper(omega * float((height * slow).max()), PASSED, LEFT_OUT)
        passed[0] = 0.0
        count = int(np.flatnonzero(passed).max(initial=0)) + 1
        passed[1:count] *= self._not_amplified(omega[1:count])
        spectrum *= passed

        # spectra of the forces, some frequencies at a time
        rows = sum(3 * len(side.nodes) for side in self.sides.values())
        rows = rows if self.onto is None else len(self.onto)
        forces = np.zeros((rows, len(omega)), dtype=complex)
        widest = max(3 * (len(side.nodes) + len(side.at)) for side in self.sides.values())
        step = max(1, _TOGETHER // widest)
        for first in range(1, count, step):
            some = slice(first, min(first + step, count))
            waves, base = self._field(omega[some], spectrum[:, some])
            each = np.concatenate([side.force(waves, base) for side in self.sides.values()])
            forces[:, some] = each if self.onto is None else self.onto @ each

        # and back to time: the forces begin at zero, as w does
        of_time = irfft(forces, size)[:, :total]
        motions = {
            Motion.BASE: irfft(spectrum, size)[:, :total],
            Motion.INCLINED: of_time - of_time[:, :1],
        }
        rest = {kind: np.pad(values, ((0, 0), (lead, 0))) for kind, values in histories.rows.items()}
        warnings = histories.warnings
        left_out = np.linalg.norm(acc - motions[Motion.BASE][:, lead:])
        left_out /= max(float(np.linalg.norm(acc)), np.finfo(float).tiny)
        if left_out > _SAID:
            cut = omega[1:][passed[1:] < 1.0]
            above = f" above {cut[0] / (2.0 * np.pi):.3g} Hz and" if len(cut) else ""
            warnings = (
                *warnings,
                f"free field: left out of the record's acceleration: {100 * left_out:.2g} % in L2 of it,"
                f"{above} at frequency zero; waves are shorter there than about three of the rock's "
                f"elements, or damping makes the motion at depth more than {AMPLIFIED[0]:g} times the "
                "surface's. Take smaller elements or less damping, low-pass the record, or let its velocity "
                "end at zero",
            )
        return Histories(rest | motions, histories.lead + lead, warnings)

    def _field(self, omega: Floats, acc: Complex) -> tuple[InclinedField, Complex]:
        """The waves w + c u_b of a base's acceleration (3, nf), and c u_b (3, nf), see above."""
        alpha = (self.field.materials[0].damping or self.damping)[0]
        base = -acc / (omega**2 - 1j * alpha * omega)  # u_b = -acc / omega^2
        return InclinedField.of_surface(self.field, omega, base, self.damping), base

    def _longest_delay(self) -> float:
        """Longest delay between the record's place and a node of the boundary, either way [s]."""
        late = [
            (side.points[:, :2] - self.field.origin) @ np.array(self.field.slowness)
            for side in self.sides.values()
        ]
        return float(np.abs(np.concatenate(late)).max(initial=0.0))

    def _not_amplified(self, omega: Floats) -> Floats:
        """Share (nf,) of a record that passes: less where the depth would move many times as the surface."""
        levels = self.field.levels[1:]
        points = np.column_stack([np.tile(self.field.origin, (len(levels), 1)), levels])
        moved = np.zeros(len(omega))
        for component in np.eye(3):
            acc = np.outer(component, np.ones(len(omega))).astype(complex)
            waves, base = self._field(omega, acc)
            size = np.linalg.norm(waves.displacement(points), axis=1) / np.linalg.norm(base, axis=0)
            moved = np.maximum(moved, size.max(axis=0))
        return taper(np.log(np.maximum.accumulate(moved)), *np.log(AMPLIFIED))


@dataclass(frozen=True)
class InclinedWaves:
    """Waves that come up through a scene's rock at an angle, as an effect."""

    scene: Scene
    damping: tuple[float, float]
    sides: Mapping[str, BoundarySide]

    def add(self, system: System, coordinates: EffectCoordinates) -> tuple[System, EffectCoordinates]:
        """Add the forces on absorbing faces: of the boundary's nodes, or of reduced coordinates."""
        field = self.scene.find(FreeField)
        assert field is not None
        total, first, pressed = sum(3 * len(side.nodes) for side in self.sides.values()), 0, {}
        for name, side in self.sides.items():
            dof = (3 * side.nodes[:, None] + np.arange(3)).ravel()
            columns = first + np.arange(len(dof))
            shape = (3 * len(self.scene.blocks[name].points), total)
            pressed[name] = csr_matrix((np.ones(len(dof)), (dof, columns)), shape=shape)
            first += len(dof)
        onto = coordinates.press(pressed)
        reduced = isinstance(onto, np.ndarray)
        drive = InclinedDrive(field, self.damping, self.sides, onto if reduced else None)
        load = -np.eye(len(onto)) if reduced else -csr_matrix(onto)
        return replace(system.loaded({Motion.INCLINED: load}), drives=(*system.drives, drive)), coordinates

    def static_loads(self, moving: PseudoStatic | None) -> dict[str, Floats]:
        """None: a part with a viscous boundary answers motions of the field, see `reduction.merged_part`."""
        return {}


def inclined_waves(scene: Scene, damping: DampingConfig) -> InclinedWaves | None:
    """The inclined field of a scene as an effect; None without one.

    Raises
    ------
    ConfigError
        for modal damping, and for layers of unlike alpha: w + c u_b is one wave only with one c.
    """
    field = scene.find(FreeField)
    if field is None or not field.inclined:
        return None
    if damping.modal is not None:
        raise ConfigError(FREE_FIELD_WITH_RATIOS)
    whole = rayleigh_coefficients(damping.rayleigh)
    drags = {(layer.damping or whole)[0] for layer in field.materials}
    if max(drags) - min(drags) > _SAME * max(drags):
        raise ConfigError(
            f"ground.incidence: layers of the rock have alpha of {min(drags):.4g} to {max(drags):.4g} 1/s in "
            "their damping, limit one; give them one alpha (materials.<name>.damping: alpha and beta), or "
            "leave `incidence` out"
        )
    sides = {
        name: BoundarySide.of(block, material_coefficients(block, damping.rayleigh)[1])
        for name, block in scene.blocks.items()
        if block.absorbing
    }
    return InclinedWaves(scene, whole, sides)
