import json
from pathlib import Path
from typing import Any

import pytest

from bha.diagnosis.result import Diagnosis
from bha.errors import InputError

EXAMPLE: dict[str, Any] = {
    "schema": "bha-diagnosis/2",
    "verdict": "named",
    "reason": "99 % of the excess error on held-out logs is removed",
    "effects": [
        {
            "kind": "creep",
            "where": "bellows 32",
            "parameters": {"tau": {"value": 0.1, "unit": "s", "ci95": [0.09, 0.11]}},
            "confidence": 0.99,
            "alone": 0.9,
            "one_of": [{"kind": "hysteresis", "where": "bellows 32"}],
        }
    ],
    "gap": {
        "metric": "rms",
        "unit": "m",
        "noise": 2e-4,
        "before": 4e-3,
        "after": 2.2e-4,
        "holdout": ["a.csv"],
        "significant": True,
    },
    "where": {},
    "candidates": [{"kind": "creep", "where": "bellows 32", "score": 0.9, "holdout": 2.2e-4}],
    "residual": {},
    "excitation": {},
    "plain": {},
    "logs": [],
}


def test_the_form_that_others_read_is_kept(tmp_path: Path) -> None:
    found = Diagnosis.model_validate(EXAMPLE)
    found.write(tmp_path / "diagnosis.json")
    data = json.loads((tmp_path / "diagnosis.json").read_text(encoding="utf-8"))
    assert data["verdict"] == "named"
    assert data["effects"][0]["parameters"]["tau"] == {
        "value": 0.1,
        "unit": "s",
        "ci95": [0.09, 0.11],
        "at_bound": False,
    }
    assert {k: data["gap"][k] for k in ("metric", "unit", "noise", "before", "after", "holdout")} == {
        k: EXAMPLE["gap"][k] for k in ("metric", "unit", "noise", "before", "after", "holdout")
    }
    assert set(data) >= {"verdict", "effects", "gap", "where", "candidates", "residual"}
    assert Diagnosis.read(tmp_path / "diagnosis.json") == found


def test_a_diagnosis_in_a_line() -> None:
    found = Diagnosis.model_validate(EXAMPLE)
    gap, effect = found.gap, found.effects[0]
    errors = f"{1e3 * gap.before:.3g} mm before, {1e3 * gap.after:.3g} mm after, noise {1e3 * gap.noise:.3g} mm"
    assert repr(found) == str(found) == f"Diagnosis(named: {effect.kind} at {effect.where}; {errors})"
    none = found.model_copy(update={"verdict": "equivalent", "effects": [], "complete": False})
    assert repr(none) == f"Diagnosis(equivalent; {errors}, interrupted)"


def test_a_diagnosis_in_a_notebook_and_as_a_table() -> None:
    found = Diagnosis.model_validate({**EXAMPLE, "reason": "a <b> b"})
    shown = found._repr_html_()
    assert '<td style="text-align:left">bellows 32</td>' in shown
    assert "tau 0.1 s" in shown
    assert "a &lt;b&gt; b" in shown
    assert "<table>" not in found.model_copy(update={"effects": []})._repr_html_()
    pytest.importorskip("pandas")
    table = found.to_pandas()
    assert table["kind"].tolist() == ["creep"]
    assert table["holdout"].tolist() == [2.2e-4]


@pytest.mark.parametrize(
    "change",
    [{"verdict": "perhaps"}, {"surprise": 1}, {"gap": {**EXAMPLE["gap"], "after": float("nan")}}],
    ids=["verdict", "key", "nan"],
)
def test_what_does_not_fit_the_schema_is_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="validation error"):
        Diagnosis.model_validate({**EXAMPLE, **change})


def test_a_file_that_is_no_diagnosis_is_an_input_error(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text("{}", encoding="utf-8")
    with pytest.raises(InputError, match="not a diagnosis"):
        Diagnosis.read(tmp_path / "x.json")
