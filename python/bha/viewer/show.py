"""What is shown at the moment: a place in recorded motions, or an arm that moves under pressures as they are set."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.arrays import floats
from bha.control import Limits, Stepper
from bha.errors import InputError
from bha.viewer.motions import Moment

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.viewer.motions import Motion

Array = NDArray[np.float64]

#: A live arm never has to catch up with more than this, s: after a pause it goes on instead.
LONGEST_ADVANCE = 0.1
#: Less than this from one picture to the next is not seen, m, and Pa.
SEEN_LENGTH, SEEN_PRESSURE = 1e-6, 10.0


class Show:
    """A clock over recorded motions and a live arm; no thread, no window. Not for several threads at once.

    The live arm is a simulation that is stepped in real time (:class:`bha.control.Stepper`): it swings, and its
    commands pass through the arm's pneumatics.

    Attributes:
        arm: the arm.
        motions: what is recorded; the live arm stands in for the first.
        start, end: of the first motion, s; 0 without one.
        time: the moment that is shown, s.
        playing: whether time goes on.
        speed: how fast, 1 is as it was.
        repeat: whether it begins again at the end.
        commands: pressures that the live arm is set to, Pa absolute, shape (inputs,).
    """

    def __init__(self, arm: Arm, motions: Sequence[Motion] = ()) -> None:
        """At the start of the first motion; live if there is none."""
        self.arm, self.motions = arm, tuple(motions)
        self.start = float(self.motions[0].time[0]) if self.motions else 0.0
        self.end = float(self.motions[0].time[-1]) if self.motions else 0.0
        self.time, self.playing, self.speed, self.repeat = self.start, False, 1.0, True
        limits = Limits.of(arm)
        #: Ambient pressure, or what of the permitted range is nearest to it, Pa absolute, shape (inputs,).
        self.relaxed = np.clip(arm.parameters.ambient_pressure, limits.low, limits.high)
        self.commands = self.relaxed
        self._live: Stepper | None = None
        if not self.motions:
            self.go_live()

    @property
    def live(self) -> bool:
        """Whether the first arm moves under :attr:`commands`."""
        return self._live is not None

    def go_live(self) -> None:
        """Let the arm go on from the pose that is shown, at rest under the pressures of this moment."""
        stepper = Stepper(self.arm)
        if self.motions:
            moment = self.motions[0].at(self.time)
            known = np.isfinite(moment.pressures)
            self.commands = np.where(known, moment.pressures, self.commands)
            stepper.reset(self.commands, moment.lengths if np.isfinite(moment.lengths).all() else None)
        else:
            stepper.reset(self.commands)
        self._live, self.playing = stepper, False

    def go_back(self) -> None:
        """Show the recorded motion again.

        Raises:
            InputError: there is none.
        """
        if not self.motions:
            raise InputError("nothing is recorded; give the viewer a log or a trajectory")
        self._live = None

    def recover(self) -> None:
        """Begin again after the live arm has diverged: the recorded motion, or the arm relaxed."""
        self.commands, self._live = self.relaxed, None
        if not self.motions:
            self.go_live()

    def command(self, pressures: ArrayLike) -> None:
        """Set what the live arm is commanded, Pa absolute, shape (inputs,).

        Raises:
            InputError: another shape, or a value that is negative or not finite.
        """
        given = floats(pressures, "pressures", (len(self.arm.inputs),))
        if (given < 0.0).any():
            k = int(np.argmin(given))
            raise InputError(f"pressures: {self.arm.inputs[k]} is {given[k]:g} Pa; pressures are absolute, 0 or more")
        self.commands = given.copy()

    def go_to(self, time: float) -> None:
        """Show another moment, s; beyond the ends these."""
        self.time = float(np.clip(time, self.start, self.end))

    def advance(self, seconds: float) -> bool:
        """Let so much time pass, s; whether something may have moved.

        Raises:
            SimulationError: the live arm diverges.
        """
        if self._live is not None:
            before, pressures = self._live.lengths, self._live.pressures
            self._live.step(self.commands, min(seconds, LONGEST_ADVANCE))
            still = np.abs(self._live.lengths - before).max() < SEEN_LENGTH
            return not (still and np.abs(self._live.pressures - pressures).max() < SEEN_PRESSURE)
        if not self.playing:
            return False
        time = self.time + self.speed * seconds
        if time >= self.end:
            self.playing = self.repeat and self.end > self.start
            time = self.start if self.playing else self.end
        self.time = time
        return True

    def moments(self) -> list[Moment]:
        """What is shown now, of each arm."""
        if self._live is None:
            return [motion.at(self.time) for motion in self.motions]
        lengths = self._live.lengths
        heads = self.arm.forward_kinematics(lengths)[0]
        first = Moment(lengths, self._live.pressures, heads, np.full_like(heads, np.nan))
        return [first, *(motion.at(self.time) for motion in self.motions[1:])]
