"""Where the camera's frame stands: axes, origin, unit and order of the heads, from where the heads are in the mean.

What: the model says where heads are under the mean pressures, roughly; a head on the other side of the base, a chain of
heads in the wrong order or a thousand times too long is told without any motion. Turns and mirror images about the
arm's own axis show in the motion only (``bha.checkup.explain``).
Limits: the model's pose is right to half a right angle and to half of the length; smaller errors are left to
identification. Where lengths are measured too, heads follow from them, and the frame is fitted to some degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import permutations, product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.checkup.finding import Explanation, Finding
from bha.checkup.mend import Mend
from bha.checkup.ranges import LENGTH_UNITS
from bha.checkup.seen import Seen
from bha.checkup.words import axes_text, camera_mend, rotation_text
from bha.errors import BhaError

if TYPE_CHECKING:
    from bha.arm import Arm

Array = NDArray[np.float64]

#: Angle, deg, between the line of heads and the model's from which on the axes are doubted, and at which they are
#: right.
DOUBTED, RIGHT = 55.0, 35.0
#: How much longer or shorter than the model a chain of heads is before its unit is doubted.
UNIT_DOUBT = 4.0
#: Offset of the camera's origin that is worth a warning, as a share of the arm's length.
FAR = 0.5
#: Most heads whose order is looked at.
_MOST_ORDERED = 5


@dataclass(frozen=True)
class Frame:
    """What was found of the camera's frame.

    Attributes:
        seen_by: matrix that takes base coordinates into those the log has, where the axes are wrong; else the unit
            matrix.
        order: for each measured head the head whose columns hold it.
        findings: what is to be said.
        shift: what is added to all heads to bring them to the base, m: roughly, and only where they are far off.
    """

    seen_by: Array
    order: tuple[int, ...]
    findings: tuple[Finding, ...]
    shift: Array = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def as_filed(cls, seen: Seen) -> Frame:
        """The frame that the file says."""
        return cls(np.eye(3), tuple(seen.measured_heads()), ())


def frame_of(arm: Arm, seen: Seen, camera: Array, where: str) -> Frame:
    """Check the mean places of the heads of a log against those of the model.

    Args:
        arm: the arm.
        seen: the log, heads in the base frame as the file places the camera.
        camera: axes of the camera's frame as columns in the base frame, as the file says.
        where: name of the log.
    """
    n = arm.section_count
    heads = seen.measured_heads()
    straight = Frame(np.eye(3), tuple(heads), ())
    if not heads:
        return straight
    means = np.array([np.median(seen.heads[seen.heads_good[:, i], i], axis=0) for i in heads])
    # A file that is off by factors may bend its arm anywhere: then the straight arm tells more.
    poses = [pose[heads] for pose in _predicted(arm, seen)]
    predicted = min(poses, key=lambda pose: _off(means, pose, _best_order(means, pose)))
    reach = float(np.linalg.norm(predicted[-1]))
    size = float(np.linalg.norm(means[-1]))
    travel = float(np.max([np.ptp(seen.heads[seen.heads_good[:, i], i], axis=0).max() for i in heads]))
    unit = _unit(heads, size, reach, travel, where) or _beyond_reach(arm, seen, camera, where)
    if unit is not None:
        return Frame(np.eye(3), tuple(heads), (unit,))
    # Two heads or more: the line between them knows no origin.
    if len(heads) > 1:
        order = _order(means, predicted)
        if order != tuple(range(len(heads))):
            return Frame(
                np.eye(3), tuple(heads[k] for k in order), (_exchanged(heads, order, means, predicted, where),)
            )
    line, expected = (
        (means[-1] - means[0], predicted[-1] - predicted[0]) if len(heads) > 1 else (means[0], predicted[0])
    )
    off = _angle(line, expected)
    near = 0.4 < size / reach < 2.0 or len(heads) > 1
    if off > DOUBTED and near:
        choices = [matrix for matrix in signed_axes() if _angle(matrix.T @ line, expected) < RIGHT]
        if choices:
            best = min(choices, key=lambda m: (np.linalg.det(m) < 0, np.abs(m - np.eye(3)).sum()))
            return Frame(best, tuple(heads), (_axes(arm, off, best, camera, line, where),))
    distance = float(np.linalg.norm(means[-1] - predicted[-1]))
    if distance > FAR * reach and len(heads) * n > 0:
        shift = predicted[-1] - means[-1]
        position = arm.parameters.base_pose.rotation_matrix @ shift
        what = f"head {heads[-1] + 1} is {1e3 * distance:.0f} mm from where the model has it: camera's origin?"
        line_text = f"[sensors] camera_position = [{', '.join(f'{v:.3f}' for v in position)}]"
        evidence = f"in the mean at {_millimetres(means[-1])} mm, by the model at {_millimetres(predicted[-1])} mm"
        numbers = {"distance": distance, "position": position.tolist()}
        found = Finding(
            "warning", "camera", where, what, evidence, numbers, (Explanation("camera's origin elsewhere", line_text),)
        )
        return Frame(np.eye(3), tuple(heads), (found,), shift)
    return straight


def signed_axes() -> list[Array]:
    """All 48 frames whose axes lie along those of the base, as matrices."""
    made = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            for k, (row, sign) in enumerate(zip(order, signs, strict=True)):
                matrix[row, k] = sign
            made.append(matrix)
    return made


def _predicted(arm: Arm, seen: Seen) -> list[Array]:
    """Heads (n, 3) of the straight arm at mean lengths and, where the model holds a pose, under the mean pressures."""
    sections = arm.parameters.sections
    poses = [np.repeat([np.mean(s.length_range) for s in sections], 3)]
    try:
        held = arm.static_lengths(np.nanmean(seen.pressures, axis=0))
        ranges = np.repeat([s.length_range for s in sections], 3, axis=0)
        if np.all(held > 0.3 * ranges[:, 0]) and np.all(held < 2.0 * ranges[:, 1]):
            poses.insert(0, held)
    except BhaError:
        pass  # the straight arm will do
    return [arm.parameters.base_pose.from_world(arm.forward_kinematics(q)[0]) for q in poses]


def _off(means: Array, predicted: Array, order: tuple[int, ...]) -> float:
    """How far heads, in an order, are from a pose: sum of squares, m^2."""
    return float(np.sum((means[list(order)] - predicted) ** 2))


def _best_order(means: Array, predicted: Array) -> tuple[int, ...]:
    """The order in which heads are nearest to a pose; the log's own of very many."""
    own = tuple(range(len(means)))
    orders = permutations(own) if len(own) <= _MOST_ORDERED else [own]
    return min(orders, key=lambda order: _off(means, predicted, order))


