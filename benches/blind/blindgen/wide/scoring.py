"""Scores of diagnoses of the wide world, by group, with Wilson intervals.

What an answer has to be follows from the sealed numbers: an effect counts as one that can be found where the plain
model leaves more than 1.2 times what the true model leaves on the held-out logs (*shows*), and a plain arm as
*equivalent* below 1.1; in between both count as right where it matters. Names that are true although nothing was hidden
(the valves' lag under commands, mass along the arcs) are *excused*: never wrong, never counted as found.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ..lookalikes import look_alike
from ..scoring import Score, compare_parameters, confusion_table, quantiles
from .verdicts import Said

GROUPS = ("null", "single", "pair", "clutter", "refused", "setup", "setup_effect")
# Other places of a delay act alike, and a hose hangs at the last head anyway.
ANYWHERE = ("delay", "tool_drag", "base_tilt", "work_conjugate")


@dataclass(frozen=True)
class Run:
    """How a call of the product went: seconds, those of the processor, exit code, and what its output shows."""

    seconds: float | None = None
    cpu: float | None = None
    code: int | None = None
    timed_out: bool = False
    traceback: bool = False
    last_line: str = ""


@dataclass(frozen=True)
class Trial:
    """One case: the sealed answer, what was said, and how the call went."""

    answer: dict[str, Any]
    said: Said
    run: Run

    @property
    def group(self) -> str:
        """Group of the case."""
        return str(self.answer["spec"]["group"])

    @property
    def true(self) -> list[dict[str, Any]]:
        """Hidden effects of the catalogue, the dominant one first."""
        return [e for e in self.answer["effects"] if e["known"]]

    @property
    def wrong(self) -> list[str]:
        """Names that are neither there nor excused."""
        kinds = {e["kind"] for e in self.true} | set(self.answer["excused"])
        # Of a class one member is enough.
        classes = [[str(e["kind"]) for e in members] for members in self.said.classes]
        return [names[0] for names in classes if not any(n in kinds for n in names)]

    @property
    def first(self) -> str:
        """First name that is not excused, or the verdict."""
        for members in self.said.classes:
            names = [str(e["kind"]) for e in members]
            if names[0] not in self.answer["excused"]:
                return next((n for n in names if n in {e["kind"] for e in self.true}), names[0])
        return "excused name only" if self.said.names else self.said.verdict

    def near(self, name: str) -> bool:
        """Whether a name looks like something that is there."""
        return any(look_alike(name, e["kind"]) for e in self.true)


def canonical(where: str, kind: str, sections: int) -> str:
    """A place in one form: of a single section all of it is ``all``."""
    place = " ".join(where.lower().split())
    if kind in ANYWHERE or (sections == 1 and place == "section 1"):
        return "all"
    return place


def right_place(trial: Trial, named: dict[str, Any], true: dict[str, Any]) -> bool:
    """Whether an effect is named where it sits."""
    n = int(trial.answer["spec"]["sections"])
    kind = str(true["kind"])
    return canonical(str(named["where"]), kind, n) == canonical(str(true["where"]), kind, n)


def _count_null(score: Score, trial: Trial) -> None:
    limits, said = trial.answer["limits"], trial.said
    score.count("null: a wrong name (wanted: none)", bool(trial.wrong))
    if limits["equivalent"]:
        score.count("null, plain model equivalent: said so", said.verdict == "equivalent")
        score.count("null, plain model equivalent: a wrong name (wanted: none)", bool(trial.wrong))
    elif limits["shows"]:
        fine = said.verdict == "unexplained" or bool(said.names and not trial.wrong)
        score.count("null, but the plain model falls short: left unexplained, or an excused name", fine)


def _count_effects(score: Score, trial: Trial) -> None:
    group, said, limits = trial.group, trial.said, trial.answer["limits"]
    kinds = [e["kind"] for e in trial.true]
    if limits["equivalent"]:
        score.count(f"{group}, below what shows: equivalent or a right name", said.verdict == "equivalent" or (
            bool(said.names) and not trial.wrong))  # fmt: skip
    if limits["shows"]:
        label = f"{group}, shows"
        score.count(f"{label}: first name (or class) right", trial.first == kinds[0], trial.near(trial.first))
        score.count(f"{label}: abstained (unexplained or equivalent)", said.verdict in ("unexplained", "equivalent"))
        if len(kinds) > 1:
            score.count(f"{label}: at least one right", any(n in kinds for n in said.names))
        if group == "pair":
            score.count(
                f"{label}: exact set right", sorted(set(said.names) - set(trial.answer["excused"])) == sorted(kinds)
            )
    score.count(f"{group}: a wrong name (wanted: none)", bool(trial.wrong))


def _count_refused(score: Score, trial: Trial) -> None:
    score.count("refused: a name (wanted: none)", bool(trial.wrong))
    if trial.answer["limits"]["shows"]:
        score.count("refused, shows: kept as unexplained", trial.said.verdict == "unexplained")


def _count_setup(score: Score, trial: Trial) -> None:
    group, said, fault = trial.group, trial.said, trial.answer["fault"]
    shows = trial.answer["limits"]["fault"]["shows"]
    label = f"{group}: " if shows else f"{group}, below what shows: "
    score.count(label + "the fault is named", said.says_fault(fault["kind"]))
    score.count(label + "some setup fault is said", bool(said.faults))
    score.count(label + "a wrong name (wanted: none)", bool(trial.wrong))
    if group == "setup_effect" and trial.answer["limits"]["shows"]:
        score.count("setup_effect: the effect is named too", trial.true[0]["kind"] in said.names)


COUNTERS = {
    "null": _count_null,
    "single": _count_effects,
    "pair": _count_effects,
    "clutter": _count_effects,
    "refused": _count_refused,
    "setup": _count_setup,
    "setup_effect": _count_setup,
}


class WideScore(Score):
    """Counts of a set, seconds and failures beside them."""

    def __init__(self) -> None:
        """Begin with nothing."""
        super().__init__()
        self.seconds: list[float] = []
        self.cpu: list[float] = []
        self.ratios: dict[str, list[float]] = {}
        self.class_sizes: list[float] = []


def _failure(trial: Trial) -> str:
    run = trial.run
    if run.timed_out:
        return "timeout"
    return "traceback" if run.traceback else "error"


def _reason(trial: Trial) -> str:
    text = trial.run.last_line or ("" if trial.run.timed_out else trial.said.problem)
    return f": {text.removeprefix('error: ')}" if text else ""


def score_trial(score: WideScore, trial: Trial) -> None:
    """Add one case."""
    group, answer, said = trial.group, trial.answer, trial.said
    truth = str(answer["fault"]["kind"]) if answer["fault"] else group
    if group in ("single", "refused"):
        truth = str(answer["effects"][0]["kind"])
    score.confusion[truth, trial.first] += 1
    score.count("all: a diagnosis came", said.verdict != "failed")
    score.count("all: traceback (wanted: none)", trial.run.traceback)
    if said.verdict == "failed":
        sensors = f"{answer['spec']['sensors']}, {answer['spec']['pressures']}"
        score.problems.append(f"{answer['case']} ({group}; {sensors}): {_failure(trial)}{_reason(trial)}")
    COUNTERS[group](score, trial)
    for effect in trial.true:
        match = next((e for members in said.classes for e in members if e["kind"] == effect["kind"]), None)
        if match is not None:
            score.count("place right, of those named right", right_place(trial, match, effect))
            compare_parameters(score, effect, match)
    for seconds, cpu in [(trial.run.seconds, trial.run.cpu)] if said.verdict != "failed" else []:
        score.seconds += [] if seconds is None else [seconds]
        score.cpu += [] if cpu is None else [cpu]
    score.class_sizes += [float(len(members)) for members in said.classes]
    if said.after is not None:
        score.ratios.setdefault(group, []).append(said.after / answer["limits"]["true_model"])


def score_trials(trials: Iterable[Trial]) -> WideScore:
    """Score many cases."""
    score = WideScore()
    for trial in trials:
        score_trial(score, trial)
    return score


def spent(seconds: list[float], cpu: list[float]) -> list[str]:
    """Lines on the time that a case with a result took."""
    if not seconds:
        return []
    text = f"Seconds a case: {quantiles(seconds)}, at most {max(seconds):.0f}"
    return ["", text + (f"; of the processor: {quantiles(cpu)}, at most {max(cpu):.0f}." if cpu else ".")]


def report(score: WideScore, title: str) -> str:
    """The score as Markdown."""
    lines = [f"## {title}", "", "| rate | hits / cases = rate [95 % interval] |", "|---|---|"]
    lines += [f"| {name} | {tally.text()} |" for name, tally in sorted(score.tallies.items())]
    if score.ratios:
        lines += [
            "",
            "| held-out error after, over what the true model leaves | cases | median (10th to 90th) |",
            "|---|---|---|",
        ]
        lines += [f"| {k} | {len(v)} | {quantiles(v)} |" for k, v in sorted(score.ratios.items())]
    if score.parameter_errors:
        lines += ["", "| parameter | cases | relative error, median (10th to 90th) |", "|---|---|---|"]
        lines += [f"| {k} | {len(v)} | {quantiles(v)} |" for k, v in sorted(score.parameter_errors.items())]
    if score.class_sizes:
        lines += ["", f"Effects and places in a class: {quantiles(score.class_sizes)}."]
    lines += spent(score.seconds, score.cpu)
    lines += [
        "",
        "Rows are the truth, columns the first name given (that is not excused).",
        "",
        *confusion_table(score.confusion),
    ]
    if score.problems:
        lines += ["", f"Without a diagnosis: {len(score.problems)}", *(f"- {text}" for text in score.problems)]
    return "\n".join(lines) + "\n"
