"""Logs in which nothing is commanded and nothing moves are equivalent, and what they contradict is said."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis import Diagnosis
from bha.diagnosis.standing import standing
from bha.errors import ConvergenceError
from bha.recordings import Recording

from .synthetic import make_logs, one_section

TIME = np.arange(400) * 0.02
AMBIENT = 101325.0


def two_sections(**offsets: float) -> bha.Arm:
    """The first two sections of the nominal arm, with stiff pieces of the second one as given, m."""
    parameters = bha.robots.load("bha_nominal").parameters
    mapping = parameters.to_mapping()
    return bha.Arm(parameters.updated({"section": [mapping["section"][0], {**mapping["section"][1], **offsets}]}))


def still_log(
    arm: bha.Arm,
    *,
    seed: int,
    heads: bool = False,
    gauge: float = 0.0,
    noise: float = 1e-4,
    pressure_noise: float = 50.0,
    moved: float = 0.0,
) -> bha.Log:
    """A log of an arm under constant pressures with what its sensors make of it, seen ``moved`` m along z or longer."""
    rng = np.random.default_rng(seed)
    p = np.full((len(TIME), len(arm.inputs)), AMBIENT + gauge)
    lengths = arm.static_lengths(p[0])
    columns: dict[str, Any] = {"t [s]": TIME}
    measured = p + pressure_noise * rng.standard_normal(p.shape)
    columns |= {f"{name} [Pa]": measured[:, k] for k, name in enumerate(arm.inputs)}
    if heads:
        positions, _ = arm.forward_kinematics(lengths)
        named = {f"{a}{i + 1} [m]": at[k] for i, at in enumerate(positions) for k, a in enumerate("xyz")}
    else:
        named = {f"q{k // 3 + 1}{k % 3 + 1} [m]": length for k, length in enumerate(lengths)}
    columns |= {
        name: at + moved * (name[0] in "zq") + noise * rng.standard_normal(len(TIME)) for name, at in named.items()
    }
    return bha.Log.from_arrays(columns)


def changed(log: bha.Log, columns: dict[str, Any]) -> bha.Log:
    """A log of one section with some columns otherwise."""
    units = {"t": "s", **{f"p1{k}": "Pa" for k in (1, 2, 3)}, **{f"q1{k}": "m" for k in (1, 2, 3)}}
    own = {f"{name} [{unit}]": np.asarray(log[name]) for name, unit in units.items()}
    return bha.Log.from_arrays(own | columns)


@pytest.mark.parametrize("noise", [1e-6, 1e-3])
def test_an_arm_that_stands_is_equivalent_and_nothing_is_said_of_what_it_does_not_show(
    tmp_path: Path, noise: float
) -> None:
    arm = one_section({"stiffness": 0.9})
    logs = [still_log(one_section({"stiffness": 0.9}), seed=seed, noise=noise) for seed in (1, 2)]
    found = bha.diagnose(arm, logs[:1], logs[1:], out=tmp_path)
    assert found.verdict == "equivalent"
    assert "nothing moves" in found.reason
    assert found.complete
    assert not found.plain
    assert not found.setup
    assert found.gap.before == pytest.approx(noise, rel=0.1)
    assert found.gap.holdout == [found.logs[1]["name"]]
    assert Diagnosis.read(tmp_path / "diagnosis.json") == found
    # Nothing was told, and nothing is changed.
    assert bha.Arm.load(tmp_path / "arm_diagnosed.toml").parameters == arm.parameters
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "nothing moves in these logs" in page
    assert "identified again" not in page


def test_a_file_whose_arm_would_stand_elsewhere_is_said() -> None:
    logs = [still_log(one_section(), seed=seed) for seed in (1, 2)]
    off = one_section({"rest_length": 1.1})
    found = bha.diagnose(off, logs)
    assert found.verdict == "equivalent"
    (text,) = found.setup
    apart = off.static_lengths([AMBIENT] * 3) - one_section().static_lengths([AMBIENT] * 3)
    assert f"{1e3 * np.abs(apart).max():.2g}" in text
    assert "one pose does not tell" in text


def test_plates_that_leave_no_room_between_what_was_measured_are_said_of_still_logs_and_refused_of_others() -> None:
    arm = two_sections()
    own = arm.parameters.sections[1]
    length = float(arm.static_lengths([AMBIENT] * len(arm.inputs))[3:].mean())
    # The head's stiff piece as long as the bellows and 5 mm more.
    described = two_sections(head_offset=own.head_offset + length + 0.005)
    logs = [still_log(arm, seed=seed, heads=True) for seed in (1, 2)]
    found = bha.diagnose(described, logs[:1], logs[1:])
    assert found.verdict == "equivalent"
    assert any(
        re.search(r"section 2 would be -(4\.9\d|5(\.0\d)?) mm long", text) and "no room" in text for text in found.setup
    )
    # With logs that move nothing can be said before the plates are right.
    moving = np.where((TIME > 2.0)[:, None], AMBIENT + 4e4, np.full((len(TIME), len(arm.inputs)), AMBIENT))
    run = bha.simulate(arm, bha.Input(TIME, moving), times=TIME, options=bha.Options(method="rk4", step=2.5e-3))
    columns: dict[str, Any] = {"t [s]": TIME}
    columns |= {f"{name} [Pa]": moving[:, k] for k, name in enumerate(arm.inputs)}
    columns |= {f"{a}{i + 1} [m]": run.head_positions[:, i, k] for i in range(2) for k, a in enumerate("xyz")}
    with pytest.raises(ConvergenceError, match=r"section 2 would be -(4\.9|5\.0) mm long"):
        bha.diagnose(described, [*logs, bha.Log.from_arrays(columns)])


def test_what_moves_in_a_log_or_between_logs_is_not_passed_over() -> None:
    arm = one_section()

    def found(*logs: bha.Log) -> bool:
        recordings = [Recording(arm, log) for log in logs]
        return standing(recordings[:1], recordings[1:]) is not None

    first = still_log(arm, seed=1)
    assert found(first)
    assert found(first, still_log(arm, seed=2))
    # Elsewhere under the same pressures.
    assert not found(first, still_log(arm, seed=2, moved=1e-3))
    # Elsewhere under others: two poses tell springs.
    assert not found(first, still_log(arm, seed=2, gauge=2e4))
    # Pressures that move a limp arm.
    assert not found(*make_logs(arm, [], durations=(3.0, 3.0)))
    # An arm that is pushed under constant pressures.
    pushed = {"q11 [m]": np.asarray(first["q11"]) + 4e-4 * np.sin(TIME)}
    assert not found(changed(first, pushed), still_log(arm, seed=2))
