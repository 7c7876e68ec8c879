"""Scores of ``bha identify`` on the wide world: converged or not, prediction of held-out logs, intervals, failures.

Read is the object that ``--json`` prints: ``converged``, ``parameters`` (``path``, ``value``, ``interval``,
``identified``), ``held_out`` (``rms_after`` by channel), ``seconds``. Intervals are held against the true values only
in cases where nothing is hidden, nothing is wrong with the setup, and the plain model is equivalent: elsewhere there is
no true value. A coverage by sort of parameter counts what the product says to be told by the logs.
"""

import json
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..scoring import Score, number_in, quantiles
from .scoring import Run, spent

GOOD = 1.3  # of what the true model leaves
ORIENTATION = re.compile(r"o[wxyz]\d+")
SORTS = ("mass", "stiffness.1", "damping", "bending_stiffness.1", "rest_length", "terminal_area")


@dataclass
class Identified:
    """What an identification said."""

    converged: bool | None = None
    parameters: list[dict[str, Any]] = field(default_factory=list)
    error: float | None = None  # RMS over all channels in metres of all held-out logs, m
    problem: str = ""


def read_identified(path: Path) -> Identified:
    """Read the JSON that the product printed; anything unusable becomes a problem."""
    try:
        text = path.read_text(encoding="utf-8")
        data = json.loads(text[text.index("{") :])
        # Quaternions are no metres, and the true model's error has none.
        squares = [
            x * x if x is not None else math.inf
            for held in data["held_out"]
            for name, x in zip(held["channels"], map(number_in, held["rms_after"]), strict=True)
            if not ORIENTATION.fullmatch(str(name))
        ]
        error = math.sqrt(sum(squares) / len(squares)) if squares else None
        return Identified(bool(data["converged"]), [dict(p) for p in data["parameters"]], error)
    except (OSError, ValueError, KeyError, TypeError) as error:
        return Identified(problem=f"{type(error).__name__}: {error}")


def _sort(path: str) -> str:
    return path.split(".", 2)[2] if path.startswith("section.") else path


def _count(score: Score, labels: Iterable[str], text: str, hit: bool) -> None:
    for label in labels:
        score.count(f"{label}: {text}", hit)


def _intervals(score: Score, answer: dict[str, Any], found: Identified) -> None:
    for p in found.parameters:
        path = str(p.get("path"))
        true = answer["parameters"].get(path)
        interval = p.get("interval")
        if true is None or _sort(path) not in SORTS or not isinstance(interval, list):
            continue
        ends = [number_in(x) for x in interval]
        value = number_in(p.get("value"))
        if value is not None and true:
            score.parameter_errors.setdefault(_sort(path), []).append(abs(value - true) / abs(true))
        if p.get("identified") is False or ends[0] is None or ends[1] is None:
            continue
        score.count("plain arms, told parameters: the interval covers the truth", ends[0] <= true <= ends[1])


def score_identifications(rows: Iterable[tuple[dict[str, Any], Identified, Run]]) -> tuple[Score, dict[str, Any]]:
    """Counts, and lists of ratios and seconds by label."""
    score = Score()
    ratios: dict[str, list[float]] = {}
    seconds: list[float] = []
    cpu: list[float] = []
    for answer, found, run in rows:
        spec, limits = answer["spec"], answer["limits"]
        plain = spec["group"] == "null" and limits["equivalent"]
        labels = ["all", f"file {spec['quality']}", f"sensors {spec['sensors']}", f"pressures {spec['pressures']}"]
        labels += ["plain arms"] if plain else [f"group {spec['group']}"]
        failed = found.converged is None
        _count(score, labels, "converged", bool(found.converged))
        score.count("all: no result", failed)
        score.count("all: traceback (wanted: none)", run.traceback)
        if failed:
            what = "timeout" if run.timed_out else "traceback" if run.traceback else "error"
            reason = "" if run.timed_out else ": " + (run.last_line or found.problem).removeprefix("error: ")
            score.problems.append(f"{answer['case']} ({spec['sensors']}, {spec['pressures']}): {what}{reason}")
        ratio = math.inf if found.error is None else found.error / limits["true_model"]
        _count(score, labels, f"held-out error within {GOOD:g} of the true model's", ratio <= GOOD)
        if not failed:
            for label in labels:
                ratios.setdefault(label, []).append(ratio)
            seconds += [] if run.seconds is None else [run.seconds]
            cpu += [] if run.cpu is None else [run.cpu]
        if plain and found.parameters:
            _intervals(score, answer, found)
    return score, {"ratios": ratios, "seconds": seconds, "cpu": cpu}


def report(score: Score, lists: dict[str, Any], title: str) -> str:
    """The score as Markdown."""
    lines = [f"## {title}", "", "| rate | hits / cases = rate [95 % interval] |", "|---|---|"]
    lines += [f"| {name} | {tally.text()} |" for name, tally in sorted(score.tallies.items())]
    lines += [
        "",
        "| held-out error over what the true model leaves | cases with a result | median (10th to 90th) |",
        "|---|---|---|",
    ]
    lines += [f"| {k} | {len(v)} | {quantiles(v)} |" for k, v in sorted(lists["ratios"].items())]
    if score.parameter_errors:
        lines += ["", "| plain arms, parameter | values | relative error, median (10th to 90th) |", "|---|---|---|"]
        lines += [f"| {k} | {len(v)} | {quantiles(v)} |" for k, v in sorted(score.parameter_errors.items())]
    lines += spent(lists["seconds"], lists["cpu"])
    if score.problems:
        lines += ["", f"Without a result: {len(score.problems)}", *(f"- {text}" for text in score.problems)]
    return "\n".join(lines) + "\n"
