"""An arm near a working point as a linear system of python-control, its signals named."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from bha import names
from bha.arrays import floats
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from bha.arm import Arm


def state_space(
    arm: Arm,
    p: ArrayLike,
    q: ArrayLike | None = None,
    qd: ArrayLike | None = None,
    *,
    period: float | None = None,
    name: str | None = None,
) -> Any:
    """An arm for small deviations from a state as a ``control.StateSpace`` (:meth:`bha.Arm.linearize`).

    States are deviations of lengths and rates, inputs those of the pressures in the bellows (pneumatics are not in
    it), outputs those of lengths and of head positions in the world; all in SI units and by the names that logs have:
    ``q11`` (``qv11`` where the bellows are not the standard three), ``qd11``, ``p11``, ``x1``.

    Args:
        arm: the arm.
        p: pressures of the working point, Pa absolute, shape (inputs,).
        q: lengths, m, shape (3n,); at rest under ``p`` if None.
        qd: rates, m/s, shape (3n,); zero if None.
        period: s; with one the system is that from one period to the next, pressures held meanwhile.
        name: of the system; that of the arm if None.

    Raises:
        InputError: an array of the wrong shape or with a value that is not finite.
        ConvergenceError: no rest under ``p``.
        MissingExtraError: python-control is not installed.
    """
    control = import_extra("control", extra="control", purpose="A linear system")
    size, sections = 3 * arm.section_count, range(1, arm.section_count + 1)
    pressures = floats(p, "p", (len(arm.inputs),))
    lengths = arm.static_lengths(pressures) if q is None else floats(q, "q", (size,))
    rates = np.zeros(size) if qd is None else floats(qd, "qd", (size,))
    a, b = arm.linearize(lengths, rates, pressures, period=period)
    heads = np.concatenate([arm.jacobian(lengths, section)[:3] for section in sections])
    own = arm.parameters.has_standard_bellows
    length, rate = (
        (names.length_name, names.velocity_name) if own else (names.coordinate_name, names.coordinate_velocity_name)
    )
    places = [(section, number) for section in sections for number in (1, 2, 3)]
    coordinates = [length(*place) for place in places]
    return control.StateSpace(
        a,
        b,
        np.hstack([np.vstack([np.eye(size), heads]), np.zeros((2 * size, size))]),
        np.zeros((2 * size, len(arm.inputs))),
        0 if period is None else period,
        states=[*coordinates, *(rate(*place) for place in places)],
        inputs=list(arm.inputs),
        outputs=[*coordinates, *(axis for section in sections for axis in names.position_names(section))],
        name=arm.name if name is None else name,
    )
