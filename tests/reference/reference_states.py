"""States of an arm and numerical derivatives for the tests of the reference model."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from bha import reference as ref

STEP = 1e-5


@dataclasses.dataclass(frozen=True)
class State:
    """Lengths, rates, accelerations, pressures and external forces (base frame) of one state."""

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    p: np.ndarray
    f_ext: np.ndarray


def with_arcs(section: ref.Section, bending: tuple[float, ...] = (0.6, 0.25, 0.15)) -> ref.Section:
    """The section as three unequal arcs whose radius falls from base to head; its mean by bending is the section's."""
    lengths, radii = (0.3, 0.2, 0.5), np.array([1.1, 1.0, 0.85])
    radii *= section.bellows_radius / (np.array(bending) @ radii)
    arcs = [
        ref.SectionArc(length, share, float(r), section.terminal_area)
        for length, share, r in zip(lengths, bending, radii, strict=True)
    ]
    return dataclasses.replace(section, arcs=tuple(arcs))


def random_state(n: int, seed: int) -> State:
    rng = np.random.default_rng(seed)
    return State(
        q=rng.uniform(0.1, 0.3, 3 * n),
        qd=rng.normal(0.0, 0.3, 3 * n),
        qdd=rng.normal(0.0, 3.0, 3 * n),
        p=rng.uniform(0.7e5, 2.2e5, 3 * n),
        f_ext=rng.normal(0.0, 2.0, (n, 3)),
    )


def straight_state(n: int, seed: int) -> State:
    """A moving arm in its straight pose, where (7) has no direction of bending."""
    state = random_state(n, seed)
    return dataclasses.replace(state, q=np.repeat(state.q[::3], 3))


def central_difference(f: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: float = STEP) -> np.ndarray:
    """df/dx by fourth-order central differences; the first axis is that of x."""
    rows = []
    for direction in np.eye(len(x)) * step:
        near, far = f(x + direction) - f(x - direction), f(x + 2 * direction) - f(x - 2 * direction)
        rows.append((8 * near - far) / (12 * step))
    return np.array(rows)


def rate(f: Callable[[float], np.ndarray], step: float = STEP) -> np.ndarray:
    """df/dt at t = 0."""
    return central_difference(lambda t: f(t[0]), np.zeros(1), step)[0]
