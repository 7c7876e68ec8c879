"""How big an effect is for a diagnosis: the gap a re-identified plain model leaves, and amplitudes for a wanted gap.

The plain model's mass, stiffness (three coefficients), damping, bending stiffness and rest length of every section
are refitted by Gauss-Newton with the Jacobian at the true plain arm, by finite differences, with a weak prior of 30
%. The gap is the RMS of what is left on the noise-free outputs, over the noise's standard deviation. It is an
estimate: the Jacobian is not renewed. Runs here take a step of 2.5 ms, whose error is far below the noise.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .effects import EFFECTS, HiddenEffect, install
from .integrate import DivergedError
from .plant import P_BENDING, P_DAMPING, P_INERTIA, P_MASS, P_REST, P_STIFFNESS
from .sensors import NoiseSet
from .truth import Excitation, Truth, simulate_log

Array = NDArray[np.float64]

COARSE = 10
LOG_GAP_TIME = 60.0
PRIOR = 0.3
DIFFERENCE = 0.01
# Tried in turn until the error falls: along weakly determined directions a full step leaves the range of the Jacobian.
LEVENBERG = (0.0, 1e-3, 3e-2)
PLAIN_GROUPS = (
    ("mass", (P_MASS, P_INERTIA, P_INERTIA + 1, P_INERTIA + 2)),
    ("stiffness_1", (P_STIFFNESS,)),
    ("stiffness_2", (P_STIFFNESS + 1,)),
    ("stiffness_3", (P_STIFFNESS + 2,)),
    ("damping", (P_DAMPING,)),
    ("bending_stiffness", (P_BENDING,)),
    ("rest_length", (P_REST,)),
)


def shorten(excitation: Excitation, duration: float) -> Excitation:
    """The lead and the first ``duration`` seconds, at the coarse step."""
    rows = 2 * round((excitation.lead + duration) / excitation.step) + 1
    return replace(excitation, pressure=excitation.pressure[:rows], force=excitation.force[:rows]).coarse(COARSE)


def scaled(truth: Truth, relative: Array) -> Truth:
    """The plain truth with its parameters changed by ``relative`` (groups by section)."""
    changed = truth.copy()
    n = truth.plant.sections.shape[0]
    for g, (_, columns) in enumerate(PLAIN_GROUPS):
        for i in range(n):
            changed.plant.sections[i, list(columns)] *= 1.0 + relative[g * n + i]
    return changed


class GapMeter:
    """Gap of a changed truth against the plain model, on given logs."""

    def __init__(self, plain: Truth, logs: Sequence[Excitation], noise: NoiseSet, *, heads: bool) -> None:
        """Keep the plain arm and the logs; runs happen on first use."""
        self.plain = plain
        self.logs = list(logs)
        self.noise = noise
        self.heads = heads
        self._base: Array | None = None
        self._jacobian: Array | None = None
        self._normal: Array | None = None

    @property
    def base(self) -> Array:
        """Outputs of the plain arm."""
        if self._base is None:
            self._base = self.outputs(self.plain)
        return self._base

    def outputs(self, truth: Truth, logs: Sequence[Excitation] | None = None) -> Array:
        """Outputs over noise, (samples, channels): lengths, or lengths and head positions."""
        parts = []
        for index, log in enumerate(self.logs if logs is None else logs):
            clean = simulate_log(truth, log, index * LOG_GAP_TIME)
            part = clean.lengths / self.noise.length
            if self.heads:
                part = np.concatenate([part, clean.heads / self.noise.position], axis=1)
            parts.append(part)
        return np.concatenate(parts)

    @property
    def jacobian(self) -> Array:
        """Outputs by relative plain parameters, (samples * channels, parameters)."""
        if self._jacobian is None:
            count = len(PLAIN_GROUPS) * self.plain.plant.sections.shape[0]
            columns = []
            for k in range(count):
                step = np.zeros(count)
                step[k] = DIFFERENCE
                columns.append((self.outputs(scaled(self.plain, step)) - self.base).ravel() / DIFFERENCE)
            self._jacobian = np.stack(columns, axis=1)
        return self._jacobian

    @property
    def normal(self) -> Array:
        """Normal matrix of the refit, prior included; of the order of the number of parameters."""
        if self._normal is None:
            self._normal = self.jacobian.T @ self.jacobian + np.eye(self.jacobian.shape[1]) / PRIOR**2
        return self._normal

    def linear_gap(self, truth: Truth) -> float:
        """Gap by linear projection alone: one run instead of up to four."""
        rest = (self.outputs(truth) - self.base).ravel()
        step = np.linalg.solve(self.normal, self.jacobian.T @ rest)
        return float(np.sqrt(np.mean((rest - self.jacobian @ step) ** 2)))

    def gap(self, truth: Truth) -> tuple[float, Array]:
        """Gap in noise standard deviations after the refit, and the refitted relative parameters."""
        target = self.outputs(truth)
        jacobian, normal = self.jacobian, self.normal
        relative = np.zeros(jacobian.shape[1])
        best, rest = relative, target - self.base
        for _ in range(3):
            for damping in LEVENBERG:
                damped = normal + damping * np.diag(np.diag(normal))
                step = np.linalg.solve(damped, jacobian.T @ rest.ravel() - best / PRIOR**2)
                trial = np.clip(best + step, -0.7, 2.0)
                try:
                    left = target - self.outputs(scaled(self.plain, trial))
                except DivergedError:
                    continue
                if np.mean(left**2) < np.mean(rest**2):
                    break
            else:
                break
            gain = np.mean(left**2) / np.mean(rest**2)
            best, rest = trial, left
            if gain > 0.95:
                break
        return float(np.sqrt(np.mean(rest**2))), best


def calibrate(meter: GapMeter, effect: HiddenEffect, wanted: float) -> HiddenEffect:
    """Scale the amplitude, within the limits of its kind, until the gap is about ``wanted``.

    Two looks through the linear projection, one or two through the refit. An amplitude at which the arm diverges is
    halved.
    """
    low, high = EFFECTS[effect.kind].limits
    if low == high:
        return effect
    amplitude = effect.amplitude
    looks = 0
    for _ in range(8):
        truth, _ = install(meter.plain, replace(effect, amplitude=amplitude))
        try:
            gap = meter.linear_gap(truth) if looks < 2 else meter.gap(truth)[0]
        except DivergedError:
            high = amplitude = 0.5 * amplitude
            continue
        ratio = float(np.clip(wanted / max(gap, 1e-9), 0.05, 20.0))
        amplitude = float(np.clip(amplitude * ratio, low, high))
        looks += 1
        if looks == 4 or (looks == 3 and abs(np.log(ratio)) < 0.4):
            return replace(effect, amplitude=amplitude)
    raise DivergedError(f"{effect.kind} at {effect.where}: the true arm diverges at every amplitude tried")
