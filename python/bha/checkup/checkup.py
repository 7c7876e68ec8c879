"""Whether logs and an arm's file belong together: all checks, in the order in which one rests on the other."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.checkup.camera import Frame, frame_of
from bha.checkup.causes import NOTED_TURN
from bha.checkup.crossed import crossed
from bha.checkup.explain import LEAST_TURN, STANDARD_ERRORS, Verdict, judge
from bha.checkup.facts import LogFacts, facts_of, read_pressures
from bha.checkup.finding import Finding, merged, worst_first
from bha.checkup.geometry import geometry_findings
from bha.checkup.gravity import gravity_findings
from bha.checkup.held import held_fit, that_move
from bha.checkup.layout import MOST_SECTIONS, Layout, layout_of
from bha.checkup.mend import Mend, in_words, mended_arm, mended_log
from bha.checkup.one_log import OneLog, logs_apart
from bha.checkup.ranges import length_findings, pressure_findings
from bha.checkup.seen import Seen
from bha.checkup.sort_of_pressure import sort_of_pressure_findings
from bha.checkup.turned import turned_sections
from bha.checkup.wiring import Evidence, evidence
from bha.checkup.words import notes, untold, wiring_finding
from bha.errors import LogWarning
from bha.recordings import Recording, recordings
from bha.recordings.clock import follows_no_motion
from bha.support.shown import html_table

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.logs import Log
    from bha.recordings import PressureSort

Array = NDArray[np.float64]

#: Kinds of warnings that say what may be wrong between logs and file, not what is worth a look in one of them.
DOUBTED = ("gravity",)
#: Faults that are mended one after the other, at the most.
MOST_REPAIRS = 8
#: A pressure that was not read for longer than this, s, leaves the rows meanwhile out.
LONGEST_UNREAD = 1.0


@dataclass(frozen=True)
class Checkup:
    """What came out of checking logs against an arm's file.

    Attributes:
        arm_name: name of the arm.
        logs: what each log holds.
        findings: what is to be said, faults first.
        untold: what these logs cannot tell, in sentences.
        recordings: the logs as the arm sees them.
        evidence: what motions follow which pressures; None where nothing was to be compared.
        verdict: what explains the motions; None likewise.
        arm: the arm, as it was checked.
        repairs: what was mended before that, in sentences; see :func:`repaired`.
    """

    arm_name: str
    logs: tuple[LogFacts, ...]
    findings: tuple[Finding, ...]
    untold: tuple[str, ...]
    recordings: tuple[Recording, ...]
    evidence: Evidence | None
    verdict: Verdict | None
    arm: Arm
    repairs: tuple[str, ...] = ()

    @property
    def faults(self) -> tuple[Finding, ...]:
        """Findings by which logs and file do not belong together as they are."""
        return tuple(finding for finding in self.findings if finding.severity == "fault")

    @property
    def doubts(self) -> tuple[Finding, ...]:
        """Warnings that are faults where the arm's model leads nowhere as the file has it."""
        return tuple(f for f in self.findings if f.severity == "warning" and f.kind in DOUBTED)

    def warn(self, stacklevel: int = 2) -> None:
        """Warn of each fault and each warning (:class:`bha.LogWarning`); notes are left out."""
        for finding in self.findings:
            if finding.severity != "note":
                warnings.warn(str(finding), LogWarning, stacklevel=stacklevel + 1)

    def to_mapping(self) -> dict[str, Any]:
        """For JSON."""
        return {
            "arm": self.arm_name,
            "faults": len(self.faults),
            "repaired": list(self.repairs),
            "findings": [finding.to_mapping() for finding in self.findings],
            "not_told": list(self.untold),
            "logs": [log.to_mapping() for log in self.logs],
        }

    def __repr__(self) -> str:
        """Arm, logs and counts in one line."""
        counts = [f"{sum(f.severity == s for f in self.findings)} {s}s" for s in ("fault", "warning", "note")]
        return f"<Checkup of {self.arm_name!r}, {len(self.logs)} log{'s' * (len(self.logs) != 1)}: {', '.join(counts)}>"

    def _repr_html_(self) -> str:
        """Findings and what is not told, for notebooks."""
        rows = [(f.severity, f.kind, f.where, f.what) for f in self.findings]
        notes = [f"not told: {text}" for text in self.untold]
        return html_table(repr(self), ("severity", "kind", "where", "what"), rows, notes=notes)

    def __str__(self) -> str:
        """Findings and what is not told, as text."""
        lines = [line for finding in self.findings for line in finding.lines()]
        lines = lines or ["nothing found: file and logs belong together as far as these logs tell"]
        lines += [f"not told: {text}" for text in self.untold]
        return "\n".join(lines)


