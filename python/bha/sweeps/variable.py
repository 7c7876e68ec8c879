"""One thing that differs from run to run: a ``[[vary]]`` table of a sweep file."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from bha.parameters.base import NotNegative, Number, Positive, Switch, Table, key

Count = Annotated[int, Field(strict=True, ge=1, le=10**12)]
Distribution = Literal["uniform", "log_uniform", "normal", "log_normal", "choice"]
Spacing = Literal["linear", "log"]


class Variable(Table):
    """A ``[[vary]]`` table: one thing that differs from run to run."""

    what: str = key("the path of a parameter, or input..., initial...", "what varies", strict=True, min_length=1)
    distribution: Distribution | None = key(
        '"uniform", "log_uniform", "normal", "log_normal" or "choice"',
        "what it is drawn from",
        left_out="in a grid",
        default=None,
    )
    low: Number | None = key(
        "a number below high; > 0 where logarithms are taken",
        "least value; the other distributions are cut here",
        default=None,
    )
    high: Number | None = key(
        "a number above low", "greatest value; the other distributions are cut here", default=None
    )
    mean: Number | None = key("a number", 'with distribution "normal"', default=None)
    standard_deviation: Positive | None = key("a number > 0", 'with distribution "normal"', default=None)
    median: Positive | None = key("a number > 0", 'with distribution "log_normal"', default=None)
    log_standard_deviation: Positive | None = key(
        "a number > 0", 'that of the natural logarithm, with distribution "log_normal"', default=None
    )
    values: tuple[Number | Annotated[str, Field(strict=True)], ...] | None = key(
        "a list of numbers, or for input.log of names of logs",
        'with distribution "choice", or in a grid',
        default=None,
        min_length=1,
    )
    weights: tuple[NotNegative, ...] | None = key(
        "a list of numbers >= 0, one for each of values, not all zero",
        'with distribution "choice"',
        left_out="all alike",
        default=None,
    )
    count: Count | None = key("a whole number >= 1", "how many values from low to high, in a grid", default=None)
    spacing: Spacing | None = key('"linear" or "log"', "in a grid with low and high", left_out="linear", default=None)
    relative: Switch = key("true or false", "whether the numbers are factors of the file's value", default=False)

    @property
    def is_text(self) -> bool:
        """Whether it chooses among names instead of numbers."""
        return self.what == "input.log"
