"""The paper's procedures of section IV, as far as its figures show them: stiffness, bending, damping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.experiments.virtual_arm import Schedule
from bha.logs import Log
from bha.parameters import ArmParameters, SectionParameters
from bha.recordings import Recording
from bha.runs.input import Input
from bha.runs.trajectory import Trajectory
from bha.simulation.single import simulate
from bha.support.extras import import_extra

Array = NDArray[np.float64]

#: What is averaged of each hold: its last part, s.
STEADY = 0.5


@dataclass(frozen=True)
class StiffnessFit:
    """Fig. 8, one section: spring force of one bellows (k,) N at mean lengths (k,) m, and the curve through them."""

    lengths: Array
    forces: Array
    rest_length: float
    stiffness: tuple[float, ...]

    def curve(self, lengths: Array) -> Array:
        """The fitted spring force, N."""
        extension = lengths - self.rest_length
        return np.asarray(sum(k * extension ** (j + 1) for j, k in enumerate(self.stiffness)))


@dataclass(frozen=True)
class BendingFit:
    """Fig. 9, one section: bending moments (k,) N m at bending angles (k,) rad, negative for phi = pi."""

    angles: Array
    moments: Array
    stiffness: float
    offset: float
    pressure_per_moment: float


@dataclass(frozen=True)
class Oscillation:
    """A damped oscillation fitted to a deflection: Hz, damping ratio, greatest deflection, RMS left and curve, m."""

    frequency: float
    damping_ratio: float
    amplitude: float
    residual: float
    curve: Array


@dataclass(frozen=True)
class DampingFit:
    """Fig. 10: the tool's measured oscillation, and the damping of each section's bellows that gives it, N s/m."""

    measured: Oscillation
    damping: tuple[float, ...]


def with_sections(arm: Arm, changes: Sequence[Mapping[str, Any]], name: str) -> Arm:
    """The arm with some keys of each section changed; provenance of what changes is dropped."""
    mapping = arm.parameters.to_mapping()
    mapping["name"] = name
    for table, change in zip(mapping["section"], changes, strict=True):
        for key, value in change.items():
            table.get("provenance", {}).pop(key, None)
            if value is None:
                table.pop(key, None)
            else:
                table[key] = value
    return Arm(ArmParameters.from_mapping(mapping, origin=name))


def seen(arm: Arm, log: Log) -> Trajectory:
    """A log as the arm sees it: pressures, and the coordinates that its lengths tell."""
    return Recording(arm, log, pressures="measured", warn=False).as_trajectory()


def steady_states(arm: Arm, log: Log, schedule: Schedule) -> tuple[Array, Array]:
    """Mean pressures (k, inputs) and lengths (k, 3n) over the last part of each hold."""
    found = seen(arm, log)
    rows = [(found.time > end - STEADY) & (found.time <= end) for end in schedule.time[1::2]]
    pressures = np.array([found.pressures[r].mean(axis=0) for r in rows])
    return pressures, np.array([np.nanmean(found.lengths[r], axis=0) for r in rows])


def fit_stiffness(arm: Arm, log: Log, schedule: Schedule, order: int = 3) -> list[StiffnessFit]:
    """Section IV-C: F_spr = A_P (p - p_amb) plus a bellows' share of the weight below it; a curve through it."""
    pressures, lengths = steady_states(arm, log, schedule)
    weight = arm.parameters.gravity[2] * np.array(_hanging_masses(arm.parameters.sections))
    fits = []
    for i, section in enumerate(arm.parameters.sections):
        three = slice(3 * i, 3 * i + 3)
        pressure = pressures[:, three].mean(axis=1) - arm.parameters.ambient_pressure
        force = section.terminal_area * pressure + weight[i] / 3
        length = lengths[:, three].mean(axis=1)
        curve = np.polynomial.Polynomial.fit(length, force, order)
        roots = [root.real for root in curve.roots() if abs(root.imag) < 1e-9]
        rest = min(roots, key=lambda root: abs(root - length[np.argmin(np.abs(force))]))
        around = curve.convert(domain=[-1, 1])(np.polynomial.Polynomial([rest, 1.0]))
        fits.append(StiffnessFit(length, force, float(rest), tuple(float(c) for c in around.coef[1:])))
    return fits


def _hanging_masses(sections: Sequence[SectionParameters]) -> list[float]:
    """What pulls at the bellows of each section, kg: a mass along it moves by its share of the section's elongation."""
    above = 0.0
    found = []
    for section in reversed(sections):
        own = section.mass + sum(mass.share * mass.mass for mass in section.masses)
        found.append(above + own)
        above += section.total_mass
    return found[::-1]


