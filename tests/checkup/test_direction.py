"""Which way a section bends: what other sections' chambers do to it is no turn of its own."""

from __future__ import annotations

import numpy as np
import pytest

from bha.checkup.response import Moments
from bha.checkup.wiring import direction, direction_error

TURN = np.radians(20.0)


def bending(turn: float, carried: float, seed: int = 0) -> tuple[Moments, np.ndarray, np.ndarray]:
    """A section of three chambers that bends by its own and by ``carried`` times another one's, in ten pieces."""
    random = np.random.default_rng(seed)
    around = np.exp(2j * np.pi * np.arange(3) / 3)
    own, other = np.r_[around, np.zeros(3)], np.r_[np.zeros(3), around]
    pieces = []
    for _ in range(10):
        # Five steps a piece: few enough for the two sections' drives to go together by chance.
        p = 1e4 * np.repeat(random.standard_normal((5, 6)), 20, axis=0)
        p[:, 3:] += 0.6 * p[:, [1, 2, 0]]
        y = p @ (own * np.exp(1j * turn) + carried * other)
        pieces.append((p.T @ p, p.T @ y, float(np.sum(np.abs(y) ** 2))))
    pp, yp, yy = (np.array(part) for part in zip(*pieces, strict=True))
    return Moments(pp, yp, yy), own, other


@pytest.mark.parametrize("turn", [0.0, TURN])
def test_what_is_carried_over_is_no_turn(turn: float) -> None:
    block, own, other = bending(turn, 1.0)
    alone, _ = direction(block, own, other[None][:0])
    beside, _ = direction(block, own, other[None])
    assert abs(np.degrees(alone - turn)) > 12.0
    assert np.degrees(beside - turn) == pytest.approx(0.0, abs=1.0)
    assert np.degrees(direction_error(block, own, other[None])) < 1.0


def test_drives_that_are_the_same_leave_the_direction_of_their_sum() -> None:
    block, own, _ = bending(TURN, 0.0)
    assert direction(block, own, own[None]) == pytest.approx(direction(block, own, own[None][:0]))
