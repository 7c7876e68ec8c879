"""The blind test's protocol: cases, sealed answers, command lines, scores."""

import csv
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bha.diagnosis.catalogue import PLANS

pytest.importorskip("numba")
sys.path.insert(0, str(Path(__file__).parents[1] / "benches" / "blind"))

from blindgen import make_case
from blindgen.armfile import build_plant, read_arm
from blindgen.cases import FILES, default_arm, read_specs, write_specs
from blindgen.effects import EFFECTS, draw_effect, draw_place, install
from blindgen.lookalikes import CLASSES, look_alike
from blindgen.plan import COUNTS, build_plan
from blindgen.runner import Diagnose
from blindgen.scoring import Verdict, confusion_table, read_verdict, report, score_cases, wilson
from blindgen.sealing import ANSWER, SealError, digest, seal, unseal, write_list
from blindgen.sensors import NOISE
from blindgen.truth import PressurePath, acting_pressure, plain_truth


def test_a_case_shows_logs_and_parameter_file_and_nothing_else(tmp_path: Path) -> None:
    out = tmp_path / "case"
    answer = make_case(7, "pressure_lag", "section 2", 1.0, "standard", out, duration_factor=0.1)
    logs = {*FILES.values(), "holdout_1.csv", "holdout_2.csv"}
    assert {p.name for p in out.iterdir()} == {"arm.toml", *logs}
    assert "lag" not in "".join(p.read_text(encoding="utf-8") for p in out.iterdir())
    with (out / "train_release.csv").open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    names = [f"{i}{k}" for i in (1, 2, 3) for k in (1, 2, 3)]
    assert rows[0][:19] == ["t [s]", *(f"p{x} [Pa]" for x in names), *(f"q{x} [mm]" for x in names)]
    assert rows[0][19:] in ([], ["fx3 [N]", "fy3 [N]", "fz3 [N]"])
    table = np.array(rows[1:], dtype=np.float64)
    np.testing.assert_allclose(np.diff(table[:, 0]), 5e-3)
    lengths = table[:, 10:19]
    assert 70.0 < lengths.min() < lengths.max() < 330.0
    np.testing.assert_allclose(lengths / 0.05, np.round(lengths / 0.05), atol=1e-6)
    # Third differences of white noise: 20 times its variance; slow motion adds little.
    quiet = np.sqrt(np.median(np.mean(np.diff(lengths, 3, axis=0) ** 2, axis=0)) / 20.0)
    assert quiet == pytest.approx(0.2, rel=0.15)
    for true, seen in zip(default_arm().sections, read_arm(out / "arm.toml").sections, strict=True):
        assert seen.mass != true.mass
        assert seen.bellows_radius == true.bellows_radius
    for name, seed in (("same", 7), ("other", 8)):
        make_case(seed, "pressure_lag", "section 2", 1.0, "standard", tmp_path / name, duration_factor=0.1)
    texts = [(tmp_path / name / "train_steps.csv").read_bytes() for name in ("case", "same", "other")]
    assert texts[0] == texts[1] != texts[2]
    assert answer["effects"][0]["comparable"]["tau_fill"] == pytest.approx(0.06)
    assert all(
        NOISE["standard"].length < floor < 2 * NOISE["standard"].length for floor in answer["noise_floor_rms"].values()
    )
    assert unseal("case", tmp_path / "case.sealed", tmp_path / "case.sealed" / "commitments") == json.loads(
        json.dumps(answer)
    )


def test_wrong_wishes_are_refused_with_what_is_allowed(tmp_path: Path) -> None:
    for wish, message in (
        (("crep", None, 1.0, "standard"), "known are"),
        (("payload", "all", 1.0, "standard"), "may sit at: section"),
        (("section_coupling", "section 3", 1.0, "standard"), "allowed sections: 1, 2"),
        (("payload", None, 1.0, "loud"), "allowed: standard, hard"),
    ):
        with pytest.raises(ValueError, match=message):
            make_case(1, *wish, tmp_path / "x")
    assert not (tmp_path / "x").exists()


