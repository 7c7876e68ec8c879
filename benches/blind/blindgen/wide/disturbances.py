"""What acts and is in no log: an Ornstein-Uhlenbeck force or pressure, or a drift from one session to the next.

A force acts at the last head, in all three directions of its frame. It is sized by how far it pushes: 0.3 to 2 mm at
the tip. A pressure has 0.3 to 1.5 kPa, one for each input. Correlation times are 0.1 to 5 s. Sessions differ in the
rest lengths of each section (1.5 mm standard deviation) and in the pressure of the surroundings (5 hPa).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..jit import compiled
from .arms import TrueArm

Array = NDArray[np.float64]

SORTS = ("none", "force", "pressure", "sessions")
REST_DRIFT, AMBIENT_DRIFT = 1.5e-3, 500.0


@dataclass(frozen=True)
class Disturbance:
    """An unlogged disturbance; ``size`` is a standard deviation in N or Pa."""

    sort: str
    size: float = 0.0
    time: float = 1.0


@dataclass(frozen=True)
class Session:
    """What is another from session to session: shift of rest lengths by section, m; of the ambient pressure, Pa."""

    rest: tuple[float, ...]
    ambient: float = 0.0


def draw_disturbance(rng: np.random.Generator, sort: str, arm: TrueArm) -> Disturbance:
    """Draw size and correlation time."""
    time = float(np.exp(rng.uniform(np.log(0.1), np.log(5.0))))
    if sort == "force":
        s = arm.sections[-1]
        bending = 0.5 * len(s.bellows) * s.radius**2 * s.stiffness[0] + s.bending[0]
        return Disturbance(sort, float(rng.uniform(0.3e-3, 2e-3) * 2.0 * bending / s.rest_length**2), time)
    if sort == "pressure":
        return Disturbance(sort, float(np.exp(rng.uniform(np.log(300.0), np.log(1500.0)))), time)
    return Disturbance(sort)


def draw_sessions(rng: np.random.Generator, disturbance: Disturbance, sections: int, logs: int) -> list[Session]:
    """The session of each log: without drift all are alike; with it the logs come from two or three sessions."""
    same = Session((0.0,) * sections)
    if disturbance.sort != "sessions":
        return [same] * logs
    count = min(logs, int(rng.integers(2, 4)))
    made = [
        Session(
            tuple(float(x) for x in REST_DRIFT * rng.standard_normal(sections)), float(AMBIENT_DRIFT * rng.normal())
        )
        for _ in range(count)
    ]
    return [made[k * count // logs] for k in range(logs)]


@compiled
def _first_order(drive: Array, keep: float) -> None:
    """``x_k = keep x_(k-1) + drive_k`` down every column, in place."""
    for k in range(1, drive.shape[0]):
        for j in range(drive.shape[1]):
            drive[k, j] += keep * drive[k - 1, j]


def ornstein_uhlenbeck(rng: np.random.Generator, rows: int, columns: int, size: float, time: float, dt: float) -> Array:
    """Stationary samples (rows, columns) with a standard deviation and a correlation time, exact at spacing ``dt``."""
    keep = float(np.exp(-dt / time))
    out = size * np.sqrt(1.0 - keep * keep) * rng.standard_normal((rows, columns))
    out[0] = size * rng.standard_normal(columns)
    _first_order(out, keep)
    return np.asarray(out)


def unlogged(
    disturbance: Disturbance, rng: np.random.Generator, arm: TrueArm, rows: int, step: float
) -> tuple[Array | None, Array | None]:
    """Unlogged pressures (rows, inputs) and head forces (rows, 3n) of one log; None where there are none."""
    if disturbance.sort == "pressure":
        return ornstein_uhlenbeck(rng, rows, len(arm.inputs), disturbance.size, disturbance.time, step), None
    if disturbance.sort == "force":
        force = np.zeros((rows, 3 * len(arm.sections)))
        force[:, -3:] = ornstein_uhlenbeck(rng, rows, 3, disturbance.size, disturbance.time, step)
        return None, force
    return None, None
