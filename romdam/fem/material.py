"""Elastic constants."""

from __future__ import annotations

from romdam.core.scene import Material


def lame(material: Material) -> tuple[float, float]:
    """Lame's lambda and mu [Pa] of an isotropic material."""
    E, nu = material.E, material.nu
    return E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