def _unit(heads: list[int], size: float, reach: float, travel: float, where: str) -> Finding | None:
    ratio = size / reach
    if 1.0 / UNIT_DOUBT < ratio < UNIT_DOUBT:
        return None
    fits = {f: unit for f, unit in LENGTH_UNITS.items() if 0.4 < ratio / f < 1.6 and travel / f < 2.0 * reach}
    if not fits or (ratio > 1 and travel < 2.0 * reach):
        return None
    columns = ", ".join(f"{axis}{heads[0] + 1}" for axis in "xyz")
    what = "head positions are not in the unit that their headings say"
    evidence = f"head {heads[-1] + 1} is {size:.4g} m from the base in the mean, the arm is about {reach:.3g} m long"
    (factor, *more) = fits
    names = [f"{axis}{i + 1}" for i in heads for axis in "xyz"]
    cause = Explanation(
        f"another unit: {' or '.join(fits.values())}",
        f"write the right unit in the headings of {columns}, ...: 'x{heads[0] + 1} [mm]'",
        None if more else Mend(factors=dict.fromkeys(names, 1.0 / factor)),
    )
    return Finding("fault", "unit", where, what, evidence, {"ratio": ratio}, (cause,))


def _beyond_reach(arm: Arm, seen: Seen, camera: Array, where: str) -> Finding | None:
    """Single coordinates of heads that travel further than the arm could take them, wherever the camera stands."""
    reaches = 2.0 * np.cumsum([section.greatest_length for section in arm.parameters.sections])
    over: dict[str, tuple[float, float]] = {}
    for i in seen.measured_heads():
        places = seen.heads[seen.heads_good[:, i], i] @ camera
        travels = np.ptp(np.quantile(places, [0.02, 0.98], axis=0), axis=0)
        over |= {f"{axis}{i + 1}": (float(t), float(reaches[i])) for axis, t in zip("xyz", travels, strict=True)}
    over = {column: (travel, reach) for column, (travel, reach) in over.items() if travel > reach}
    if not over:
        return None
    columns = ", ".join(over)
    column, (travel, reach) = next(iter(over.items()))
    units = [unit for factor, unit in LENGTH_UNITS.items() if 0.01 * reach < travel / factor < reach]
    return Finding(
        "fault",
        "unit",
        where,
        f"positions go further than the arm reaches: {columns}",
        f"{column} travels {1e3 * travel:.4g} mm; with lengths within length_range the arm takes that head "
        f"{1e3 * reach:.4g} mm at the most, from one side to the other",
        {"travel": travel, "reach": reach},
        (
            Explanation(
                f"another unit: {' or '.join(units)}" if units else "another unit, or no position of that head",
                f"write the right unit in the headings of {columns}: '{column} [mm]'",
            ),
        ),
    )


