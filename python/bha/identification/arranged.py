"""Logs in the order of an identification: which session each is of, what was known to be otherwise, what is checked."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from bha.arm import Arm
from bha.checkup import Finding, checked
from bha.errors import InputError
from bha.estimation.conditions import Condition, changes_of
from bha.estimation.free import FreeParameter
from bha.estimation.records import Record, record
from bha.logs import Log
from bha.recordings import PressureSort, Recording
from bha.recordings.clock import follows_no_motion

_SESSION = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")


@dataclass(frozen=True)
class Arranged:
    """Records of the logs.

    Attributes:
        arm: the arm that they are of: the file's, or as it was mended.
        used: those to fit.
        held: those held out.
        repairs: what was mended, in sentences.
        faults: by what logs and file do not belong together, in sentences.
    """

    arm: Arm
    used: tuple[Record, ...]
    held: tuple[Record, ...]
    repairs: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


def arranged(
    arm: Arm,
    logs: Sequence[Log | Recording | Record],
    holdout: Sequence[Log | Recording | Record],
    *,
    sessions: Mapping[str, Sequence[str]] | None = None,
    changes: Mapping[str, Mapping[str, float]] | None = None,
    pressures: PressureSort | None = None,
    repair: bool = False,
) -> Arranged:
    """Records of logs that are checked, each with its session and its changes.

    Args:
        arm: the file's arm.
        logs: to be fitted.
        holdout: to be predicted.
        sessions: name of a session -> names of its logs.
        changes: name of a log -> path -> number.
        pressures: which pressures of the logs drive the arm; those of the first log for all if None.
        repair: mend first what a machine can mend, see :func:`bha.checkup.repaired`.

    Raises:
        InputError: a name that no log or more than one has, a log in two sessions, a log twice, or one whose rows
            follow no motion.
        LogError: a log lacks a pressure of the arm.
    """
    items: list[Log | Recording | Record] = [*logs, *holdout]
    repairs: tuple[str, ...] = ()
    faults: list[Finding] = []
    if repair:
        others = [item for item in items if not isinstance(item, Record)]
        if len(others) < len(items) or changes:
            what = "known changes of the arm" if changes else "records"
            raise InputError(f"repair: not with {what}; mend the file first, and give logs or recordings")
        checkup = checked(arm, others, pressures=pressures, repair=True)
        arm, repairs, items = checkup.arm, checkup.repairs, list(checkup.recordings)
        faults += checkup.faults
    names = [_name(item) for item in items]
    session_of: dict[int, str] = {}
    for session, members in (sessions or {}).items():
        if not _SESSION.fullmatch(session):
            raise InputError(f"session {session!r}: letters, digits, _ and - are allowed, a letter or digit first")
        for name in members:
            place = place_of(name, names)
            if place in session_of:
                raise InputError(f"{name}: of session {session_of[place]} and of session {session}; name it once")
            session_of[place] = session
    known = {place_of(name, names): changes_of(values) for name, values in (changes or {}).items()}
    made: list[Record] = []
    sort = pressures
    arms: dict[tuple[tuple[str, float], ...], Arm] = {(): arm}
    groups: dict[tuple[tuple[str, float], ...], list[Recording]] = {}
    for place, item in enumerate(items):
        session, values = session_of.get(place, ""), known.get(place, ())
        if isinstance(item, Record):
            made.append(replace(item, session=session or item.session, changes=values or item.changes))
            continue
        if values not in arms:
            arms[values] = Arm(Condition("", values).applied(arm.parameters))
        recording = _recording(arm, arms[values], item, sort)
        if (fault := follows_no_motion(recording.clock, recording.time[0])) is not None:
            raise InputError(f"{recording.name}: {fault}")
        sort = sort or recording.pressures.sort
        groups.setdefault(values, []).append(recording)
        made.append(record(arm, recording, session=session, changes=dict(values)))
    if not repair:
        for values, own in groups.items():
            faults += checked(arms[values], own).faults
    used, held = made[: len(logs)], made[len(logs) :]
    _check_once(used, held)
    said = [f"logs and file do not belong together: {fault.in_a_line()}" for fault in faults]
    return Arranged(arm, tuple(used), tuple(held), repairs, tuple(dict.fromkeys(said)))


def _name(item: Log | Recording | Record) -> str:
    if isinstance(item, Log):
        return item.path.name if item.path is not None else "<arrays>"
    return item.name


def _recording(arm: Arm, changed: Arm, item: Log | Recording, sort: PressureSort | None) -> Recording:
    """A log as the arm with its changes records it."""
    if isinstance(item, Log):
        return Recording(changed, item, pressures=sort, warn=False)
    if item.arm == changed:
        return item
    if item.arm != arm:
        raise InputError(f"{item.name}: a recording of {item.arm.name}, not of {arm.name}")
    return Recording(changed, item.log, pressures=item.pressures.sort, name=item.name, warn=False)


def place_of(name: str, names: Sequence[str]) -> int:
    """The place of the log of a name.

    Raises:
        InputError: no log, or more than one, has it.
    """
    places = [k for k, own in enumerate(names) if own == name]
    if len(places) != 1:
        what = "several logs have this name" if places else "no log has this name"
        raise InputError(f"{name}: {what}; the logs are {', '.join(names)}")
    return places[0]


def by_session(
    free: Iterable[FreeParameter | str],
    per_session: Iterable[FreeParameter | str],
    used: Sequence[Record],
    held: Sequence[Record],
) -> tuple[FreeParameter, ...]:
    """The free parameters with some of them once a session instead of once for all.

    What is named keeps the prior and bounds that it had as a shared one, unless it states its own.

    Raises:
        InputError: there are no two sessions, a log is of none, or a session has held-out logs alone.
    """
    shared = [f if isinstance(f, FreeParameter) else FreeParameter(f) for f in free]
    apart = [f if isinstance(f, FreeParameter) else FreeParameter(f) for f in per_session]
    if not apart:
        return tuple(shared)
    names = list(dict.fromkeys(rec.session for rec in used))
    what = ", ".join(f.path for f in apart)
    if lost := [rec.name for rec in (*used, *held) if not rec.session]:
        raise InputError(f"{what}: estimated session by session, and {', '.join(lost)} is of none; name its session")
    if len(names) < 2:
        raise InputError(f"{what}: estimated session by session, and all logs are of session {names[0]}; name two")
    if untold := sorted({rec.session for rec in held} - set(names)):
        raise InputError(
            f"{what}: estimated session by session, and no log of session {untold[0]} is fitted; fit one, or leave its "
            "held-out logs aside"
        )
    stated = {f.path: f for f in apart}
    before = {f.path: f for f in shared}
    kept = [f for f in shared if f.path not in stated]
    for path, parameter in stated.items():
        bare = parameter == FreeParameter(path)
        kept += [replace(before.get(path, parameter) if bare else parameter, sessions=(name,)) for name in names]
    return tuple(kept)


def _check_once(used: Sequence[Record], held: Sequence[Record]) -> None:
    """A log that counts twice makes intervals too narrow; one that is fitted is no test."""
    seen: dict[str, str] = {}
    for rec, place in [*((r, "fitted") for r in used), *((r, "held out") for r in held)]:
        if rec.sha256 is None:
            continue
        if rec.sha256 in seen:
            text = f"{rec.name}: the same log is {seen[rec.sha256]} already"
            raise InputError(f"{text}, and {place} again; name every log once")
        seen[rec.sha256] = place
