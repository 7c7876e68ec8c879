"""A sensor that hangs when its log ends: the pressures tell, if they have moved the arm before."""

from __future__ import annotations

import numpy as np
import pytest
from tests.diagnosis.synthetic import one_section

import bha
from bha.recordings import hung

#: Rows, s; every 2 s one of three commands is another.
TIME = np.arange(2400) * 0.01


def stepped() -> tuple[np.ndarray, np.ndarray]:
    """Commands of three chambers, one after the other, and what they move, on a grid of 1 mm."""
    levels = np.zeros((12, 3))
    for step in range(1, 12):
        levels[step] = levels[step - 1]
        levels[step, step % 3] = 3e4 - levels[step, step % 3]
    pressures = 1e5 + np.repeat(levels, 200, axis=0)
    lengths, here = np.zeros_like(pressures), pressures[0]
    for k, now in enumerate(pressures):
        here = here + 0.1 * (now - here)
        lengths[k] = np.round(0.2 + 1e-6 * (here - 1e5), 3)
    return pressures, lengths


def stands_from(lengths: np.ndarray) -> int:
    """The row from which nothing changes any more."""
    return int(np.flatnonzero(np.any(np.diff(lengths, axis=0) != 0.0, axis=1))[-1]) + 1


@pytest.mark.parametrize("moved", [True, False])
def test_outputs_that_stand_while_a_pressure_goes_on_as_often_before_hang(moved: bool) -> None:
    pressures, lengths = stepped()
    if moved:
        lengths[2180:] = lengths[2180]
    assert hung.hangs_from(TIME, lengths, pressures, np.zeros(3)) == (stands_from(lengths) if moved else None)


@pytest.mark.parametrize("why", ["rest", "short", "stood before", "never moved anything"])
def test_an_arm_that_rests_does_not_hang(why: str) -> None:
    pressures, lengths = stepped()
    if why == "rest":
        pressures[2200:] = pressures[2199]
        lengths[2180:] = lengths[2180]
    elif why == "short":
        lengths[2380:] = lengths[2380]
        pressures[2385:] += 3e4
    elif why == "stood before":
        # A tube that is blocked: its chamber moves nothing, at the end as before.
        lengths[:, 2] = 0.2
        pressures[2200:] = pressures[2199]
        pressures[2200:, 2] += 3e4
        lengths[2200:] = lengths[2199]
    else:
        pressures = np.column_stack([pressures, np.full(len(TIME), 1e5)])
        pressures[2200:] = pressures[2199]
        pressures[2200:, 3] += 3e4
        lengths[2180:] = lengths[2180]
    assert hung.hangs_from(TIME, lengths, pressures, np.zeros(pressures.shape[1])) is None


def test_what_is_known_to_hang_tells_nothing_of_the_arm() -> None:
    pressures, lengths = stepped()
    lengths[580:795] = lengths[580]
    lengths[2180:] = lengths[2180]
    assert hung.hangs_from(TIME, lengths, pressures, np.zeros(3)) is None
    assert hung.hangs_from(TIME, lengths, pressures, np.zeros(3), [(5.8, 7.95)]) == stands_from(lengths)


def test_a_recording_leaves_out_what_hangs_at_its_end() -> None:
    pressures, lengths = stepped()
    lengths[2180:] = lengths[2180]
    columns = {"t [s]": TIME}
    columns |= {f"pc1{k + 1} [Pa]": pressures[:, k] for k in range(3)}
    columns |= {f"q1{k + 1} [m]": lengths[:, k] for k in range(3)}
    recording = bha.Recording(one_section(), bha.Log.from_arrays(columns), warn=False)
    last = stands_from(lengths)
    assert not recording.usable[last + 1 :].any()
    assert recording.usable[: last + 1].all()
    assert sum("stands still" in note for note in recording.notes) == 3
