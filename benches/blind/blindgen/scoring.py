"""Scores of a diagnosis against the sealed answers.

What is counted, with Wilson 95 % intervals: first name right, exact set right, place right, names really present,
false names on null data, abstentions on effects outside the catalogue, coverage of the parameter intervals; and, as
medians, parameter errors and held-out errors before and after against the noise. A name from the same class of
look-alikes is counted as *in class*, never as right. A case whose ``diagnosis.json`` is missing or unreadable counts
as failed: it stays in every denominator.
"""

import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .lookalikes import look_alike

# Names a product may give to a comparable parameter; the first that is there counts. Signs are conventions, so sizes
# are compared.
ALIASES: dict[tuple[str, str], tuple[str, ...]] = {
    ("hysteresis", "force"): ("force", "F_h", "Fh", "amplitude"),
    ("friction", "force"): ("coulomb_force", "coulomb", "force", "F_c", "Fc"),
    ("bending_damping", "damping"): ("damping", "d", "d_b", "c"),
    ("section_coupling", "stiffness"): ("stiffness", "k"),
    ("weak_bellows", "loss"): ("loss", "w", "weakness", "relative", "change"),
    ("payload", "mass"): ("mass", "m", "dm"),
    ("base_tilt", "angle"): ("angle", "tilt"),
    ("tool_drag", "stiffness"): ("stiffness", "k"),
    ("pressure_lag", "tau_fill"): ("tau_fill", "fill", "tau"),
    ("pressure_lag", "tau_vent"): ("tau_vent", "vent", "tau"),
    ("delay", "delay"): ("delay", "time", "T", "dead_time"),
    ("valve_dead_band", "band"): ("band", "dead_band", "width"),
    ("pressure_offset", "offset"): ("offset", "bias", "b"),
    ("pressure_gain", "gain"): ("gain", "e", "error"),
    ("length_offset", "offset"): ("offset", "bias", "b"),
    ("length_gain", "gain"): ("gain", "e", "error"),
}
# Places that mean the same.
SAME_PLACE: dict[str, frozenset[str]] = {
    "tool_drag": frozenset({"all", "section 3"}),
    "base_tilt": frozenset({"all", "section 1"}),
}
OUTCOMES_ELSE = ("equivalent", "unexplained", "setup", "failed")
# What verdicts were called in earlier versions.
EARLIER = {"no_gap": "equivalent", "unknown": "unexplained"}
NAMES = ("named", "one_of")


def wilson(hits: int, total: int, z: float = 1.959964) -> tuple[float, float]:
    """Wilson score interval of a rate; (0, 1) without data."""
    if total == 0:
        return 0.0, 1.0
    rate = hits / total
    spread = z * math.sqrt(rate * (1 - rate) / total + z * z / (4 * total * total))
    middle = rate + z * z / (2 * total)
    scale = 1 + z * z / total
    low = 0.0 if hits == 0 else max(0.0, (middle - spread) / scale)
    high = 1.0 if hits == total else min(1.0, (middle + spread) / scale)
    return low, high


@dataclass
class Verdict:
    """What the product said about a case."""

    verdict: str
    effects: list[dict[str, Any]]
    gap: dict[str, Any]
    problem: str = ""

    @property
    def first(self) -> str:
        """First named kind, or the verdict without a name."""
        return str(self.effects[0]["kind"]) if self.verdict in NAMES and self.effects else self.verdict