def check(
    arm: Arm,
    logs: Recording | Log | str | os.PathLike[str] | Sequence[Recording | Log | str | os.PathLike[str]],
    *,
    pressures: PressureSort | None = None,
    missing: bool = False,
) -> Checkup:
    """Check whether logs and an arm's file belong together; some tenths of a second.

    Pressures and lengths beside their ranges, gauge for absolute, units, implausible numbers of the file, the sign of
    gravity, tubes and length sensors exchanged, chambers at another azimuth, a camera turned, mirrored or elsewhere.
    What acts alike is said together with what tells it apart. See ``docs/guides/check.md``.

    Args:
        arm: the arm.
        logs: logs, paths or recordings, one or several.
        pressures: which pressures drive the arm, see :class:`bha.Recording`.
        missing: with paths: take NaN and empty cells of measured outputs as missing samples.

    Raises:
        LogError: a log cannot be read or lacks a pressure of the arm.
        InputError: there is no log.
    """
    # What a recording warns of stands among the findings here.
    made = recordings(arm, logs, pressures=pressures, missing=missing, warn=False)
    return check_recordings(arm, made)


def checked(
    arm: Arm,
    logs: Sequence[Recording | Log | str | os.PathLike[str]],
    *,
    pressures: PressureSort | None = None,
    missing: bool = False,
    repair: bool = False,
) -> Checkup:
    """Logs that are checked, and warned of: what identification and diagnosis begin with.

    ``repair`` mends what can be mended (:func:`repaired`); go on with the arm and recordings of the result.

    Raises:
        LogError: a log cannot be read or lacks a pressure of the arm.
        InputError: a recording is of another arm.

    Warns:
        LogWarning: logs and file do not belong together, or something else is to be doubted.
    """
    made = recordings(arm, logs, pressures=pressures, missing=missing, warn=False)
    found = repaired(arm, made) if repair else check_recordings(arm, made)
    found.warn(stacklevel=3)
    return found


def repaired(arm: Arm, made: Sequence[Recording]) -> Checkup:
    """Check, mend the first fault that a machine can mend, and check again, until there is none.

    Returns:
        The last check, with the mended arm and recordings, and what was mended. Faults that are left are in it.
    """
    found = check_recordings(arm, made)
    done: list[str] = []
    tried: set[str] = set()
    for _ in range(MOST_REPAIRS):
        fault = next((f for f in found.faults if _mend(f) is not None and f.what not in tried), None)
        mend = None if fault is None else _mend(fault)
        if fault is None or mend is None:
            break
        tried.add(fault.what)
        arm = arm if mend.of_log else mended_arm(arm, mend)
        again = [
            Recording(
                arm,
                mended_log(r.log, mend) if mend.of_log and fault.concerns(r.name) else r.log,
                pressures=r.pressures.sort,
                name=r.name,
                warn=False,
            )
            for r in found.recordings
        ]
        first, *others = fault.explanations
        done.append(in_words(first.what, [e.what for e in others], fault.where))
        found = check_recordings(arm, again)
    return replace(found, repairs=tuple(done))


def _mend(finding: Finding) -> Mend | None:
    """How a fault is mended by machine: as the first of its explanations says."""
    return finding.explanations[0].mend if finding.explanations else None


def check_recordings(arm: Arm, made: Sequence[Recording]) -> Checkup:
    """The same of recordings: what runs in front of identification and diagnosis."""
    layout = layout_of(arm)
    found = geometry_findings(arm)
    seen = []
    for recording in made:
        one = seen_of(recording)
        ranges = _ranges(arm, layout, recording, one)
        if not any(f.severity == "fault" and f.kind in ("gauge", "unit") for f in ranges):
            sort = _sort_of_pressure(arm, layout, recording, one)
            ranges = [
                finding for finding in ranges if not sort or finding.kind not in ("gauge", "pressure_range")
            ] + sort
        found += ranges
        seen.append(one)
    facts = tuple(facts_of(recording) for recording in made)
    for fact in facts:
        found += fact.findings()
    said: list[str] = []
    result: tuple[Evidence | None, Verdict | None] = (None, None)
    # Motions under pressures or in units that are wrong anyway would only repeat it.
    blocked = [f for f in found if f.severity == "fault" and f.kind in ("gauge", "unit", "pressure_range", "geometry")]
    movable = [one for one in seen if one.length_names or one.measured_heads()]
    still = [f"{r.name}: {why}" for r in made if (why := follows_no_motion(r.clock, r.time[0])) is not None]
    if not movable:
        why = still[0] if still else "neither lengths nor heads are measured"
        said.append(f"{why}: nothing but pressures is checked")
    elif arm.section_count > MOST_SECTIONS:
        said.append(f"arms of more than {MOST_SECTIONS} sections: tubes, azimuth, camera and gravity are not checked")
    elif any(f.kind == "geometry" for f in blocked):
        said.append("tubes, azimuth, camera and gravity are not checked before the file's numbers are right")
    else:
        more, said, result = _motions(arm, layout, made, movable, said, blocked)
        found += more
    return Checkup(arm.name, facts, worst_first(merged(found)), tuple(said), tuple(made), *result, arm)


