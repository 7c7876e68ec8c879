"""What causes are called, and the lines that mend them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bha.checkup.causes import Cause
from bha.checkup.explain import Verdict
from bha.checkup.finding import Explanation, Finding
from bha.checkup.layout import Layout
from bha.checkup.mend import Mend
from bha.checkup.wiring import Evidence, as_filed, explained, explained_linear, explained_shares, seen_drive

Array = NDArray[np.float64]

#: Causes that are listed at the most.
MOST_LISTED = 6


def wiring_finding(
    verdict: Verdict, found: Evidence, columns: Sequence[str], camera: Array, where: str, *, alone: bool = False
) -> Finding | None:
    """The finding of a verdict, None where the file explains the motions as well as anything.

    Args:
        verdict: what came out.
        found: the evidence that it rests on.
        columns: of the log, for each input.
        camera: axes of the camera's frame as columns in the base frame, as the file says, shape (3, 3).
        where: name of the log or logs.
        alone: whether it is of one log among others that are right: then the arm's file is right, too.
    """
    layout = found.layout
    if verdict.causes:
        top = verdict.causes[0]
        listed = verdict.causes[:MOST_LISTED]
        explanations = tuple(explanation(cause, found, columns, camera, alone=alone) for cause in listed)
        what = _headline(top, layout)
        kind = "camera" if {c.kind for c in verdict.causes} == {"camera"} else "wiring"
        return Finding(
            "fault",
            kind,
            where,
            what,
            _evidence(verdict, found),
            _numbers(verdict),
            explanations,
            _splits(verdict.causes, found),
        )
    if verdict.unexplained:
        sections = ", ".join(str(i + 1) for i in verdict.unexplained)
        what = f"the bending of section {sections} follows the pressures, but not as its chambers push"
        repair = "pressurize one chamber after the other by hand and write down which way the section bends"
        return Finding(
            "warning", "wiring", where, what, _evidence(verdict, found), _numbers(verdict),
            (Explanation("two mistakes at once, or other chambers than the file says", repair),),
        )  # fmt: skip
    return None


def notes(verdict: Verdict, layout: Layout, where: str, least: float, most: float, errors: float) -> list[Finding]:
    """Turns that are sure, but too small to be a fault: between ``least`` and ``most`` deg."""
    said: list[Finding] = []
    if verdict.causes:
        return said
    for turn in verdict.turns:
        angle = float(np.degrees(turn.angle))
        if (
            turn.judged
            and least <= abs(angle) < most
            and abs(turn.angle) > errors * turn.error
            and turn.explained > 0.5
        ):
            what = (
                f"section {turn.section + 1} is seen turned by {angle:.0f} deg by its {turn.group}: "
                "a small error of azimuth or camera"
            )
            evidence = (
                f"{angle:.1f} ± {np.degrees(turn.error):.1f} deg, {100 * turn.explained:.0f} % of the bending explained"
            )
            numbers = {"angle_deg": angle, "error_deg": float(np.degrees(turn.error))}
            repair = f"{_angles_line(layout, turn.section, turn.angle)}, or [sensors] camera_rotation_deg"
            said.append(
                Finding("note", "wiring", where, what, evidence, numbers, (Explanation("azimuth or camera", repair),))
            )
    return said


def untold(verdict: Verdict, found: Evidence, columns: Sequence[str]) -> list[str]:
    """What these logs cannot tell, in sentences."""
    layout = found.layout
    said = []
    still = [columns[j] for j in range(len(columns)) if not found.moved[j]]
    if still:
        said.append(f"{', '.join(still)} hardly moved: which chambers they feed is not seen")
    if not found.groups:
        said.append("nothing moved enough with the pressures to tell tubes, azimuth or camera")
        return said
    if "heads" not in found.groups:
        said.append("heads are not measured: a camera's frame is not checked")
    elif "lengths" not in found.groups:
        said.append("lengths are not measured: turned or exchanged chambers and a turned or mirrored camera look alike")
    blind = sorted({t.section for t in verdict.turns} - {t.section for t in verdict.turns if t.judged})
    for i in blind:
        said.append(
            f"section {i + 1} bends too little, or its chambers were driven together or against each other: the places "
            "of its chambers are not checked"
        )
    kinds = {(c.kind, c.sections) for c in verdict.not_excluded}
    if any(kind == "camera" for kind, _ in kinds):
        said.append("motions lie in one plane: a mirrored camera would not show")
    for i in range(layout.section_count):
        if ("tubes", (i,)) in kinds and i not in blind:
            said.append(
                f"some exchange of tubes within section {i + 1} would not show: drive its chambers one after the other"
            )
    if any(kind in ("tubes_between", "sections") for kind, _ in kinds):
        said.append("some exchange of tubes between sections would not show: drive one section alone")
    return said


def explanation(
    cause: Cause, found: Evidence, columns: Sequence[str], camera: Array, *, alone: bool = False
) -> Explanation:
    """A cause in words, with the line that mends it; of a log that is ``alone`` at fault the log's, not the file's."""
    if cause.kind in ("tubes", "tubes_between", "sections"):
        said = _tubes(cause, found.layout, columns, alone=alone)
    elif cause.kind == "azimuth":
        said = _azimuth(cause, found)
    elif cause.kind == "camera":
        said = _camera(cause, camera, found.layout.base_rotation)
    else:
        said = _sensors(cause, found)
    if alone and cause.kind in ("azimuth", "camera"):
        said = replace(said, repair=f"a copy of the arm's file for this log alone, with {said.repair}", mend=None)
    return said if cause.count == 1 else replace(said, what=f"{said.what} ({cause.count} mistakes at once)")


def _tubes(cause: Cause, layout: Layout, columns: Sequence[str], *, alone: bool) -> Explanation:
    changed = {columns[j]: columns[k] for j, k in enumerate(cause.assignment.feeds) if j != k}
    lines = []
    for i in range(layout.section_count):
        feeds = [layout.inputs[int(np.argwhere(np.array(cause.assignment.feeds) == j)[0, 0])] for j in layout.fed_by[i]]
        if any(layout.inputs[j] != name for j, name in zip(layout.fed_by[i], feeds, strict=True)):
            degrees = np.degrees(layout.angles[i])
            tables = (f'angle_deg = {a:g}, input = "{name}"' for a, name in zip(degrees.round(3), feeds, strict=True))
            lines.append(f"section {i + 1}: " + "; ".join(tables))
    pairs = ", ".join(f"{a} to {b}" for a, b in changed.items())
    if cause.kind == "sections":
        what = f"tubes of sections {_list(cause.sections)} exchanged as a whole: {_arrows(changed)}"
    else:
        what = f"tubes exchanged: {_arrows(changed)}"
    repair = f"in the log's heading rename {pairs}"
    if not alone:
        repair += "; or in the arm's file write the [[section.bellows]] of " + ", those of ".join(lines)
    return Explanation(what, repair, Mend(renames=changed))


def _azimuth(cause: Cause, found: Evidence) -> Explanation:
    parts = ", ".join(
        f"section {i + 1} by {np.degrees(a):.0f} deg" for i, a in zip(cause.sections, cause.turns, strict=True)
    )
    watched = set(cause.assignment.turns)
    against = "" if watched == {"heads"} and "lengths" in found.groups else (
        " against the length sensors" if watched == {"lengths"} else ""
    )  # fmt: skip
    what = f"chambers at another azimuth than the file says{against}: {parts}"
    lines = "; ".join(_angles_line(found.layout, i, a) for i, a in zip(cause.sections, cause.turns, strict=True))
    angles = {i: _angles(found.layout, i, a) for i, a in zip(cause.sections, cause.turns, strict=True)}
    return Explanation(what, lines, Mend(angles=angles))


def _angles(layout: Layout, section: int, turn: float) -> tuple[float, ...]:
    angles = np.mod(np.degrees(layout.angles[section] + turn) + 180.0, 360.0) - 180.0
    return tuple(round(float(a), 0) + 0.0 for a in angles)


def _angles_line(layout: Layout, section: int, turn: float) -> str:
    text = ", ".join(f"angle_deg = {a:g}" for a in _angles(layout, section, turn))
    return f"[[section.bellows]] of section {section + 1}, in their order: {text}"


def _camera(cause: Cause, camera: Array, base: Array) -> Explanation:
    turn = cause.turns[0]
    seen = turned(turn, mirrored=cause.mirrored)
    axes = base @ seen.T @ camera
    whole = np.round(axes)
    what = f"camera mirrored (and turned by {round(float(np.degrees(turn)))} deg)" if cause.mirrored else (
        f"camera turned by {round(float(np.degrees(turn)))} deg about the arm's axis"
    )  # fmt: skip
    if np.allclose(axes, whole, atol=0.2) and abs(abs(np.linalg.det(whole)) - 1.0) < 1e-9:
        return Explanation(what, f"[sensors] camera_axes = {axes_text(whole)}", camera_mend(whole, None))
    if cause.mirrored:
        # The nearest axes, and what is left as a rotation before them: axes = R A.
        flip = np.diag([1.0, -1.0, 1.0])
        return Explanation(
            what,
            f"[sensors] camera_axes = {axes_text(flip)}, camera_rotation_deg = {rotation_text(axes @ flip)}",
            camera_mend(flip, axes @ flip),
        )
    return Explanation(what, f"[sensors] camera_rotation_deg = {rotation_text(axes)}", camera_mend(np.eye(3), axes))


def camera_mend(axes: Array, rotation: Array | None) -> Mend:
    """The camera's axes, a signed permutation, and its rotation (None for none) as a change of the file."""
    return Mend(
        arm={
            "sensors": {
                "camera_axes": axes_of(axes),
                "camera_rotation_deg": [0.0, 0.0, 0.0] if rotation is None else rotation_vector(rotation),
            }
        }
    )


