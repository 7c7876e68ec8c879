"""What the log says of the pressures: those in the chambers, measured, or the commands alone.

A chamber follows its command through two first-order stages and, where only commands are logged, a dead time. A
measured pressure has white noise and may lie on a grid; a command is exact and held from one change to the next.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..jit import compiled

Array = NDArray[np.float64]

SORTS = ("measured", "commanded")
UNITS = {"Pa": 1.0, "kPa(g)": 1e3, "bar": 1e5}
SECOND_STAGE = 0.25


@dataclass(frozen=True)
class PressureSense:
    """How pressures are logged; SI."""

    sort: str
    lag: float  # of the valves, s
    delay: float  # of the commands, s
    noise: float
    grid: float
    unit: str

    @property
    def commanded(self) -> bool:
        """Whether the log holds commands alone."""
        return self.sort == "commanded"


def draw_pressures(rng: np.random.Generator, sort: str) -> PressureSense:
    """Draw lag, dead time, noise and grid."""
    unit = str(rng.choice(list(UNITS)))
    if sort == "commanded":
        lag = float(np.exp(rng.uniform(np.log(0.05), np.log(0.6))))
        return PressureSense(sort, lag, float(rng.uniform(0.0, 0.15)), 0.0, 0.0, unit)
    noise = float(np.exp(rng.uniform(np.log(50.0), np.log(500.0))))
    grid = float(rng.choice([50.0, 100.0, 200.0, 500.0])) if rng.random() < 0.4 else 0.0
    return PressureSense(sort, float(rng.uniform(0.025, 0.15)), 0.0, noise, grid, unit)


@compiled
def _two_stages(command: Array, first: float, second: float) -> None:
    """Two first-order stages in a row at every input, in place; ``first`` and ``second`` are what a step keeps."""
    for j in range(command.shape[1]):
        a = command[0, j]
        b = command[0, j]
        for k in range(command.shape[0]):
            a = command[k, j] + (a - command[k, j]) * first
            b = a + (b - a) * second
            command[k, j] = b


def chamber_pressures(sense: PressureSense, command: Array, step: float) -> Array:
    """Pressures in the chambers from commands on a grid of spacing ``step``; at rest in the first row."""
    late = round(sense.delay / step)
    out = np.concatenate([np.repeat(command[:1], late, axis=0), command[: command.shape[0] - late]]).copy()
    shares = (1.0 - SECOND_STAGE, SECOND_STAGE)
    _two_stages(out, *(float(np.exp(-step / (share * sense.lag))) for share in shares))
    return out


def log_pressures(sense: PressureSense, rng: np.random.Generator, values: Array) -> Array:
    """What the log holds of pressures at its rows, Pa absolute."""
    if sense.commanded:
        return values.copy()
    read = values + sense.noise * rng.standard_normal(values.shape)
    return np.asarray(np.round(read / sense.grid) * sense.grid if sense.grid else read)
