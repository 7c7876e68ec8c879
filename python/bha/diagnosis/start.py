"""States that measurements tell: lengths and rates of all sections at one moment, from lengths or head positions.

What: where simulations begin, at the start of a log or of a piece of it (node states of multiple shooting).
Source: the inverse of the forward kinematics, paper (11) and (14), by Gauss and Newton: a section of constant curvature
has three numbers, and so has the position of its head.
Validity: every section's lengths or its head's position measured; motion that is straight over the first rows.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.estimation.records import Record
from bha.recordings import Observation

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


def tells_state(observation: Observation, sections: int) -> bool:
    """Whether the outputs tell the lengths of all sections: by the head's position of each, the rest by lengths."""
    heads = _heads(observation)
    rest = [i for i in range(sections) if i + 1 not in heads]
    columns = [3 * i + k for i in rest for k in range(3)]
    return not rest or int(np.linalg.matrix_rank(observation.rows[:, columns], tol=LEAST_SINGULAR)) == len(columns)


def first_state(arm: _core.Arm, record: Record, sections: int) -> Array:
    """Lengths and rates at the first compared row, m and m/s, shape (6n,).

    From what was measured there where that tells them; else at rest under the first pressures.

    Raises:
        ConvergenceError: no rest under the first pressures, and nothing measured to start from.
    """
    observation = record.observation
    if tells_state(observation, sections):
        values, rates = _start_of(record)
        lengths = len(observation.rows)
        if int(np.linalg.matrix_rank(observation.rows, tol=LEAST_SINGULAR)) == 3 * sections:
            # Lengths alone tell all: nothing to search for.
            known = (values[:lengths] - observation.shifts) / observation.gains - observation.offsets
            both = np.column_stack([known, rates[:lengths] / observation.gains])
            return np.asarray(np.linalg.lstsq(observation.rows, both, rcond=None)[0].T.ravel())
        q = pose(arm, observation, values, sections)
        if q is not None:
            _, jacobian = observation.at(arm, q)
            return np.concatenate([q, np.linalg.lstsq(jacobian, rates, rcond=None)[0]])
    first, drive = int(record.rows[0]), record.drive
    q = arm.static_lengths(drive.pressures[first], None if drive.forces is None else drive.forces[first])
    return np.concatenate([q, np.zeros(3 * sections)])


def _heads(observation: Observation) -> set[int]:
    """Sections, from 1, of which all three coordinates of the head were measured."""
    own = [output.section for output in observation.outputs if output.kind == "position"]
    return {section for section in own if own.count(section) == 3}


def _start_of(record: Record) -> tuple[Array, Array]:
    """Values and rates of all channels at the first compared row, by a straight line through the rows after it."""
    time = record.time
    count = max(FEWEST_ROWS, int(np.searchsorted(time, time[0] + START_TIME)))
    rates, values = np.polyfit(time[:count] - time[0], record.measured[:count], 1)
    return values, rates


def pose(arm: _core.Arm, observation: Observation, values: Array, sections: int) -> Array | None:
    """Lengths at which the arm shows ``values`` (C,) in its outputs, shape (3n,); None if it cannot."""
    q = _straight(arm, observation, values, sections)
    for _ in range(MOST_STEPS):
        predicted, jacobian = observation.at(arm, q)
        step = np.linalg.lstsq(jacobian, values - predicted, rcond=LEAST_SINGULAR)[0]
        q = q + np.clip(step, -GREATEST_STEP, GREATEST_STEP)
        if not np.all(np.isfinite(q)):
            return None
        if np.max(np.abs(step)) < LEAST_STEP:
            break
    return q if np.max(np.abs(observation.at(arm, q)[0] - values)) < FAR else None


def _straight(arm: _core.Arm, observation: Observation, values: Array, sections: int) -> Array:
    """Where the search begins: what lengths tell; else straight, as long as a head is away from the one before."""
    q = np.full(3 * sections, SOME_LENGTH)
    straight = np.vstack([arm.shape(q, 1)[:1], arm.forward_kinematics(q)[0]])
    heads = _heads(observation)
    last = straight[0]
    for i in range(1, sections + 1):
        own = slice(3 * (i - 1), 3 * i)
        if i not in heads:
            mine = np.flatnonzero(np.any(observation.rows[:, own] != 0.0, axis=1))
            known = values[mine] - observation.offsets[mine] - observation.shifts[mine]
            if len(known):
                q[own] = np.linalg.lstsq(observation.rows[mine][:, own], known, rcond=None)[0]
            # Where the head is then does not matter much: it only says from where the next section's is away.
            last = straight[i]
            continue
        columns = [k for k, o in enumerate(observation.outputs) if o.kind == "position" and o.section == i]
        head = observation.camera.base_positions(values[columns])
        rigid = float(np.linalg.norm(straight[i] - straight[i - 1])) - SOME_LENGTH
        q[own] = max(float(np.linalg.norm(head - last)) - rigid, LEAST_LENGTH)
        last = head
    return q
