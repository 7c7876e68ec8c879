"""Which time of a message counts, and whether its clock can be trusted.

A message has up to two times: the stamp in its header, when it was measured, by the clock of whoever measured; and when
it was recorded, by the clock of the recorder. Stamps are better where all mapped topics have them. Where one has none
all count as recorded, for two clocks in one log may differ by anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import LogError
from bha.logs.foreign.mapping import Stamp
from bha.logs.foreign.series import Said

#: Messages may come out of order by as much, ns: queues reorder, clocks that are set jump further.
_REORDERED = 500_000_000
#: Stamps and times of recording may drift apart by as much over a log, ns.
_DRIFT = 1_000_000_000

Times = NDArray[np.int64]


@dataclass(frozen=True)
class Stamps:
    """The times of some messages, ns since 1970.

    Attributes:
        source: what they are of, for errors.
        stamps: in their headers; 0 where there is none.
        received: when they were recorded.
        stamped: whether all have headers.
    """

    source: str
    stamps: Times
    received: Times
    stamped: bool


def times_of(
    origin: str, groups: Sequence[Stamps], asked: Stamp | None, said: Said
) -> tuple[list[Times], list[NDArray[Any]]]:
    """Times of each group, never decreasing, and the order of its messages in them.

    Raises:
        LogError: stamps are asked for but some are 0, or a clock was set back.
    """
    without = [g.source for g in groups if not g.stamped or not g.stamps.any()]
    use = asked or ("received" if without else "header")
    times: list[Times] = []
    orders: list[NDArray[Any]] = []
    for group in groups:
        stamps = use == "header" and group.source not in without
        time = group.stamps if stamps else group.received
        if stamps:
            _check_stamps(origin, group, said)
        order, late = _in_order(origin, group.source, time, "stamps" if stamps else "times of recording")
        if late:
            said.notes.append(f"{group.source}: messages out of order by up to {late * 1e-6:.3g} ms were sorted")
        times.append(time[order])
        orders.append(order)
    said.notes.append(_in_words(groups, use, asked, without))
    return times, orders


def _in_words(groups: Sequence[Stamps], use: Stamp, asked: Stamp | None, without: list[str]) -> str:
    if use == "header":
        delays = np.concatenate(
            [g.received - g.stamps for g in groups if g.source not in without] or [np.zeros(1, np.int64)]
        )
        text = "times are the stamps in the messages' headers"
        text += f", recorded a median of {np.median(delays) * 1e-6:.3g} ms after"
        return text + (f"; when recorded for {', '.join(without)}, which has no stamps" if without else "")
    text = "times are those at which messages were recorded"
    return text if asked else f"{text}, for {', '.join(without)} has no stamps"


def _check_stamps(origin: str, group: Stamps, said: Said) -> None:
    absent = group.stamps <= 0
    if absent.any():
        number = int(np.argmax(absent)) + 1
        raise LogError(
            f'{origin}: {group.source}, message {number} has the stamp 0; stamp = "received" under [time] of the '
            "mapping takes the times of recording instead"
        )
    delay = group.received - group.stamps
    step = np.abs(np.diff(delay)) if len(delay) > 1 else np.zeros(1, np.int64)
    number = int(np.argmax(step))
    if step[number] > _DRIFT:
        said.doubts.append(
            f"{group.source}: at message {number + 2} the stamps jump by {step[number] * 1e-9:.4g} s against the times "
            'of recording; was a clock set? stamp = "received" under [time] takes the latter'
        )


def _in_order(origin: str, source: str, time: Times, what: str) -> tuple[NDArray[Any], int]:
    """The order in which times do not decrease, and by how much they did, ns."""
    order = np.argsort(time, kind="stable")
    latest = np.maximum.accumulate(time)
    behind = latest - time
    worst = int(np.argmax(behind))
    late = int(behind[worst])
    if late > _REORDERED:
        raise LogError(
            f"{origin}: {source}, message {worst + 1}: the {what} go back by {late * 1e-9:.4g} s: a clock was set, or "
            "a simulation began anew. Cut the bag there, or choose the other times by stamp under [time]"
        )
    return order, late
