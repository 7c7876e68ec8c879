"""The wide blind world: what answers are worth, by hand; how a product is called."""

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("numba")
ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "benches" / "blind"))

from blindgen.runner import Folders  # noqa: E402
from blindgen.scoring import quantiles  # noqa: E402
from blindgen.wide import hidden  # noqa: E402
from blindgen.wide.adapt import adapted  # noqa: E402
from blindgen.wide.identification import read_identified, score_identifications  # noqa: E402
from blindgen.wide.plan import WideSpec  # noqa: E402
from blindgen.wide.reference import judgement  # noqa: E402
from blindgen.wide.runner import Product, call, command, read_run, results  # noqa: E402
from blindgen.wide.scoring import Run, Trial, report, score_trials  # noqa: E402
from blindgen.wide.verdicts import Said, read_said, with_refusal  # noqa: E402

SPEC = WideSpec(
    case="demo_0000", seed=7, subset="tune", group="single", kinds=("creep",), strengths=(3.0,), fault="", sections=1,
    layout=(4, True, True), regime="fabric", mounting="hanging", quality="tape", sensors="heads", rate="10", noise=2e-4,
    coloured=False, pressures="measured", disturbance="none", programme="rich", logs=2, total=40.0,
)  # fmt: skip


def sealed_answer(group: str, kinds: list[tuple[str, str]], ratio: float, **more: Any) -> dict[str, Any]:
    limits = judgement(1e-3, 1e-3 * np.sqrt(max(ratio**2 - 1.0, 0.0)))
    answer = {
        "case": "x",
        "spec": {"group": group, "sections": 2, "sensors": "heads", "pressures": "measured", "quality": "tape"},
        "effects": [{"kind": k, "where": w, "known": not hidden.KINDS[k].refused, "comparable": {}} for k, w in kinds],
        "fault": None,
        "excused": [],
        "limits": limits,
        "parameters": {"section.1.mass": 0.5, "section.1.damping": 10.0},
    }
    return {**answer, **more}


def said(verdict: str, *names: tuple[str, str], faults_: tuple[str, ...] = ()) -> Said:
    effects: list[dict[str, Any]] = [{"kind": k, "where": w, "parameters": {}} for k, w in names]
    if verdict == "one_of":
        effects = [{**effects[0], "one_of": effects[1:]}]
    return Said(verdict, effects, [{"kind": f, "where": ""} for f in faults_], 3e-3, 1.2e-3)


def test_scores_of_hand_made_diagnoses() -> None:
    fault = {"kind": "tubes_swapped", "where": "input p11, input p12", "swap": ["p11", "p12"], "angle": 0.0}
    wrong_setup = {"limits": {**judgement(1e-3, 0.0), "fault": judgement(1e-3, 5e-3)}, "fault": fault}
    rows = [
        (sealed_answer("null", [], 1.0), said("equivalent")),
        (sealed_answer("null", [], 1.0), said("named", ("base_tilt", "all"))),
        (sealed_answer("null", [], 1.0, excused=["delay"]), said("named", ("delay", "all"))),
        (sealed_answer("null", [], 2.0), said("unexplained")),
        (sealed_answer("single", [("creep", "all")], 3.0), said("named", ("creep", "All"))),
        (sealed_answer("single", [("creep", "all")], 3.0), said("one_of", ("friction", "all"), ("creep", "section 1"))),
        (sealed_answer("single", [("creep", "all")], 3.0), said("named", ("payload", "section 1"))),
        (sealed_answer("single", [("creep", "all")], 1.0), said("equivalent")),
        (
            sealed_answer("pair", [("creep", "all"), ("payload", "section 2")], 3.0),
            said("named", ("payload", "section 2")),
        ),
        (sealed_answer("refused", [("periodic_force", "section 1")], 3.0), said("unexplained")),
        (sealed_answer("setup", [], 1.0, **wrong_setup), said("setup", faults_=("chambers swapped",))),
        (sealed_answer("setup", [], 1.0, **wrong_setup), said("setup", faults_=("camera mirrored",))),
        (sealed_answer("setup", [], 1.0, **wrong_setup), Said("failed", problem="no file")),
    ]
    score = score_trials(Trial(a, s, Run(10.0, 8.0, 0, traceback=s.verdict == "failed")) for a, s in rows)
    found = {k: (t.hits, t.total) for k, t in score.tallies.items()}
    assert found["null: a wrong name (wanted: none)"] == (1, 4)
    assert found["null, plain model equivalent: said so"] == (1, 3)
    assert found["null, but the plain model falls short: left unexplained, or an excused name"] == (1, 1)
    assert found["single, shows: first name (or class) right"] == (2, 3)
    assert found["single: a wrong name (wanted: none)"] == (1, 4)
    assert found["single, below what shows: equivalent or a right name"] == (1, 1)
    assert found["pair, shows: at least one right"] == (1, 1)
    assert found["pair, shows: exact set right"] == (0, 1)
    assert found["refused, shows: kept as unexplained"] == (1, 1)
    assert found["setup: the fault is named"] == (1, 3)
    assert found["setup: some setup fault is said"] == (2, 3)
    assert found["place right, of those named right"] == (2, 3)
    assert found["all: traceback (wanted: none)"] == (1, 13)
    text = report(score, "title")
    assert "| single | 4 | 1.2" in text
    assert "traceback" in text


