"""What an experiment hands back: figures, a table, and the paper's claims beside our numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper, or of ``docs/explanation/model.md``, and what came out here.

    Attributes:
        paper: what is claimed, in few words.
        ours: what was found, with numbers and units.
        holds: whether it agrees.
    """

    paper: str
    ours: str
    holds: bool


@dataclass(frozen=True)
class Table:
    """A table: headings and rows of text."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


@dataclass(frozen=True)
class Outcome:
    """Result of one experiment.

    Attributes:
        name: as on the command line, ``fig12``.
        title: a line.
        text: paragraphs that say what was done.
        claims: what the paper says and what was found.
        figures: file stem to (figure, caption).
        tables: to show below the figures.
        numbers: the numbers behind the claims, SI, by name.
    """

    name: str
    title: str
    text: str
    claims: Sequence[Claim] = ()
    figures: Mapping[str, tuple[Figure, str]] = field(default_factory=dict)
    tables: Sequence[Table] = ()
    numbers: Mapping[str, float] = field(default_factory=dict)
