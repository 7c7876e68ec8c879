"""One section whose bellows slip, by an integrator of its own: elements that slip at once, side by side.

The core has no part in the slip: a bellows pushes as its pressure does, so that the force of its elements is put in as
pressure, and the arm's motion between samples follows by Runge and Kutta's method with the elements at every stage.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

import bha

from .synthetic import SAMPLE_TIME, one_section, pressures, simulated

Array = NDArray[np.float64]
STEPS = 2


def slipping(arm: bha.Arm, time: Array, p: Array, yields: Sequence[float], forces: Sequence[float]) -> Array:
    """Lengths, shape (rows, 3): each bellows has elements of greatest force F, N, at travels from rest, m."""
    reach, greatest = (np.array(v)[:, None] for v in (yields, forces))
    area, h = arm.parameters.sections[0].terminal_area, (time[1] - time[0]) / STEPS
    q, v, strain = simulated(arm, time[:2], p[:2], [])[0], np.zeros(3), np.zeros((len(yields), 3))
    lengths = [q]
    for before, after in pairwise(p):
        for k in range(STEPS):
            first, last = (before + (after - before) * share / STEPS for share in (k, k + 1))
            start, begun = q, strain

            def strained(q: Array, start: Array = start, begun: Array = begun) -> Array:
                return np.clip(begun + (q - start) / reach, -1.0, 1.0)

            def acceleration(q: Array, v: Array, p: Array) -> Array:
                return arm.forward_dynamics(q, v, p - np.sum(greatest * strained(q), axis=0) / area)

            half = 0.5 * (first + last)
            a1 = acceleration(q, v, first)
            v2 = v + 0.5 * h * a1
            a2 = acceleration(q + 0.5 * h * v, v2, half)
            v3 = v + 0.5 * h * a2
            a3 = acceleration(q + 0.5 * h * v2, v3, half)
            v4 = v + h * a3
            a4 = acceleration(q + h * v3, v4, last)
            q = q + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            strain = strained(q)
        lengths.append(q)
    return np.array(lengths)


def slip_logs(
    yields: Sequence[float], forces: Sequence[float], durations: Sequence[float], noise: float = 2e-4
) -> list[bha.Log]:
    """Logs of that arm, alternately steps and multisines."""
    arm, logs = one_section(), []
    for number, duration in enumerate(durations):
        rng = np.random.default_rng([0, number])
        time = np.arange(round(duration / SAMPLE_TIME) + 1) * SAMPLE_TIME
        p = pressures(time, "multisine" if number % 2 else "steps", rng)
        q = slipping(arm, time, p, yields, forces) + noise * rng.standard_normal((len(time), 3))
        sensed = p + 200.0 * rng.standard_normal(p.shape)
        columns = {"t [s]": time} | {f"{name} [Pa]": sensed[:, k] for k, name in enumerate(arm.inputs)}
        logs.append(bha.Log.from_arrays(columns | {f"q1{k + 1} [m]": q[:, k] for k in range(3)}))
    return logs
