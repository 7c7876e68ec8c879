"""Coverage and bias by condition and parameter, and whether they are what is wanted.

Wanted of every parameter under every condition: 90 to 99 % of the 95 % intervals hold the true value, and the mean
error is below a quarter of the standard error, or below 1 %. With n repeats a share has an error of its own (Wilson's
bounds): a cell counts as below 90 % only where the binomial test says so, all cells of the table together at 5 %
(Holm).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

LEAST, MOST = 0.90, 0.99
#: Largest mean error in standard errors, or else as a share of the true value.
BIAS, SMALL_BIAS = 0.25, 0.01
FAMILY = 0.05


@dataclass(frozen=True)
class Cell:
    """A parameter under a condition.

    Attributes:
        condition, parameter: which.
        count: intervals.
        inside: those that hold the true value.
        error: median standard error, as a share of the true value.
        bias: mean error, the same.
        bias_error: standard error of that.
        spread: standard deviation of the errors, the same.
    """

    condition: str
    parameter: str
    count: int
    inside: int
    error: float
    bias: float
    bias_error: float
    spread: float

    @property
    def bounds(self) -> tuple[float, float]:
        """95 % bounds of the coverage (Wilson 1927)."""
        interval = stats.binomtest(self.inside, self.count).proportion_ci(method="wilson")
        return float(interval.low), float(interval.high)

    @property
    def p_below(self) -> float:
        """Chance of no more intervals that hold, were the coverage 90 %."""
        return float(stats.binom.cdf(self.inside, self.count, LEAST))

    @property
    def unbiased(self) -> bool:
        """Whether the mean error is small, or could well be (two of its own standard errors)."""
        allowed = max(BIAS * self.error, SMALL_BIAS)
        return abs(self.bias) < allowed + 2.0 * self.bias_error


def cells(lines: Sequence[Any]) -> list[Cell]:
    """The cells of a store, in its order."""
    found: dict[tuple[str, str], list[Any]] = defaultdict(list)
    for line in lines:
        for path, numbers in line.get("parameters", {}).items():
            found[line["condition"], path].append(numbers)
    made = []
    for (condition, path), numbers in found.items():
        errors = np.array([n["value"] / n["true"] - 1.0 for n in numbers])
        known = np.array([n["error"] / abs(n["true"]) for n in numbers])
        spread = float(np.std(errors, ddof=1)) if len(errors) > 1 else float("nan")
        inside = sum(n["inside"] for n in numbers)
        error = spread / np.sqrt(len(errors))
        made.append(
            Cell(condition, path, len(errors), inside, float(np.median(known)), float(errors.mean()), error, spread)
        )
    return made


def rejected(made: Sequence[Cell]) -> list[Cell]:
    """Cells whose coverage is below 90 %, all together at 5 % (Holm 1979)."""
    found: list[Cell] = []
    for k, cell in enumerate(sorted(made, key=lambda c: c.p_below)):
        if cell.p_below > FAMILY / (len(made) - k):
            break
        found.append(cell)
    return found


def text(lines: Sequence[Any]) -> str:
    """The table, as Markdown, and a line on what it says."""
    made = cells(lines)
    below = rejected(made)
    rows = [
        "| condition | parameter | intervals | inside | coverage (95 % bounds) | error % | spread % | bias % |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for c in made:
        low, high = c.bounds
        mark = " **below 90 %**" if c in below else ""
        off = "" if c.unbiased else " **biased**"
        rows.append(
            f"| {c.condition} | {c.parameter} | {c.count} | {c.inside} | {100 * c.inside / c.count:.0f} % "
            f"({100 * low:.0f} to {100 * high:.0f}){mark} | {100 * c.error:.2f} | {100 * c.spread:.2f} | "
            f"{100 * c.bias:.2f} ± {100 * c.bias_error:.2f}{off} |"
        )
    rows += ["", *_by_condition(lines, made)]
    outside = [c for c in made if not LEAST <= c.inside / c.count <= MOST]
    rows.append(
        f"\n{len(made)} cells: {len(outside)} outside 90 to 99 %, {len(below)} rejected against 90 % at "
        f"{100 * FAMILY:g} % for all together, {sum(not c.unbiased for c in made)} biased"
    )
    return "\n".join(rows)


def _by_condition(lines: Sequence[Any], made: Sequence[Cell]) -> list[str]:
    """A line for each condition: coverage of all parameters, failures, time."""
    rows = ["| condition | repeats | converged | all intervals | seconds each |", "|---|---|---|---|---|"]
    for name in dict.fromkeys(line["condition"] for line in lines):
        own = [line for line in lines if line["condition"] == name]
        mine = [c for c in made if c.condition == name]
        count, inside = sum(c.count for c in mine), sum(c.inside for c in mine)
        share = f"{100 * inside / count:.1f} %" if count else "-"
        converged = sum(line.get("converged", False) for line in own)
        seconds = float(np.mean([line["seconds"] for line in own]))
        rows.append(f"| {name} | {len(own)} | {converged} | {share} | {seconds:.1f} |")
    return rows
