"""Constant-curvature arc: pose, partial derivatives and second directional derivatives in closed form.

Source: arc of eqs. (7), (9) of the paper, with the arc's end written through Stumpff functions
``c_n(s) = sum_k (-s)^k / (2k + n)!`` of ``s = u^2 + v^2 = psi^2``:

    position  p = l [u c_2, v c_2, c_1]
    rotation  R = exp([w]x), w = (-v, u, 0)
    angular velocity (in the frame of the arc's base)  W_u u' + W_v v',
              W_u = (-u v c_3, 1 - v^2 c_3, -v c_2),  W_v = (u^2 c_3 - 1, u v c_3, u c_2)

Derivatives follow from ``d c_n / ds = (n c_{n+2} - c_{n+1}) / 2``. Frame: the arc starts at the origin along z and
bends towards ``(u, v)``. Valid for every finite ``u, v, l``; the straight arc is no special case.
"""

from typing import Any

import numpy as np

from .jit import compiled

# Rows of the work array that :func:`evaluate_arc` fills, each a vector of 3.
POSITION, BY_U, BY_V, BY_L, SECOND, ANGULAR_U, ANGULAR_V, ANGULAR_SECOND, ROTATION = range(9)
ARC_ROWS = ROTATION + 3

# Below this psi^2 the series for c_5, c_6 converges to rounding with ten terms; above it the recursion loses nothing.
SERIES_LIMIT = 4.0


@compiled
def stumpff(s: float) -> tuple[float, float, float, float, float, float]:
    """c_1 .. c_6 at ``s``: top two by series, the others downward by ``c_n = 1/n! - s c_{n+2}``."""
    if s < SERIES_LIMIT:
        c5 = 0.0
        c6 = 0.0
        for k in range(10, -1, -1):
            c5 = 1.0 - s / ((2 * k + 6) * (2 * k + 7)) * c5
            c6 = 1.0 - s / ((2 * k + 7) * (2 * k + 8)) * c6
        c5 /= 120.0
        c6 /= 720.0
        c4 = 1.0 / 24.0 - s * c6
        c3 = 1.0 / 6.0 - s * c5
        c2 = 0.5 - s * c4
        c1 = 1.0 - s * c3
    else:
        psi = np.sqrt(s)
        c1 = np.sin(psi) / psi
        c2 = (1.0 - np.cos(psi)) / s
        c3 = (1.0 - c1) / s
        c4 = (0.5 - c2) / s
        c5 = (1.0 / 6.0 - c3) / s
        c6 = (1.0 / 24.0 - c4) / s
    return c1, c2, c3, c4, c5, c6


@compiled
def evaluate_arc(u: float, v: float, l: float, du: float, dv: float, dl: float, out: Any) -> None:  # noqa: E741
    """Fill ``out`` (ARC_ROWS, 3) for the arc ``(u, v, l)`` moving at the constant rates ``(du, dv, dl)``."""
    s = u * u + v * v
    c1, c2, c3, c4, c5, c6 = stumpff(s)
    c1s = 0.5 * (c3 - c2)
    c2s = 0.5 * (2.0 * c4 - c3)
    c3s = 0.5 * (3.0 * c5 - c4)
    c4s = 0.5 * (4.0 * c6 - c5)
    c1ss = 0.5 * (c3s - c2s)
    c2ss = 0.5 * (2.0 * c4s - c3s)

    ds = 2.0 * (u * du + v * dv)
    dds = 2.0 * (du * du + dv * dv)
    d1 = c1s * ds
    d2 = c2s * ds
    d3 = c3s * ds
    dd1 = c1ss * ds * ds + c1s * dds
    dd2 = c2ss * ds * ds + c2s * dds

    out[POSITION, 0] = l * u * c2
    out[POSITION, 1] = l * v * c2
    out[POSITION, 2] = l * c1
    out[BY_U, 0] = l * (c2 + 2.0 * u * u * c2s)
    out[BY_U, 1] = l * 2.0 * u * v * c2s
    out[BY_U, 2] = l * 2.0 * u * c1s
    out[BY_V, 0] = out[BY_U, 1]
    out[BY_V, 1] = l * (c2 + 2.0 * v * v * c2s)
    out[BY_V, 2] = l * 2.0 * v * c1s
    out[BY_L, 0] = u * c2
    out[BY_L, 1] = v * c2
    out[BY_L, 2] = c1

    out[SECOND, 0] = 2.0 * dl * (du * c2 + u * d2) + l * (2.0 * du * d2 + u * dd2)
    out[SECOND, 1] = 2.0 * dl * (dv * c2 + v * d2) + l * (2.0 * dv * d2 + v * dd2)
    out[SECOND, 2] = 2.0 * dl * d1 + l * dd1

    out[ANGULAR_U, 0] = -u * v * c3
    out[ANGULAR_U, 1] = 1.0 - v * v * c3
    out[ANGULAR_U, 2] = -v * c2
    out[ANGULAR_V, 0] = u * u * c3 - 1.0
    out[ANGULAR_V, 1] = u * v * c3
    out[ANGULAR_V, 2] = u * c2
    # Time derivative of W_u u' + W_v v' at constant u', v'; with e = u v' - v u' it reads (u, v, .) (c_3 e).
    e = u * dv - v * du
    out[ANGULAR_SECOND, 0] = (du * c3 + u * d3) * e
    out[ANGULAR_SECOND, 1] = (dv * c3 + v * d3) * e
    out[ANGULAR_SECOND, 2] = d2 * e

    out[ROTATION, 0] = 1.0 - u * u * c2
    out[ROTATION, 1] = -u * v * c2
    out[ROTATION, 2] = u * c1
    out[ROTATION + 1, 0] = -u * v * c2
    out[ROTATION + 1, 1] = 1.0 - v * v * c2
    out[ROTATION + 1, 2] = v * c1
    out[ROTATION + 2, 0] = -u * c1
    out[ROTATION + 2, 1] = -v * c1
    out[ROTATION + 2, 2] = 1.0 - s * c2
