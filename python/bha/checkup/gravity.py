"""The sign of gravity: an arm that hangs by its file and stands in the laboratory, or the reverse.

Two kinds of evidence. Poses: an arm with gravity as in the file and one with it reversed are each fitted to the poses
that the pressures hold (:mod:`bha.checkup.held`); numbers of the file that are wrong by what the weight does twice then
explain as much as they can. A weight acts on all sections at once, in one direction, and as large as a scale says. What
pulls an arm otherwise (a hose, a softer bellows) is physics and no fault: where the file with such physics explains as
much as gravity reversed does without it, nothing is said (:mod:`bha.checkup.rivals`).
Carrying over: the weight of an outer section that bends aside bends the inner ones too, back in an arm that hangs,
further in one that stands; the bending of the inner sections under the outer ones' pressures therefore has another
sign, whatever the rest lengths are. A spring between sections does the same.
Limits: arms of one section that hang or stand are hardly told; arms that are stiff for their weight do not tell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.checkup.finding import Explanation, Finding, Severity
from bha.checkup.held import finds, gain, held_fit, sure_gain, weighs_as_filed
from bha.checkup.mend import Mend
from bha.checkup.rivals import best_rival
from bha.checkup.wiring import LEAST_BALANCE, Evidence, Key, balance, explained
from bha.errors import BhaError

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.estimation.statics import Statics
    from bha.recordings import Recording

Array = NDArray[np.float64]

#: How much less poses must leave with gravity reversed (:func:`bha.checkup.held.gain`) than with the file as it is, and
#: than with the best physics of few numbers beside it: by what a search may end short of its best. From ``SOME`` on,
#: where that physics is not clearly better, it is a doubt. What is carried over may speak for it too, from ``BESIDE``
#: on; poses alone ask for ``ALONE`` in the place of ``BEYOND``. Table: docs/decisions/0013.
HELD, BEYOND, SOME, NOT_BEHIND = 0.05, 0.01, 0.12, 0.1
BESIDE, ALONE = 0.1, 0.03
#: Logarithm of how many times less the bending leaves unexplained with gravity reversed (product over the sections),
#: and what it is not expected to leave below.
CARRIED, CARRIED_FLOOR = 0.4, 0.003
#: Share of a section's bending that its own chambers must explain for this.
LEAST_FOLLOWED = 0.5
#: Correlation of two sections' drives from which on they count as driven in step.
DRIVEN_ALIKE = 0.7
#: Change of pressure over which the model's response is taken, Pa.
_STEP = 2e3


@dataclass(frozen=True)
class Signs:
    """What an arm with gravity reversed explains beyond that of the file: logarithms, see above.

    Attributes:
        held: how many times less it leaves of the poses.
        beyond: how many times less than the file with physics of few numbers; 0 where ``held`` says nothing.
        carried: how many times less of what outer sections bend the inner ones.
        weighs: whether it has found the poses, and with about the weight that the file says.
    """

    held: float
    beyond: float
    carried: float
    weighs: bool

    @property
    def by_poses(self) -> bool:
        """Whether the poses say that gravity is reversed."""
        beyond = BEYOND if self.carried > BESIDE else ALONE
        return self.weighs and self.held > HELD and self.beyond > beyond and self.carried > -CARRIED

    @property
    def by_carrying(self) -> bool:
        """Whether what is carried over says so; it counts where the poses are not against it."""
        return self.carried > CARRIED and not self.held < -HELD and not self.beyond < -BEYOND

    @property
    def doubted(self) -> bool:
        """Whether the poses would say so, were there no physics that explains them as well."""
        return self.weighs and self.held > SOME and self.beyond > -NOT_BEHIND and self.carried > -CARRIED

    @property
    def as_filed(self) -> bool:
        """Whether the sign is told, and is that of the file."""
        return self.carried < -CARRIED or self.held < -HELD

    def evidence(self) -> str:
        """The numbers as a sentence."""
        said = []
        if self.by_carrying:
            said.append(
                "what outer sections bend the inner ones by their weight has the other sign: with gravity reversed "
                f"{np.exp(self.carried):.2g} times less of the bending is unexplained"
            )
        if self.by_poses or self.doubted:
            beside = np.exp(abs(self.beyond))
            said.append(
                f"with gravity reversed poses are missed by {np.exp(self.held):.3g} times less, each way with the "
                "masses, stiffnesses and rest lengths that suit it best; springs, gains or offsets of single chambers "
                f"beside the file miss them by {beside:.3g} times {'more' if self.beyond > 0.0 else 'less'} than that"
            )
        return "; ".join(said)


def signs(arm: Arm, made: Sequence[Recording], pressures: Array, found: Evidence, filed: Statics | None) -> Signs:
    """Compare both signs of gravity; arguments as of :func:`gravity_findings`."""
    other_arm = arm.with_changes(gravity=[float(-g) for g in arm.parameters.gravity])
    other = held_fit(other_arm, made)
    held = sure_gain(arm, made, filed, other, HELD)
    beyond = gain(best_rival(arm, made, filed, other), other) if held > HELD else 0.0
    weighs = other is not None and finds(made, other) and weighs_as_filed(other)
    return Signs(held, beyond, carried_over(arm, other_arm, found, pressures), weighs)


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
    told = signs(arm, made, pressures, found, filed)
    if told.by_carrying:
        headline = "the arm moves as if gravity were reversed"
    elif told.by_poses:
        headline = "the arm rests as if gravity were reversed"
    elif told.doubted:
        headline = "the arm rests a little as if gravity were reversed"
    else:
        return [], told.as_filed
    severity: Severity = "fault" if told.by_carrying or told.by_poses else "warning"
    line = "gravity = [" + ", ".join(f"{-g + 0.0:g}" for g in gravity) + "]"
    what = "gravity points the other way: the arm hangs where the file lets it stand, or the reverse"
    explanations = [Explanation(what, line, Mend(arm={"gravity": [-float(g) + 0.0 for g in gravity]}))]
    if not told.by_carrying and np.hypot(*gravity[:2]) > 0.5 * np.linalg.norm(gravity):
        # Of an arm that lies, a force at its tip and its weight are hardly two things.
        held_up = "a hose or a cord holds the arm up with about twice its weight"
        explanations.append(Explanation(held_up, "nothing in the file: a log without it"))
    split = (
        "look at how the arm is mounted: the file's z axis runs along the straight arm, gravity = [0, 0, 9.81] hangs"
    )
    numbers = {"held": told.held, "beyond": told.beyond, "carried": told.carried}
    finding = Finding(severity, "gravity", where, headline, told.evidence(), numbers, tuple(explanations), (split,))
    return [finding], True


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
