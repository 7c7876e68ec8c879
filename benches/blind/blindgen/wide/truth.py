"""The true arm of the wide world with all that is hidden in it, from the pressure that is logged to the length that is
read.

The pressure path turns the pressure in the chamber into the one that acts: error of the reading taken off, dead time,
dead band, sag of a shared supply; then, inside the simulation, a lag that follows the volume. Errors are those of the
reading: ``reading = ambient + (1 + gain) (p - ambient) + offset``, ``reading = (1 + gain) q + offset``.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..jit import compiled
from .integrate import Arm, Drive, Lag, Simulator, State, no_lag

Array = NDArray[np.float64]


@dataclass
class Path:
    """Hidden effects between the chamber and the bellows, arrays over inputs; and the sag of a shared supply."""

    gain: Array
    offset: Array
    delay: Array
    band: Array
    sag: float = 0.0  # pressure lost by each input for a step of 1 Pa at all others, Pa
    sag_time: float = 0.3

    def copy(self) -> "Path":
        """An independent copy."""
        arrays = (x.copy() for x in (self.gain, self.offset, self.delay, self.band))
        return Path(*arrays, self.sag, self.sag_time)


@dataclass
class Reading:
    """Hidden errors of the length sensors, arrays over the coordinates' lengths; a delay of all sensors."""

    gain: Array
    offset: Array
    delay: float = 0.0

    def copy(self) -> "Reading":
        """An independent copy."""
        return Reading(self.gain.copy(), self.offset.copy(), self.delay)


@dataclass
class Truth:
    """Everything between the pressures of the chambers and the lengths and poses that sensors see."""

    arm: Arm
    lag: Lag
    path: Path
    reading: Reading

    def copy(self) -> "Truth":
        """An independent copy, to install an effect in."""
        return Truth(self.arm.copy(), Lag(*(x.copy() for x in self.lag)), self.path.copy(), self.reading.copy())


def plain_truth(arm: Arm, inputs: int) -> Truth:
    """The arm without any hidden effect."""
    zero = np.zeros(inputs)
    lengths = np.zeros(3 * arm.plant.sections.shape[0])
    path = Path(zero.copy(), zero.copy(), zero.copy(), zero.copy())
    return Truth(arm, no_lag(inputs), path, Reading(lengths.copy(), lengths.copy()))


@compiled
def play(pressure: Array, band: float) -> None:
    """Play of half-width ``band``, in place."""
    x = pressure[0]
    for k in range(pressure.shape[0]):
        x = min(max(x, pressure[k] - band), pressure[k] + band)
        pressure[k] = x


@compiled
def _sag(rise: Array, share: float, decay: float, out: Array) -> None:
    """Each input loses a part of what all others took in lately."""
    taken = np.zeros(rise.shape[1])
    for k in range(rise.shape[0]):
        total = 0.0
        for j in range(rise.shape[1]):
            taken[j] = decay * taken[j] + max(rise[k, j], 0.0)
            total += taken[j]
        for j in range(rise.shape[1]):
            out[k, j] -= share * (total - taken[j])


def through_path(path: Path, ambient: float, chamber: Array, step: float) -> Array:
    """Pressures before the hidden lag, from those in the chambers on a grid of spacing ``step``."""
    out = ambient + (chamber - ambient - path.offset) / (1.0 + path.gain)
    times = np.arange(chamber.shape[0]) * step
    for j in range(chamber.shape[1]):
        if path.delay[j] > 0.0:
            out[:, j] = np.interp(times - path.delay[j], times, out[:, j])
        if path.band[j] > 0.0:
            column = np.ascontiguousarray(out[:, j])
            play(column, path.band[j])
            out[:, j] = column
    if path.sag != 0.0:
        rise = np.diff(out, axis=0, prepend=out[:1])
        _sag(rise, path.sag, float(np.exp(-step / path.sag_time)), out)
    return np.asarray(out)


@dataclass
class Clean:
    """Noise-free samples from a log's first moment on, every ``spacing`` seconds, and the state there."""

    spacing: float
    coordinates: Array  # (samples, 3n)
    heads: Array  # (samples, n, 12)
    start: State


def simulate(
    truth: Truth,
    chamber: Array,
    lead: int,
    step: float,
    stride: int,
    *,
    ripple: Array | None = None,
    force: Array | None = None,
    start: State | None = None,
    time: float = 0.0,
) -> Clean:
    """One log from pressures in the chambers on a grid whose row ``lead`` is the log's first moment.

    At rest at the first row, unless a ``start`` at row ``lead`` is given. Raises DivergedError.
    """
    acting = through_path(truth.path, truth.arm.ambient, chamber, step)
    simulator = Simulator(truth.arm, truth.lag)
    drive = Drive(acting, ripple, force, step)
    # A delay of all sensors is the arm of a little earlier: begin that much before the log.
    first = max(0, lead - round(truth.reading.delay / step))
    if start is None:
        state = simulator.rest(acting[0], time - lead * step)
        if first > 0:
            simulator.run(state, drive.part(0, first), first)
    else:
        state = start.copy()
    begin = state.copy()
    last = first + acting.shape[0] - 1 - lead
    coordinates, heads = simulator.run(state, drive.part(first, last), stride)
    return Clean(step * stride, coordinates, heads, begin)


def read_lengths(truth: Truth, coordinates: Array) -> Array:
    """Lengths at 0, 120 and 240 degrees as their sensors read them, (samples, 3n)."""
    radius = truth.arm.plant.radius
    columns = []
    for i, r in enumerate(radius):
        u, v, length = coordinates[:, 3 * i], coordinates[:, 3 * i + 1], coordinates[:, 3 * i + 2]
        for k in range(3):
            angle = 2.0 * np.pi * k / 3.0
            columns.append(length - r * (u * np.cos(angle) + v * np.sin(angle)))
    return np.asarray((1.0 + truth.reading.gain) * np.stack(columns, axis=1) + truth.reading.offset)
