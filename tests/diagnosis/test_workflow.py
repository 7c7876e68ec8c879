"""The workflow on small synthetic logs: one section, a few seconds, some kinds of effects."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import bha
from bha.diagnosis import workflow
from bha.errors import InputError
from bha.recordings import recordings

from .synthetic import make_logs, one_section

KINDS = ("creep", "weak_bellows", "quadratic_damping", "pressure_offset")
DURATIONS = (4.0, 4.0, 4.0)
PRODUCT = one_section({"mass": 0.93, "stiffness": 1.1, "rest_length": 0.9, "damping": 1.12, "bending_stiffness": 1.1})


def test_a_hidden_effect_is_named_with_its_place_and_numbers(tmp_path: Path) -> None:
    hidden = {"kind": "creep", "where": "bellows 12", "parameters": {"stiffness": 150.0, "tau": 0.6}}
    logs = make_logs(one_section(), [hidden], seed=3, durations=DURATIONS)
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=KINDS, out=tmp_path, report=False)
    assert found.verdict == "named"
    assert [(e.kind, e.where) for e in found.effects] == [("creep", "bellows 12")]
    numbers = found.effects[0].parameters
    assert numbers["stiffness"].value == pytest.approx(150.0, rel=0.05)
    assert numbers["tau"].value == pytest.approx(0.6, rel=0.05)
    assert found.gap.before > 3.0 * found.gap.noise
    assert found.gap.after < 1.15 * found.gap.noise
    # What was identified is in the new parameter file, and the file simulates as the diagnosis does.
    arm = bha.Arm.load(tmp_path / "arm_diagnosed.toml")
    effect = arm.parameters.effects[0]
    assert effect.parameters["tau"] == pytest.approx(numbers["tau"].value, rel=1e-12)
    assert effect.provenance["tau"].status == "identified"
    assert arm.parameters.sections[0].mass == pytest.approx(found.plain["section 1 mass"].value, rel=1e-12)
    assert {path.name for path in tmp_path.iterdir()} == {"arm_diagnosed.toml", "diagnosis.json"}


def test_an_arm_that_is_only_badly_calibrated_has_equivalent() -> None:
    logs = make_logs(one_section(), [], seed=5, durations=DURATIONS)
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=KINDS)
    assert found.verdict == "equivalent"
    assert found.effects == []
    assert found.gap.after == found.gap.before
    assert found.plain["section 1 rest_length"].value == pytest.approx(0.15, rel=0.005)
    assert found.gap.noise == pytest.approx(np.hypot(2e-4, 1.4e-4), rel=0.2)


@pytest.mark.filterwarnings("ignore::bha.errors.LogWarning")  # what stands still for long does not count
def test_readings_in_coarse_steps_are_no_gap_and_hide_no_effect() -> None:
    """Steps of 1 mm with 0.05 mm of noise: differences of readings see next to nothing of either."""
    coarse = {"noise": 5e-5, "quantum": 1e-3, "durations": (6.0, 6.0, 6.0)}
    logs = make_logs(one_section(), [], seed=5, **coarse)
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=KINDS)
    assert found.verdict == "equivalent"
    assert found.gap.noise == pytest.approx(np.hypot(1e-3 / np.sqrt(12.0), 1.4e-4), rel=0.2)
    hidden = {"kind": "creep", "where": "bellows 12", "parameters": {"stiffness": 150.0, "tau": 0.6}}
    logs = make_logs(one_section(), [hidden], seed=3, **coarse)
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=KINDS)
    assert [(e.kind, e.where) for e in found.effects] == [("creep", "bellows 12")]


def test_a_gap_outside_the_catalogue_is_not_named() -> None:
    # The true effect is a pressure lag on one input; none of the candidates is one.
    hidden = {"kind": "pressure_lag", "where": "input p12", "parameters": {"fill": 0.15, "vent": 0.3}}
    logs = make_logs(one_section(), [hidden], seed=6, durations=DURATIONS)
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=("weak_bellows", "pressure_offset"))
    assert found.verdict == "unexplained"
    assert found.effects == []


@pytest.mark.filterwarnings("ignore:.*length_range:bha.LogWarning")
def test_a_model_that_is_far_off_from_the_start_is_not_without_gap() -> None:
    logs = make_logs(one_section(), [], seed=7, durations=DURATIONS)
    columns = {f"q1{k + 1} [m]": logs[2].lengths[:, k] + 0.5 for k in range(3)}
    columns |= {"t [s]": logs[2].time} | {f"p1{k} [Pa]": logs[2].pressures(PRODUCT.inputs)[:, k - 1] for k in (1, 2, 3)}
    found = bha.diagnose(PRODUCT, logs[:2], [bha.Log.from_arrays(columns)], kinds=("weak_bellows",))
    assert found.verdict == "setup"  # lengths half a metre beyond their range
    assert "runs away" in found.reason
    assert found.gap.before > 0.3


def test_the_same_seed_gives_the_same_diagnosis_whatever_the_threads() -> None:
    logs = make_logs(one_section(), [], seed=5, durations=(2.0, 2.0))
    first, second = (bha.diagnose(PRODUCT, logs[:1], logs[1:], kinds=("quadratic_damping",), threads=n) for n in (1, 2))
    assert first.model_copy(update={"seconds": 0.0, "made": None}) == second.model_copy(
        update={"seconds": 0.0, "made": None}
    )


def test_an_interrupted_search_leaves_what_it_found(monkeypatch: pytest.MonkeyPatch) -> None:
    hidden = {"kind": "weak_bellows", "where": "bellows 11", "parameters": {"change": -0.1}}
    logs = make_logs(one_section(), [hidden], seed=7, durations=(3.0, 3.0))

    def interrupt(stage: str, share: float | None) -> None:
        if stage.startswith("pruning"):
            raise KeyboardInterrupt

    outcome = workflow.run(
        recordings(PRODUCT, logs[:1]), recordings(PRODUCT, logs[1:]), kinds=("weak_bellows",), progress=interrupt
    )
    assert not outcome.diagnosis.complete
    assert outcome.best.key == (("weak_bellows", "bellows 11"),)


def test_a_search_out_of_time_answers_with_what_it_has_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    hidden = {"kind": "weak_bellows", "where": "bellows 11", "parameters": {"change": -0.1}}
    logs = make_logs(one_section(), [hidden], seed=7, durations=(3.0, 3.0))
    now = [0.0]
    monkeypatch.setattr(workflow.time, "monotonic", lambda: now[0])

    def tell(stage: str, share: float | None) -> None:
        if "refining" in stage:
            now[0] = 61.0

    found = bha.diagnose(PRODUCT, logs[:1], logs[1:], kinds=("weak_bellows",), progress=tell, limit=60.0)
    assert found.unexamined == "pruning: without weak_bellows at bellows 11"
    assert not found.complete
    assert found.verdict == "named"
    assert [(e.kind, e.where) for e in found.effects] == [("weak_bellows", "bellows 11")]


def test_wrong_arguments_are_input_errors() -> None:
    logs = make_logs(one_section(), [], durations=(1.0,))
    with pytest.raises(InputError, match="at least one"):
        bha.diagnose(PRODUCT, [])
    with pytest.raises(InputError, match="limit"):
        bha.diagnose(PRODUCT, logs, limit=0.0)
    with pytest.raises(InputError, match="no candidate"):
        bha.diagnose(PRODUCT, logs, kinds=("gremlin",))


def test_a_lag_of_two_stages_is_one_name_with_the_times_of_both(tmp_path: Path) -> None:
    stages = [
        {"kind": "pressure_lag", "where": "all", "parameters": {"fill": 0.06, "vent": 0.1}},
        {"kind": "pressure_lag", "where": "all", "parameters": {"fill": 0.02, "vent": 0.03}},
    ]
    logs = make_logs(one_section(), stages, seed=4, durations=DURATIONS)
    found = bha.diagnose(PRODUCT, logs[:2], logs[2:], kinds=("pressure_lag", "delay"), out=tmp_path, report=False)
    assert [(e.kind, e.where) for e in found.effects] == [("pressure_lag", "all")]
    (effect,) = found.effects
    assert len(effect.elements) == 2
    for name, true in (("fill", 0.08), ("vent", 0.13)):
        together = effect.parameters[name]
        assert together.value == pytest.approx(sum(e[name].value for e in effect.elements))
        assert together.value == pytest.approx(true, rel=0.05)
    assert found.gap.after < 1.15 * found.gap.noise
    written = bha.Arm.load(tmp_path / "arm_diagnosed.toml").parameters.effects
    assert [e.kind for e in written] == ["pressure_lag", "pressure_lag"]


@pytest.mark.filterwarnings("ignore::bha.LogWarning")
@pytest.mark.parametrize("exchanged", [("p11", "p12"), ("q11", "q12")])
def test_exchanged_tubes_or_sensors_are_no_physics(exchanged: tuple[str, str]) -> None:
    logs = []
    for log in make_logs(one_section(), [], seed=5, durations=DURATIONS):
        other = dict(zip(exchanged, exchanged[::-1], strict=True))
        columns = {f"{other.get(name, name)} [{log.units[name]}]": log[name] for name in log.columns}
        logs.append(bha.Log.from_arrays(columns))
    with pytest.warns(bha.LogWarning, match="tubes exchanged: p11 and p12"):
        found = bha.diagnose(one_section(), logs[:2], logs[2:], kinds=("bending_nonlinear", "bending_damping"))
    assert found.verdict == "setup"
    assert found.effects == []
    assert "p11 and p12" in found.reason
    assert any("p11 and p12" in text and "repair: " in text for text in found.setup)


def test_a_gap_that_does_not_matter_to_the_user_is_equivalent() -> None:
    hidden = {"kind": "creep", "where": "bellows 12", "parameters": {"stiffness": 150.0, "tau": 0.6}}
    logs = make_logs(one_section(), [hidden], seed=3, durations=(2.0, 2.0))
    found = bha.diagnose(PRODUCT, logs[:1], logs[1:], kinds=("creep",), tolerance=0.05)
    assert found.verdict == "equivalent"
    assert found.gap.tolerance == 0.05
    assert "does not matter" in found.reason
    with pytest.raises(InputError, match="tolerance: found -1"):
        bha.diagnose(PRODUCT, logs[:1], logs[1:], tolerance=-1.0)


def test_what_logs_cannot_tell_apart_is_named_as_a_class() -> None:
    # A single step: whether a bellows is weak or its pressure too high is the same.
    hidden = {"kind": "pressure_offset", "where": "input p12", "parameters": {"offset": 4e3}}
    logs = make_logs(one_section(), [hidden], seed=3, durations=(3.0, 3.0))
    found = bha.diagnose(PRODUCT, logs[:1], logs[1:], kinds=("pressure_offset", "length_offset"))
    assert found.has_names
    for effect in found.effects:
        assert effect.alone <= effect.confidence <= 1.0
    assert (found.verdict == "one_of") == any(effect.one_of for effect in found.effects)


def test_one_log_certifies_itself_and_that_is_said() -> None:
    hidden = {"kind": "pressure_offset", "where": "input p12", "parameters": {"offset": 6000.0}}
    (log,) = make_logs(one_section(), [hidden], seed=9, durations=(9.0,))
    found = bha.diagnose(PRODUCT, [log], kinds=("pressure_offset",))
    assert [(e.kind, e.where) for e in found.effects] == [("pressure_offset", "input p12")]
    assert found.gap.holdout[0].endswith("(last third)")
    assert any("biased by selection" in note for note in found.residual["notes"])
