"""Exact derivatives of forward dynamics by state, pressures and named parameters.

They are taken by dual numbers through the model itself, not by differences; only how the model's numbers follow from a
named parameter (``bha.parameters.paths``: mostly a product) is differenced, to order 8, which is good to about 1e-12.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arm.wrench import Wrench
from bha.errors import ParameterError
from bha.parameters import ArmParameters, paths

A = TypeVar("A")

#: Differences of order 8, central and to one side: places in steps, weights.
_CENTRAL = ((-4, -3, -2, -1, 1, 2, 3, 4), (1 / 280, -4 / 105, 1 / 5, -4 / 5, 4 / 5, -1 / 5, 4 / 105, -1 / 280))
_ONE_SIDED = (
    (0, 1, 2, 3, 4, 5, 6, 7, 8),
    (-761 / 280, 8.0, -14.0, 56 / 3, -35 / 2, 56 / 5, -14 / 3, 8 / 7, -1 / 8),
)


def linearized(
    arm: _core.Arm, q: ArrayLike, qd: ArrayLike, p: ArrayLike, period: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """As :meth:`bha.Arm.linearize`, of an arm of the core, which has no parameters of its own.

    Raises:
        InputError: an array of the wrong shape or with a value that is not finite.
    """
    return _core.linearize(arm, q, qd, p, period)


class Derivatives(NamedTuple):
    """Forward dynamics and its derivatives at one state; n sections, m inputs.

    Attributes:
        acceleration: q'', shape (3n,), m/s^2.
        by_lengths: d q''/dq, shape (3n, 3n), 1/s^2.
        by_velocities: d q''/dq', shape (3n, 3n), 1/s.
        by_pressures: d q''/dp, shape (3n, m), m/(s^2 Pa).
        by_parameters: d q''/d parameter, shape (3n, k), in the order of ``parameters``.
        parameters: paths of the parameters.
    """

    acceleration: NDArray[np.float64]
    by_lengths: NDArray[np.float64]
    by_velocities: NDArray[np.float64]
    by_pressures: NDArray[np.float64]
    by_parameters: NDArray[np.float64]
    parameters: tuple[str, ...]


def difference_arms(
    parameters: ArmParameters, path: str, made_of: Callable[[ArmParameters], A]
) -> tuple[list[A], list[float]]:
    """Arms with the parameter at ``path`` a little changed, and weights: the derivative of anything smooth by it.

    Args:
        parameters: those of the arm.
        path: of the number that is changed.
        made_of: makes an arm of parameters.

    Raises:
        ParameterError: there is no such parameter.
    """
    value = paths.get_value(parameters, path)
    reach = 2e-3 * abs(value) if value else 1e-3

    def at(steps: int) -> A:
        return made_of(paths.with_values(parameters, {path: value + steps * reach}))

    for sign, (places, weights) in ((1.0, _CENTRAL), (1.0, _ONE_SIDED), (-1.0, _ONE_SIDED)):
        try:
            arms = [at(int(sign) * place) for place in places]
        except ParameterError:
            continue
        return arms, [sign * weight / reach for weight in weights]
    raise ParameterError(
        f"{parameters.name}: {path} = {value} cannot be changed to either side, so there is no derivative by it"
    )


def differentiator(
    arm: _core.Arm,
    parameters: ArmParameters,
    names: Sequence[str],
    made_of: Callable[[ArmParameters], _core.Arm],
) -> Callable[..., Derivatives]:
    """The function (q, qd, p, f_ext=None, wrenches=None) that gives an arm's :class:`Derivatives`.

    Make it once, call it often.

    Args:
        arm: the arm.
        parameters: its parameters.
        names: paths of those that derivatives are taken by.
        made_of: makes an arm like this one of other parameters.

    Raises:
        ParameterError: there is no such parameter.
    """
    paths_of = tuple(names)
    stated = paths.stated(parameters, paths_of)
    if stated is not parameters:
        arm, parameters = made_of(stated), stated
    core = _core.Differentiator(arm, [difference_arms(parameters, path, made_of) for path in paths_of])
    n, m = 3 * len(parameters.sections), len(parameters.inputs)

    def derivatives(
        q: ArrayLike,
        qd: ArrayLike,
        p: ArrayLike,
        f_ext: ArrayLike | None = None,
        wrenches: Iterable[Wrench] | None = None,
    ) -> Derivatives:
        found = core(q, qd, p, f_ext, wrenches)
        columns = found.rows.T
        return Derivatives(
            acceleration=found.acceleration,
            by_lengths=columns[:, :n],
            by_velocities=columns[:, n : 2 * n],
            by_pressures=columns[:, 2 * n : 2 * n + m],
            by_parameters=columns[:, 2 * n + m :],
            parameters=paths_of,
        )

    return derivatives
