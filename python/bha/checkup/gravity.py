"""The sign of gravity: an arm that hangs by its file and stands in the laboratory, or the reverse.

Two kinds of evidence. Poses: an arm with gravity as in the file and one with it reversed are each fitted to the poses
that the pressures hold (:mod:`bha.checkup.held`); numbers of the file that are wrong by what the weight does twice then
explain as much as they can. Carrying over: the weight of an outer section that bends aside bends the inner ones too,
back in an arm that hangs, further in one that stands; the bending of the inner sections under the outer ones' pressures
therefore has another sign, whatever the rest lengths are.
Limits: arms of one section that hang or stand are hardly told; arms that are stiff for their weight do not tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.checkup.finding import Explanation, Finding, Severity
from bha.checkup.held import held_fit, sure_gain
from bha.checkup.mend import Mend
from bha.checkup.wiring import LEAST_BALANCE, Evidence, Key, balance, explained
from bha.errors import BhaError

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.estimation.statics import Statics
    from bha.recordings import Recording

Array = NDArray[np.float64]

#: How much less poses must leave with gravity reversed (:func:`bha.checkup.held.gain`): for a fault, for a doubt, and
#: for a doubt together with what is carried over. A real arm's poses, missed by hundreds of times the noise because it
#: creeps and sticks, gain up to 0.13 by a sign that is none; where the sign is told, arms gain 1 and more
#: (docs/decisions/0013).
HELD, HELD_SOME, HELD_LITTLE = 0.5, 0.12, 0.05
#: Logarithm of how many times less the bending leaves unexplained with gravity reversed (product over the sections),
#: alone and together with the poses, and what it is not expected to leave below.
CARRIED, CARRIED_LITTLE, CARRIED_FLOOR = 0.4, 0.2, 0.003
#: Share of a section's bending that its own chambers must explain for this.
LEAST_FOLLOWED = 0.5
#: Correlation of two sections' drives from which on they count as driven in step.
DRIVEN_ALIKE = 0.7
#: Change of pressure over which the model's response is taken, Pa.
_STEP = 2e3


def gravity_findings(
    arm: Arm, made: Sequence[Recording], pressures: Array, found: Evidence, where: str, filed: Statics | None
) -> tuple[list[Finding], bool]:
    """Whether gravity points the other way than the file says, and whether these logs tell its sign at all.

    Args:
        arm: the arm of the file.
        made: the logs.
        pressures: their means, Pa, shape (J,).
        found: what their motions follow.
        where: names of the logs.
        filed: the file's arm fitted to the poses.
    """
    gravity = np.asarray(arm.parameters.gravity)
    if not np.any(gravity):
        return [], True
    other_arm = arm.with_changes(gravity=[float(-g) for g in gravity])
    held = sure_gain(arm, made, filed, held_fit(other_arm, made), HELD_LITTLE)
    carried = carried_over(arm, other_arm, found, pressures)
    by_poses = held > HELD
    # What is carried over counts where the poses are not against it, and the less it need be the more they are for it.
    by_carrying = carried > CARRIED and not held < -HELD_LITTLE
    both = carried > CARRIED_LITTLE and held > HELD_LITTLE
    # Poses against what is carried over: then something else is wrong.
    if not (by_carrying or both or (held > HELD_SOME and carried > -CARRIED)):
        return [], carried < -CARRIED or held < -HELD_LITTLE
    said = []
    if by_carrying or both:
        said.append(
            "what outer sections bend the inner ones by their weight has the other sign: with gravity reversed "
            f"{np.exp(carried):.2g} times less of the bending is unexplained"
        )
    if held > HELD_SOME or both:
        said.append(
            f"with gravity reversed poses are missed by {np.exp(held):.2g} times less, each way with the masses, "
            "stiffnesses and rest lengths that suit it best"
        )
    line = "gravity = [" + ", ".join(f"{-g + 0.0:g}" for g in gravity) + "]"
    what = "gravity points the other way: the arm hangs where the file lets it stand, or the reverse"
    explanation = Explanation(what, line, Mend(arm={"gravity": [-float(g) + 0.0 for g in gravity]}))
    split = (
        "look at how the arm is mounted: the file's z axis runs along the straight arm, gravity = [0, 0, 9.81] hangs"
    )
    headline = (
        "the arm moves as if gravity were reversed" if by_carrying else "the arm rests as if gravity were reversed"
    )
    numbers = {"held": held, "carried": carried}
    # A little of each is what sections that are coupled leave too: that is a doubt and no fault.
    sure = by_carrying or (by_poses and carried > -CARRIED)
    severity: Severity = "fault" if sure else "warning"
    if not sure:
        headline = "the arm rests a little as if gravity were reversed"
    return [Finding(severity, "gravity", where, headline, "; ".join(said), numbers, (explanation,), (split,))], True


def carried_over(arm: Arm, other: Arm, found: Evidence, pressures: Array) -> float:
    """Logarithm of how many times less of the bending ``other`` leaves unexplained than ``arm``.

    The responses are those of the model's poses to each pressure about ``pressures`` (J,), each section's times a
    factor that is not negative.
    """
    layout = found.layout
    keys = [
        key
        for key in sorted(found.informative)
        if key[2] == "bending" and balance(found.blocks[key], layout.bending[key[1]]) >= LEAST_BALANCE
    ]
    # The bending must follow the pressures as the file says in the first place.
    keys = [key for key in keys if explained(found.blocks[key], layout.bending[key[1]]) >= LEAST_FOLLOWED]
    if arm.section_count < 2 or len({key[1] for key in keys}) < 2 or _driven_alike(found, keys):
        return 0.0
    left = []
    for one in (arm, other):
        response = bending_response(one, found, pressures)
        if response is None:
            return 0.0
        shares = [explained(found.blocks[key], response[key[1]]) for key in keys]
        left.append(sum(float(np.log(CARRIED_FLOOR + 1.0 - share)) for share in shares))
    return left[0] - left[1]


def _driven_alike(found: Evidence, keys: Sequence[Key]) -> bool:
    """Whether sections were driven in step, so that what one carries over to another cannot be told from its own."""
    drives = found.layout.bending
    for k, key in enumerate(keys):
        pp, _, _ = found.blocks[key].total()
        for other in keys[:k]:
            if other[1] == key[1]:
                continue
            own, theirs = drives[key[1]], drives[other[1]]
            power = np.real(own.conj() @ pp @ own) * np.real(theirs.conj() @ pp @ theirs)
            if abs(own.conj() @ pp @ theirs) > DRIVEN_ALIKE * np.sqrt(max(float(power), 1e-300)):
                return True
    return False


def bending_response(arm: Arm, found: Evidence, pressures: Array) -> NDArray[np.complex128] | None:
    """How the model's poses bend with each pressure, rad/Pa, shape (n, J), complex; None where it holds no pose."""
    n = arm.section_count
    made = np.empty((n, len(pressures)), dtype=np.complex128)
    for j in range(len(pressures)):
        step = np.zeros(len(pressures))
        step[j] = _STEP
        try:
            more, less = (arm.static_lengths(pressures + sign * step) for sign in (1.0, -1.0))
        except BhaError:
            return None
        change = ((more - less) / (2.0 * _STEP)).reshape(n, 3)
        turned = np.sum(change * np.exp(2j * np.pi / 3 * np.arange(3)), axis=1)
        made[:, j] = -(2.0 / 3.0) * turned / found.layout.coordinate_radius
    return made
