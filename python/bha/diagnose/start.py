"""States that measurements tell: lengths and rates of all sections at one moment, from lengths or head positions.

What: where simulations begin, at the start of a log or of a piece of it (node states of multiple shooting).
Source: the inverse of the forward kinematics, paper (11) and (14), by Gauss and Newton: a section of constant curvature
has three numbers, and so has the position of its head.
Validity: every section's lengths or its head's position measured; motion that is straight over the first rows.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bha import _core, names
from bha.diagnose.engine import channel_columns
from bha.diagnose.records import Record

Array = NDArray[np.float64]

#: Time from the start of a record that gives its state, s, and the fewest rows.
START_TIME, FEWEST_ROWS = 0.06, 6
#: Greatest step of a length in the search for a pose, m, most steps, and the step at which it ends.
GREATEST_STEP, MOST_STEPS, LEAST_STEP = 0.02, 40, 1e-10
#: Greatest distance of what the found pose shows from what was measured, m: beyond it the heads are out of reach.
FAR = 0.02
#: Directions of a pose with singular values below this share of the largest are not told: no step along them.
LEAST_SINGULAR = 1e-6
#: Any length, to see what of an arm is rigid, and the least one that a search begins with, m.
SOME_LENGTH, LEAST_LENGTH = 0.1, 0.01


def tells_state(channels: Sequence[str], sections: int) -> bool:
    """Whether the channels tell the lengths of all sections: three lengths or the head's position of each."""
    return all(_section_channels(channels, i) is not None for i in range(1, sections + 1))


def first_state(arm: _core.Arm, record: Record, sections: int) -> Array:
    """Lengths and rates at the first compared row, m and m/s, shape (6n,).

    From what was measured there where that tells them; else at rest under the first pressures.

    Raises:
        ConvergenceError: no rest under the first pressures, and nothing measured to start from.
    """
    if tells_state(record.channels, sections):
        values, rates = _start_of(record)
        used = [c for i in range(1, sections + 1) for c in _section_channels(record.channels, i) or ()]
        columns = [record.channels.index(name) for name in used]
        if all(name.startswith("q") for name in used):
            return np.concatenate([values[columns], rates[columns]])
        q = pose(arm, used, values[columns], sections)
        if q is not None:
            _, jacobian = _channels_at(arm, used, q)
            return np.concatenate([q, np.linalg.lstsq(jacobian, rates[columns], rcond=None)[0]])
    first = int(record.rows[0])
    q = arm.static_lengths(record.pressures[first], None if record.forces is None else record.forces[first])
    return np.concatenate([q, np.zeros(3 * sections)])


def _section_channels(channels: Sequence[str], section: int) -> tuple[str, ...] | None:
    """The channels that tell the lengths of a section: its lengths where all are measured, else its head's position."""
    lengths = tuple(names.length_name(section, k) for k in (1, 2, 3))
    for wanted in (lengths, tuple(names.position_names(section))):
        if all(name in channels for name in wanted):
            return wanted
    return None


def _start_of(record: Record) -> tuple[Array, Array]:
    """Values and rates of all channels at the first compared row, by a straight line through the rows after it."""
    time = record.output_time
    count = max(FEWEST_ROWS, int(np.searchsorted(time, time[0] + START_TIME)))
    rates, values = np.polyfit(time[:count] - time[0], record.outputs[:count], 1)
    return values, rates


def pose(arm: _core.Arm, channels: Sequence[str], values: Array, sections: int) -> Array | None:
    """Lengths at which the arm shows ``values`` (k,) in the channels, shape (3n,); None if it cannot."""
    q = _straight(arm, channels, values, sections)
    for _ in range(MOST_STEPS):
        predicted, jacobian = _channels_at(arm, channels, q)
        step = np.linalg.lstsq(jacobian, values - predicted, rcond=LEAST_SINGULAR)[0]
        q = q + np.clip(step, -GREATEST_STEP, GREATEST_STEP)
        if not np.all(np.isfinite(q)):
            return None
        if np.max(np.abs(step)) < LEAST_STEP:
            break
    return q if np.max(np.abs(_channels_at(arm, channels, q)[0] - values)) < FAR else None


def _straight(arm: _core.Arm, channels: Sequence[str], values: Array, sections: int) -> Array:
    """Where the search begins: every section straight, as long as its head is away from the one before."""
    q = np.full(3 * sections, SOME_LENGTH)
    heights = arm.forward_kinematics(q)[0][:, 2]
    place = {name: k for k, name in enumerate(channels)}
    last = np.zeros(3)
    for i in range(1, sections + 1):
        own = slice(3 * (i - 1), 3 * i)
        if names.length_name(i, 1) in place:
            q[own] = [values[place[names.length_name(i, k)]] for k in (1, 2, 3)]
            # Where the head is then does not matter much: it only says from where the next section's is away.
            last = np.array([0.0, 0.0, heights[i - 1]])
            continue
        head = np.array([values[place[name]] for name in names.position_names(i)])
        rigid = heights[i - 1] - (heights[i - 2] if i > 1 else 0.0) - SOME_LENGTH
        q[own] = max(float(np.linalg.norm(head - last)) - rigid, LEAST_LENGTH)
        last = head
    return q


def _channels_at(arm: _core.Arm, channels: Sequence[str], q: Array) -> tuple[Array, Array]:
    """Values of the channels at the lengths ``q`` and their derivatives by these, shapes (k,) and (k, 3n)."""
    sections = len(q) // 3
    heads, _ = arm.forward_kinematics(q)
    columns = channel_columns(channels, sections)
    slopes = np.vstack([np.eye(len(q)), *(arm.jacobian(q, i)[:3] for i in range(1, sections + 1))])
    return np.concatenate([q, heads.ravel()])[columns], slopes[columns]
