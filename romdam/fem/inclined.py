"""Plane waves that come up through level layers at an angle: P, SV and SH of one horizontal slowness.

All motion goes as exp(i omega (t - p x)), x along the direction of travel and p the slowness, one over the
apparent velocity along the surface. In each layer it is a sum of waves up and down, of vertical wave numbers

    nu_P^2 = rho omega_d^2 / (lambda + 2 mu) - (omega p)^2,   nu_S^2 = rho omega_d^2 / mu - (omega p)^2,

with omega_d^2 = omega^2 - i alpha omega and moduli times 1 + i beta omega. The surface moves as it is
told and carries no traction, which gives all waves of the first layer; displacement and traction go on at
its foot, which gives those of the next (Haskell's method). No wave needs to be named: of a motion that
one SV wave makes at the surface, a half-space has that wave, and what it reflects.

References
----------
Haskell, Bull. Seism. Soc. Am. 43 (1953) 17; Aki, Richards, Quantitative Seismology, 2nd ed. (2002), sections
5.2 and 5.4; Achenbach, Wave Propagation in Elastic Solids (1973), section 5.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from romdam.core.arrays import Floats, Ints
from romdam.core.scene import FreeField, Material
from romdam.core.system import Complex
from romdam.fem.material import lame

_SIGNS = np.array([1.0, -1.0])  # of the vertical phase: down, up


@dataclass(frozen=True)
class _Layer:
    """Waves of a layer at some frequencies.

    Attributes
    ----------
    phase : (nf, 4) i nu z per height above the layer's top, of P down, P up, S down, S up [1/m]
    motion : (nf, 3, 4) displacement along the travel, across and up of each; SH moves across, by 1
    lam, mu : (nf,) complex moduli [Pa]
    """

    phase: Complex
    motion: Complex
    lam: Complex
    mu: Complex


@dataclass(frozen=True)
class InclinedField:
    """The field of given motions of the surface.

    Attributes
    ----------
    field : layers, slowness and origin
    omega : (nf,) above zero [rad/s]
    layers : waves of each
    plane, across : (layers, nf, 4) and (layers, nf, 2) amplitudes of waves in the plane and of SH
    """

    field: FreeField
    omega: Floats
    layers: tuple[_Layer, ...]
    plane: Complex
    across: Complex

    @classmethod
    def of_surface(
        cls, field: FreeField, omega: Floats, surface: Complex, damping: tuple[float, float]
    ) -> Self:
        """Find the field.

        Parameters
        ----------
        omega : (nf,) above zero [rad/s]
        surface : (3, nf) displacement of the surface at the field's origin along x, y, z
        damping : alpha [1/s], beta [s] of materials without damping of their own
        """
        along, across, up = directions(field) @ surface
        p = float(np.hypot(*field.slowness))
        state = np.zeros((len(omega), 4), dtype=complex)  # along, up, shear, normal stress
        state[:, 0], state[:, 1] = along, up
        state_across = np.zeros((len(omega), 2), dtype=complex)
        state_across[:, 0] = across
        layers, plane, transverse = [], [], []
        for height, material in zip(-np.diff(field.levels), field.materials, strict=True):
            layer = _layer(material, omega, p, damping)
            whole = _states(layer, omega * p)
            a = np.linalg.solve(whole, state[..., None])[..., 0]
            k = layer.phase[:, 2:]
            stress = layer.mu[:, None] * k
            of_across = np.stack([np.ones_like(k), stress], axis=1)
            b = np.linalg.solve(of_across, state_across[..., None])[..., 0]
            layers.append(layer)
            plane.append(a)
            transverse.append(b)
            state = (whole @ (a * np.exp(-layer.phase * height))[..., None])[..., 0]
            state_across = (of_across @ (b * np.exp(-k * height))[..., None])[..., 0]
        return cls(field, omega, tuple(layers), np.array(plane), np.array(transverse))

    def layer_at(self, z: Floats) -> Ints:
        """(n,) layers at elevations."""
        return np.clip(np.searchsorted(-self.field.levels, -z, side="right") - 1, 0, len(self.layers) - 1)

    def displacement(self, points: Floats, which: Ints | None = None) -> Complex:
        """(n, 3, nf) along x, y, z at points (n, 3).

        Parameters
        ----------
        which : (n,) layers; those at their elevations if not given
        """
        out = np.zeros((len(points), 3, len(self.omega)), dtype=complex)
        for k, some, phase, waves in self._waves(points, which):
            layer = self.layers[k]
            local = np.zeros((len(some), 3, len(self.omega)), dtype=complex)
            local[:, 0], local[:, 2] = (
                np.einsum("nwf,fw->nf", waves[:, :4], layer.motion[:, row]) for row in (0, 2)
            )
            local[:, 1] = waves[:, 4:].sum(axis=1)
            out[some] = np.einsum("ij,nif->njf", directions(self.field), local * phase[:, None])
        return out

    def traction(self, points: Floats, normals: Floats, which: Ints) -> Complex:
        """(n, 3, nf) stress times normals (n, 3), of any length, along x, y, z at points (n, 3) of layers."""
        out = np.zeros((len(points), 3, len(self.omega)), dtype=complex)
        turn = directions(self.field)
        kx = self.omega * float(np.hypot(*self.field.slowness))
        for k, some, phase, waves in self._waves(points, which):
            layer, normal = self.layers[k], normals[some] @ turn.T
            x, z, vertical = layer.motion[:, 0], layer.motion[:, 2], layer.phase
            dilation = -1j * kx[:, None] * x + vertical * z
            shear = layer.mu[:, None] * (vertical * x - 1j * kx[:, None] * z)
            of_x = layer.lam[:, None] * dilation - 2j * layer.mu[:, None] * kx[:, None] * x
            of_z = layer.lam[:, None] * dilation + 2.0 * layer.mu[:, None] * vertical * z
            of_y = layer.lam[:, None] * dilation
            xx, zz, yy, xz = (
                np.einsum("nwf,fw->nf", waves[:, :4], each) for each in (of_x, of_z, of_y, shear)
            )
            sh = waves[:, 4:]
            yz = np.einsum("nwf,fw->nf", sh, layer.mu[:, None] * vertical[:, 2:])
            xy = -1j * kx * layer.mu * sh.sum(axis=1)
            n = normal[:, :, None]
            local = np.stack(
                [
                    xx * n[:, 0] + xy * n[:, 1] + xz * n[:, 2],
                    xy * n[:, 0] + yy * n[:, 1] + yz * n[:, 2],
                    xz * n[:, 0] + yz * n[:, 1] + zz * n[:, 2],
                ],
                axis=1,
            )
            out[some] = np.einsum("ij,nif->njf", turn, local * phase[:, None])
        return out

    def _waves(self, points: Floats, which: Ints | None) -> list[tuple[int, Ints, Complex, Complex]]:
        """Layer, its points, their horizontal phase (n, nf), and amplitudes (n, 6, nf) of its waves there."""
        z = np.minimum(points[:, 2], self.field.levels[0])
        layer_of = self.layer_at(z) if which is None else which
        late = (points[:, :2] - self.field.origin) @ np.array(self.field.slowness)
        parts = []
        for k in np.unique(layer_of):
            some = np.flatnonzero(layer_of == k)
            layer = self.layers[k]
            heights, at = np.unique(np.round(z[some] - self.field.levels[k], 9), return_inverse=True)
            exponents = np.exp(layer.phase.T[None] * heights[:, None, None])
            amplitudes = np.concatenate([self.plane[k], self.across[k]], axis=1).T
            waves = (np.concatenate([exponents, exponents[:, 2:]], axis=1) * amplitudes)[at]
            delays, back = np.unique(np.round(late[some], 12), return_inverse=True)
            phase = np.exp(-1j * delays[:, None] * self.omega)[back]
            parts.append((int(k), some, phase, waves))
        return parts


def directions(field: FreeField) -> Floats:
    """(3, 3) unit vectors along the travel, across it, and up."""
    x, y = np.array(field.slowness) / np.hypot(*field.slowness)
    return np.array([[x, y, 0.0], [-y, x, 0.0], [0.0, 0.0, 1.0]])


def _layer(material: Material, omega: Floats, p: float, damping: tuple[float, float]) -> _Layer:
    alpha, beta = material.damping or damping
    loss: Complex = np.asarray(1.0 + 1j * beta * omega, dtype=np.complex128)
    lam, mu = lame(material)[0] * loss, lame(material)[1] * loss
    inertia, kx = material.rho * (omega**2 - 1j * alpha * omega), omega * p
    nu_p, nu_s = np.sqrt(inertia / (lam + 2.0 * mu) - kx**2), np.sqrt(inertia / mu - kx**2)
    size_p, size_s = np.sqrt(kx**2 + np.abs(nu_p) ** 2), np.sqrt(kx**2 + np.abs(nu_s) ** 2)
    motion = np.zeros((len(omega), 3, 4), dtype=complex)
    for column, sign in enumerate(_SIGNS):
        motion[:, 0, column], motion[:, 2, column] = -kx / size_p, sign * nu_p / size_p
        motion[:, 0, 2 + column], motion[:, 2, 2 + column] = sign * nu_s / size_s, kx / size_s
    nu = np.stack([nu_p, -nu_p, nu_s, -nu_s], axis=1)
    return _Layer(1j * nu, motion, lam, mu)


def _states(layer: _Layer, kx: Floats) -> Complex:
    """(nf, 4, 4) along, up, shear and normal stress on a level plane, of each wave."""
    x, z, vertical = layer.motion[:, 0], layer.motion[:, 2], layer.phase
    shear = layer.mu[:, None] * (vertical * x - 1j * kx[:, None] * z)
    dilation = -1j * kx[:, None] * x + vertical * z
    normal = layer.lam[:, None] * dilation + 2.0 * layer.mu[:, None] * vertical * z
    return np.stack([x, z, shear, normal], axis=1)