@pytest.mark.parametrize(
    ("text", "verdict"),
    [
        ('{"verdict": "no_gap"}', "equivalent"),
        ('{"verdict": "unknown", "effects": []}', "unexplained"),
        ('{"verdict": "named", "effects": [{"kind": "creep", "where": "all"}], "gap": {"after": 1e-3}}', "named"),
        ('{"verdict": "one_of", "effects": [{"kind": "creep", "where": "all", "one_of": []}]}', "one_of"),
        ('{"verdict": "setup", "setup": ["azimuth"]}', "setup"),
        ('{"verdict": "named", "effects": []}', "failed"),
        ('{"verdict": "setup"}', "failed"),
        ('{"verdict": "maybe"}', "failed"),
        ("[]", "failed"),
    ],
)
def test_verdicts_of_today_and_to_come(tmp_path: Path, text: str, verdict: str) -> None:
    (tmp_path / "diagnosis.json").write_text(text, encoding="utf-8")
    assert read_said(tmp_path / "diagnosis.json").verdict == verdict


def test_refusals_that_name_the_fault_and_endless_medians() -> None:
    line = "error: log.csv: found -0.08 kPa; is this gauge pressure? Then write 'p11 [kPa(g)]'"
    assert with_refusal(Said("failed"), line).says_fault("gauge_as_absolute")
    assert not with_refusal(Said("failed"), "error: no head was measured").faults
    assert not with_refusal(Said("named"), line).faults
    assert quantiles([1.0, 2.0, 3.0, 4.0, 5.0, math.inf]) == "3.5 (1.5 to inf)"
    assert quantiles([1.0, math.inf, math.inf]).endswith("to inf)")
    assert quantiles([3.0]) == "3 (3 to 3)"


def test_scores_of_hand_made_identifications(tmp_path: Path) -> None:
    data = {
        "converged": True,
        "parameters": [
            {"path": "section.1.mass", "value": 0.51, "interval": [0.49, 0.53], "identified": True},
            {"path": "section.1.damping", "value": 20.0, "interval": [18.0, 22.0], "identified": True},
        ],
        "held_out": [{"channels": ["x1", "z1", "ox1"], "rms_after": [1e-3, 1.4e-3, 1.0]}],
    }
    path = tmp_path / "stdout.txt"
    path.write_text("progress\n" + json.dumps(data), encoding="utf-8")
    found = read_identified(path)
    assert found.error == pytest.approx(np.sqrt(0.5 * (1.0 + 1.96)) * 1e-3)
    path.write_text("", encoding="utf-8")
    answer = sealed_answer("null", [], 1.0)
    rows = [
        (answer, found, Run(5.0, 4.0, 0)),
        (answer, read_identified(path), Run(1.0, 1.0, 1, traceback=True, last_line="boom")),
    ]
    score, lists = score_identifications(rows)
    tallies = {k: (t.hits, t.total) for k, t in score.tallies.items()}
    assert tallies["all: converged"] == (1, 2)
    assert tallies["plain arms: held-out error within 1.3 of the true model's"] == (1, 2)
    assert tallies["plain arms, told parameters: the interval covers the truth"] == (1, 2)
    assert score.parameter_errors["mass"] == pytest.approx([0.02])
    assert lists["ratios"]["all"] == pytest.approx([found.error / 1e-3])
    assert "boom" in score.problems[0]


