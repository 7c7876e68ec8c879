"""Exact derivatives of trajectories by initial state and named parameters, as :mod:`bha.arm.derivatives` has them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.arm import Arm
from bha.arm.derivatives import difference_arms
from bha.arrays import floats
from bha.logs import Log
from bha.parameters import paths
from bha.runs.input import Input
from bha.runs.options import Options
from bha.simulation.single import as_input
from bha.support.shown import short_repr


@short_repr
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
    stated = paths.stated(arm.parameters, names)
    arm = arm if stated is arm.parameters else arm.with_parameters(stated)
    time = floats(times, "times", (None,))
    by_parameters = np.zeros((size, len(names)))
    if x0_by_parameters is not None:
        by_parameters = floats(x0_by_parameters, "x0_by_parameters", by_parameters.shape)
    initial = size if initial_state else 0
    seeds = np.vstack([np.eye(size)[:initial], by_parameters.T])
    found = _core.sensitivities(
        arm,
        source.in_core(options.interpolation),
        time,
        float(source.time[0]) if start is None else float(start),
        x0,
        [difference_arms(arm.parameters, path, arm.with_parameters) for path in names],
        [None] * initial + list(range(len(names))),
        seeds,
        method=options.method,
        step=options.step,
        rtol=options.rtol,
        atol=options.atol,
        max_steps=options.max_steps,
    )
    columns = np.moveaxis(found.derivatives, 0, -1)
    return Sensitivities(time, found.states, columns[..., :initial], columns[..., initial:], names)
