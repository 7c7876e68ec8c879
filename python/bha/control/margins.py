"""Stability margins: controller and arm as one linear loop around a pose, with the lag of the pneumatics.

Around rest at a pose the arm is x' = A x + B p by exact derivatives (:meth:`bha.Arm.linearize`). An input's pneumatics
are a lag of first order, or spool, chamber and PI pressure controller, small against the valve's limits and with its
dead band taken as compensated; commands are held for a period. Controllers are what the core runs: law, Kalman filter
with the core's own gain, or differences. From these follow, exactly for the linear loop,

- whether it is stable: the moduli of its poles;
- the peak of the sensitivity M_s, the largest singular value over all frequencies of S = (I + C P)^-1 with the loop cut
  at the commanded pressures. 1 / M_s is the loop's distance from instability: M_s = 2 lets the gain of every command
  grow by a factor of 2 or fall by one of 2/3, and leaves 29 degrees of phase (Skogestad & Postlethwaite,
  *Multivariable Feedback Control*, 2005, sec. 2.4.3);
- the motion that sensor noise keeps up, from the loop's Lyapunov equation.

Limits: small motion around one pose; no saturation, no dead band, no hysteresis or creep in the loop.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.control.controller import Controller
from bha.control.limits import Limits
from bha.control.loop import Sensors
from bha.control.observers import FilteredDifference
from bha.control.working_point import WorkingPoint, mean_lengths

if TYPE_CHECKING:
    from bha.arm import Arm

Floats = NDArray[np.float64]

_ON_THE_CIRCLE = 1e-7
"""Poles this near to the unit circle count as on it: two at 1 are found apart by the root of a number's precision."""