def _order(means: Array, predicted: Array) -> tuple[int, ...]:
    """The order of heads that makes the chain most like the model's; the log's own unless another is far better."""
    own, best = tuple(range(len(means))), _best_order(means, predicted)
    before = _off(means, predicted, own)
    steps = np.linalg.norm(np.diff(np.vstack([np.zeros(3), predicted]), axis=0), axis=1).min()
    return best if _off(means, predicted, best) < 0.35 * before and before > steps**2 else own


def _exchanged(heads: list[int], order: tuple[int, ...], means: Array, predicted: Array, where: str) -> Finding:
    changed = {
        f"{axis}{heads[k] + 1}": f"{axis}{heads[i] + 1}" for i, k in enumerate(order) if i != k for axis in "xyz"
    }
    what = "heads are exchanged: they follow one another in another order than sections do"
    evidence = "; ".join(
        f"head {i + 1} in the mean at {_millimetres(m)} mm, by the model at {_millimetres(p)} mm"
        for i, m, p in zip(heads, means, predicted, strict=True)
    )
    pairs = ", ".join(f"{a} to {b}" for a, b in changed.items())
    return Finding(
        "fault",
        "camera",
        where,
        what,
        evidence,
        {},
        (Explanation("columns of heads exchanged", f"in the log's heading rename {pairs}", Mend(renames=changed)),),
    )


def _axes(arm: Arm, off: float, seen_by: Array, camera: Array, line: Array, where: str) -> Finding:
    direction = line / np.linalg.norm(line)
    what = f"the line of heads points {off:.0f} deg away from the arm: the camera's axes are not the base frame's"
    evidence = (
        f"it points along ({', '.join(f'{v:.2f}' for v in direction)}) of the base frame, as the file places the camera"
    )
    axes = arm.parameters.base_pose.rotation_matrix @ seen_by.T @ camera
    whole = np.round(axes)
    along = np.allclose(axes, whole, atol=0.2)
    repair = (
        f"[sensors] camera_axes = {axes_text(whole)}"
        if along
        else f"[sensors] camera_rotation_deg = {rotation_text(axes)}"
    )
    found = Explanation(
        "axes of the camera exchanged, reversed or turned (or base and tip exchanged)",
        repair,
        camera_mend(whole, None) if along else camera_mend(np.eye(3), axes),
    )
    split = "the axes across the arm are a guess here; repair, and check again: its motions tell"
    return Finding("fault", "camera", where, what, evidence, {"angle_deg": off}, (found,), (split,))


def _angle(a: Array, b: Array) -> float:
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(a @ b / size, -1.0, 1.0)))) if size > 0.0 else 0.0


def _millimetres(position: Array) -> str:
    return "(" + ", ".join(f"{1e3 * v:.0f}" for v in position) + ")"
