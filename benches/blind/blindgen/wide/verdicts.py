"""What the product said: a ``diagnosis.json`` of today or of earlier versions, read into one form.

``no_gap`` is read as ``equivalent`` and ``unknown`` as ``unexplained``. With ``one_of`` each effect has its class.
Setup faults are in ``setup`` (or ``faults``): tables with ``kind`` and ``where``, or plain words. Anything unusable is
``failed``, with the reason.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..scoring import EARLIER, number_in

VERDICTS = ("equivalent", "named", "one_of", "unexplained", "setup")
# A word of the first group must be in the name that a product gives to a fault of this kind.
FAULT_WORDS: dict[str, tuple[str, ...]] = {
    "tubes_swapped": ("tube", "chamber", "input", "pressures_swapped"),
    "sensors_swapped": ("sensor", "length", "wire", "head", "marker"),
    "azimuth": ("azimuth", "turned_section", "section_angle"),
    "gravity_sign": ("gravity",),
    "gauge_as_absolute": ("gauge", "absolute"),
    "camera_mirrored": ("mirror", "camera"),
}
# A clean refusal that says what is wrong with the setup is an answer, too.
REFUSALS = {"gauge_as_absolute": "gauge pressure"}


@dataclass
class Said:
    """A diagnosis as it is scored."""

    verdict: str
    effects: list[dict[str, Any]] = field(default_factory=list)
    faults: list[dict[str, Any]] = field(default_factory=list)
    before: float | None = None
    after: float | None = None
    seconds: float | None = None
    problem: str = ""

    @property
    def names(self) -> list[str]:
        """Kinds that are named, in the product's order."""
        return [str(e["kind"]) for e in self.effects]

    @property
    def classes(self) -> list[list[dict[str, Any]]]:
        """What is named, each with all that it was said not to be told from."""
        return [[e, *(dict(other) for other in e.get("one_of") or [])] for e in self.effects]

    @property
    def first(self) -> str:
        """First name, or the verdict without one."""
        return self.names[0] if self.effects else self.verdict

    def says_fault(self, kind: str) -> bool:
        """Whether a fault of this kind is said."""
        words = (kind, *FAULT_WORDS[kind])
        return any(word in str(f["kind"]).lower().replace(" ", "_") for f in self.faults for word in words)


def with_refusal(said: Said, line: str) -> Said:
    """The faults that an error's text names, where there is no diagnosis."""
    found = [kind for kind, words in REFUSALS.items() if words in line]
    if said.verdict == "failed" and found:
        said.faults = [{"kind": kind, "where": ""} for kind in found]
    return said


def _faults(data: dict[str, Any]) -> list[dict[str, Any]]:
    said = data.get("setup") or data.get("faults") or []
    said = [said] if isinstance(said, dict | str) else list(said)
    return [dict(x) if isinstance(x, dict) else {"kind": str(x), "where": ""} for x in said]


def read_said(path: Path) -> Said:
    """Read a ``diagnosis.json``."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        verdict = EARLIER.get(str(data["verdict"]), str(data["verdict"]))
        if verdict not in VERDICTS:
            raise ValueError(f"verdict {verdict!r}")
        effects = [dict(e) for e in (data.get("effects") or [])]
        for effect in effects:
            str(effect["kind"]), str(effect["where"])
        if verdict in ("named", "one_of") and not effects:
            raise ValueError(f"verdict {verdict!r} without an effect")
        faults = _faults(data)
        if verdict == "setup" and not faults:
            raise ValueError("verdict 'setup' without a fault")
        named = effects if verdict in ("named", "one_of", "setup") else []
        gap = dict(data.get("gap") or {})
        before, after = number_in(gap.get("before")), number_in(gap.get("after"))
        return Said(verdict, named, faults, before, after, number_in(data.get("seconds")))
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        return Said("failed", problem=f"{type(error).__name__}: {error}")