def turned(angle: float, *, mirrored: bool = False) -> Array:
    """The map of base coordinates into those seen: turned about z after, perhaps, a mirror image in y."""
    c, s = np.cos(angle), np.sin(angle)
    matrix = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return matrix @ np.diag([1.0, -1.0, 1.0]) if mirrored else matrix


def axes_text(axes: Array) -> str:
    """A signed permutation of the base axes as ``camera_axes``: its columns."""
    return "[" + ", ".join(f'"{name}"' for name in axes_of(axes)) + "]"


def axes_of(axes: Array) -> list[str]:
    """A signed permutation of the base axes by the names of its columns."""
    names = []
    for column in axes.T:
        k = int(np.argmax(np.abs(column)))
        names.append(("-" if column[k] < 0 else "") + "xyz"[k])
    return names


def rotation_text(rotation: Array) -> str:
    """A rotation matrix as a rotation vector, deg, as text."""
    return "[" + ", ".join(f"{v:.1f}" for v in rotation_vector(rotation)) + "]"


def rotation_vector(rotation: Array) -> list[float]:
    """A rotation matrix as a rotation vector in whole degrees."""
    angle = float(np.arccos(np.clip((np.trace(rotation) - 1.0) / 2.0, -1.0, 1.0)))
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    if np.linalg.norm(axis) < 1e-9:  # half a turn: the axis is what stays
        values, vectors = np.linalg.eigh(0.5 * (rotation + rotation.T))
        axis = vectors[:, int(np.argmax(values))] if angle > 1.0 else np.array([0.0, 0.0, 1.0])
    vector = np.degrees(angle) * axis / np.linalg.norm(axis)
    return [round(float(v), 0) + 0.0 for v in vector]


