"""The black box beside which a grey box is judged: it learns what it can represent, and says how far off it is."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from benches import real_arm, ridge

import bha


def lagging_log(seed: int, seconds: float = 30.0) -> bha.Log:
    """Heads that follow each pressure in parts at once and in parts behind a lag of a second; pressures in steps."""
    random = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, ridge.INTERVAL)
    steps = 1e5 + 5e4 * random.random((len(time) // 40 + 1, 6))
    pressures = np.repeat(steps, 40, axis=0)[: len(time)]
    behind = np.zeros_like(pressures)
    behind[0] = pressures[0]
    keep = np.exp(-ridge.INTERVAL / 1.0)
    for k in range(1, len(time)):
        behind[k] = keep * behind[k - 1] + (1.0 - keep) * pressures[k]
    mixing = np.random.default_rng(0).standard_normal((6, 6)) * 1e-6
    heads = pressures @ mixing + behind @ mixing[::-1]
    columns = {f"p{name} [Pa]": column for name, column in zip(ridge.INPUTS, pressures.T, strict=True)}
    columns |= {f"{name} [m]": column for name, column in zip(ridge.HEADS, heads.T, strict=True)}
    return bha.Log.from_arrays({"t [s]": time, **columns})


def test_a_linear_system_with_a_lag_is_predicted() -> None:
    model = ridge.fitted_ridge([lagging_log(1), lagging_log(2)], "measured")
    held = lagging_log(3)
    motion = np.std(np.column_stack([held[name] for name in ridge.HEADS[3:]]))
    assert model.tip_error(held, 1.0) < 0.02 * motion


def test_a_play_follows_once_its_input_has_moved_by_its_width() -> None:
    values = np.array([0.0, 1.0, 3.0, 2.0, -1.0])[:, None]
    assert ridge._play(values, 2.0)[:, 0] == pytest.approx([0.0, 0.0, 1.0, 1.0, 1.0])
    assert ridge._play(values, 1.0)[:, 0] == pytest.approx([0.0, 0.0, 2.0, 2.0, 0.0])


def test_folds_leave_out_what_they_say(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:  # type: ignore[no-untyped-def]
    every = real_arm.folds()
    assert len(every) == 12
    for fold in every:
        assert not set(fold.fit) & set(fold.held), fold.name
    assert not any("rest" in name or name == "jan10_1_2" for fold in every for name in (*fold.fit, *fold.held))
    monkeypatch.setattr(sys, "argv", ["real_arm", "--data", str(tmp_path)])
    real_arm.main()
    assert "nothing to do" in capsys.readouterr().out
    made = {("a", "x"): {"m": {"1": 1e-3, "2": 3e-3}}, ("a", "y"): {"m": {"3": 2e-3}}}
    assert "| a | **all in turn** | | 2.0, 3.0 |" in real_arm.table(made, ["m"])
