"""Probes without effects in the core: those on pressures as changed inputs, on length sensors as changed outputs.

What: the same forms as `rust/src/effects/kinds`, at the samples. An arm without effects runs abreast with others like
it in the lanes of the processor, whatever its inputs; hundreds of probes gain by that. Fits use the core's effects.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bha.estimation.records import Record

Array = NDArray[np.float64]

ON_PRESSURES = frozenset({"pressure_lag", "delay", "valve_dead_band", "pressure_offset", "pressure_gain", "leak"})
ON_LENGTHS = frozenset({"length_offset", "length_gain", "wire_backlash"})
#: Where they are of sensors, not of pressures.
OF_SENSORS = frozenset({"sensors", "heads"})
#: 1 bar, Pa.
BAR = 1e5


@dataclass(frozen=True)
class PressureProbe:
    """An effect on pressures.

    Attributes:
        kind: as in the registry.
        inputs: indices of the inputs it acts on.
        numbers: its numbers.
    """

    kind: str
    inputs: tuple[int, ...]
    numbers: Mapping[str, float]


def acting_pressures(record: Record, probes: Sequence[PressureProbe], ambient: float) -> list[Array]:
    """The pressures that act under each probe, Pa, each (rows, inputs)."""
    p, time = record.drive.pressures, record.drive.time
    result = [p.copy() for _ in probes]
    stepping: list[tuple[int, int]] = []
    for k, probe in enumerate(probes):
        for j in probe.inputs:
            if probe.kind == "pressure_offset":
                result[k][:, j] += probe.numbers["offset"]
            elif probe.kind == "pressure_gain":
                result[k][:, j] += probe.numbers["gain"] * (p[:, j] - ambient)
            elif probe.kind == "leak":
                loss = probe.numbers["drop"] / BAR**0.5
                above = p[:, j] - ambient
                root = 0.5 * (np.sqrt(loss**2 + 4.0 * np.abs(above)) - loss)
                result[k][:, j] = ambient + np.sign(above) * root**2
            elif probe.kind == "delay":
                result[k][:, j] = np.interp(time - probe.numbers["time"], time, p[:, j])
            else:
                stepping.append((k, j))
    _step_through(time, p, probes, stepping, result)
    # A chamber that a fit has emptied to vacuum, beside tubes that are exchanged, holds no less under any probe.
    return [np.maximum(acting, 0.0) for acting in result]


def _step_through(
    time: Array, p: Array, probes: Sequence[PressureProbe], stepping: Sequence[tuple[int, int]], result: Sequence[Array]
) -> None:
    """Lags and dead bands, whose output has a memory: all of them side by side, sample by sample."""
    if not stepping:
        return
    columns = np.array([j for _, j in stepping])
    band = np.array([probes[k].numbers.get("band", np.nan) for k, _ in stepping])
    fill = np.array([probes[k].numbers.get("fill", 1.0) for k, _ in stepping])
    vent = np.array([probes[k].numbers.get("vent", 1.0) for k, _ in stepping])
    plays = np.isfinite(band)
    width = np.where(plays, band, 0.0)
    u = p[:, columns]
    out = np.empty_like(u)
    out[0] = x = u[0]
    for row in range(1, len(time)):
        h = time[row] - time[row - 1]
        tau = np.where(u[row] > x, fill, vent)
        keep = np.exp(-h / tau)
        # Exact for a straight line from the last sample to this one, at one time constant; a jump does not move it.
        slope = (u[row] - u[row - 1]) / h if h > 0.0 else np.zeros_like(x)
        lagged = u[row] - ((u[row - 1] - x) * keep + slope * tau * (1.0 - keep)) if h > 0.0 else x
        played = np.minimum(np.maximum(x, u[row] - width), u[row] + width)
        x = np.where(plays, played, lagged)
        out[row] = x
    for place, (k, j) in enumerate(stepping):
        result[k][:, j] = out[:, place]


def length_change(kind: str, channel: str, record: Record, outputs: Array, size: float) -> Array:
    """Change of the outputs (rows, channels) per unit of an offset, a gain or a play ``size`` of one length sensor."""
    change = np.zeros_like(outputs)
    if channel not in record.channels:
        return change
    k = record.channels.index(channel)
    if kind == "length_offset":
        change[:, k] = 1.0
    elif kind == "length_gain":
        change[:, k] = outputs[:, k]
    else:
        reading = outputs[0, k]
        for row, length in enumerate(outputs[:, k]):
            reading = min(max(reading, length - size), length + size)
            change[row, k] = (reading - length) / size
    return change