def _sensors(cause: Cause, found: Evidence) -> Explanation:
    if cause.kind == "sensor_sections":
        source = cause.assignment.sources["lengths"]
        changed: dict[str, str] = {}
        for i, other in enumerate(source):
            changed |= dict(zip(found.length_places[i], found.length_places[other], strict=False)) if i != other else {}
        what = f"length sensors of sections {_list(cause.sections)} exchanged"
        return Explanation(what, f"in the log's heading rename {_pairs(changed)}", Mend(renames=changed))
    renamed: dict[str, str] = {}
    if cause.kind == "wires":
        names = found.linear["lengths"].names
        order = cause.assignment.channels["lengths"]
        renamed = {names[k]: names[c] for k, c in enumerate(order) if k != c}
    for i in cause.sections:
        turn, mirrored = cause.assignment.turns["lengths"][i], cause.assignment.mirrored["lengths"][i]
        renamed |= renames(found.length_places[i], turn, mirrored=mirrored)
    what = f"length sensors exchanged: {_arrows(renamed, 'shows')}"
    return Explanation(what, f"in the log's heading rename {_pairs(renamed)}", Mend(renames=renamed))


def renames(places: Mapping[str, float], turn: float, *, mirrored: bool) -> dict[str, str]:
    """Column to the length that it really shows, where a section's bending is seen turned and perhaps mirrored."""
    names, angles = list(places), np.array(list(places.values()))
    changed = {}
    for name, angle in zip(names, angles, strict=True):
        real = turn - angle if mirrored else angle - turn
        k = int(np.argmin(np.abs(np.angle(np.exp(1j * (angles - real))))))
        if names[k] != name:
            changed[name] = names[k]
    return changed


