"""What readers of foreign files give back: what a file has, and series of samples with their own times."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import BhaError, LogError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """A part of a foreign file that could be mapped.

    Attributes:
        source: its name in a mapping file.
        kind: type of its values, ``"float64"`` or ``"geometry_msgs/msg/Pose"``.
        shape: as text, ``"1000 x 3"``; empty for messages of one number.
        count: number of samples.
        rate: samples per second, or None.
        about: what else is known: frames, names, units.
        proposal: the value of a mapping file that fits it, as TOML; empty if nothing speaks for one.
    """

    source: str
    kind: str
    shape: str = ""
    count: int = 0
    rate: float | None = None
    about: str = ""
    proposal: str = ""


@dataclass(frozen=True)
class Series:
    """Samples that share their times.

    Attributes:
        source: where they come from, for errors: a topic, or the array that has the times.
        time: whole nanoseconds (int64) or seconds (float64), never decreasing.
        columns: values by heading, as the file has them.
    """

    source: str
    time: NDArray[Any]
    columns: dict[str, Array]


@dataclass(frozen=True)
class Foreign:
    """All that a mapping takes from a file.

    Attributes:
        series: with times of their own.
        notes: how it was read, a text each.
        doubts: what is odd, a text each.
    """

    series: tuple[Series, ...]
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


@dataclass
class Said:
    """What is to be said of a file while it is read."""

    notes: list[str] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)


@contextmanager
def named_faults(origin: str, what: str, advice: str = "") -> Iterator[None]:
    """What other libraries raise at a damaged file, as the package's own error.

    They raise errors of many kinds: of the system, of parsers, of memory that a damaged length asks for.
    """
    try:
        yield
    except BhaError:
        raise
    except Exception as error:
        said = " ".join(str(error).split()) or type(error).__name__
        text = f"{origin}: {what} is damaged, cut off or of a kind that cannot be read: {said[:300]}"
        raise LogError(f"{text}; {advice}" if advice else text) from error
