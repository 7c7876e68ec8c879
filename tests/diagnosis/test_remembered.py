"""An arm that stands elsewhere under the same pressures after each use is named for it, as a family."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis import Diagnosis, plain
from bha.diagnosis.remembered import FAMILY, Remembered, with_memory

from .synthetic import SAMPLE_TIME, make_logs, one_section, pressures, simulated

#: What holds the arm where each log begins, N m and N, in place of what it did before.
HOLDS = ((1.2, -0.6, 6.0), (-1.0, 1.0, -6.0), (0.4, 1.2, 4.0), (-1.4, -0.4, -4.0))


LAG = {"fill": 0.15, "vent": 0.3}


def held_logs(arm: bha.Arm, *, commanded: bool = False) -> list[bha.Log]:
    """Logs that begin at rest without pressure, the arm held otherwise in each; if wanted of commands, which lag."""
    valves = [{"kind": "pressure_lag", "where": "all", "parameters": LAG}] if commanded else []
    sort = "pc" if commanded else "p"
    logs, time = [], np.arange(round(8.0 / SAMPLE_TIME)) * SAMPLE_TIME
    for number, hold in enumerate(HOLDS):
        rng = np.random.default_rng([3, number])
        p = pressures(time, "steps", rng)
        p = np.where(time[:, None] < 1.0, 101325.0, p)
        numbers = dict(zip(("to_x", "to_y", "along"), hold, strict=True))
        q = simulated(arm, time, p, [{"kind": "preload", "where": "section 1", "parameters": numbers}, *valves])
        columns: dict[str, Any] = {"t [s]": time}
        columns |= {f"{sort}{name[1:]} [Pa]": p[:, k] for k, name in enumerate(arm.inputs)}
        columns |= {f"q1{k + 1} [m]": q[:, k] + 1e-4 * rng.standard_normal(len(time)) for k in range(3)}
        logs.append(bha.Log.from_arrays(columns))
    return logs


def test_what_holds_an_arm_off_in_each_log_is_named_as_a_family(tmp_path: Path) -> None:
    logs = held_logs(one_section())
    found = bha.diagnose(
        one_section({"stiffness": 0.9, "damping": 1.2}),
        logs[:3],
        logs[3:],
        kinds=("payload",),
        out=tmp_path,
        report=False,
    )
    assert found.verdict == "one_of", found.reason
    (memory,) = found.missing
    assert {memory.kind, *(other.kind for other in memory.one_of)} == set(FAMILY)
    assert memory.gap_removed > 0.9
    assert found.gap.before > 3.0 * found.gap.after
    assert found.gap.after < 1.3 * found.gap.noise
    # What is written holds it by the mean of the logs' first poses, and has no numbers that nobody knows.
    written = bha.Arm.load(tmp_path / "arm_diagnosed.toml").parameters
    assert [effect.kind for effect in written.effects] == ["preload"]
    assert Diagnosis.read(tmp_path / "diagnosis.json") == found


def test_under_commands_an_arm_that_has_no_fabrics_areas_loses_nothing_by_them() -> None:
    """Its plain model begins at what an identification finds, with areas that change with length."""
    logs = held_logs(one_section(), commanded=True)
    guess = one_section({"stiffness": 0.9, "damping": 1.2})
    found = bha.diagnose(guess, logs[:3], logs[3:], kinds=("payload",), pressures="commanded", report=False)
    assert any("areas that change with length" in text for text in found.setup)
    assert found.gap.after < 1.15 * found.gap.noise
    lag = next(effect for effect in found.effects if effect.kind == "pressure_lag")
    assert {name: lag.parameters[name].value for name in LAG} == pytest.approx(LAG, rel=0.05)
    # A file that has such areas is begun as it is.
    fabric = guess.with_effects([{"kind": "effective_area", "where": "section 1", "by_length": -10.0}])
    assert plain._of_fabric(fabric, (), None) is None


def test_one_of_the_family_that_is_named_already_is_the_name_and_setup_comes_first() -> None:
    logs = make_logs(one_section(), [], durations=(3.0, 3.0))
    found = bha.diagnose(one_section(), logs[:1], logs[1:], kinds=("payload",))
    memory = Remembered(0.02, 0.01, 0.004, 0.9)
    named = with_memory(found, memory)
    assert named.missing[0].kind == FAMILY[0]
    assert "stands up to 20 mm elsewhere" in named.reason
    assert with_memory(named, memory) is named
    assert with_memory(found, None) is found
    setup = found.model_copy(update={"verdict": "setup"})
    assert with_memory(setup, memory) is setup