def test_every_kind_changes_the_truth_where_it_says() -> None:
    rng = np.random.default_rng(1)
    arm = default_arm()
    plain = plain_truth(build_plant(arm), np.array(arm.gravity))
    heads = np.random.default_rng(0).normal(0.0, 0.1, (200, 3, 3)) + np.array([0.0, 0.0, 0.5])

    def everything(truth: Any) -> np.ndarray:
        parts = [truth.plant.sections, [truth.plant.work_conjugate], *truth.hidden, *vars(truth.path).values()]
        parts += [truth.sensors.gain, truth.sensors.offset, [truth.sensors.delay]]
        return np.concatenate([np.ravel(np.asarray(p, dtype=np.float64)) for p in parts])

    before = everything(plain)
    for kind in EFFECTS.values():
        for _ in range(8):
            effect = draw_effect(kind.name, draw_place(kind, rng), rng, heads)
            changed, filled = install(plain, effect)
            assert np.any(everything(changed) != before), effect
            assert set(kind.comparable) <= set(filled.parameters)
        assert np.array_equal(everything(plain), before)


def test_pressure_path_by_hand() -> None:
    zero = np.zeros(1)
    dt = 1e-3
    step = np.where(np.arange(2000) >= 500, 2e5, 1e5)[:, None]

    def path(**parts: float) -> PressurePath:
        names = ("gain", "offset", "delay", "band", "tau_fill", "tau_vent")
        return PressurePath(*(np.array([parts[n]]) if n in parts else zero for n in names))

    late = acting_pressure(path(delay=0.02), 1e5, step, dt)
    assert np.argmax(late > 1.5e5) == pytest.approx(520, abs=1)
    lag = acting_pressure(path(tau_fill=0.1, tau_vent=0.3), 1e5, step, dt)[:, 0]
    # The area above the response of two stages in a row is the sum of their time constants.
    assert np.sum(2e5 - lag[500:]) * dt / 1e5 == pytest.approx(0.1, rel=0.02)
    down = acting_pressure(path(tau_fill=0.1, tau_vent=0.3), 1e5, 3e5 - step, dt)[:, 0]
    assert np.sum(down[500:] - 1e5) * dt / 1e5 == pytest.approx(0.3, rel=0.03)
    slow = 1e5 + 5e3 * np.sin(np.arange(4000) * 5e-3)[:, None]
    assert acting_pressure(path(band=1e3), 1e5, slow, dt).max() == pytest.approx(1.04e5, rel=1e-4)
    assert acting_pressure(path(gain=0.25, offset=500.0), 1e5, np.full((3, 1), 1.255e5), dt) == pytest.approx(1.2e5)


def test_sealed_answers_betray_nothing_and_no_change_goes_unseen(tmp_path: Path) -> None:
    sealed, public = tmp_path / "sealed", tmp_path / "public"
    first = seal({"kind": "creep"}, "case_1", sealed, public)
    second = seal({"kind": "creep"}, "case_2", sealed, public)
    assert first != second
    assert unseal("case_1", sealed, public) == {"kind": "creep"}
    assert write_list(public, tmp_path / "list.txt") == 2
    assert (tmp_path / "list.txt").read_text(encoding="utf-8").splitlines()[0] == f"{first}  case_1"
    assert digest(b"", b"abc").startswith("ba7816bf")
    (sealed / "case_1" / ANSWER).write_text('{"kind": "delay"}', encoding="utf-8")
    with pytest.raises(SealError, match="case_1"):
        unseal("case_1", sealed, public)


def test_plan_holds_what_it_promises(tmp_path: Path) -> None:
    plan = build_plan(1)
    report_set = [s for s in plan if s.subset == "report"]
    assert len(report_set) >= 200
    assert len({s.case for s in plan}) == len(plan) == len({s.seed for s in plan})
    kinds = {k for k, kind in EFFECTS.items() if kind.known}
    for subset in COUNTS:
        assert {s.effects[0].kind for s in plan if s.subset == subset and s.group == "single"} == kinds
    for spec in plan:
        names = [e.kind for e in spec.effects]
        assert not any(look_alike(a, b) for a in names for b in names)
        assert len(names) == {"null": 0, "single": 1, "unknown": 1, "pair": 2}.get(spec.group, 5)
        assert not any(name in spec.case for name in EFFECTS)
    # What a diagnosis may name instead is in the classes too, whether or not the plans hide it.
    assert {name for group in CLASSES for name in group} <= kinds | {plan.kind for plan in PLANS}
    write_specs(plan, tmp_path / "plan.json")
    assert read_specs(tmp_path / "plan.json") == plan == build_plan(1)


def test_command_template() -> None:
    call = Diagnose("tool '{arm}' {train} --holdout {holdout} --out={out} -q", 1.0)
    words = call.command(Path("c"), Path("r"))
    assert words[:2] == ["tool", "c/arm.toml"]
    assert words[2:5] == ["c/train_steps.csv", "c/train_multisine.csv", "c/train_release.csv"]
    assert words[5:] == ["--holdout", "c/holdout_1.csv", "--holdout", "c/holdout_2.csv", "--out=r", "-q"]
    with pytest.raises(ValueError, match=r"lacks \{train\}"):
        Diagnose("tool {arm} {out}", 1.0)


