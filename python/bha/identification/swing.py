"""Damping from free swings after a lost contact, paper section IV (Fig. 10).

Two steps. Each swing is fitted with one decaying oscillation, which gives the frequency and the damping ratio of its
slowest mode and is what Fig. 10 shows. The bellows' dampings follow from a fit of the simulated swing to the measured
one, with two factors beside them (on all longitudinal and on all bending stiffnesses), so that a frequency that is off
does not pass for damping.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import InputError
from bha.estimation.records import Record
from bha.estimation.refinement import Refinement, Settings, refine
from bha.estimation.stretches import Stretch, swings
from bha.support.extras import import_extra

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Oscillation:
    """A decaying oscillation fitted to a channel of a swing: y = mean + e^(-decay t) (a cos(omega t) + b sin(omega t)).

    Attributes:
        stretch: the swing.
        channel: the channel that swings most, in units of its noise.
        frequency: omega / (2 pi), Hz.
        decay: 1/s.
        time: times of its rows, s.
        measured: the channel, m.
        fitted: the fit, m.
    """

    stretch: Stretch
    channel: str
    frequency: float
    decay: float
    time: Array
    measured: Array
    fitted: Array

    @property
    def damping_ratio(self) -> float:
        """decay / sqrt(omega^2 + decay^2)."""
        return float(self.decay / np.hypot(2.0 * np.pi * self.frequency, self.decay))


@dataclass(frozen=True)
class SwingFit:
    """Dampings from swings.

    Attributes:
        oscillations: one a swing.
        refinement: the fit of the simulated swings; ``values`` and ``standard_errors`` of its first n parameters are
        the
            sections' dampings, N s/m, or of its first one, if one damping was asked for all.
    """

    oscillations: tuple[Oscillation, ...]
    refinement: Refinement

    @property
    def used(self) -> tuple[Stretch, ...]:
        """The swings."""
        return tuple(o.stretch for o in self.oscillations)

    @property
    def damping(self) -> dict[str, tuple[float, float]]:
        """Estimate and standard error of each damping by its path."""
        fit = self.refinement
        entries = zip(fit.coordinates, fit.values, fit.standard_errors, strict=True)
        return {c.path: (float(v), float(e)) for c, v, e in entries if "damping" in c.path}


def swing_damping(
    arm: Arm,
    records: Sequence[Record],
    *,
    alike: bool = False,
    settings: Settings | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> SwingFit:
    """Dampings of an arm from the free swings found in its logs.

    Args:
        arm: everything else about the arm, roughly right.
        records: the logs.
        alike: whether one factor on all dampings is estimated, instead of one damping a section.
        settings: how the simulated swings are fitted.
        progress: as in :func:`bha.estimation.refinement`.

    Raises:
        InputError: no swing was found.
    """
    found = [(rec, stretch) for rec in records for stretch in swings(rec)]
    if not found:
        raise InputError(
            f"no free swing was found in {', '.join(rec.name for rec in records)}: let the arm swing for a few seconds "
            "under constant pressures after an external force lets go"
        )
    cut = [
        replace(rec.kept(slice(stretch.first, stretch.last)), name=f"{rec.name} {stretch.start:g}-{stretch.end:g} s")
        for rec, stretch in found
    ]
    dampings = ["section.*.damping"] if alike else [f"section.{k + 1}.damping" for k in range(arm.section_count)]
    factors = ["section.*.stiffness.*", "section.*.bending_stiffness.*"]
    used = settings or Settings(windows=(0.75, 4.0))
    fit = refine(arm, cut, [*dampings, *factors], used, progress=progress)
    return SwingFit(tuple(oscillation(rec, stretch) for rec, stretch in found), fit)


def oscillation(rec: Record, stretch: Stretch) -> Oscillation:
    """Fit one decaying oscillation to the channel of a swing that moves most."""
    optimize = import_extra("scipy.optimize", extra="identify", purpose="Fitting swings")
    rows = slice(stretch.first, stretch.last)
    table = rec.measured[rows]
    channel = int(np.argmax(np.nanstd(table, axis=0) / rec.noise))
    good = rec.usable[rows, channel]
    time, y = rec.time[rows][good], table[good, channel]
    t = time - time[0]
    spread = float(np.std(y)) or 1.0
    frequency = _peak_frequency(t, y)

    def parts(p: Array) -> tuple[Array, Array]:
        # The linear part (mean, a, b) follows from frequency and decay.
        envelope = np.exp(-np.exp(p[1]) * t)
        basis = np.column_stack([np.ones_like(t), envelope * np.cos(p[0] * t), envelope * np.sin(p[0] * t)])
        return basis, np.linalg.lstsq(basis, y, rcond=None)[0]

    def left(p: Array) -> Array:
        basis, linear = parts(p)
        return np.asarray((y - basis @ linear) / spread)

    start = np.array([2.0 * np.pi * frequency, np.log(max(1.0 / t[-1], 1e-3))])
    best = optimize.least_squares(left, start, x_scale=[0.1 * start[0], 0.3])
    basis, linear = parts(best.x)
    return Oscillation(
        stretch=stretch,
        channel=rec.channels[channel],
        frequency=float(abs(best.x[0]) / (2.0 * np.pi)),
        decay=float(np.exp(best.x[1])),
        time=time,
        measured=y,
        fitted=basis @ linear,
    )


def _peak_frequency(t: Array, y: Array) -> float:
    """Frequency of the highest peak of the spectrum, Hz, samples made even first."""
    count = len(t)
    even = np.linspace(t[0], t[-1], count)
    values = np.interp(even, t, y)
    values = (values - values.mean()) * np.hanning(count)
    spectrum = np.abs(np.fft.rfft(values, 4 * count))
    frequencies = np.fft.rfftfreq(4 * count, (t[-1] - t[0]) / (count - 1))
    # Below one period in the stretch there is drift, not swing.
    usable = frequencies > 1.0 / t[-1]
    return float(frequencies[usable][np.argmax(spectrum[usable])])
