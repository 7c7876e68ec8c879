"""Sensors: noise, quantisation, and the log files.

Standard set: 0.2 mm standard deviation and 0.05 mm steps on the lengths, 200 Pa on the pressures; hard set: 1 mm and
500 Pa. Head positions have 0.3 mm (hard: 1 mm). The tip force is that of a load cell with 0.02 N. Coloured noise is
half (by variance) a first-order process with a correlation time of 30 ms, half white, at the same standard deviation.
"""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .truth import SAMPLE_TIME, CleanLog

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseSet:
    """Standard deviations and the quantisation step of the lengths, SI."""

    length: float
    length_step: float
    pressure: float
    position: float
    force: float = 0.02
    colour_time: float = 0.03


NOISE = {
    "standard": NoiseSet(length=2e-4, length_step=5e-5, pressure=200.0, position=3e-4),
    "hard": NoiseSet(length=1e-3, length_step=5e-5, pressure=500.0, position=1e-3),
}


@dataclass
class MeasuredLog:
    """What the product gets to see; ``heads`` only where head positions are measured, ``force`` only where a force
    was logged.
    """

    time: Array
    pressure: Array
    lengths: Array
    heads: Array | None
    force: Array | None


def _length_noise(rng: np.random.Generator, shape: tuple[int, ...], noise: NoiseSet, coloured: bool) -> Array:
    white: Array = rng.standard_normal(shape)
    if not coloured:
        return noise.length * white
    keep = float(np.exp(-SAMPLE_TIME / noise.colour_time))
    drive = np.sqrt(1.0 - keep * keep) * rng.standard_normal(shape)
    slow: Array = np.empty(shape)
    slow[0] = rng.standard_normal(shape[1])
    for k in range(1, shape[0]):
        slow[k] = keep * slow[k - 1] + drive[k]
    mixed: Array = noise.length * np.sqrt(0.5) * (white + slow)
    return mixed


def measure(
    clean: CleanLog, noise: NoiseSet, rng: np.random.Generator, *, heads: bool = False, coloured: bool = False
) -> MeasuredLog:
    """Pass a clean log through the sensors."""
    lengths = clean.lengths + _length_noise(rng, clean.lengths.shape, noise, coloured)
    forced = bool(np.any(clean.force))
    return MeasuredLog(
        time=np.arange(lengths.shape[0], dtype=np.float64) * SAMPLE_TIME,
        pressure=clean.pressure + noise.pressure * rng.standard_normal(clean.pressure.shape),
        lengths=np.round(lengths / noise.length_step) * noise.length_step,
        heads=clean.heads + noise.position * rng.standard_normal(clean.heads.shape) if heads else None,
        force=clean.force + noise.force * rng.standard_normal(clean.force.shape) if forced else None,
    )


def write_log(log: MeasuredLog, path: Path) -> None:
    """Write a log as CSV, whole or not at all. Columns: ``t [s]``, ``p11 [Pa]`` absolute, ``q11 [mm]``, ``x1
    [m]``, ``fx3 [N]``.
    """
    d = log.lengths.shape[1]
    names = [f"{i + 1}{k + 1}" for i in range(d // 3) for k in range(3)]
    header = ["t [s]", *(f"p{x} [Pa]" for x in names), *(f"q{x} [mm]" for x in names)]
    blocks = [(log.time[:, None], "%.3f"), (log.pressure, "%.1f"), (1e3 * log.lengths, "%.2f")]
    if log.heads is not None:
        header += [f"{axis}{i + 1} [m]" for i in range(d // 3) for axis in "xyz"]
        blocks.append((log.heads, "%.5f"))
    if log.force is not None:
        header += [f"f{axis}{d // 3} [N]" for axis in "xyz"]
        blocks.append((log.force, "%.4f"))
    style = [kind for block, kind in blocks for _ in range(block.shape[1])]
    rows = np.concatenate([block for block, _ in blocks], axis=1)
    line = ",".join(style)
    temporary = path.with_name(path.name + ".part")
    with temporary.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(header)
        file.writelines(line % tuple(row) + "\n" for row in rows.tolist())
    os.replace(temporary, path)