def read_verdict(path: Path) -> Verdict:
    """Read a ``diagnosis.json``; anything unusable becomes the verdict ``failed`` with the reason."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        verdict = EARLIER.get(str(data["verdict"]), str(data["verdict"]))
        effects = [dict(e) for e in data.get("effects", [])]
        if verdict not in (*NAMES, *OUTCOMES_ELSE[:-1]):
            raise ValueError(f"verdict {verdict!r}")
        if verdict in NAMES and not effects:
            raise ValueError(f"verdict {verdict!r} without an effect")
        for effect in effects:
            str(effect["kind"]), str(effect["where"])
        return Verdict(verdict, effects if verdict in NAMES else [], dict(data.get("gap") or {}))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        return Verdict("failed", [], {}, f"{type(error).__name__}: {error}")


def same_place(kind: str, named: str, true: str) -> bool:
    """Whether a named place is the true one."""
    a, b = (" ".join(x.lower().split()) for x in (named, true))
    return a == b or (kind in SAME_PLACE and {a, b} <= SAME_PLACE[kind])


@dataclass
class Tally:
    """Hits, in-class hits and the number of trials."""

    hits: int = 0
    total: int = 0
    in_class: int = 0

    def add(self, hit: bool, in_class: bool = False) -> None:
        """Count one trial."""
        self.total += 1
        self.hits += hit
        self.in_class += bool(in_class and not hit)

    def text(self) -> str:
        """``hits/total rate [low, high]``, and how many misses stayed in class."""
        if not self.total:
            return "-"
        low, high = wilson(self.hits, self.total)
        tail = f", in class {self.in_class}" if self.in_class else ""
        return f"{self.hits}/{self.total} = {self.hits / self.total:.3f} [{low:.3f}, {high:.3f}]{tail}"


@dataclass
class Score:
    """All counts of a set of cases."""

    tallies: dict[str, Tally] = field(default_factory=dict)
    parameter_errors: dict[str, list[float]] = field(default_factory=dict)
    held_out: dict[str, list[tuple[float, float, float, float]]] = field(default_factory=dict)
    confusion: Counter[tuple[str, str]] = field(default_factory=Counter)
    problems: list[str] = field(default_factory=list)

    def count(self, name: str, hit: bool, in_class: bool = False) -> None:
        """Count one trial of a named rate."""
        self.tallies.setdefault(name, Tally()).add(hit, in_class)


def number_in(item: object) -> float | None:
    """A finite number, or the ``value`` of a table; None otherwise."""
    value = item.get("value") if isinstance(item, dict) else item
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None


def compare_parameters(score: Score, true: dict[str, Any], named: dict[str, Any]) -> None:
    """Count relative errors and the coverage of intervals of an effect that was named right."""
    given = dict(named.get("parameters") or {})
    about = [number_in(given.get(f"about_{axis}")) for axis in "xy"]
    if about[0] is not None and about[1] is not None:
        given.setdefault("angle", math.hypot(about[0], about[1]))
    for key, reading in true["comparable"].items():
        # The answer is the sensor's gain, a diagnosis has that from the reading to the pressure that acts.
        value = -reading / (1.0 + reading) if (true["kind"], key) == ("pressure_gain", "gain") else reading
        for alias in ALIASES.get((true["kind"], key), (key,)):
            guess = number_in(given.get(alias))
            if guess is None:
                continue
            name = f"{true['kind']}.{key}"
            error = abs(abs(guess) - abs(value)) / abs(value) if value else math.inf
            score.parameter_errors.setdefault(name, []).append(error)
            interval = given[alias].get("ci95") if isinstance(given[alias], dict) else None
            if isinstance(interval, list) and len(interval) == 2:
                ends = sorted(float(x) for x in interval)
                inside = ends[0] <= value <= ends[1] or ends[0] <= -value <= ends[1]
                score.count("interval covers the truth", inside)
            break


def _row_name(answer: dict[str, Any]) -> str:
    group = str(answer["spec"]["group"])
    return str(answer["effects"][0]["kind"]) if group in ("single", "unknown") else group


@dataclass(frozen=True)
class Trial:
    """One case as the counters see it."""

    score: Score
    spec: dict[str, Any]
    known: list[dict[str, Any]]
    verdict: Verdict

    @property
    def kinds(self) -> list[str]:
        """True kinds of the catalogue, the dominant one first."""
        return [e["kind"] for e in self.known]

    @property
    def names(self) -> list[str]:
        """Kinds the product named, in its order."""
        return [str(e["kind"]) for e in self.verdict.effects]

    def near(self, name: str) -> bool:
        """Whether a name looks like something that is there."""
        return any(look_alike(name, kind) for kind in self.kinds)

    def count_names(self, label: str) -> None:
        """Count every name given: really there, in class, or neither."""
        for name in self.names:
            self.score.count(label, name in self.kinds, self.near(name))


def _count_single(trial: Trial) -> None:
    score, first, kind = trial.score, trial.verdict.first, trial.kinds[0]
    for label in ("single", f"single, {trial.spec['noise']} noise"):
        score.count(f"{label}: first name right", first == kind, trial.near(first))
    score.count("single: exact set right", trial.names == trial.kinds)
    score.count("single: abstained", trial.verdict.verdict not in (*NAMES, "failed"))
    if first == kind:
        right = same_place(first, str(trial.verdict.effects[0]["where"]), trial.known[0]["where"])
        score.count("single: place right, of those named right", right)


def _count_pair(trial: Trial) -> None:
    score, names, kinds = trial.score, trial.names, trial.kinds
    wrong = [n for n in names if n not in kinds]
    score.count("pair: exact set right", sorted(names) == sorted(kinds))
    score.count("pair: at least one right", any(n in kinds for n in names))
    score.count("pair: a wrong name among them (wanted: none)", bool(wrong))
    score.count("pair: a wrong name of no class (wanted: none)", any(not trial.near(n) for n in wrong))


def _count_null(trial: Trial) -> None:
    score, spec, named = trial.score, trial.spec, trial.verdict.verdict in NAMES
    variant = "distributed mass" if spec["distributed"] else ("exponential springs" if spec["hardening"] else "plain")
    score.count("null: named (wanted: none)", named)
    score.count(f"null, {variant}: named (wanted: none)", named)
    score.count("null: verdict equivalent", trial.verdict.verdict == "equivalent")
    if spec["distributed"] and named:
        score.count("null, distributed mass: the name is payload", trial.names == ["payload"])


def _count_unknown(trial: Trial) -> None:
    trial.score.count("unknown: not named", trial.verdict.verdict not in (*NAMES, "failed"))
    trial.score.count("unknown: verdict unexplained", trial.verdict.verdict == "unexplained")


def _count_clutter(trial: Trial) -> None:
    first = trial.verdict.first
    trial.score.count("clutter: dominant named first", first == trial.kinds[0], trial.near(first))
    trial.count_names("clutter: names really there")


def _count_unknown_clutter(trial: Trial) -> None:
    trial.count_names("unknown in clutter: names really there")


COUNTERS: dict[str, Callable[[Trial], None]] = {
    "single": _count_single,
    "pair": _count_pair,
    "null": _count_null,
    "unknown": _count_unknown,
    "clutter": _count_clutter,
    "unknown_clutter": _count_unknown_clutter,
}


def score_case(score: Score, answer: dict[str, Any], verdict: Verdict) -> None:
    """Add one case to the score."""
    group = str(answer["spec"]["group"])
    trial = Trial(score, answer["spec"], [e for e in answer["effects"] if e["known"]], verdict)
    score.confusion[_row_name(answer), verdict.first] += 1
    if verdict.verdict == "failed":
        score.problems.append(f"{answer['case']}: {verdict.problem}")
    COUNTERS[group](trial)
    for effect in trial.known:
        match = next((e for e in verdict.effects if e["kind"] == effect["kind"]), None)
        if match is not None:
            if group != "single":
                right = same_place(effect["kind"], str(match["where"]), effect["where"])
                score.count("several effects: place right, of those named right", right)
            compare_parameters(score, effect, match)
    before, after, noise = (number_in(verdict.gap.get(key)) for key in ("before", "after", "noise"))
    if before is not None and after is not None and noise:
        floors = answer["noise_floor_rms"]
        floor = math.sqrt((floors["holdout_1"] ** 2 + floors["holdout_2"] ** 2) / 2)
        score.held_out.setdefault(group, []).append((before, after, noise, floor))


def quantiles(values: Sequence[float]) -> str:
    """Median, and 10th to 90th percentile, as text."""
    ordered = sorted(values)

    def at(share: float) -> float:
        place = share * (len(ordered) - 1)
        low = int(place)
        high = min(low + 1, len(ordered) - 1)
        # Between equals, infinite ones too, there is nothing to interpolate.
        if ordered[low] == ordered[high] or place == low:
            return ordered[low]
        return ordered[low] + (place - low) * (ordered[high] - ordered[low])

    return f"{at(0.5):.3g} ({at(0.1):.3g} to {at(0.9):.3g})"


def report(score: Score, title: str) -> str:
    """The score as Markdown: rates, parameter errors, held-out errors, confusion matrix."""
    lines = [f"## {title}", "", "| rate | hits / cases = rate [95 % interval] |", "|---|---|"]
    lines += [f"| {name} | {tally.text()} |" for name, tally in sorted(score.tallies.items())]
    if score.parameter_errors:
        lines += ["", "| parameter | cases | relative error, median (10th to 90th percentile) |", "|---|---|---|"]
        lines += [f"| {k} | {len(v)} | {quantiles(v)} |" for k, v in sorted(score.parameter_errors.items())]
    if score.held_out:
        lines += [
            "",
            "| held-out error, group | cases | before / noise | after / noise | after / best possible "
            "| after within 1.15 of the noise |",
            "|---|---|---|---|---|---|",
        ]
        for group, rows in sorted(score.held_out.items()):
            tally = Tally()
            for _, after, noise, _ in rows:
                tally.add(after <= 1.15 * noise)
            columns = [[b / n for b, _, n, _ in rows], [a / n for _, a, n, _ in rows], [a / f for _, a, _, f in rows]]
            lines.append(f"| {group} | {len(rows)} | " + " | ".join(map(quantiles, columns)) + f" | {tally.text()} |")
    lines += ["", "Confusion: rows are the truth, columns the first name given.", "", *confusion_table(score.confusion)]
    if score.problems:
        lines += ["", f"Failed cases: {len(score.problems)}", *(f"- {text}" for text in score.problems)]
    return "\n".join(lines) + "\n"


def confusion_table(confusion: Counter[tuple[str, str]]) -> list[str]:
    """Confusion matrix as lines of Markdown."""
    rows = sorted({row for row, _ in confusion})
    named = sorted({column for _, column in confusion} - set(OUTCOMES_ELSE))
    columns = [*named, *(c for c in OUTCOMES_ELSE if any(k == c for _, k in confusion))]
    lines = ["| truth \\ named | " + " | ".join(columns) + " |", "|---|" + "---|" * len(columns)]
    for row in rows:
        cells = [str(confusion[row, column] or "") for column in columns]
        lines.append(f"| {row} | " + " | ".join(cells) + " |")
    return lines


def score_cases(pairs: Iterable[tuple[dict[str, Any], Verdict]]) -> Score:
    """Score many cases."""
    score = Score()
    for answer, verdict in pairs:
        score_case(score, answer, verdict)
    return score
