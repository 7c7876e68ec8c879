"""The report: one page that tells the story in its order, offline, with numbers that are those of the result."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bha
from bha.diagnosis import Diagnosis
from bha.diagnosis.arm_figure import blamed_bellows, blamed_heads
from bha.diagnosis.figures import decade_ticks
from bha.diagnosis.result import Effect

from .synthetic import make_logs, one_section

pytest.importorskip("plotly")

PRODUCT = one_section({"mass": 0.93, "stiffness": 1.1})
HIDDEN = {"kind": "weak_bellows", "where": "bellows 12", "parameters": {"change": -0.2}}


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Diagnosis, list[dict[str, Any]]]:
    folder = tmp_path_factory.mktemp("report")
    logs = make_logs(one_section(), [HIDDEN], seed=3, durations=(3.0, 3.0))
    arm = PRODUCT.with_parameters(PRODUCT.parameters.updated({"name": "<b>arm</b>"}))
    found = bha.diagnose(arm, logs[:1], logs[1:], kinds=("weak_bellows",), out=folder, command="bha diagnose <x>")
    text = (Path(folder) / "report.html").read_text(encoding="utf-8")
    figures = json.loads(re.search(r"const figures=(\[.*?\]);figures\.forEach", text, re.DOTALL).group(1))  # type: ignore[union-attr]
    return text, found, figures


def test_it_says_in_words_what_was_found_and_how_it_was_made(
    told: tuple[str, Diagnosis, list[dict[str, Any]]],
) -> None:
    text, found, _ = told
    assert re.search(r"<h1>Bellows 2 of section 1 is 2\d(\.\d)? % softer than the file says</h1>|"
                     r"<h1>Bellows 2 of section 1 is 1\d(\.\d)? % softer than the file says</h1>", text)  # fmt: skip
    assert found.made is not None
    assert found.made.version == bha.__version__
    assert found.made.command == "bha diagnose <x>"
    assert [f.part for f in found.made.files] == ["training", "held out"]
    assert found.made.date in text
    assert "bha diagnose &lt;x&gt;" in text
    assert "<b>arm</b>" not in text.replace("\\u003cb>arm", "")
    assert Diagnosis.model_validate_json(found.to_json()) == found


def test_errors_stand_in_the_order_of_the_story(told: tuple[str, Diagnosis, list[dict[str, Any]]]) -> None:
    _, found, figures = told
    bars = figures[0]["data"][0]
    assert bars["y"] == ["plain model", "with what is named", "noise alone"]
    assert bars["x"] == pytest.approx([1e3 * found.gap.before, 1e3 * found.gap.after, 1e3 * found.gap.noise])
    # One number for one thing: the candidate that is named, refitted alone, has the error after.
    assert found.candidates[0].holdout == pytest.approx(found.gap.after, rel=1e-6)


def test_the_arm_moves_as_measured_with_the_culprit_in_colour(
    told: tuple[str, Diagnosis, list[dict[str, Any]]],
) -> None:
    _, _, figures = told
    (arm,) = [f for f in figures if f["data"][0]["type"] == "scatter3d"]
    names = [trace["name"] for trace in arm["data"]]
    assert names[1] == "what is named"
    assert arm["data"][1]["showlegend"]
    assert len(arm["frames"]) > 20
    for frame in (arm["frames"][0], arm["frames"][-1]):
        measured, simulated = frame["data"][2], frame["data"][3]
        # Where the measured backbone ends is where the simulated head is, to the noise of the lengths.
        ends = np.array([[measured[a][-1], simulated[a][-1]] for a in "xyz"])
        assert np.linalg.norm(ends[:, 0] - ends[:, 1]) < 5e-3


def test_estimates_say_what_the_file_started_with(told: tuple[str, Diagnosis, list[dict[str, Any]]]) -> None:
    _, found, _ = told
    mass = found.plain["section 1 mass"]
    assert mass.start == pytest.approx(PRODUCT.parameters.sections[0].mass)
    assert mass.value == pytest.approx(one_section().parameters.sections[0].mass, rel=0.1)


def test_spectra_of_white_noise_lie_at_its_density(told: tuple[str, Diagnosis, list[dict[str, Any]]]) -> None:
    _, found, _ = told
    spectrum = found.residual["spectrum"]
    after, noise = np.array(spectrum["after"]), np.array(spectrum["noise"])
    frequency = np.array(spectrum["frequency"])
    fast = (frequency > 5.0) & (frequency < 25.0)  # above the arm, below where thinning filters
    assert np.mean(after[fast]) == pytest.approx(np.mean(noise[fast]), rel=0.3)


def test_culprits_are_the_bellows_of_a_place_or_a_head() -> None:
    arm = bha.robots.load("bha_nominal")

    def effect(kind: str, where: str) -> Effect:
        return Effect(kind=kind, where=where, parameters={}, confidence=1.0)

    assert blamed_bellows(arm, effect("weak_bellows", "bellows 32")) == [(2, 1)]
    assert blamed_bellows(arm, effect("creep", "section 2")) == [(1, 0), (1, 1), (1, 2)]
    assert len(blamed_bellows(arm, effect("creep", "all"))) == 9
    assert blamed_bellows(arm, effect("pressure_gain", "input p13")) == [(0, 2)]
    assert blamed_bellows(arm, effect("payload", "section 3")) == []
    assert blamed_bellows(arm, effect("delay", "sensors")) == []
    assert blamed_heads(arm, [effect("payload", "section 3")]) == [3 - 1]


@pytest.mark.parametrize(
    ("low", "high", "within"),
    [
        (2e-3, 5.0, [0.01, 0.1, 1.0]),
        (0.15, 1.4, [0.2, 0.5, 1.0]),
        (0.17, 0.32, [0.2, 0.25, 0.3]),
        (0.171, 0.204, [0.18, 0.19, 0.2]),
    ],
)
def test_a_logarithmic_axis_has_at_least_three_ticks_within_its_values(
    low: float, high: float, within: list[float]
) -> None:
    assert [tick for tick in decade_ticks(low, high) if low <= tick <= high] == pytest.approx(within)
