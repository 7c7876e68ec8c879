"""Exact derivatives: of forward dynamics and of trajectories, by state, pressures and named parameters.

They are taken by dual numbers through the model itself, not by differences; only how the model's numbers follow from a
named parameter (``bha.parameters.paths``: mostly a product) is differenced, to order 8, which is good to about 1e-12.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arrays import floats
from bha.errors import ParameterError
from bha.parameters import paths
from bha.runs.simulation import Input, Options, as_input

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.logs import Log

#: Differences of order 8, central and to one side: places in steps, weights.
_CENTRAL = ((-4, -3, -2, -1, 1, 2, 3, 4), (1 / 280, -4 / 105, 1 / 5, -4 / 5, 4 / 5, -1 / 5, 4 / 105, -1 / 280))
_ONE_SIDED = (
    (0, 1, 2, 3, 4, 5, 6, 7, 8),
    (-761 / 280, 8.0, -14.0, 56 / 3, -35 / 2, 56 / 5, -14 / 3, 8 / 7, -1 / 8),
)


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


@dataclass(frozen=True)
class Sensitivities:
    """A trajectory and its derivatives; 2 x 3n states (lengths, then rates), k parameters.

    Attributes:
        time: times of the rows, s, shape (rows,).
        states: lengths and rates, m and m/s, shape (rows, 6n).
        by_initial_state: shape (rows, 6n, 6n): d state / d initial state.
        by_parameters: shape (rows, 6n, k), in the order of ``parameters``.
        parameters: paths of the parameters.
    """

    time: NDArray[np.float64]
    states: NDArray[np.float64]
    by_initial_state: NDArray[np.float64]
    by_parameters: NDArray[np.float64]
    parameters: tuple[str, ...]


def parameter_names(arm: Arm) -> tuple[str, ...]:
    """Paths of all numbers of an arm that there are derivatives by: ``section.2.mass``, ``gravity.x``, ..."""
    return tuple(path for path in paths.available(arm.parameters) if not paths.is_of_sensors(path))


def difference_arms(arm: Arm, path: str) -> tuple[list[Arm], list[float]]:
    """Arms with the parameter at ``path`` a little changed, and weights: the derivative of anything smooth by it.

    Raises:
        ParameterError: there is no such parameter.
    """
    value = paths.get_value(arm.parameters, path)
    reach = 2e-3 * abs(value) if value else 1e-3

    def at(steps: int) -> Arm:
        return arm.with_parameters(paths.with_values(arm.parameters, {path: value + steps * reach}))

    for sign, (places, weights) in ((1.0, _CENTRAL), (1.0, _ONE_SIDED), (-1.0, _ONE_SIDED)):
        try:
            arms = [at(int(sign) * place) for place in places]
        except ParameterError:
            continue
        return arms, [sign * weight / reach for weight in weights]
    raise ParameterError(
        f"{arm.name}: {path} = {value} cannot be changed to either side, so there is no derivative by it"
    )


def differentiator(arm: Arm, parameters: Sequence[str] = ()) -> Callable[..., Derivatives]:
    """The function (q, qd, p, f_ext=None) that gives an arm's :class:`Derivatives`; make it once, call it often.

    Raises:
        ParameterError: there is no such parameter.
    """
    names = tuple(parameters)
    core = _core.Differentiator(arm, [difference_arms(arm, path) for path in names])
    n, m = 3 * arm.section_count, len(arm.inputs)

    def derivatives(q: ArrayLike, qd: ArrayLike, p: ArrayLike, f_ext: ArrayLike | None = None) -> Derivatives:
        acceleration, rows = core(q, qd, p, f_ext)
        columns = rows.T
        return Derivatives(
            acceleration=acceleration,
            by_lengths=columns[:, :n],
            by_velocities=columns[:, n : 2 * n],
            by_pressures=columns[:, 2 * n : 2 * n + m],
            by_parameters=columns[:, 2 * n + m :],
            parameters=names,
        )

    return derivatives


def sensitivities(
    arm: Arm,
    drive: Input | Log,
    x0: ArrayLike,
    *,
    times: ArrayLike,
    parameters: Sequence[str] = (),
    initial_state: bool = True,
    x0_by_parameters: ArrayLike | None = None,
    start: float | None = None,
    options: Options | None = None,
) -> Sensitivities:
    """A trajectory's exact derivatives by its initial state and by named parameters.

    Args:
        arm: the arm.
        drive: its input.
        x0: initial lengths and rates, shape (6n,).
        times: times of the rows, s, ascending.
        parameters: paths of parameters.
        initial_state: whether to take derivatives by the initial state.
        x0_by_parameters: how the initial state itself depends on the parameters, shape (6n, k); not at all if None.
        start: start, s; the first sample if None.
        options: how to integrate; an adaptive method's steps count as constants.

    Raises:
        ParameterError: there is no such parameter.
        InputError: an argument is not allowed.
        SimulationError: the run cannot go on.
    """
    options = options or Options()
    source = as_input(arm, drive)
    size, names = 6 * arm.section_count, tuple(parameters)
    time = floats(times, "times", (None,))
    by_parameters = np.zeros((size, len(names)))
    if x0_by_parameters is not None:
        by_parameters = floats(x0_by_parameters, "x0_by_parameters", by_parameters.shape)
    initial = size if initial_state else 0
    seeds = np.vstack([np.eye(size)[:initial], by_parameters.T])
    states, rows = _core.sensitivities(
        arm,
        source.time,
        source.pressures,
        source.force_rows,
        time,
        float(source.time[0]) if start is None else float(start),
        x0,
        [difference_arms(arm, path) for path in names],
        [None] * initial + list(range(len(names))),
        seeds,
        interpolation=options.interpolation or source.interpolation,
        method=options.method,
        step=options.step,
        rtol=options.rtol,
        atol=options.atol,
        max_steps=options.max_steps,
    )
    columns = np.moveaxis(rows, 0, -1)
    return Sensitivities(time, states, columns[..., :initial], columns[..., initial:], names)