@dataclass(frozen=True, eq=False)
class _System:
    """x+ = a x + b u, y = c x + d u, a row a period."""

    a: Floats
    b: Floats
    c: Floats
    d: Floats

    def response(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """y over u at each z, shape (len(z), outputs, inputs)."""
        moved = z[:, None, None] * np.eye(len(self.a)) - self.a
        found = self.c @ np.linalg.solve(moved, np.broadcast_to(self.b, (len(z), *self.b.shape))) + self.d
        return np.asarray(found, dtype=np.complex128)


@dataclass(frozen=True, eq=False)
class LinearLoop:
    """A controller and an arm around a pose, linear; made by :func:`linear_loop`.

    Attributes:
        period: control period, s.
        frequencies: at which the sensitivity is computed, Hz, shape (k,).
    """

    period: float
    frequencies: Floats
    _plant: _System
    _controller: _System
    _rates: slice

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles of the closed loop in z, one a state."""
        return np.asarray(np.linalg.eigvals(self._closed()[0]), dtype=np.complex128)

    @property
    def stable(self) -> bool:
        """Whether no pole lies outside the unit circle.

        On it stand the integrals of errors that no pressure can correct, where bellows share an input.
        """
        return bool(np.abs(self.poles).max() < 1.0 + _ON_THE_CIRCLE)

    @property
    def sensitivity(self) -> Floats:
        """Largest singular value of the sensitivity at each of :attr:`frequencies`, shape (k,)."""
        return self._sensitivity(self.frequencies)

    @property
    def sensitivity_peak(self) -> float:
        """M_s, over :attr:`frequencies` and those of the closed loop's own swings; infinite where it is not stable."""
        if not self.stable:
            return float("inf")
        own = np.abs(np.angle(self.poles)) / (2 * np.pi * self.period)
        own = own[(own > self.frequencies.min()) & (own < self.frequencies.max())]
        return float(self._sensitivity(np.concatenate([self.frequencies, own])).max())

    def _sensitivity(self, frequencies: Floats) -> Floats:
        z = np.exp(2j * np.pi * frequencies * self.period)
        loop = self._controller.response(z) @ self._plant.response(z)
        values = np.linalg.svd(np.eye(loop.shape[1]) + loop, compute_uv=False)
        return np.asarray(1.0 / np.maximum(values[:, -1], np.finfo(float).tiny))

    def rate_noise(self, sensors: Sensors) -> float:
        """Root mean square of the lengths' rates, over all lengths, that noise of ``sensors`` keeps up, m/s.

        Infinite where the loop is not stable.
        """
        if not self.stable:
            return float("inf")
        closed, inlet = self._closed()
        m = self._rates.stop - self._rates.start
        inputs = inlet.shape[1] - m
        scale = np.repeat([sensors.length_noise, sensors.pressure_noise], [m, inputs])
        covariance = (inlet * scale) @ (inlet * scale).T
        # Sum of closed^k covariance closed^k^T by doubling; 2^40 periods are enough for any pole that is inside at all.
        for _ in range(40):
            covariance = covariance + closed @ covariance @ closed.T
            closed = closed @ closed
        return float(np.sqrt(np.mean(np.diag(covariance)[self._rates])))

    def _closed(self) -> tuple[Floats, Floats]:
        """Matrix of the closed loop, and how noise of lengths and pressures enters."""
        p, c = self._plant, self._controller
        a = np.block([[p.a - p.b @ c.d @ p.c, -p.b @ c.c], [c.b @ p.c, c.a]])
        return a, np.vstack([-p.b @ c.d, c.b])


def linear_loop(
    controller: Controller,
    plant: Arm | None = None,
    *,
    pose: ArrayLike | None = None,
    period: float = 1e-3,
    frequencies: ArrayLike | None = None,
) -> LinearLoop:
    """A controller and the arm it leads, linear around rest at a pose.

    Args:
        controller: one of :mod:`bha.control`; where no gains are given, those it finds for itself.
        plant: the arm it leads; its own model if None.
        pose: lengths (3n,), m; None: the middle of their ranges. The arm is taken where it rests nearest to that.
        period: control period, s.
        frequencies: for the sensitivity, Hz, shape (k,); None: 80 from 0.2 Hz to almost half the control rate.

    Raises:
        ConvergenceError: no rest near the pose.
        InputError: arms that do not fit together.
    """
    arm = controller.arm if plant is None else plant
    limits = controller.limits or Limits.of(controller.arm)
    rest = limits.rest_near(arm, limits.middle if pose is None else pose)
    p, q = rest.pressures, rest.lengths
    m, inputs = len(q), len(p)
    model = WorkingPoint.at(controller.model(), q, p)
    if frequencies is None:
        frequencies = np.geomspace(0.2, 0.475 / period, 80)
    return LinearLoop(
        period,
        np.asarray(frequencies, dtype=np.float64),
        _plant(arm, WorkingPoint.at(arm, q, p), period),
        _controller(controller, model, period, (m, inputs)),
        slice(m, 2 * m),
    )


def largest_gain(peak: Callable[[float], float], bound: float) -> float:
    """The largest factor up to 1 on a gain for which ``peak`` of it (a sensitivity peak) keeps to ``bound``.

    Found from 1 downwards by steps of a quarter, then to 2 %. Where not even 1 % of the gain keeps to it, 1 %.
    """
    factor = 1.0
    while peak(factor) > bound and factor > 0.01:
        factor *= 0.75
    if factor == 1.0:
        return factor
    low, high = factor, factor / 0.75
    while high / low > 1.02:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if peak(middle) <= bound else (low, middle)
    return max(low, 0.01)


def _plant(arm: Arm, point: WorkingPoint, period: float) -> _System:
    """From commands to lengths, then pressures. Its first states are lengths and rates."""
    m, inputs = len(point.lengths), len(point.pressures)
    zero, one = np.zeros((inputs, inputs)), np.eye(inputs)
    motion = np.block([[np.zeros((m, m)), np.eye(m)], [point.by_lengths, point.by_rates]])
    force = np.vstack([np.zeros((m, inputs)), point.by_pressures])
    table = arm.parameters.pneumatics
    if table is None or table.level == "ideal":
        a, b = _held(motion, force, period)
        # The measured pressure is the command of the period before.
        a = np.block([[a, np.zeros((2 * m, inputs))], [np.zeros((inputs, 2 * m)), zero]])
        b = np.vstack([b, one])
        states = 2 * m + inputs
    elif table.level == "lag":
        assert table.fill_time is not None
        assert table.vent_time is not None
        rate = 2.0 / (table.fill_time + table.vent_time)
        a, b = _held(
            np.block([[motion, force], [np.zeros((inputs, 2 * m)), -rate * one]]),
            np.vstack([np.zeros((2 * m, inputs)), rate * one]),
            period,
        )
        states = 2 * m + inputs
    else:
        a, b = _held(*_pneumatic(arm, point, motion, force), period)
        states = 2 * m + 3 * inputs
    seen = np.zeros((m + inputs, states))
    seen[:m, :m] = np.eye(m)
    seen[m:, 2 * m : 2 * m + inputs] = one
    return _System(a, b, seen, np.zeros((m + inputs, inputs)))


def _pneumatic(arm: Arm, point: WorkingPoint, motion: Floats, force: Floats) -> tuple[Floats, Floats]:
    """The arm under full pneumatics: states lengths, rates, pressures p, wanted rates w behind the spool, integrals I.

    p' = g w - n p V'/V, w' = (k_p (u - p) + I - w) / T_s, I' = k_i (u - p). The valve is opened for the middle volume
    and for ambient density, g = V_middle / V (p / p_amb)^(1 - 1/n) says what comes of it.
    """
    table = arm.parameters.pneumatics
    assert table is not None
    given = (
        table.polytropic_exponent,
        table.dead_volume,
        table.proportional_gain,
        table.integral_gain,
        table.spool_time,
    )
    exponent, dead_volume, proportional, integral, spool = (float(x) for x in given if x is not None)
    areas = mean_lengths(arm, weighted=True)
    limits = Limits.of(arm)
    middle = dead_volume + areas @ limits.middle
    volume = dead_volume + areas @ point.lengths
    m, inputs = len(point.lengths), len(point.pressures)
    ambient = arm.parameters.ambient_pressure
    gain = middle / volume * (point.pressures / ambient) ** (1.0 - 1.0 / exponent)
    rates, p = slice(m, 2 * m), slice(2 * m, 2 * m + inputs)
    w, i = slice(p.stop, p.stop + inputs), slice(p.stop + inputs, p.stop + 2 * inputs)
    a, b = np.zeros((i.stop, i.stop)), np.zeros((i.stop, inputs))
    one = np.eye(inputs)
    a[: 2 * m, : 2 * m], a[: 2 * m, p] = motion, force
    a[p, rates], a[p, w] = -(exponent * point.pressures / volume)[:, None] * areas, np.diag(gain)
    a[w, p], a[w, w], a[w, i], b[w] = -proportional / spool * one, -one / spool, one / spool, proportional / spool * one
    a[i, p], b[i] = -integral * one, integral * one
    return a, b


def _controller(controller: Controller, point: WorkingPoint, period: float, size: tuple[int, int]) -> _System:
    """From deviations of measured lengths, then pressures, to minus the command."""
    m, inputs = size
    law = controller.feedback(point, period)
    observer = controller.observer or controller.default_observer()
    one, zero = np.eye(m), np.zeros((m, m))
    if isinstance(observer, FilteredDifference):
        keep = float(np.exp(-observer.cutoff * period))
        slope = (1 - keep) / period
        # States: the length before and the rate; their present values are those of the next period.
        before = np.block([[zero, zero], [-slope * one, keep * one]])
        into = np.vstack([np.hstack([one, np.zeros((m, inputs))]), np.hstack([slope * one, np.zeros((m, inputs))])])
        seen = np.hstack([law.proportional, law.derivative])
    else:
        core = controller.build(period)
        core.step(point.lengths, point.pressures, np.vstack([point.lengths, np.zeros((2, m))]))
        gain = core.observer_gain
        ahead = _prediction(point, period, inputs, core.observer_substeps)
        corrected = (np.eye(3 * m) - gain @ np.hstack([one, zero, zero])) @ ahead
        predict, pressed = corrected[:, : 3 * m], corrected[:, 3 * m :]
        # Real pressures are taken as the mean of the period's ends, ideal ones as they are; one more state: the last.
        share = 0.0 if controller.arm.pneumatics_level == "ideal" else 0.5
        before = np.block([[predict, share * pressed], [np.zeros((inputs, 3 * m + inputs))]])
        into = np.block([[gain, (1 - share) * pressed], [np.zeros((inputs, m)), np.eye(inputs)]])
        seen = np.hstack([law.proportional, law.derivative, law.disturbance, np.zeros((inputs, inputs))])
    states = len(before)
    if not law.integral.any():
        # A state that nothing depends on would stand as a pole at 1.
        return _System(before, into, seen @ before, seen @ into)
    # Integral of the estimated (Kalman filter) or measured lengths, taken on before it is used.
    pick = np.zeros((m, states))
    pick[:, :m] = one
    a = np.block([[before, np.zeros((states, m))], [period * pick @ before, one]])
    b = np.vstack([into, period * pick @ into])
    out = np.hstack([seen, law.integral])
    return _System(a, b, out @ a, out @ b)


def _prediction(point: WorkingPoint, period: float, inputs: int, count: int) -> Floats:
    """The Kalman filter's prediction over a period: from lengths, rates, unexplained accelerations and pressures.

    As the core takes it: ``count`` evaluations at the lengths half a step ahead, or, where that is 0, exactly.
    """
    m = len(point.lengths)
    one, zero, none = np.eye(m), np.zeros((m, m)), np.zeros((m, inputs))
    motion = np.block([[zero, one], [point.by_lengths, point.by_rates]])
    rest = np.hstack([np.zeros((m + inputs, 2 * m)), np.eye(m + inputs)])
    if count == 0:
        ahead = _held(motion, np.block([[zero, none], [one, point.by_pressures]]), period)
        return np.vstack([np.hstack(ahead), rest])[: 3 * m]
    step = period / count
    half = step / 2 * one
    rates = np.hstack([zero, one, zero, none]) + step * np.hstack(
        [point.by_lengths, point.by_lengths @ half + point.by_rates, one, point.by_pressures]
    )
    lengths = np.hstack([one, half, zero, none]) + half @ rates
    return np.linalg.matrix_power(np.vstack([lengths, rates, rest]), count)[: 3 * m]


def _held(a: Floats, b: Floats, period: float) -> tuple[Floats, Floats]:
    """x' = a x + b u over a period with u held: matrix exponential by scaling and squaring of its power series."""
    n = len(a)
    block = np.zeros((n + b.shape[1], n + b.shape[1]))
    block[:n] = np.hstack([a, b]) * period
    squarings = max(0, int(np.ceil(np.log2(max(np.abs(block).sum(axis=0).max(), 1e-300)))) + 2)
    term = total = np.eye(len(block))
    for k in range(1, 16):
        term = term @ block / (k * 2.0**squarings)
        total = total + term
    for _ in range(squarings):
        total = total @ total
    return total[:n, :n], total[:n, n:]