def test_wilson_interval_against_known_values() -> None:
    assert wilson(95, 100) == pytest.approx((0.88825, 0.97846), abs=1e-5)
    assert wilson(0, 100) == pytest.approx((0.0, 0.03699), abs=1e-5)
    assert wilson(0, 0) == (0.0, 1.0)


def answer(group: str, *effects: tuple[str, str], noise: str = "standard", distributed: float = 0.0) -> dict[str, Any]:
    return {
        "case": "x",
        "spec": {"group": group, "noise": noise, "distributed": distributed, "hardening": False},
        "effects": [
            {
                "kind": kind,
                "where": where,
                "known": EFFECTS[kind].known,
                "comparable": {"tau_fill": 0.10, "tau_vent": 0.2} if kind == "pressure_lag" else {},
            }
            for kind, where in effects
        ],
        "noise_floor_rms": {"holdout_1": 2e-4, "holdout_2": 2e-4},
    }


def named(*effects: tuple[str, str], parameters: dict[str, Any] | None = None, after: float = 2.1e-4) -> Verdict:
    listed = [{"kind": k, "where": w, "parameters": parameters or {}} for k, w in effects]
    gap = {"noise": 2e-4, "before": 4e-3, "after": after}
    return Verdict("named" if listed else "equivalent", listed, gap)


def test_scores_of_hand_made_diagnoses() -> None:
    lag = {"tau_fill": {"value": 0.11, "ci95": [0.09, 0.13]}, "tau_vent": {"value": 0.25, "ci95": [0.21, 0.29]}}
    score = score_cases(
        [
            (answer("single", ("pressure_lag", "all")), named(("pressure_lag", "All"), parameters=lag)),
            (answer("single", ("delay", "all"), noise="hard"), named(("pressure_lag", "all"), after=3e-4)),
            (answer("single", ("payload", "section 2")), named(("payload", "section 3"), ("creep", "all"))),
            (answer("single", ("contact", "section 3")), Verdict("failed", [], {}, "no file")),
            (
                answer("pair", ("creep", "all"), ("payload", "section 1")),
                named(("payload", "section 1"), ("hysteresis", "all")),
            ),
            (answer("null"), named()),
            (answer("null", distributed=0.06), named(("payload", "section 1"))),
            (answer("unknown", ("stiffness_drift", "all")), Verdict("unexplained", [], {})),
            (answer("unknown", ("periodic_force", "section 1")), named(("creep", "all"))),
            (
                answer("clutter", ("creep", "all"), ("payload", "section 1")),
                named(("hysteresis", "all"), ("payload", "section 1")),
            ),
        ]
    )
    expect = {
        "single: first name right": (2, 4, 1),
        "single, hard noise: first name right": (0, 1, 1),
        "single: exact set right": (1, 4, 0),
        "single: place right, of those named right": (1, 2, 0),
        "pair: exact set right": (0, 1, 0),
        "pair: at least one right": (1, 1, 0),
        "null: named (wanted: none)": (1, 2, 0),
        "null, distributed mass: the name is payload": (1, 1, 0),
        "unknown: not named": (1, 2, 0),
        "clutter: dominant named first": (0, 1, 1),
        "clutter: names really there": (1, 2, 1),
        "interval covers the truth": (1, 2, 0),
    }
    assert {k: (t.hits, t.total, t.in_class) for k, t in score.tallies.items() if k in expect} == expect
    assert score.parameter_errors["pressure_lag.tau_fill"] == pytest.approx([0.1])
    assert score.confusion["delay", "pressure_lag"] == 1
    assert score.confusion["contact", "failed"] == 1
    text = report(score, "title")
    assert "| single | 3 |" in text
    assert "x: no file" in text
    assert confusion_table(score.confusion)[0].endswith("equivalent | unexplained | failed |")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"verdict": "maybe"}',
        '{"verdict": "named", "effects": []}',
        '{"verdict": "named", "effects": [{"kind": "a"}]}',
    ],
)
def test_unusable_diagnosis_is_a_failed_case(tmp_path: Path, text: str) -> None:
    (tmp_path / "diagnosis.json").write_text(text, encoding="utf-8")
    assert read_verdict(tmp_path / "diagnosis.json").first == "failed"