def test_calls_and_cases_for_a_product_that_knows_less(tmp_path: Path) -> None:
    case = tmp_path / "case"
    case.mkdir()
    (case / "arm.toml").write_text('name = "a"\n\n[sensors]\nlengths = "coordinates"\n\n[[section]]\nmass = 1.0\n'
                                   '\n[[length_sensor]]\nname = "w"\nsections = [1]\n', encoding="utf-8")  # fmt: skip
    for name in ("train_1", "train_2", "holdout_1"):
        (case / f"{name}.csv").write_text("t [s],pc11 [Pa],q11 [mm]\n0,1,2\n", encoding="utf-8")
    words = command("bha x {arm} {train} --holdout {holdout} {commanded} --out {out}/o", case, tmp_path / "r")
    assert words[2:5] == [str(case / x) for x in ("arm.toml", "train_1.csv", "train_2.csv")]
    assert words[5:] == [
        "--holdout",
        str(case / "holdout_1.csv"),
        "--pressures",
        "commanded",
        "--out",
        f"{tmp_path}/r/o",
    ]
    assert adapted(case, tmp_path / "same", []) == case
    other = adapted(case, tmp_path / "other", ["sensors", "commands"])
    assert (other / "arm.toml").read_text(encoding="utf-8") == 'name = "a"\n\n[[section]]\nmass = 1.0\n'
    assert (other / "train_1.csv").read_text(encoding="utf-8") == "t [s],p11 [Pa],q11 [mm]\n0,1,2\n"
    assert "--pressures" not in command("x {arm} {train} {commanded} {out}", other, tmp_path)


def test_product_is_called_once_and_stopped_in_time(tmp_path: Path) -> None:
    """A made-up product: what it says is read back, how it went is kept, and one that never ends is ended."""
    folders = Folders(tmp_path / "out")
    case = folders.cases / SPEC.case
    case.mkdir(parents=True)
    (case / "arm.toml").write_text("", encoding="utf-8")
    (case / "train_1.csv").write_text("t [s],p11 [Pa]\n", encoding="utf-8")
    script = tmp_path / "product.py"
    script.write_text(
        "import sys, pathlib\n"
        "pathlib.Path(sys.argv[-1], 'diagnosis.json').write_text('{\"verdict\": \"no_gap\"}')\n"
        "raise RuntimeError('late')\n",
        encoding="utf-8",
    )
    fails = Product("diagnose", f"{sys.executable} {script} {{arm}} {{train}} --holdout {{holdout}} {{out}}", 60.0)
    assert "exit code 1" in fails(SPEC, folders)
    place = results(folders, "diagnose") / SPEC.case
    run = read_run(place / "run.json")
    assert run.traceback
    assert run.code == 1
    assert run.last_line == "RuntimeError: late"
    assert read_said(place / "diagnosis.json").verdict == "equivalent"
    call(folders, [SPEC], Product("diagnose", "false {arm} {train} {out}", 1.0), 1)
    assert read_run(place / "run.json") == run
    endless = Product("identify", f"{sys.executable} -c 'while True: pass' {{arm}} {{train}} {{out}}", 1.0)
    assert "stopped" in endless(SPEC, folders)
    assert read_run(results(folders, "identify") / SPEC.case / "run.json").timed_out
