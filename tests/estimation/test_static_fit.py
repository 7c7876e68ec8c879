"""Static parameters from chosen rows: those of an arm that stands where its pressures hold it."""

from __future__ import annotations

import numpy as np
import pytest

import bha
from bha.errors import InputError
from bha.estimation.records import record
from bha.estimation.static_fit import fit_poses
from bha.logs import Log

from .slow_arm import TRUE, arm_of, log_of

FREE = ("section.1.stiffness.1", "section.1.bending_stiffness.1")


def held_log(arm: bha.Arm, count: int = 12) -> Log:
    """An arm that rests under other pressures in each row, 0.02 mm of noise on its tip."""
    random = np.random.default_rng(3)
    pressures = 101325.0 + random.uniform(0.0, 5.0e4, (count, 4))
    tips = np.stack([arm.forward_kinematics(arm.static_lengths(p))[0][0] for p in pressures])
    tips += 2e-5 * random.standard_normal(tips.shape)
    columns = {"t [s]": np.arange(count) * 0.5} | {f"p1{k + 1} [Pa]": pressures[:, k] for k in range(4)}
    return Log.from_arrays(columns | {f"{axis}1 [m]": tips[:, k] for k, axis in enumerate("xyz")})


def test_poses_that_are_held_tell_springs_and_bending() -> None:
    guess = arm_of(TRUE | {"stiffness": 1.4 * TRUE["stiffness"], "bending_stiffness": 2.0 * TRUE["bending_stiffness"]})
    rec = record(guess, held_log(arm_of(TRUE)), noise=np.full(3, 2e-5))
    found = fit_poses(guess, [rec], FREE, rows=[np.arange(1, 12)], scale=2e-5)
    assert found.converged
    assert found.values == pytest.approx([TRUE["stiffness"], TRUE["bending_stiffness"]], rel=0.02)
    assert found.errors[0].shape == (11, 3)
    assert np.sqrt(np.mean(found.errors[0] ** 2)) < 3e-5
    assert [free.path for free in found.starts()] == list(FREE)


def test_no_rows_are_an_error() -> None:
    rec = record(arm_of(TRUE), log_of(arm_of(TRUE), 3, duration=5.0))
    with pytest.raises(InputError, match="no row"):
        fit_poses(arm_of(TRUE), [rec], FREE, rows=[np.empty(0, dtype=np.int64)])