def fit_bending(arm: Arm, section: int, log: Log, schedule: Schedule) -> BendingFit:
    """Section IV-D: what pressures, springs and gravity leave of the balance of a bent section; a line through it.

    ``arm`` has the stiffness found before and no bending stiffness.
    """
    pressures, lengths = steady_states(arm, log, schedule)
    parameters = arm.parameters.sections[section - 1]
    first, radius = 3 * (section - 1), parameters.bellows_radius
    still = np.zeros(lengths.shape[1])
    angles, moments = [], []
    for q, p in zip(lengths, pressures, strict=True):
        balance = arm.actuation_force(q, p) - arm.bias_force(q, still)
        of_section = balance[first : first + 3]
        # dq_k/du = -r cos a_k
        moments.append(-radius * (of_section[0] - 0.5 * of_section[1] - 0.5 * of_section[2]))
        angles.append((q[first + 1] + q[first + 2] - 2 * q[first]) / (3 * radius))
    slope, offset = np.polyfit(angles, moments, 1)
    per_moment = 1.0 / (1.5 * parameters.terminal_area * radius)
    return BendingFit(np.array(angles), np.array(moments), float(slope), float(offset), per_moment)


def fit_oscillation(time: Array, deflection: Array) -> Oscillation:
    """Least squares of exp(-decay t) (a cos wt + b sin wt) to a deflection about zero, from its release at t = 0."""
    optimize = import_extra("scipy.optimize", extra="identify", purpose="Identification")

    def left(rates: Array) -> Array:
        decay, frequency = rates
        phase = 2 * np.pi * frequency * time
        envelope = np.exp(-decay * time)
        waves = np.column_stack([envelope * np.cos(phase), envelope * np.sin(phase)])
        return np.asarray(waves @ np.linalg.lstsq(waves, deflection, rcond=None)[0] - deflection)

    dt = time[1] - time[0]
    # The strongest line of the spectrum, padded so that the start lies within a fraction of its width.
    spectrum = np.abs(np.fft.rfft(deflection - deflection.mean(), 8 * len(time)))
    start = np.fft.rfftfreq(8 * len(time), dt)[np.argmax(spectrum)]
    fit = optimize.least_squares(left, [0.5, start], x_scale=[0.5, 0.1])
    decay, frequency = fit.x
    return Oscillation(
        frequency=float(frequency),
        damping_ratio=float(decay / np.hypot(decay, 2 * np.pi * frequency)),
        amplitude=float(np.abs(deflection).max()),
        residual=float(np.sqrt(np.mean(fit.fun**2))),
        curve=np.asarray(deflection + fit.fun),
    )


def fit_damping(arm: Arm, log: Log, release: float) -> DampingFit:
    """Section IV-E: the damping with which the model's swing decays as the measured one does.

    One swing gives one number: the ratio of damping to stiffness of the bellows, taken as a property of their material
    and the same in all sections.
    """
    optimize = import_extra("scipy.optimize", extra="identify", purpose="Identification")
    start, free = swing_from_release(arm, log, release)
    time = free.time - free.time[0]
    measured = fit_oscillation(time, lateral(arm, free)[:, -1])
    drive = Input.constant(free.pressures.mean(axis=0), float(time[-1]))
    stiffness = [s.stiffness[0] for s in arm.parameters.sections]

    def with_ratio(ratio: float) -> Arm:
        return with_sections(arm, [{"damping": ratio * k} for k in stiffness], arm.name)

    def too_much(ratio: float) -> float:
        swung, deflection, _ = simulated_swing(with_ratio(ratio), drive, start)
        return fit_oscillation(swung, deflection[:, -1]).damping_ratio - measured.damping_ratio

    ratio = optimize.brentq(too_much, 1e-4, 0.1, xtol=1e-5)
    return DampingFit(measured, tuple(ratio * k for k in stiffness))


def simulated_swing(arm: Arm, drive: Input, start: Array) -> tuple[Array, Array, Array]:
    """Times (m,), lateral deflections of all heads from their rest (m, n) and lengths (m, 3n) of a swing from rest."""
    run = simulate(arm, drive, dt=5e-3, q0=start)
    rest = arm.forward_kinematics(arm.static_lengths(drive.pressures[0], start=start))[0][:, 0]
    return run.time, run.head_positions[:, :, 0] - rest, run.lengths


def swing_from_release(arm: Arm, log: Log, release: float) -> tuple[Array, Trajectory]:
    """Lengths at the release (mean over the 0.1 s before it) and what was measured from there on."""
    found = seen(arm, log)
    before = (found.time > release - 0.1) & (found.time <= release)
    return np.nanmean(found.lengths[before], axis=0), found[int(np.searchsorted(found.time, release)) :]


def lateral(arm: Arm, free: Trajectory) -> Array:
    """Lateral deflection x of every head from where it comes to rest, from measured lengths; (m, n), m."""
    x = np.array([arm.forward_kinematics(q)[0][:, 0] for q in free.lengths])
    return np.asarray(x - x[free.time > free.time[-1] - 1.0].mean(axis=0))
