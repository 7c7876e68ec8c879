"""The plain model of a diagnosis: where the file's values lead nowhere, it begins where an identification would."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from estimation.slow_arm import TRUE, arm_of, log_of

import bha
from bha.checkup import Finding
from bha.diagnosis import Diagnosis, plain
from bha.diagnosis.baseline import Baseline, fit_baseline
from bha.errors import ConvergenceError, InputError

BEGAN = "the plain model began where held poses"
#: A third of the stiffness, three times the area, half of the bending stiffness, three times the damping.
GUESS = {"stiffness": 1 / 3, "terminal_area": 3.0, "bending_stiffness": 0.5, "damping": 3.0}


def diagnosed(factors: dict[str, float]) -> Diagnosis:
    logs = [log_of(arm_of(TRUE), seed, duration=15.0) for seed in range(3)]
    return bha.diagnose(arm_of({key: factors.get(key, 1.0) * x for key, x in TRUE.items()}), logs, kinds=("payload",))


def refuse_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """A simulation that diverges from the file's values, as one of an arm that rings does."""

    def fitted(*arguments: Any, **starts: Any) -> Baseline:
        if not arguments[-1]:
            raise ConvergenceError("the simulation diverges")
        return fit_baseline(*arguments, **starts)

    monkeypatch.setattr(plain, "fit_baseline", fitted)


def test_a_file_from_which_the_fit_diverges_is_left_for_what_held_poses_say(monkeypatch: pytest.MonkeyPatch) -> None:
    refuse_the_file(monkeypatch)
    found = diagnosed(GUESS)
    assert any(BEGAN in note for note in found.setup)
    assert found.verdict == "equivalent"
    assert found.gap.before < 1.1 * found.gap.noise
    # What held poses tell of the scale: area over stiffness.
    area, start = found.plain["section 1 terminal_area"], arm_of(TRUE).parameters.sections[0]
    stiffness = np.mean([n.value for name, n in found.plain.items() if "tangent stiffness" in name])
    assert area.value / stiffness == pytest.approx(start.terminal_area / start.stiffness[0], rel=0.1)


def test_a_file_that_is_near_is_where_it_begins() -> None:
    found = diagnosed({"stiffness": 1.1, "bending_stiffness": 0.9})
    assert not any(BEGAN in note for note in found.setup)
    assert found.verdict == "equivalent"


@pytest.mark.parametrize("sure", [True, False])
def test_where_the_file_leads_nowhere_it_is_said_by_what_logs_and_file_do_not_belong_together(
    monkeypatch: pytest.MonkeyPatch, sure: bool
) -> None:
    def refused(*_: Any) -> None:
        raise ConvergenceError("the simulation diverges")

    monkeypatch.setattr(plain, "prepare_runs", refused)
    monkeypatch.setattr(plain, "_begun", lambda *_: pytest.fail("a start was looked for"))
    finding = Finding("fault" if sure else "warning", "gravity", "all logs", "it rests reversed", "", {}, ())
    with pytest.raises(InputError, match=r"do not belong together: it rests reversed.*diverges"):
        plain.PlainFits(
            arm_of(TRUE),
            [],
            commanded=False,
            camera=True,
            faults=[finding] * sure,
            doubts=[finding] * (not sure),
            seed=0,
            threads=1,
            cache=plain.Cache(None, ""),
            scatter=None,
            tell=lambda *_: None,
        ).best()
