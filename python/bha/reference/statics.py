"""Static models: coupled, N(q, 0) = tau(q, p) (62), and decoupled, spring force against pressure bellows by bellows.

Units: m, Pa. The coupled model is implicit in q; the paper found it slower than the dynamic simulation.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bha.errors import ConvergenceError, MissingExtraError
from bha.reference.arguments import external, vector
from bha.reference.derivatives import transformations
from bha.reference.forces import (
    actuation_bellows_forces,
    actuation_force_terms,
    bias_force_terms,
    spring_force,
    spring_slope,
)
from bha.reference.homogeneous import Array
from bha.reference.parameters import Arm
from bha.reference.wrenches import Wrench

_NEWTON_STEPS = 50
_FORCE_TOLERANCE = 1e-9  # N, relative to the greatest force at hand where that exceeds 1 N


def static_residual(arm: Arm, q: Array, p: Array, f_ext: Array | None = None, wrenches: Sequence[Wrench] = ()) -> Array:
    """N(q, 0) - tau(q, p) of (62); shape (3n,), N."""
    q, p, f_ext = vector(arm, "q", q), vector(arm, "p", p), external(arm, f_ext)
    state = transformations(arm, q)
    return bias_force_terms(arm, state, q, np.zeros_like(q), f_ext, wrenches) - actuation_force_terms(arm, state, p)


def static_lengths(
    arm: Arm,
    p: Array,
    f_ext: Array | None = None,
    q_start: Array | None = None,
    wrenches: Sequence[Wrench] = (),
) -> Array:
    """Equation (62), static coupled: lengths q (3n,) m at which the pressures p (3n,) Pa hold the arm.

    Args:
        arm: the arm.
        p: absolute pressures, Pa.
        f_ext: external forces (n, 3) at the centres of mass in the world, N.
        q_start: where the search starts; by default at the decoupled solution. There can be more than one pose, and
            ``end_force`` can make the one that is found unstable.
        wrenches: wrenches anywhere.

    Raises ConvergenceError with the residual that was left, MissingExtraError without SciPy.
    """
    try:
        from scipy.optimize import root  # noqa: PLC0415  (an optional dependency)
    except ImportError as error:
        raise MissingExtraError("static_lengths needs SciPy: pip install 'bha[identify]'") from error
    start = decoupled_static_lengths(arm, p) if q_start is None else vector(arm, "q_start", q_start)

    def residual_at(q: Array) -> Array:
        return static_residual(arm, q, p, f_ext, wrenches)

    solution = root(residual_at, start, method="hybr", options={"xtol": 1e-13})
    residual = float(np.max(np.abs(residual_at(solution.x))))
    # The residual decides, not the solver's flag: with so small an xtol it may report that it cannot improve further.
    scale = max(1.0, float(np.max(np.abs(actuation_bellows_forces(arm, vector(arm, "p", p))))))
    if not residual <= _FORCE_TOLERANCE * scale:
        raise ConvergenceError(
            f"static coupled model: no pose found, a force of {residual:.3g} N is left ({solution.message}); "
            "start nearer with q_start, or check that the pressures can be held"
        )
    return np.asarray(solution.x, dtype=float)


def decoupled_static_lengths(arm: Arm, p: Array) -> Array:
    """Static decoupled model: F_spr(q) = A_P (p - p_amb) for every bellows, no gravity, no bending; (3n,), m.

    Every bellows alone, but for the axial spring of a section, which takes a third of its force from each.
    Newton's method from the rest length. Raises ConvergenceError where a spring cannot balance its pressure.
    """
    forces = actuation_bellows_forces(arm, vector(arm, "p", p))
    lengths = np.empty_like(forces)
    for i, section in enumerate(arm.sections):
        extension = np.zeros(3)
        tolerance = _FORCE_TOLERANCE * np.maximum(1.0, np.abs(forces[i]))
        for _ in range(_NEWTON_STEPS):
            axial = extension.mean() + section.rest_length - section.axial_rest_length
            residual = spring_force(section.stiffness, extension) - forces[i]
            residual = residual + spring_force(section.axial_stiffness, axial) / 3.0
            if (np.abs(residual) <= tolerance).all():
                break
            slopes = np.diag(spring_slope(section.stiffness, extension))
            slopes = slopes + spring_slope(section.axial_stiffness, axial) / 9.0
            extension = extension - np.linalg.solve(slopes, residual)
        else:
            raise ConvergenceError(
                f"static decoupled model: section {i + 1} cannot balance {forces[i]} N with its springs; "
                f"forces of {residual} N are left"
            )
        lengths[i] = section.rest_length + extension
    return lengths.reshape(-1)
