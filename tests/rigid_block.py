"""Newmark's rigid block on a shaken plane, integrated exactly from event to event."""

from itertools import pairwise

import numpy as np

from romdam.core.arrays import Floats


def rigid_slip(along: Floats, dt: float, down: float, resisting: float) -> Floats:
    """Slip up the slope of a rigid block at every sample, under ground acceleration linear between samples.

    It slides with s'' = -a - down - resisting sign(s'), and is at rest where |a + down| <= resisting;
    s' is a parabola between events, whose zeros end the sliding.

    Parameters
    ----------
    along : (nt,) ground acceleration up the slope [m/s2]
    down, resisting : g sin(slope), mu g cos(slope) [m/s2]

    References
    ----------
    Newmark, Effects of earthquakes on dams and embankments, Geotechnique 15 (1965) 139.
    """
    slip, rate, made = 0.0, 0.0, [0.0]
    for a, b in pairwise(-along - down):
        t, turn = 0.0, (b - a) / dt
        while t < dt:
            pull = a + turn * t
            if rate == 0.0 and abs(pull) <= resisting + 1e-12:  # at rest until the pull is more than that
                ends = [(side * resisting - a) / turn for side in (-1.0, 1.0) if turn * side > 0.0]
                t = min([dt, *(end for end in ends if end > t)])
                rate = 0.0 if t == dt else np.sign(turn) * 1e-300
                continue
            net, left = pull - resisting * np.sign(rate or pull), dt - t
            stops = [
                z.real for z in np.roots([0.5 * turn, net, rate]) if z.imag == 0.0 and 1e-12 < z.real < left
            ]
            h = min([left, *stops])
            slip += rate * h + net * h**2 / 2.0 + turn * h**3 / 6.0
            rate = 0.0 if h < left else rate + net * h + turn * h**2 / 2.0
            t += h
        made.append(slip)
    return np.array(made)
