"""What an angle of incidence changes, in closed form: delays along the surface, factors of a half-space."""

from __future__ import annotations

import numpy as np

from romdam.core.scene import FreeField, Material


def surface_factors(material: Material, slowness: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Motion along the travel and up, of a half-space's surface by an SV and a P wave of unit amplitude.

    The incoming S wave moves ahead and down, the P wave ahead and up, where the waves travel up and ahead.

    Parameters
    ----------
    slowness : along the surface, below that of P waves [s/m]

    References
    ----------
    Aki, Richards, Quantitative Seismology, 2nd ed. (2002), eq. 5.27 to 5.32: sums of the incident and the
    reflected waves.
    """
    c_s, c_p = material.wave_speeds
    a, b = np.sqrt(c_p**-2 - slowness**2), np.sqrt(c_s**-2 - slowness**2)
    twist = c_s**-2 - 2.0 * slowness**2
    share = 2.0 * c_s**-2 / (twist**2 + 4.0 * slowness**2 * a * b)
    of_sv = share * c_s * b * twist, -share * 2.0 * c_s * slowness * a * b
    of_p = share * 2.0 * c_p * slowness * a * b, share * c_p * a * twist
    return (float(of_sv[0]), float(of_sv[1])), (float(of_p[0]), float(of_p[1]))


def incidence_statement(field: FreeField) -> str:
    """Say what the angle of a field changes: when the surface moves, and how one wave alone would move it."""
    p = float(np.hypot(*field.slowness))
    x, y = np.array(field.slowness) / p
    deepest = field.materials[-1]
    sv, of_p = surface_factors(deepest, p)
    shear, pressure = np.degrees(np.arcsin(p * np.array(deepest.wave_speeds)))
    return (
        f"waves travel along ({x:.3g}, {y:.3g}) with an apparent velocity of {1.0 / p:.4g} m/s: "
        f"{1e5 * p:.3g} ms of delay for 100 m; the surface moves as the record at x = "
        f"{field.origin[0]:.4g} m, y = {field.origin[1]:.4g} m. In the lowest layer S waves come up at "
        f"{shear:.3g} degrees and P waves at {pressure:.3g}. Alone in a half-space of it, SV would move the "
        f"surface by {sv[0]:.3g} of its amplitude along and {abs(sv[1]):.3g} up (straight up 2 and 0), P by "
        f"{of_p[0]:.3g} and {of_p[1]:.3g} (0 and 2); both together make the record"
    )