def _motions(
    arm: Arm,
    layout: Layout,
    made: Sequence[Recording],
    seen: Sequence[Seen],
    said: list[str],
    blocked: Sequence[Finding],
) -> tuple[list[Finding], list[str], tuple[Evidence, Verdict]]:
    """Camera first, then wiring in the frame that was found, then gravity."""
    found: list[Finding] = []
    camera = layout.base_rotation.T @ made[0].observation.camera.matrix
    where = seen[0].name if len(seen) == 1 else "all logs"
    frames = [frame_of(arm, one, camera, one.name) for one in seen]
    odd = [frame for frame in frames if frame.findings]
    # One camera for all logs: said once, and believed where most logs say so.
    once = {(finding.kind, *sorted(finding.numbers)): finding for frame in odd for finding in frame.findings}
    found += once.values()
    believed = odd[0] if 2 * len(odd) > len(frames) else Frame.as_filed(seen[0])
    framed = [_reframed(one, believed) for one in seen]
    told = evidence(layout, framed)
    verdict = judge(told)
    columns = made[0].pressures.columns
    axes = believed.seen_by.T @ camera
    # One log at fault among others may cancel out in the sum; a camera that is wrong for all comes first.
    apart = [] if odd else logs_apart(layout, framed, verdict)
    faults = [fault for one in apart if (fault := _of_one_log(one, columns, axes, apart, seen)) is not None]
    found += faults
    if apart and (others := _others(framed, apart)):
        told = evidence(layout, others)
        verdict = judge(told)
        where = ", ".join(one.name for one in others)
    wiring = wiring_finding(verdict, told, columns, axes, where)
    used = _others(framed, apart) or framed
    pair = crossed(layout, used, told, verdict)
    if pair is not None:
        wiring, verdict = pair.finding(where), replace(verdict, causes=())
    if wiring is not None:
        found = _one_camera(found, wiring, [cause.kind for cause in verdict.causes])
    found += notes(verdict, layout, where, NOTED_TURN, LEAST_TURN, STANDARD_ERRORS)
    said = [*said, *untold(verdict, told, columns)]
    if apart and not verdict.causes:
        told, verdict = apart[0].found, apart[0].verdict
    if wiring is not None or faults or blocked or odd:
        said.append("the sign of gravity is not checked before the faults above are mended")
        return found, said, (told, verdict)
    moving = that_move(made)
    filed = held_fit(arm, moving)
    turned = turned_sections(arm, moving, told, verdict, filed)
    pressures = np.mean([one.pressures.mean(axis=0) for one in framed], axis=0)
    more, told_sign = gravity_findings(arm, moving, pressures, told, where, filed)
    if turned is not None and not any(finding.numbers["held"] > turned.gain for finding in more):
        # One explanation at a time: the next is looked for when this one is mended.
        verdict = replace(verdict, causes=(turned.cause,), gain=turned.gain)
        wiring = wiring_finding(verdict, told, columns, axes, where)
        more = [] if wiring is None else [wiring]
    found += more
    if not told_sign and not more:
        said.append("the sign of gravity: reversed it explains the poses about as well, with other numbers")
    return found, said, (told, verdict)


def _of_one_log(
    one: OneLog, columns: Sequence[str], axes: Array, apart: Sequence[OneLog], seen: Sequence[Seen]
) -> Finding | None:
    """The finding of one log that is at fault alone."""
    finding = wiring_finding(one.verdict, one.found, columns, axes, one.name, alone=bool(_others(seen, apart)))
    right = [log.name for log in _others(seen, apart)]
    if finding is None or not right:
        return finding
    names = ", ".join(right[:3]) + (f" and {len(right) - 3} more" if len(right) > 3 else "")
    return replace(finding, evidence=f"{finding.evidence}; {names} do{'es' * (len(right) == 1)} not show it")


