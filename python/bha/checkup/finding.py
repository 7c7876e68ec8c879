"""Findings: what is wrong, how badly, by which numbers, and which lines repair it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

from bha.checkup.mend import Mend

Severity = Literal["fault", "warning", "note"]
#: From the worst on.
SEVERITIES: tuple[Severity, ...] = ("fault", "warning", "note")


@dataclass(frozen=True)
class Explanation:
    """One of the mistakes that explain a finding.

    Attributes:
        what: the mistake.
        repair: the line that mends it: of the arm's file, of the log's heading, or an option.
        mend: the same as data, where a machine can make it.
    """

    what: str
    repair: str
    mend: Mend | None = None


@dataclass(frozen=True)
class Finding:
    """Something that is to be said of logs and a file together.

    Attributes:
        severity: ``"fault"`` (they do not belong together as they are), ``"warning"`` (results may be wrong) or
            ``"note"``.
        kind: ``"gauge"``, ``"pressure_range"``, ``"length_range"``, ``"unit"``, ``"geometry"``, ``"wiring"``,
            ``"camera"``, ``"gravity"``, ``"samples"`` or ``"columns"``.
        where: ``"arm file"``, or the log's name, or ``"all logs"``.
        what: a sentence.
        evidence: the numbers, as text.
        numbers: the numbers, for machines.
        explanations: mistakes that explain it; several where they act alike, the likeliest first.
        splits: what would tell these explanations apart.
        logs: names of the logs that it concerns where ``where`` does not have them all.
    """

    severity: Severity
    kind: str
    where: str
    what: str
    evidence: str = ""
    numbers: dict[str, Any] = field(default_factory=dict)
    explanations: tuple[Explanation, ...] = ()
    splits: tuple[str, ...] = ()
    logs: tuple[str, ...] = ()

    def concerns(self, name: str) -> bool:
        """Whether it is of a log of that name."""
        return self.where == "all logs" or name in (self.logs or self.where.split(", "))

    def lines(self) -> Iterator[str]:
        """The finding as lines of text."""
        yield f"{self.severity}, {self.where}: {self.what}"
        if self.evidence:
            yield f"  evidence: {self.evidence}"
        several = len(self.explanations) > 1
        for number, explanation in enumerate(self.explanations, start=1):
            yield f"  {f'{number}. ' if several else ''}{explanation.what}"
            yield f"     repair: {explanation.repair}"
        for split in self.splits:
            yield f"  to tell them apart: {split}"

    def in_a_line(self) -> str:
        """The finding with what mends it, without its evidence."""
        causes = " or ".join(f"{e.what} (repair: {e.repair})" for e in self.explanations)
        return f"{self.where}: {self.what}" + (f": {causes}" if causes else "")

    def __str__(self) -> str:
        """The finding as text."""
        return "\n".join(self.lines())

    def to_mapping(self) -> dict[str, Any]:
        """For JSON; numbers that are not finite become None."""
        mapping = asdict(self)
        mapping["numbers"] = {key: _finite(value) for key, value in self.numbers.items()}
        for explanation, written in zip(self.explanations, mapping["explanations"], strict=True):
            written["mend"] = explanation.mend is not None
        return mapping


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return value


def merged(findings: Sequence[Finding]) -> list[Finding]:
    """Findings that say the same of several logs said once, in the order of the first ones."""
    groups: dict[tuple[Any, ...], list[Finding]] = {}
    for finding in findings:
        said = tuple((explanation.what, explanation.repair) for explanation in finding.explanations)
        groups.setdefault((finding.severity, finding.kind, finding.what, said), []).append(finding)
    return [
        group[0]
        if len(group) == 1
        else replace(group[0], where=", ".join(_shown([f.where for f in group])), logs=tuple(f.where for f in group))
        for group in groups.values()
    ]


def _shown(names: list[str]) -> list[str]:
    return names if len(names) <= 4 else [*names[:3], f"and {len(names) - 3} more logs"]


def worst_first(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Faults, then warnings, then notes; otherwise in their order."""
    return tuple(sorted(findings, key=lambda finding: SEVERITIES.index(finding.severity)))
