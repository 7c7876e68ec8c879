"""What can be reached: the error that the true arm leaves on the held-out logs, and the one that the plain model
leaves.

*True model*: the arm with all that is hidden in it, fed the pressures of the log, from the true state at the log's
start; it knows neither the disturbance nor the drift of the session, as nobody does who predicts. Its RMS error over
the sound samples is the floor. *Plain model*: lumped masses, polynomial springs, nothing hidden, refitted to clean
training logs by Gauss-Newton (mass with inertia, three spring coefficients, damping, bending stiffness and rest length
of every section; lag and dead time under commands; place and turn of a camera), with a prior of 30 %. What it leaves
beyond the true model on the held-out logs, in quadrature with the floor, says whether there is anything to find:

The plain model's error is an upper bound: a search from elsewhere, or on whole logs, may find a better one.

* it *shows* where the plain model leaves more than SHOWS times the floor,
* the plain model is *equivalent* where it leaves less than EQUIVALENT times the floor; in between both answers count.

Runs of the plain model take a coarse step and the logs' beginnings.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..plant import P_BENDING, P_INERTIA, P_MASS, P_SLICED
from . import bellows as b
from .integrate import STEP, DivergedError
from .pressures import PressureSense, chamber_pressures
from .sensors import Sensors, observe
from .truth import Truth, simulate

Array = NDArray[np.float64]

SHOWS, EQUIVALENT = 1.2, 1.1
COARSE = 4
SPACING = 0.01
PRIOR = 0.3
TRIAL = 0.01
LEVENBERG = (0.0, 1e-3, 3e-2, 0.3, 3.0)
JACOBIANS = 3
CAMERA_STEP = 1e-3  # m and rad


@dataclass(frozen=True)
class Drill:
    """One log as the plain model is run on it: commands on the grid of steps, the log's first row, its length."""

    command: Array
    lead: int
    duration: float

    def shortened(self, duration: float) -> "Drill":
        """The lead and the first ``duration`` seconds."""
        rows = self.lead + round(min(duration, self.duration) / STEP) + 1
        return replace(self, command=self.command[:rows], duration=min(duration, self.duration))


def _scale(names: Sequence[int], of_bellows: bool) -> Callable[[Truth, int, float], None]:
    def change(truth: Truth, i: int, factor: float) -> None:
        if of_bellows:
            rows = truth.arm.table[:, b.B_SECTION] == i
            for column in names:
                truth.arm.table[rows, column] *= factor
        else:
            truth.arm.plant.sections[i, list(names)] *= factor

    return change


GROUPS = {
    "mass": _scale((P_MASS, P_INERTIA, P_INERTIA + 1, P_INERTIA + 2), False),
    "stiffness_1": _scale((b.B_STIFFNESS,), True),
    "stiffness_2": _scale((b.B_STIFFNESS + 1,), True),
    "stiffness_3": _scale((b.B_STIFFNESS + 2,), True),
    "damping": _scale((b.B_DAMPING,), True),
    "bending": _scale((P_BENDING,), False),
    "rest_length": _scale((b.B_REST,), True),
}


