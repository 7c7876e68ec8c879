"""What readings leave open of a pressure between them: as large as it truly is, there where it is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from bha.recordings.doubt import NOTHING, doubt
from bha.recordings.interpolation import akima

Array = NDArray[np.float64]
NOISE = 50.0


def rises(time: Array, rng: np.random.Generator, width: float) -> Array:
    """Steps of some 20 kPa at any time, each behind two lags of ``width``, s."""
    edges = np.arange(1.0, time[-1], 1.3) + rng.uniform(0.0, 0.3, len(np.arange(1.0, time[-1], 1.3)))
    since = np.maximum(time[:, None] - edges, 0.0)
    shape = 1.0 - (1.0 + since / width) * np.exp(-since / width) if width else 1.0 * (since > 0.0)
    return 1.3e5 + shape @ rng.normal(0.0, 2e4, len(edges))


@pytest.mark.parametrize("rate", [10, 25, 50])
def test_smooth_pressures_are_missed_by_as_much_as_is_said(rate: int) -> None:
    rng = np.random.default_rng(rate)
    time = np.arange(60_001) / 1e3
    true = rises(time, rng, 0.03)
    knots = np.arange(0, len(time), 1000 // rate)
    readings = true[knots] + NOISE * rng.standard_normal(len(knots))
    found = doubt(time, time[knots], readings, NOISE, akima)
    drawn = np.concatenate([found.drawn(time, rng) for _ in range(8)])
    missed = true - akima(time, time[knots], true[knots])
    inner = slice(1000, -1000)
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(np.sqrt(np.mean(missed[inner] ** 2)), rel=0.45, abs=20.0)
    # It stands where the pressure moves.
    told = np.zeros(len(time), dtype=bool)
    for a, b, scale in zip(found.first, found.last, found.scale, strict=True):
        told[a:b] = scale > 0.1 * found.scale.max()
    assert np.sum(missed[inner][~told[inner]] ** 2) < 0.15 * np.sum(missed[inner] ** 2)
    assert np.mean(told) < 0.5


def test_of_jumps_their_time_is_not_known() -> None:
    """A jump at any moment within h: its straight line is off by an area of standard deviation step h / sqrt(12)."""
    rng = np.random.default_rng(3)
    time = np.arange(120_001) / 1e3
    true = rises(time, rng, 0.0)
    rows = np.arange(0, len(time), 100)
    found = doubt(time[rows], time[rows], true[rows], 0.0, np.interp)
    # Rows of the log are all the samples there are: the area stands at both ends.
    areas = [0.1 * found.drawn(time[rows], rng) for _ in range(20)]
    missed = true - np.interp(time, time[rows], true[rows])
    own = np.array([np.sum(missed[a : a + 100]) * 1e-3 for a in rows[:-1]])
    assert np.sqrt(np.mean(np.square(areas)) * 2.0) == pytest.approx(np.sqrt(np.mean(own**2)), rel=0.3)


def test_noise_and_slow_pressures_leave_nothing_open() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(2001) / 100.0
    slow = 1.3e5 + 2e4 * np.sin(0.6 * time) + NOISE * rng.standard_normal(len(time))
    assert doubt(time, time, slow, NOISE, np.interp) is NOTHING
    assert doubt(time[:30], time[:30], slow[:30], NOISE, np.interp) is NOTHING


def test_a_part_has_its_own_intervals() -> None:
    time = np.arange(1001) / 100.0
    knots = np.arange(0, 1001, 10)
    values = rises(time, np.random.default_rng(2), 0.0)[knots]
    whole = doubt(time, time[knots], values, 0.0, akima)
    part = whole.between(300, 700)
    inside = (whole.first >= 300) & (whole.last <= 700)
    assert np.array_equal(part.first + 300, whole.first[inside])
    drawn = part.drawn(time[300:701], np.random.default_rng(0))
    assert drawn.shape == (401,)
    assert not np.any(drawn[knots[30:71] - 300])
