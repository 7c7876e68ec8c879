"""Ctrl-C in a fit keeps what was reached; progress says how long the rest takes."""

from __future__ import annotations

import json
from itertools import count
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import bha
from bha.cli import main
from bha.estimation.pace import Pace, spoken_time
from bha.identification import Settings, identify
from bha.parameters import ArmParameters, paths

from .identify_logs import measured, multisine, off, one_section

FREE = ("section.1.mass", "section.1.stiffness.1", "section.1.damping")
TRUE = {"section.1.mass": 0.75, "section.1.stiffness.1": 1300.0, "section.1.damping": 18.0}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("interrupted")
    arm = one_section()
    off(arm, dict.fromkeys(FREE, 1.25)).save(folder / "start.toml")
    measured(arm, multisine(arm, 4.0, 100.0, 1), seed=1).write(folder / "fit.csv")
    return folder


def stopping_at(beginning: str):  # type: ignore[no-untyped-def]
    """Progress that is where Ctrl-C comes, once a text begins so."""

    def tell(text: str, _: float) -> None:
        if text.startswith(beginning):
            raise KeyboardInterrupt

    return tell


def test_what_was_reached_is_kept(files: Path) -> None:
    arm, log = bha.Arm.load(files / "start.toml"), bha.Log.read(files / "fit.csv")
    settings = Settings(windows=(0.75, 2.0), draws=0)
    found = identify(arm, [log], FREE, holdout=[], settings=settings, progress=stopping_at("windows of 2 s, step 1"))
    assert found.interrupted
    assert not found.converged
    values = {e.path: e.value for e in found.estimates}
    for path, true in TRUE.items():  # the short windows have led to where the arm stands
        assert values[path] == pytest.approx(true, rel=0.05)
    assert all(np.isnan(e.standard_error) for e in found.estimates)
    (warning,) = [text for text in found.warnings if "interrupted" in text]
    assert "to go on, run the same command with the file" in warning
    section = found.parameters().sections[0]
    assert section.provenance["mass"].status == "assumed"
    assert section.provenance["mass"].source == "the fit was interrupted: mass of section 1"
    assert section.provenance["stiffness"].ci95 is None


def test_standard_errors_that_are_not_waited_for_unmake_no_convergence(files: Path) -> None:
    arm, log = bha.Arm.load(files / "start.toml"), bha.Log.read(files / "fit.csv")
    found = identify(arm, [log], FREE, settings=Settings(windows=(2.0,)), progress=stopping_at("standard errors"))
    assert found.interrupted
    assert found.converged
    assert found.refinement.outcome.message == "interrupted before its standard errors were known"


def test_before_the_first_step_there_is_nothing_to_keep(files: Path) -> None:
    arm, log = bha.Arm.load(files / "start.toml"), bha.Log.read(files / "fit.csv")
    with pytest.raises(KeyboardInterrupt):
        identify(arm, [log], FREE, progress=stopping_at("choosing the step"))


def test_the_command_writes_it_and_goes_on_from_there(files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = count()
    original = Pace.step

    def step(self: Pace, text: str, stage: int, number: int) -> None:
        if next(steps) == 3:
            raise KeyboardInterrupt
        original(self, text, stage, number)

    arguments = [str(files / "fit.csv"), "--windows", "0.75,2", *(x for path in FREE for x in ("--free", path))]
    part, whole = files / "part.toml", files / "whole.toml"
    with monkeypatch.context() as patch:
        patch.setattr(Pace, "step", step)
        done = CliRunner().invoke(main, ["identify", str(files / "start.toml"), *arguments, "--out", str(part)])
    assert done.exit_code == 130, done.output
    assert "INTERRUPTED after" in done.output
    assert f"written: {part}" in done.output
    assert "to go on, run the same command" in done.output
    reached = ArmParameters.read(part)
    assert paths.get_value(reached, FREE[0]) != 1.25 * 0.75
    on = CliRunner().invoke(main, ["identify", str(part), *arguments, "--out", str(whole), "--json"])
    assert on.exit_code == 0, on.output
    assert json.loads(on.stdout)["converged"]
    assert ArmParameters.read(whole).sections[0].provenance["mass"].status == "identified"
    assert paths.get_value(ArmParameters.read(whole), FREE[0]) == pytest.approx(0.75, rel=0.03)


def test_the_time_left_is_the_work_left_at_the_pace_so_far() -> None:
    """Steps of 2 s in the first stage, which has half the work of the others: 5 of these and 2 x (4 + 2 + 3)."""
    now = [100.0]
    said: list[tuple[str, float]] = []
    pace = Pace(lambda text, done: said.append((text, done)), [1.0, 2.0, 2.0], 3.0, clock=lambda: now[0])
    pace.step("a", 0, 0)
    assert said[-1] == ("a", 0.0)
    now[0] += 2.0
    pace.step("b", 0, 1)
    left = 2.0 * (5 + 2 * (4 + 2 + 3))
    assert said[-1] == ("b, about 45 s left", pytest.approx(2.0 / (2.0 + left)))
    now[0] += 10.0  # a step that takes longer lowers the pace, and the bar does not run back
    pace.step("c", 0, 2)
    assert said[-1][0] == "c, about 2 min left"
    assert said[-1][1] >= said[-2][1]
    pace.last("d")
    assert said[-1][0] == "d, about 35 s left"  # 12 s for two steps of half the work, six of them
    pace.finish()
    assert said[-1] == ("done", 1.0)
    assert [spoken_time(t) for t in (0.2, 12.3, 47.0, 100.0)] == [
        "about 1 s",
        "about 12 s",
        "about 45 s",
        "about 2 min",
    ]
