"""What is in the folder of a sweep, in few numbers: read partition by partition, in bounded memory."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError
from bha.sweeps.folder import manifest
from bha.sweeps.group import STATUSES
from bha.sweeps.partitions import numbers, partition_path, partitions_in, read_partition


@dataclass
class RunningMoments:
    """Count, mean, standard deviation and range of the finite numbers among those added.

    Added in pieces by the update of Chan, Golub and LeVeque (Algorithms for computing the sample variance, 1983).
    """

    count: int = 0
    mean: float = math.nan
    low: float = math.nan
    high: float = math.nan
    _squares: float = 0.0

    def add(self, values: NDArray[np.float64]) -> None:
        """Take numbers into account; those that are not finite do not count."""
        values = values[np.isfinite(values)]
        if not len(values):
            return
        mean, squares = float(values.mean()), float(((values - values.mean()) ** 2).sum())
        if self.count == 0:
            self.count, self.mean, self._squares = len(values), mean, squares
            self.low, self.high = float(values.min()), float(values.max())
            return
        total = self.count + len(values)
        difference = mean - self.mean
        self._squares += squares + difference**2 * self.count * len(values) / total
        self.mean += difference * len(values) / total
        self.count = total
        self.low, self.high = min(self.low, float(values.min())), max(self.high, float(values.max()))

    @property
    def standard_deviation(self) -> float:
        """That of the sample; NaN of fewer than two numbers."""
        return math.sqrt(self._squares / (self.count - 1)) if self.count > 1 else math.nan


@dataclass(frozen=True)
class Summary:
    """What is in the folder of a sweep.

    Attributes:
        folder: the folder.
        runs: runs of the whole sweep.
        done: runs that are there.
        partitions: partitions of the whole sweep.
        finished: partitions that are there.
        statuses: number of runs by status.
        metrics: of each metric unit and moments over the runs that are there and have it.
    """

    folder: Path
    runs: int
    done: int
    partitions: int
    finished: int
    statuses: dict[str, int]
    metrics: dict[str, tuple[str, RunningMoments]] = field(default_factory=dict)

    @property
    def complete(self) -> bool:
        """Whether all partitions are there."""
        return self.finished == self.partitions

    def to_mapping(self) -> dict[str, Any]:
        """For JSON; numbers that are not there are null."""
        return {
            "folder": str(self.folder),
            "runs": self.runs,
            "done": self.done,
            "partitions": self.partitions,
            "finished": self.finished,
            "complete": self.complete,
            "statuses": self.statuses,
            "metrics": {
                name: {
                    "unit": unit,
                    "count": moments.count,
                    "mean": _or_none(moments.mean),
                    "standard_deviation": _or_none(moments.standard_deviation),
                    "min": _or_none(moments.low),
                    "max": _or_none(moments.high),
                }
                for name, (unit, moments) in self.metrics.items()
            },
        }


def summarize(out: str | os.PathLike[str]) -> Summary:
    """Read what is in the folder of a sweep, finished or not.

    Raises:
        InputError: the folder holds no sweep, or what is in it is damaged.
        FileError: a file cannot be read.
        MissingExtraError: pyarrow is not installed.
    """
    folder = Path(out)
    found = manifest(folder)
    names = found.spec.metrics
    metrics = {name: (found.columns[name].unit, RunningMoments()) for name in names}
    statuses = dict.fromkeys(STATUSES, 0)
    finished = partitions_in(folder)
    for partition in finished:
        table = read_partition(folder, partition, found.fingerprint, ["status", *names])
        for entry in table.column("status").value_counts().to_pylist():
            if entry["values"] not in statuses:
                path = partition_path(folder, partition)
                raise InputError(f"{path}: status {entry['values']!r}; allowed: {', '.join(STATUSES)}")
            statuses[entry["values"]] += int(entry["counts"])
        for name, (_, moments) in metrics.items():
            moments.add(numbers(table, name))
    return Summary(
        folder=folder,
        runs=found.runs,
        done=sum(statuses.values()),
        partitions=found.partitions,
        finished=len(finished),
        statuses=statuses,
        metrics=metrics,
    )


def _or_none(number: float) -> float | None:
    return number if math.isfinite(number) else None
