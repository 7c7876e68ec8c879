"""Where on an arm an effect sits: ``all``, ``section 2``, ``bellows 32``, ``input p13``, ``sensors``, ``heads``.

The one spot where such texts are read and written; that of the core is ``rust/src/effects/place.rs``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

Sort = Literal["all", "section", "bellows", "input", "sensors", "heads"]

#: How a place of each sort is written, for errors.
WRITTEN: dict[Sort, str] = {
    "all": '"all"',
    "section": '"section N", as in "section 2"',
    "bellows": '"bellows IK" (section I, bellows K), as in "bellows 32" ("bellows 10_2" where one has two digits)',
    "input": '"input NAME", as in "input p13"',
    "sensors": '"sensors"',
    "heads": '"heads"',
}
_NUMBER = "[1-9][0-9]{0,3}"
_TEXT = re.compile(
    rf"all|sensors|heads|section (?P<section>{_NUMBER})|input (?P<input>p[0-9]+(?:_[0-9]+)?)"
    rf"|bellows (?:(?P<i>[1-9])(?P<k>[1-9])|(?P<ii>{_NUMBER})_(?P<kk>{_NUMBER}))"
)


@dataclass(frozen=True)
class Place:
    """A place on an arm.

    Attributes:
        sort: what sort of place it is.
        section: number of the section that it is, or that its bellows belongs to, from 1; else None.
        bellows: number of the bellows within the section, from 1; else None.
        input: name of the pressure input; else None.
    """

    sort: Sort = "all"
    section: int | None = None
    bellows: int | None = None
    input: str | None = None

    @classmethod
    def of_section(cls, section: int) -> Place:
        """A section, counted from 1."""
        return cls("section", section)

    @classmethod
    def of_bellows(cls, section: int, bellows: int) -> Place:
        """A bellows; sections and bellows count from 1."""
        return cls("bellows", section, bellows)

    @classmethod
    def of_input(cls, name: str) -> Place:
        """A pressure input, ``p13``."""
        return cls("input", input=name)

    @classmethod
    def read(cls, text: str) -> Place | None:
        """The place that a text is; None if it is none. Whether an arm has it is another question."""
        return _read(text)

    def __str__(self) -> str:
        """As a parameter file has it."""
        match self.sort:
            case "section":
                return f"section {self.section}"
            case "bellows":
                assert self.section is not None
                assert self.bellows is not None
                separator = "_" if max(self.section, self.bellows) > 9 else ""
                return f"bellows {self.section}{separator}{self.bellows}"
            case "input":
                return f"input {self.input}"
        return self.sort

    def parts(self, sort: str, inputs: Sequence[Sequence[str]]) -> list[Place]:
        """The places of sort ``sort`` that make up this one; itself where it has no such parts.

        Args:
            sort: ``"section"``, ``"bellows"`` or ``"input"``; any other has no parts.
            inputs: of the arm: for each section the input of each of its bellows.
        """
        if self.sort in ("bellows", "input"):
            return [self]
        sections = range(1, len(inputs) + 1) if self.section is None else [self.section]
        match sort:
            case "section":
                return [Place.of_section(i) for i in sections]
            case "bellows":
                return [Place.of_bellows(i, k) for i in sections for k in range(1, len(inputs[i - 1]) + 1)]
            case "input":
                return [Place.of_input(name) for name in dict.fromkeys(n for i in sections for n in inputs[i - 1])]
        return [self]

    def bellows_in(self, inputs: Sequence[Sequence[str]]) -> list[tuple[int, int]]:
        """The bellows that it is, holds or feeds: section and number, both from 0; ``inputs`` as in :meth:`parts`."""
        return [
            (i, k)
            for i, names in enumerate(inputs)
            for k, name in enumerate(names)
            if self.section in (None, i + 1) and self.bellows in (None, k + 1) and self.input in (None, name)
        ]


@lru_cache(maxsize=1024)
def _read(text: str) -> Place | None:
    found = _TEXT.fullmatch(text)
    if found is None:
        return None
    section, bellows = found["section"] or found["i"] or found["ii"], found["k"] or found["kk"]
    if bellows:
        return Place.of_bellows(int(section), int(bellows))
    if section:
        return Place.of_section(int(section))
    if found["input"]:
        return Place.of_input(found["input"])
    return Place("sensors" if text == "sensors" else "heads" if text == "heads" else "all")
