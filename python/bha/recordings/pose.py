"""The pose in which an arm shows given values in its outputs, by least squares on the forward kinematics.

What: lengths whose outputs, paper (11) and (14), are nearest to what was measured, drawn weakly to the pose that the
pressures hold, which decides what is not measured. The search begins straight where heads and lengths tell all of it,
at the pose that pressures hold else.
Limits: outputs lie in the right valley of a pose, no more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.errors import BhaError
from bha.parameters import ArmParameters
from bha.recordings.outputs import Observation

Array = NDArray[np.float64]

#: How far a pose may be from the one the pressures hold before that counts against it, m.
_POSE_DEVIATION = 0.02
#: Channels are not trusted more than this, m.
LEAST_DEVIATION = 1e-5
#: Greatest step of a length in the search for a pose, m, most steps, and the step at which it ends.
_GREATEST_STEP, _MOST_STEPS, _LEAST_STEP = 0.02, 40, 1e-10
#: Directions of a pose with singular values below this share of the largest are not told.
_LEAST_SINGULAR = 1e-6
#: Any length, to see what of an arm is rigid, and the least one that a search begins with, m.
_SOME_LENGTH, _LEAST_LENGTH = 0.1, 0.01


def pose(
    arm: _core.Arm,
    parameters: ArmParameters,
    observation: Observation,
    values: Array,
    deviation: Array,
    pressures: Array,
    forces: Array | None = None,
) -> Array:
    """Lengths that fit measured channels best, shape (3n,).

    Args:
        arm: the arm.
        parameters: how many sections it has, and how long they may be.
        observation: the channels as this arm shows them.
        values: measured channels, m, shape (C,); NaN for one that was not.
        deviation: standard deviation of each, m, shape (C,).
        pressures: Pa, shape (inputs,); the pose they hold decides what no channel tells.
        forces: external forces, N, shape (n, 3); None for none.
    """
    n = 3 * len(parameters.sections)
    rest = _rest(arm, parameters, pressures, forces)
    weight = 1.0 / np.maximum(deviation, LEAST_DEVIATION)
    seen = np.isfinite(values)
    told = bool(np.all(seen)) and tells_state(observation, len(parameters.sections))
    q = _straight(arm, observation, values, len(parameters.sections)) if told else rest.copy()
    for _ in range(_MOST_STEPS):
        predicted, jacobian = observation.at(arm, q)
        # The pull to the resting pose is weak: it decides only what no channel tells.
        lhs = np.vstack([jacobian[seen] * weight[seen, None], np.eye(n) / _POSE_DEVIATION])
        rhs = np.concatenate([(values - predicted)[seen] * weight[seen], (rest - q) / _POSE_DEVIATION])
        step = np.linalg.lstsq(lhs, rhs, rcond=None)[0]
        q = q + np.clip(step, -_GREATEST_STEP, _GREATEST_STEP)
        if np.abs(step).max() < _LEAST_STEP:
            break
    return q


def tells_state(observation: Observation, sections: int) -> bool:
    """Whether the outputs tell the lengths of all sections: by the head's position of each, the rest by lengths."""
    heads = _heads(observation)
    rest = [i for i in range(sections) if i + 1 not in heads]
    columns = [3 * i + k for i in rest for k in range(3)]
    return not rest or int(np.linalg.matrix_rank(observation.rows[:, columns], tol=_LEAST_SINGULAR)) == len(columns)


def _heads(observation: Observation) -> set[int]:
    """Sections, from 1, of which all three coordinates of the head were measured."""
    own = [output.section for output in observation.outputs if output.kind == "position"]
    return {section for section in own if own.count(section) == 3}


def _straight(arm: _core.Arm, observation: Observation, values: Array, sections: int) -> Array:
    """Where a search begins: what lengths tell; else straight, as long as a head is away from the one before."""
    q = np.full(3 * sections, _SOME_LENGTH)
    straight = np.vstack([arm.shape(q, 1)[:1], arm.forward_kinematics(q)[0]])
    heads = _heads(observation)
    last = straight[0]
    count = len(observation.rows)
    lengths = (values[:count] - observation.shifts) / observation.gains - observation.offsets
    for i in range(1, sections + 1):
        own = slice(3 * (i - 1), 3 * i)
        if i not in heads:
            mine = np.flatnonzero(np.any(observation.rows[:, own] != 0.0, axis=1))
            if len(mine):
                q[own] = np.linalg.lstsq(observation.rows[mine][:, own], lengths[mine], rcond=None)[0]
            # Where the head is then does not matter much: it only says from where the next section's is away.
            last = straight[i]
            continue
        columns = [k for k, o in enumerate(observation.outputs) if o.kind == "position" and o.section == i]
        head = observation.camera.base_positions(values[columns])
        rigid = float(np.linalg.norm(straight[i] - straight[i - 1])) - _SOME_LENGTH
        q[own] = max(float(np.linalg.norm(head - last)) - rigid, _LEAST_LENGTH)
        last = head
    return q


def _rest(arm: _core.Arm, parameters: ArmParameters, pressures: Array, forces: Array | None) -> Array:
    """The pose that pressures hold; the middle of the range where there is none."""
    low, high = (np.repeat([s.length_range[k] for s in parameters.sections], 3) for k in (0, 1))
    try:
        q: Array = arm.static_lengths(pressures, forces)
    except BhaError:
        return np.asarray(0.5 * (low + high))
    return q if np.all((q > 0.5 * low) & (q < 1.5 * high)) else np.asarray(0.5 * (low + high))