def _others(logs: Sequence[Seen], apart: Sequence[OneLog]) -> list[Seen]:
    """The logs but those at fault alone."""
    wrong = {one.number for one in apart}
    return [one for k, one in enumerate(logs) if k not in wrong]


def _one_camera(found: list[Finding], wiring: Finding, kinds: Sequence[str]) -> list[Finding]:
    """The findings with that of the motions; what both say of the camera's axes is said once."""
    axes = [finding for finding in found if finding.kind == "camera" and "angle_deg" in finding.numbers]
    if not axes or kinds[:1] != ["camera"]:
        return [*found, wiring]
    (guess,) = axes[0].explanations
    explanations = tuple(
        replace(explanation, what=guess.what if kind == "camera" else f"{guess.what}, and {explanation.what}")
        for explanation, kind in zip(wiring.explanations, kinds, strict=False)
    )
    evidence = f"{axes[0].evidence}; {wiring.evidence}"
    whole = replace(axes[0], evidence=evidence, explanations=explanations, splits=wiring.splits)
    return [whole if finding is axes[0] else finding for finding in found]


def _reframed(seen: Seen, frame: Frame) -> Seen:
    """The log with heads in the frame, order and place that were found."""
    heads, good = seen.heads.copy(), seen.heads_good.copy()
    measured = seen.measured_heads()
    if len(measured) != len(frame.order):
        return seen
    heads[:, measured] = seen.heads[:, list(frame.order)]
    good[:, measured] = seen.heads_good[:, list(frame.order)]
    return replace(seen, heads=(heads + frame.shift) @ frame.seen_by, heads_good=good)


def _ranges(arm: Arm, layout: Layout, recording: Recording, seen: Seen) -> list[Finding]:
    found = pressure_findings(
        arm,
        layout.pressure_range,
        recording.name,
        recording.pressures.columns,
        recording.log.gauge_columns,
        recording.time,
        read_pressures(recording),
    )
    own = [k for k, output in enumerate(recording.outputs) if output.kind == "length" and output.number > 0]
    sections = [recording.outputs[k].section - 1 for k in own]
    values = np.where(recording.usable[:, own], recording.measured[:, own], np.nan)
    names = [recording.outputs[k].name for k in own]
    return found + length_findings(layout.length_range[sections], recording.name, names, recording.time, values)


def _sort_of_pressure(arm: Arm, layout: Layout, recording: Recording, seen: Seen) -> list[Finding]:
    """Gauge for absolute by the poses of the model; only where something was measured to compare with."""
    measured = seen.length_names or seen.measured_heads()
    if not measured or recording.arm.section_count > MOST_SECTIONS:
        return []
    gauge, columns = recording.log.gauge_columns, recording.pressures.columns
    return sort_of_pressure_findings(arm, seen, layout.pressure_range, gauge, columns)


def seen_of(recording: Recording) -> Seen:
    """What the checks look at of a recording."""
    observation, outputs = recording.observation, recording.outputs
    lengths = [k for k, output in enumerate(outputs) if output.kind == "length"]
    rows, measured, usable = recording.aligned
    n, base = recording.arm.section_count, recording.arm.parameters.base_pose
    heads = np.full((len(rows), n, 3), np.nan)
    good = np.zeros((len(rows), n), dtype=np.bool_)
    for i in range(n):
        own = {o.number: k for k, o in enumerate(outputs) if o.kind == "position" and o.section == i + 1}
        if len(own) == 3:
            columns = [own[axis] for axis in (1, 2, 3)]
            heads[:, i] = base.from_world(observation.camera.base_positions(measured[:, columns]))
            good[:, i] = usable[:, columns].all(axis=1) & np.isfinite(heads[:, i]).all(axis=1)
    driven = ~_undriven(recording)[rows]
    return Seen(
        name=recording.name,
        time=recording.time[rows],
        pressures=read_pressures(recording)[rows],
        length_names=tuple(outputs[k].name for k in lengths),
        length_rows=observation.rows,
        lengths=measured[:, lengths] - observation.offsets,
        lengths_good=usable[:, lengths] & np.isfinite(measured[:, lengths]) & driven[:, None],
        heads=heads,
        heads_good=good & driven[:, None],
    )


def _undriven(recording: Recording) -> NDArray[np.bool_]:
    """Rows in which some pressure was not read for so long that what drove the arm is not known."""
    lost = np.zeros(len(recording.time), dtype=np.bool_)
    for fact in recording.pressure_facts:
        for start, end in (*fact.frozen, *fact.dropouts):
            if end - start > LONGEST_UNREAD:
                lost |= (recording.time > start) & (recording.time <= end)
    return lost
