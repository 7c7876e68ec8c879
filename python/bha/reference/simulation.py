"""Time integration of (48): the plain fourth-order Runge-Kutta method, and a right-hand side for other integrators.

Units: s, m, m/s, Pa. The state is y = (q, q'), shape (6n,). Nothing here is adaptive or fast; it is what the compiled
integrators are compared with.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from bha.errors import InputError, SimulationError
from bha.reference.arguments import vector
from bha.reference.dynamics import forward_dynamics
from bha.reference.homogeneous import Array
from bha.reference.parameters import Arm

PressureFunction = Callable[[float], Array]
ForceFunction = Callable[[float], Array]


@dataclasses.dataclass(frozen=True)
class ReferenceTrajectory:
    """Times (k,) s, lengths q (k, 3n) m and rates qd (k, 3n) m/s."""

    t: Array
    q: Array
    qd: Array


def right_hand_side(
    arm: Arm, pressure_function: PressureFunction, force_function: ForceFunction | None = None
) -> Callable[[float, Array], Array]:
    """Return f(t, y) = y' for y = (q, q'), for instance for ``scipy.integrate.solve_ivp(..., method="DOP853")``.

    ``pressure_function(t)`` gives absolute pressures (3n,) Pa; ``force_function(t)`` external forces (n, 3) at the
    centres of mass in the world, N.
    """

    def f(t: float, y: Array) -> Array:
        q, qd = np.split(y, 2)
        f_ext = None if force_function is None else force_function(t)
        return np.concatenate([qd, forward_dynamics(arm, q, qd, pressure_function(t), f_ext)])

    return f


def simulate_rk4(
    arm: Arm,
    q0: Array,
    qd0: Array,
    pressure_function: PressureFunction,
    dt: float,
    n_steps: int,
    force_function: ForceFunction | None = None,
) -> ReferenceTrajectory:
    """Integrate (48) from t = 0 over ``n_steps`` steps of ``dt`` seconds with the classical Runge-Kutta method.

    Returns the n_steps + 1 states. Raises InputError for a wrong start or step, SimulationError with the time of the
    last good state and the trajectory up to it where the motion diverges.
    """
    if not (np.isfinite(dt) and dt > 0 and n_steps >= 0):
        raise InputError(f"dt, n_steps: found {dt!r}, {n_steps!r}, needed are dt > 0 and n_steps >= 0")
    f = right_hand_side(arm, pressure_function, force_function)
    y: Array = np.empty((n_steps + 1, 6 * arm.section_count))
    y[0] = np.concatenate([vector(arm, "q0", q0), vector(arm, "qd0", qd0)])
    t: Array = dt * np.arange(n_steps + 1, dtype=np.float64)
    for k in range(n_steps):
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                y[k + 1] = _rk4_step(f, float(t[k]), y[k], dt)
        except (_DivergedError, np.linalg.LinAlgError, OverflowError) as error:
            raise SimulationError(
                f"the motion diverged after t = {t[k]:.6g} s (step {k + 1} of {n_steps}): the state is not finite; "
                "try a smaller dt or check pressures and parameters",
                time=float(t[k]),
                trajectory=_trajectory(t[: k + 1], y[: k + 1]),
            ) from error
    return _trajectory(t, y)


def _rk4_step(f: Callable[[float, Array], Array], t: float, y: Array, dt: float) -> Array:
    k1 = f(t, y)
    k2 = f(t + dt / 2, _finite(y + dt / 2 * k1))
    k3 = f(t + dt / 2, _finite(y + dt / 2 * k2))
    k4 = f(t + dt, _finite(y + dt * k3))
    return _finite(y + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4))


class _DivergedError(Exception):
    """A stage of the method is not finite."""


def _finite(y: Array) -> Array:
    if not np.isfinite(y).all():
        raise _DivergedError
    return y


def _trajectory(t: Array, y: Array) -> ReferenceTrajectory:
    q, qd = np.split(y, 2, axis=1)
    return ReferenceTrajectory(t=t, q=q, qd=qd)