class Meter:
    """What a refitted plain model leaves of a changed truth, in metres, on given logs."""

    def __init__(self, plain: Truth, drills: Sequence[Drill], sense: PressureSense, sensors: Sensors) -> None:
        """Keep the plain arm and the logs; runs happen on first use."""
        self.plain, self.drills, self.sense, self.sensors = plain, list(drills), sense, sensors
        self.names = [(name, i) for name in GROUPS for i in range(plain.arm.plant.sections.shape[0])]
        self.valves = ["lag", "delay"] if sense.commanded else []
        self.camera = 6 if sensors.sort in ("heads", "poses") else 0
        self.count = len(self.names) + len(self.valves) + self.camera
        self._base: Array | None = None
        self._jacobian: Array | None = None

    def outputs(
        self,
        truth: Truth,
        drills: Sequence[Drill] | None = None,
        sense: PressureSense | None = None,
        sensors: Sensors | None = None,
    ) -> Array:
        """Clean channels of all logs, one after the other, (samples, channels)."""
        sense, sensors = sense or self.sense, sensors or self.sensors
        step = STEP * COARSE
        parts = []
        for drill in self.drills if drills is None else drills:
            chamber = chamber_pressures(sense, drill.command, STEP)[::COARSE]
            clean = simulate(truth, chamber, drill.lead // COARSE, step, round(SPACING / step))
            parts.append(observe(sensors, truth, clean.coordinates, clean.heads).values)
        return np.concatenate(parts)

    def changed(self, relative: Array) -> tuple[Truth, PressureSense, Sensors]:
        """The plain model at relative changes of its parameters."""
        truth = self.plain.copy()
        for (name, i), x in zip(self.names, relative, strict=False):
            if x:
                GROUPS[name](truth, i, 1.0 + x)
        rest = relative[len(self.names) :]
        sense, sensors = self.sense, self.sensors
        if self.valves:
            lag, delay = rest[0], rest[1]
            sense = replace(sense, lag=sense.lag * (1.0 + lag), delay=max(0.0, sense.delay + sense.lag * delay))
            rest = rest[2:]
        if self.camera:
            moved = np.array([*sensors.camera, *sensors.turn]) + rest * CAMERA_STEP / TRIAL
            sensors = replace(sensors, camera=tuple(moved[:3]), turn=tuple(moved[3:]))
        return truth, sense, sensors

    def at(self, relative: Array, drills: Sequence[Drill] | None = None) -> Array:
        """Outputs of the plain model at relative changes of its parameters."""
        truth, sense, sensors = self.changed(relative)
        return self.outputs(truth, drills, sense, sensors)

    @property
    def base(self) -> Array:
        """Outputs of the plain model at the true values."""
        if self._base is None:
            self._base = self.at(np.zeros(self.count))
        return self._base

    @property
    def jacobian(self) -> Array:
        """Outputs over noise by relative changes at the true values, (samples * channels, parameters)."""
        if self._jacobian is None:
            self._jacobian = self._jacobian_at(np.zeros(self.count), self.base)
        return self._jacobian

    def _jacobian_at(self, relative: Array, base: Array) -> Array:
        columns = []
        for k in range(self.count):
            step = relative.copy()
            step[k] += TRIAL
            columns.append((self.at(step) - base).ravel() / TRIAL / self.sensors.noise)
        return np.stack(columns, axis=1)

    def _weights(self) -> Array:
        free = np.ones(self.count) / PRIOR**2
        if self.camera:
            # Nobody knows where the camera stands: 0.3 m and rad.
            free[-self.camera :] = (CAMERA_STEP / TRIAL / 0.3) ** 2
        return free

    def linear_gap(self, truth: Truth) -> float:
        """RMS left by linear projection alone, m."""
        rest = (self.outputs(truth) - self.base).ravel() / self.sensors.noise
        normal = self.jacobian.T @ self.jacobian + np.diag(self._weights())
        left = rest - self.jacobian @ np.linalg.solve(normal, self.jacobian.T @ rest)
        return float(np.sqrt(np.mean(left**2)) * self.sensors.noise)

    def refit(self, truth: Truth) -> tuple[float, Array]:
        """RMS left after the refit, m, and the relative changes: Levenberg-Marquardt, the Jacobian renewed up to twice
        where the error is still above a third of the noise. Mass along an arc starts as half as much mass at its head.
        """
        target = self.outputs(truth)
        best = np.zeros(self.count)
        n = truth.arm.plant.sections.shape[0]
        best[:n] = -0.5 * truth.arm.plant.sections[:, P_SLICED]
        begun = bool(np.any(best))
        rest = target - (self.at(best) if begun else self.base)
        noise = self.sensors.noise
        for renewal in range(JACOBIANS):
            fresh = begun or renewal > 0
            jacobian = self._jacobian_at(best, target - rest) if fresh else self.jacobian
            before = np.mean(rest**2)
            for _ in range(2):
                trial = self._step(jacobian, target, best, rest)
                if trial is None:
                    break
                gain = np.mean(trial[1] ** 2) / np.mean(rest**2)
                best, rest = trial
                if gain > 0.9:
                    break
            if np.mean(rest**2) < (noise / 3.0) ** 2 or np.mean(rest**2) > 0.95 * before:
                break
        return float(np.sqrt(np.mean(rest**2))), best

    def _step(self, jacobian: Array, target: Array, best: Array, rest: Array) -> tuple[Array, Array] | None:
        """One damped step that lowers the error, and what it leaves; None where no damping helps."""
        normal = jacobian.T @ jacobian + np.diag(self._weights())
        pull = jacobian.T @ rest.ravel() / self.sensors.noise - self._weights() * best
        mechanics = len(self.names)
        for damping in LEVENBERG:
            trial = best + np.linalg.solve(normal + damping * np.diag(np.diag(normal)), pull)
            trial[:mechanics] = np.clip(trial[:mechanics], -0.8, 3.0)
            if self.valves:
                trial[mechanics : mechanics + 2] = np.clip(trial[mechanics : mechanics + 2], -0.9, 5.0)
            try:
                left = target - self.at(trial)
            except DivergedError:
                continue
            if np.mean(left**2) < np.mean(rest**2):
                return trial, left
        return None

    def left_on(self, truth: Truth, relative: Array, drills: Sequence[Drill]) -> float:
        """RMS by which the plain model at ``relative`` misses the truth on other logs, m; infinite if it diverges."""
        try:
            return float(np.sqrt(np.mean((self.outputs(truth, drills) - self.at(relative, drills)) ** 2)))
        except DivergedError:
            return float("inf")


def judgement(floor: float, plain_left: float) -> dict[str, Any]:
    """Numbers for the sealed answer: errors on the held-out logs, and what they mean."""
    error = float(np.hypot(floor, plain_left))
    ratio = error / floor
    return {
        "true_model": floor,
        "plain_model": error if np.isfinite(error) else None,
        "ratio": ratio if np.isfinite(ratio) else None,
        "shows": bool(ratio > SHOWS),
        "equivalent": bool(ratio < EQUIVALENT),
    }