def _headline(top: Cause, layout: Layout) -> str:
    if top.kind in ("sections", "sensor_sections"):
        return f"sections {_list(top.sections)} move as if exchanged"
    if top.kind == "wires":
        return "length sensors do not move as their places say"
    if top.kind == "camera":
        return "all heads move " + (
            "in a mirrored frame" if top.mirrored else f"turned by {round(float(np.degrees(top.turns[0])))} deg"
        )
    if top.kind == "azimuth":
        parts = " and ".join(f"{np.degrees(a):.0f} deg" for a in top.turns)
        which = f"section{'s' * (len(top.sections) > 1)} {_list(top.sections)}"
        return f"the bending of {which} is turned by {parts} against the file"
    if len(top.sections) > 1:
        return f"sections {_list(top.sections)} do not bend as their chambers push by the file"
    return f"section {_list(top.sections)} does not bend as its chambers push by the file"


#: Change of a share of motion that is worth a word.
_WORTH_SAYING = 0.02


def _evidence(verdict: Verdict, found: Evidence) -> str:
    """How much of each bending the file explains, and the first explanation beside it."""
    top = verdict.causes[0] if verdict.causes else None
    parts = []
    for turn in verdict.turns:
        if not turn.judged or (top is not None and turn.section not in top.sections):
            continue
        said = (
            f"section {turn.section + 1} by {turn.group}: the file explains {100 * turn.as_filed:.0f} % of the bending"
        )
        if top is not None:
            drive = seen_drive(found.layout, top.assignment, turn.group)[0][turn.section]
            share = explained(found.blocks[turn.group, turn.section, "bending"], drive)
            said += f", this {100 * share:.0f} %"
        if turn.explained > 0.5 and abs(turn.angle) > 0.1:
            said += f" (it is turned by {np.degrees(turn.angle):.0f} ± {np.degrees(turn.error):.1f} deg)"
        parts.append(said)
    parts += _lengthening(top, found)
    for group, linear in found.linear.items():
        as_stated = explained_linear(found, as_filed(found.layout), group)
        said = f"{', '.join(linear.names[:3])}: the file explains {100 * as_stated:.0f} % of the motion"
        if top is not None:
            said += f", this {100 * explained_linear(found, top.assignment, group):.0f} %"
        parts.append(said)
    return "; ".join(parts)


def _lengthening(top: Cause | None, found: Evidence) -> list[str]:
    """The same of how sections lengthen, where an explanation changes what is explained of it."""
    if top is None:
        return []
    filed = explained_shares(found, as_filed(found.layout), top.sections)
    better, parts = explained_shares(found, top.assignment, top.sections), []
    for key in sorted(filed):
        (group, section, kind), before, after = key, filed[key], better[key]
        if kind == "length" and abs(after - before) >= _WORTH_SAYING:
            parts.append(
                f"section {section + 1} by {group}: {100 * before:.0f} % of its mean length, this {100 * after:.0f} %"
            )
    return parts


def _numbers(verdict: Verdict) -> dict[str, object]:
    return {
        "gain": verdict.gain,
        "turns": [
            f"{t.group} {t.section + 1}: {np.degrees(t.angle):.1f} deg, {t.explained:.3f}, as filed {t.as_filed:.3f}"
            for t in verdict.turns
            if t.judged
        ],
    }


def _splits(causes: Sequence[Cause], found: Evidence) -> tuple[str, ...]:
    kinds = {c.kind for c in causes}
    said = []
    if len(causes) < 2:
        return ()
    if kinds & {"tubes", "tubes_between", "sections", "azimuth"}:
        said.append("pressurize one chamber by hand and see which way the section bends: away from that chamber")
    if "camera" in kinds:
        said.append("move a marker by hand along the base frame's x axis, then y, and watch the camera's numbers")
    if kinds & {"sensors", "sensor_sections", "wires"}:
        said.append("pull one length sensor by hand and watch which column changes")
    if "azimuth" in kinds and "tubes" in kinds:
        said.append("compare each chamber's place on the arm with angle_deg in the file")
    return tuple(said)


def _arrows(changed: Mapping[str, str], verb: str = "feeds the chamber of") -> str:
    if len(changed) == 2 and list(changed.values()) == list(changed)[::-1]:
        return " and ".join(changed)
    return ", ".join(f"{a} {verb} {b}" for a, b in changed.items())


def _pairs(changed: Mapping[str, str]) -> str:
    return ", ".join(f"{a} to {b}" for a, b in changed.items())


def _list(sections: Sequence[int]) -> str:
    return " and ".join(str(i + 1) for i in sections)
