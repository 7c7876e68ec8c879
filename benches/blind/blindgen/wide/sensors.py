"""Sensors of the wide world: what they see of the arm, when, and how badly.

Four sorts: lengths at the coordinates (0, 120, 240 degrees on the section's radius); draw wires at other angles and
radii, from the base through one section or more; positions of heads by a camera that stands beside the base and is a
little turned; the same with orientations. White or first-order noise, a grid of values, outliers, spells in which the
last value is held, a clock that ticks every 15.6 ms, a camera of 30 Hz in a log of 200 Hz.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .arms import TrueArm
from .disturbances import ornstein_uhlenbeck
from .truth import Truth, read_lengths

Array = NDArray[np.float64]

SORTS = ("coordinates", "wires", "heads", "poses")
# Rate of the sensors and of the log's rows, 1/s.
RATES: dict[str, tuple[int, int]] = {
    "10": (10, 10),
    "30 in 200": (30, 200),
    "50": (50, 50),
    "100": (100, 100),
    "200": (200, 200),
    "1000": (1000, 1000),
}
GRIDS = (5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3)
FINEST = 1e-5
TICK = 0.015625
ARM_OF_ANGLE = 0.1  # an orientation is as uncertain as two points this far apart, m


@dataclass(frozen=True)
class Wire:
    """A draw wire through sections (from 0) at an angle and radius."""

    name: str
    angle: float
    radius: float
    sections: tuple[int, ...]


@dataclass(frozen=True)
class Sensors:
    """All about the sensors of a case; SI."""

    sort: str
    rate: str
    noise: float
    colour: float  # correlation time; 0: white
    grid: float
    outliers: bool
    spells: bool
    ticks: bool
    wires: tuple[Wire, ...] = ()
    heads: tuple[int, ...] = ()  # sections (from 0) whose heads are seen
    camera: tuple[float, ...] = (0.0, 0.0, 0.0)  # place of the camera's frame in the base frame
    turn: tuple[float, ...] = (0.0, 0.0, 0.0)  # its rotation vector
    mirrored: bool = False

    @property
    def rows(self) -> int:
        """Rows of the log a second."""
        return RATES[self.rate][1]


def draw_sensors(
    rng: np.random.Generator,
    arm: TrueArm,
    sort: str,
    rate: str,
    noise: float,
    coloured: bool,
    *,
    all_heads: bool = False,
) -> Sensors:
    """Draw what the plan leaves open; ``all_heads``: the camera sees every head."""
    n = len(arm.sections)
    grid = float(rng.choice(GRIDS)) if rng.random() < 0.4 else FINEST
    wires: list[Wire] = []
    if sort == "wires":
        for i, s in enumerate(arm.sections):
            first = rng.uniform(0.0, 2.0 * np.pi)
            through = tuple(range(i + 1)) if rng.random() < 0.4 else (i,)
            wires += [
                Wire(
                    f"wire{i + 1}{'abc'[k]}",
                    float((first + 2.0 * np.pi * k / 3.0 + rng.uniform(-0.25, 0.25)) % (2.0 * np.pi)),
                    float(s.radius * rng.uniform(0.8, 1.4)),
                    through,
                )
                for k in range(3)
            ]
    seen = tuple(range(n)) if rng.random() < 0.6 or all_heads else (n - 1,)
    offset = rng.normal(size=3)
    offset *= rng.uniform(8e-3, 25e-3) / np.linalg.norm(offset)
    axis = rng.normal(size=3)
    axis *= np.deg2rad(rng.uniform(0.0, 5.0)) / np.linalg.norm(axis)
    camera = sort in ("heads", "poses")
    return Sensors(
        sort=sort,
        rate=rate,
        noise=noise,
        colour=float(np.exp(rng.uniform(np.log(0.02), np.log(0.2)))) if coloured else 0.0,
        grid=grid,
        outliers=bool(rng.random() < 1 / 6),
        spells=bool(rng.random() < 1 / 6),
        ticks=bool(rng.random() < 1 / 8),
        wires=tuple(wires),
        heads=seen if camera else (),
        camera=tuple(float(x) for x in offset) if camera else (0.0, 0.0, 0.0),
        turn=tuple(float(x) for x in axis) if camera else (0.0, 0.0, 0.0),
    )


def rotation(vector: Array) -> Array:
    """Rotation matrix of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector) / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def quaternions(matrices: Array) -> Array:
    """Unit quaternions, scalar first and not negative, of rotation matrices (m, 3, 3)."""
    out = np.empty((matrices.shape[0], 4))
    trace = np.trace(matrices, axis1=1, axis2=2)
    squares = np.stack([trace, *(2.0 * matrices[:, k, k] - trace for k in range(3))], axis=1)
    largest = np.argmax(squares, axis=1)
    for m, (r, best) in enumerate(zip(matrices, largest, strict=True)):
        q = np.array([1.0 + trace[m], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
        if best:
            i = best - 1
            j, k = (i + 1) % 3, (i + 2) % 3
            q = np.empty(4)
            q[0] = r[k, j] - r[j, k]
            q[1 + i] = 1.0 + r[i, i] - r[j, j] - r[k, k]
            q[1 + j] = r[j, i] + r[i, j]
            q[1 + k] = r[k, i] + r[i, k]
        q /= np.linalg.norm(q)
        out[m] = q if q[0] >= 0.0 else -q
    return out


def wire_length(wire: Wire, coordinates: Array) -> Array:
    """Length of a wire along arcs: ``l - r (u cos a + v sin a)``, summed over its sections."""
    total = np.zeros(coordinates.shape[0])
    for i in wire.sections:
        u, v, length = coordinates[:, 3 * i], coordinates[:, 3 * i + 1], coordinates[:, 3 * i + 2]
        total += length - wire.radius * (u * np.cos(wire.angle) + v * np.sin(wire.angle))
    return total


@dataclass
class Channels:
    """Channels of one log: names, values in m (samples, channels), orientations (samples, heads, 3, 3) or None."""

    names: tuple[str, ...]
    values: Array
    orientations: Array | None = None


def observe(sensors: Sensors, truth: Truth, coordinates: Array, heads: Array) -> Channels:
    """What perfect sensors would say of states and heads."""
    if sensors.sort == "coordinates":
        n = coordinates.shape[1] // 3
        names = tuple(f"q{i + 1}{k + 1}" for i in range(n) for k in range(3))
        return Channels(names, read_lengths(truth, coordinates))
    if sensors.sort == "wires":
        values = np.stack([wire_length(w, coordinates) for w in sensors.wires], axis=1)
        return Channels(tuple(w.name for w in sensors.wires), values)
    back = rotation(np.array(sensors.turn)).T
    mirror = np.diag([1.0, -1.0, 1.0]) if sensors.mirrored else np.eye(3)
    names = tuple(f"{axis}{i + 1}" for i in sensors.heads for axis in "xyz")
    seen = heads[:, list(sensors.heads)]
    places = (seen[:, :, :3] - np.array(sensors.camera)) @ (mirror @ back).T
    orientations = None
    if sensors.sort == "poses":
        frames = seen[:, :, 3:].reshape(*seen.shape[:2], 3, 3)
        # A mirrored picture shows mirrored bodies too; what a tracker reports is a proper rotation again.
        orientations = mirror @ back @ frames @ mirror
    return Channels(names, places.reshape(places.shape[0], -1), orientations)


@dataclass
class Measured:
    """What a log holds of the sensors: stamps, values in m, quaternions or None, and the rows that are sound."""

    time: Array
    names: tuple[str, ...]
    values: Array
    quaternions: Array | None
    sound: NDArray[np.bool_]


def sample_rows(rate: int, spacing: float, samples: int) -> NDArray[np.int64]:
    """Indices of fine samples at whole periods of a rate."""
    period = 1.0 / (rate * spacing)
    return np.round(np.arange(int((samples - 1) / period + 1e-9) + 1) * period).astype(np.int64)


def measure(sensors: Sensors, rng: np.random.Generator, clean: Channels, spacing: float) -> Measured:
    """Pass fine clean samples through the sensors, the clock and the log."""
    own, rows = RATES[sensors.rate]
    picked = sample_rows(own, spacing, clean.values.shape[0])
    values = clean.values[picked].copy()
    count, channels = values.shape
    if sensors.colour:
        noise = ornstein_uhlenbeck(rng, count, channels, sensors.noise, sensors.colour, 1.0 / own)
    else:
        noise = sensors.noise * rng.standard_normal((count, channels))
    values += noise
    sound = np.ones((count, channels), dtype=np.bool_)
    if sensors.outliers:
        hits = rng.random((count, channels)) < min(0.5, 0.2 / own)
        values[hits] += rng.choice([-1.0, 1.0], hits.sum()) * rng.uniform(8e-3, 40e-3, hits.sum())
        sound &= ~hits
    frames = None if clean.orientations is None else clean.orientations[picked].copy()
    if frames is not None:
        shakes = sensors.noise / ARM_OF_ANGLE * rng.standard_normal((count, frames.shape[1], 3))
        for m in range(count):
            for i in range(frames.shape[1]):
                frames[m, i] = frames[m, i] @ rotation(shakes[m, i])
    if sensors.spells:
        t = float(rng.uniform(2.0, 10.0))
        while t < count / own:
            first, last = round(t * own), min(count, round((t + rng.uniform(0.3, 1.5)) * own))
            values[first:last] = values[min(first, count - 1)]
            sound[first + 1 : last] = False
            if frames is not None:
                frames[first:last] = frames[min(first, count - 1)]
            t += float(rng.uniform(8.0, 20.0))
    values = np.round(values / sensors.grid) * sensors.grid
    turned = (
        None
        if frames is None
        else np.stack([quaternions(frames[:, i]) for i in range(frames.shape[1])], axis=1).reshape(count, -1)
    )
    times = np.arange(int((clean.values.shape[0] - 1) * spacing * rows + 1e-9) + 1) / rows
    if own != rows:
        # A slower sensor in a faster log: its last value again and again.
        index = np.minimum(np.floor(times * own + 1e-9).astype(np.int64), count - 1)
        fresh = np.diff(index, prepend=-1) > 0
        values, sound = values[index], sound[index] & fresh[:, None]
        turned = None if turned is None else turned[index]
    stamps = np.floor(times / TICK + 1e-9) * TICK if sensors.ticks else times
    return Measured(stamps, clean.names, values, turned, sound)
