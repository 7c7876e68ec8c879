"""Controllers that run in the core. Each is an immutable description; :meth:`Controller.build` makes one that runs.

With e = reference minus length, coordinates the bellows lengths, and M q'' + C q' + N = tau (paper (48)); the laws in
full are in ``docs/guides/control.md``. All commands stay within the limits; while an input is at one, integrals only
unwind.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha import _core
from bha.control.controller import USUAL_PERIOD, Controller, pressure_time
from bha.control.limits import Limits
from bha.control.margins import largest_gain, linear_loop
from bha.control.observers import FilteredDifference, Observer
from bha.control.working_point import Feedback, WorkingPoint, mean_lengths
from bha.support.shown import short_repr

if TYPE_CHECKING:
    from bha.arm import Arm


SENSITIVITY_BOUND = 2.0
"""M_s that gains which the laws choose by themselves keep to: a factor of 2 to instability in every command."""


@dataclass(frozen=True)
class Pid(Controller):
    """PID on the lengths, each input by itself: what a user has without a model.

    The gains are multiples of k / A, the stiffness of a bellows at rest over its terminal area, so that the same
    numbers serve sections of different size: 1 answers an error of 1 mm with the pressure that lengthens a free bellows
    by 1 mm.

    Attributes:
        proportional: multiple of k / A.
        integral: 1/s, multiple of k / A.
        derivative: s, multiple of k / A.
    """

    proportional: float = 0.3
    integral: float = 3.0
    derivative: float = 0.04
    lead_time: float | None = field(default=0.0, kw_only=True)

    def law(self, period: float = USUAL_PERIOD) -> dict[str, Any]:
        """The law with its gains, as the core takes it."""
        scale = _pressure_per_length(self.arm)
        return {
            "kind": "pid",
            "proportional": (self.proportional * scale).tolist(),
            "integral": (self.integral * scale).tolist(),
            "derivative": (self.derivative * scale).tolist(),
        }

    def feedback(self, point: WorkingPoint, period: float = USUAL_PERIOD) -> Feedback:
        """What the law does to small deviations around rest at ``point``."""
        mean = _pressure_per_length(self.arm)[:, None] * mean_lengths(self.arm)
        return Feedback.of(self.proportional * mean, self.derivative * mean, self.integral * mean)

    def default_observer(self) -> Observer:
        """Differences: a law without a model needs no model to observe."""
        return FilteredDifference()


@dataclass(frozen=True)
class GravityPd(Controller):
    """PD on the lengths with compensation of weight, springs and bending at the reference.

    tau = N(q_ref, 0) + K_p e + K_d e' + K_i int e, gains as multiples of the bellows' stiffness at rest, length by
    length.

    Pressures lag. Behind a lag T a proportional gain K_p takes K_p T off the arm's damping, and where lag, spool and
    period have turned the derivative's phase by more than 90 degrees (at 60 Hz with the shipped arm's full pneumatics),
    it drives what it should damp. The derivative left out is therefore ``proportional`` (0.04 s + T), T the time
    constant of the model's pneumatics, and the proportional gain left out is the largest up to 1 for which the
    sensitivity peaks at no more than 2 (:func:`bha.control.linear_loop`, at the middle of the lengths). Gains that are
    given are taken as they are. Gains are chosen for the control period that the controller is built for.

    Attributes:
        proportional: multiple of the stiffness; None: by the margin.
        integral: 1/s, multiple of the stiffness; None: twice the proportional gain.
        derivative: s, multiple of the stiffness; None: as above.
    """

    proportional: float | None = None
    integral: float | None = None
    derivative: float | None = None

    @cached_property
    def gains(self) -> tuple[float, float, float]:
        """:meth:`gains_at` a period of 1 ms."""
        return self.gains_at(USUAL_PERIOD)

    def gains_at(self, period: float) -> tuple[float, float, float]:
        """Proportional (1), integral (1/s) and derivative gain (s), multiples of the stiffness, chosen or given.

        Raises:
            ConvergenceError: no rest near the middle of the lengths to choose them at; give them.
        """
        p, i, d = self.proportional, self.integral, self.derivative
        if p is None:
            p = _largest(self, period, lambda part: replace(self, proportional=part))
        return p, 2.0 * p if i is None else i, p * (0.04 + pressure_time(self.arm)) if d is None else d

    def law(self, period: float = USUAL_PERIOD) -> dict[str, Any]:
        """The law with its gains, as the core takes it."""
        scale = _stiffness(self.arm)
        gains = zip(("proportional", "integral", "derivative"), self.gains_at(period), strict=True)
        return {"kind": "gravity_pd"} | {name: (gain * scale).tolist() for name, gain in gains}

    def feedback(self, point: WorkingPoint, period: float = USUAL_PERIOD) -> Feedback:
        """What the law does to small deviations around rest at ``point``."""
        unit = point.pressures_by_force * _stiffness(self.arm)
        p, i, d = self.gains_at(period)
        return Feedback.of(p * unit, d * unit, i * unit)


@dataclass(frozen=True)
class StaticModel(Controller):
    """The static coupled model (62) turned round at a corrected pose: tau = N(q_ref + k_p e + k_i int e, 0).

    Attributes:
        proportional: plain number.
        integral: 1/s.
    """

    proportional: float = 0.0
    integral: float = 0.3

    def law(self, period: float = USUAL_PERIOD) -> dict[str, Any]:
        """The law with its gains, as the core takes it."""
        return {"kind": "static_model", "proportional": self.proportional, "integral": self.integral}

    def feedback(self, point: WorkingPoint, period: float = USUAL_PERIOD) -> Feedback:
        """What the law does to small deviations around rest at ``point``."""
        held = point.pressures_by_lengths
        return Feedback.of(self.proportional * held, np.zeros_like(held), self.integral * held)


@dataclass(frozen=True)
class FeedbackLinearization(Controller):
    """Feedback linearization: tau = M a + C q' + N, a = q_ref'' + k_d e' + k_p e.

    Taken at the reference, corrected by the integral of the error, the arm keeps its own stiffness and damping against
    errors; taken at the measured state, they are cancelled with the model's, which only pays where these are known to a
    per cent or so and pressures follow at once.

    The damping ratio of 0.7 is where the sensitivity peaks least behind the shipped arm's full pneumatics; the arm's
    own damping comes on top. A ratio of 1 follows no better and passes more noise. The bandwidth left out is the
    largest up to 30 rad/s for which the sensitivity peaks at no more than 2 behind the model's own pneumatics
    (:func:`bha.control.linear_loop`, at the middle of the lengths).

    Attributes:
        dynamics: ``"full"``, or ``"reduced"`` (paper: without rotational energy and Coriolis forces).
        at: where the model is taken, ``"reference"`` or ``"measured"``.
        bandwidth: k_p is its square, rad/s; at the measured state that of the error's poles; None: by the margin.
        damping_ratio: k_d = 2 damping_ratio bandwidth.
        integral_rate: rate of the integral's correction, 1/s (at the measured state the third pole); 0: no integral.
        compensate_disturbance: whether the acceleration that the Kalman filter finds unexplained is taken off.
    """

    dynamics: Literal["full", "reduced"] = "full"
    at: Literal["reference", "measured"] = "reference"
    bandwidth: float | None = None
    damping_ratio: float = 0.7
    integral_rate: float = 5.0
    compensate_disturbance: bool = False

    def model(self) -> Arm:
        """The arm that the core computes with."""
        full = self.dynamics == "full"
        return self.arm if full else self.arm.with_changes(rotational_energy=False, coriolis_forces=False)

    @cached_property
    def gains(self) -> tuple[float, float, float]:
        """:meth:`gains_at` a period of 1 ms."""
        return self.gains_at(USUAL_PERIOD)

    def gains_at(self, period: float) -> tuple[float, float, float]:
        """Proportional (1/s^2), integral (1/s; at the measured state 1/s^3) and derivative gain (1/s), chosen or given.

        Raises:
            ConvergenceError: no rest near the middle of the lengths to choose the bandwidth at; give one.
        """
        w, i = self.bandwidth, self.integral_rate
        if w is None:
            fastest = 30.0
            w = fastest * _largest(self, period, lambda part: replace(self, bandwidth=part * fastest))
        d = 2 * self.damping_ratio * w
        return (w**2 + d * i, w**2 * i, d + i) if self.at == "measured" else (w**2, i, d)

    def law(self, period: float = USUAL_PERIOD) -> dict[str, Any]:
        """The law with its gains, as the core takes it."""
        p, i, d = self.gains_at(period)
        return {
            "kind": "feedback_linearization",
            "proportional": p,
            "integral": i,
            "derivative": d,
            "at_measured": self.at == "measured",
            "compensate_disturbance": self.compensate_disturbance,
        }

    def feedback(self, point: WorkingPoint, period: float = USUAL_PERIOD) -> Feedback:
        """What the law does to small deviations around rest at ``point``."""
        p, i, d = self.gains_at(period)
        unit = point.pressures_by_force @ point.inertia
        unexplained = unit if self.compensate_disturbance else 0 * unit
        if self.at == "measured":
            # The model's own stiffness and damping are cancelled.
            return Feedback(p * unit + unit @ point.by_lengths, d * unit + unit @ point.by_rates, i * unit, unexplained)
        return Feedback(p * unit, d * unit, i * point.pressures_by_lengths, unexplained)


@short_repr
@dataclass(frozen=True)
class LinearQuadraticRegulator(Controller):
    """A constant gain from the linearization at a pose, on top of the static model at the reference.

    p = p_0(q_ref) + K (x_ref - x), K for the cost ``sum |e / length_scale|^2 + |e' / rate_scale|^2 +
    |dp / pressure_scale|^2``.

    Attributes:
        pose: lengths (3n,) at which the gain is computed, m; None: the middle of their ranges.
        length_scale: m.
        rate_scale: m/s.
        pressure_scale: Pa.
        period: period the gain is computed for, s; None: the control period that the controller is built for.
    """

    pose: ArrayLike | None = None
    length_scale: float = 2e-3
    rate_scale: float = 0.2
    pressure_scale: float = 3e3
    period: float | None = None

    def gain(self, period: float = USUAL_PERIOD) -> NDArray[np.float64]:
        """K, shape (inputs, 6n), Pa/m and Pa s/m."""
        limits = self.limits or Limits.of(self.arm)
        rest = limits.rest_near(self.arm, limits.middle if self.pose is None else self.pose)
        p, q = rest.pressures, rest.lengths
        # In units of the scales, so that the Riccati equation sees numbers of like size.
        a, b = self.arm.linearize(q, np.zeros_like(q), p, period=self.period or period)
        scale = np.repeat([self.length_scale, self.rate_scale], len(q))
        a = a * scale / scale[:, None]
        b = b * self.pressure_scale / scale[:, None]
        gain = _core.linear_quadratic_gain(a, b, np.eye(len(scale)), np.eye(b.shape[1]))
        return np.asarray(gain * self.pressure_scale / scale, dtype=np.float64)

    def law(self, period: float = USUAL_PERIOD) -> dict[str, Any]:
        """The law with its gains, as the core takes it."""
        return {"kind": "state_feedback", "gain": self.gain(period).ravel().tolist()}

    def feedback(self, point: WorkingPoint, period: float = USUAL_PERIOD) -> Feedback:
        """What the law does to small deviations around rest at ``point``."""
        gain = self.gain(period)
        m = gain.shape[1] // 2
        return Feedback.of(gain[:, :m], gain[:, m:])


def _largest(controller: Controller, period: float, with_part: Callable[[float], Controller]) -> float:
    """The largest part up to 1 of a gain with which the loop at ``period`` s keeps to the bound of the sensitivity."""
    found = controller.__dict__.setdefault("_largest", {})
    if period not in found:
        found[period] = largest_gain(
            lambda part: linear_loop(with_part(part), period=period).sensitivity_peak, SENSITIVITY_BOUND
        )
    return float(found[period])


def _stiffness(arm: Arm) -> NDArray[np.float64]:
    """Stiffness at rest of one bellows, N/m, for each length, (3n,): the mean over the bellows of its section."""
    values = []
    for number, section in enumerate(arm.parameters.sections, start=1):
        values += [float(np.mean([b.stiffness[0] for b in section.resolved_bellows(number)]))] * 3
    return np.array(values)


def _pressure_per_length(arm: Arm) -> NDArray[np.float64]:
    """Stiffness over terminal area, Pa/m, for each input, (inputs,): the mean over the bellows it feeds."""
    ratios: dict[str, list[float]] = {name: [] for name in arm.inputs}
    for number, section in enumerate(arm.parameters.sections, start=1):
        for bellows in section.resolved_bellows(number):
            if bellows.terminal_area > 0:
                ratios[bellows.input].append(bellows.stiffness[0] / bellows.terminal_area)
    return np.array([float(np.mean(found)) if found else 0.0 for found in ratios.values()])
