"""Whether pressures that are held between readings act as these stairs, or as something smooth: the arm tells.

A sensor that renews at 25 Hz in a log of 100 Hz holds readings of a smooth pressure; a valve that is set anew at 25 Hz
holds the pressure itself. Both logs look alike, but the arm does not: stairs shake it once a renewal. Three readings of
the pressures are simulated with the arm of the file: a curve through the readings, stairs that jump where a reading is
renewed, and stairs that rise between that row and the one before. What they and the measured outputs have in common
over a renewal is taken away, so that an arm which is somewhat wrong, or somewhere else, does not matter:

    ripple = (1 - mean over a renewal) three times;  share = <ripple of measured - curve, ripple of stairs - curve> /
    <ripple of stairs - curve, itself>.

It is 0 where the arm follows the curve, and 1 where it follows the stairs (the file's mass over the true one, or so,
where the file is wrong).
Limits: outputs at least twice as dense as the renewals, and a ripple that stands out of their noise: else the curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.errors import BhaError
from bha.parameters import paths
from bha.recordings.clock import later
from bha.recordings.compare import predicted
from bha.recordings.readings import Readings
from bha.recordings.samples import changes
from bha.runs.input import Input
from bha.runs.simulation import Simulation, concatenate

Array = NDArray[np.float64]
#: How stairs come into the model: with jumps in the rows of new readings, or straight from the row before.
Rise = Literal["hold", "linear"]

#: Share of the stairs' ripple from which the arm follows them: smooth pressures leave up to 0.15, stairs 0.4 or more.
FOLLOWS = 0.25
#: A share is told if it is this many of its standard deviations.
TOLD = 3.5
#: Outputs are dense if their readings are at most this part of a renewal apart.
DENSE = 0.6
#: Longest stretch that is simulated, s: where pressures move most.
LONGEST = 60.0
#: How often the mean over a renewal is taken away.
_TIMES = 3
#: Fewest readings of an output, and its noise, m, where it tells none.
FEWEST, LEAST_NOISE = 20, 1e-9
#: With fewer rows a renewal stairs between rows must leave clearly less than those in rows, else about as much.
FEW, CLEARLY, ALIKE = 8, 0.97, 1.003
#: What of the file's arm may be wrong when stairs are told from stairs, and by how much it is varied.
UNSURE, VARIED = ("section.*.mass", "section.*.damping", "section.*.stiffness.*", "section.*.bending_stiffness.*"), 1.2


@dataclass(frozen=True)
class Stairs:
    """The arm's answer.

    Attributes:
        share: of the ripple that stairs would cause, what the outputs have.
        deviation: its standard deviation by the outputs' noise.
        rise: the stairs that fit best.
        names: of the pressures that are held.
        renewal: how long, s.
    """

    share: float
    deviation: float
    rise: Rise
    names: tuple[str, ...] = ()
    renewal: float = 0.0

    @property
    def act(self) -> bool:
        """Whether the pressures act as stairs."""
        return self.share >= FOLLOWS and self.share >= TOLD * self.deviation

    @property
    def told(self) -> bool:
        """Whether the outputs tell stairs from a curve."""
        return self.act or self.deviation * TOLD < 1.0 - FOLLOWS

    def in_words(self) -> str:
        """For the notes of a recording."""
        return (
            f"{', '.join(self.names)} renewed every {self.renewal:.3g} s: held as they are, not a curve; the outputs "
            f"show {100.0 * self.share:.0f} % of how such steps would shake the file's arm"
        )


def stairs(recording: Readings) -> Stairs | None:
    """What the arm tells of held pressures; None where none is held, or no output is dense enough."""
    held = [fact for fact in recording.pressure_facts if fact.held > 0.0 and not fact.filled]
    if not held:
        return None
    renewal = max(fact.interval for fact in held)
    dense = [k for k, fact in enumerate(recording.facts) if 0.0 < fact.interval <= DENSE * renewal]
    if not dense:
        return None
    # Jumps in all rows would hold back what moves from row to row.
    moves = max(float(np.mean(changes(column))) for column in recording.drive_by("steps", "linear")[0].pressures.T)
    rises: tuple[Rise, ...] = ("hold", "linear") if moves <= DENSE else ("linear",)
    rows = _liveliest(recording)
    look = _Look(recording, rows, tuple(dense), renewal)
    try:
        curve = look.simulated(recording.acting, "curve", "linear")
        stepped = {rise: look.simulated(recording.acting, "steps", rise) for rise in rises}
        answers = [_share(look, curve, stepped[rise], rise) for rise in rises]
        told = [answer for answer in answers if answer is not None]
        if not told:
            return None
        best = max(told, key=lambda answer: answer.share / answer.deviation)
        if best.act and len(rises) > 1:
            left = {r: look.left(recording.acting, curve, stepped[r], r) for r in rises}
            # Untold, few rows a renewal are those of a loop that logs what it sets; many are read as commands are.
            few = renewal < FEW * recording.clock.interval
            rise: Rise = "linear" if left["linear"] < left["hold"] * (CLEARLY if few else ALIKE) else "hold"
            best = next((answer for answer in told if answer.rise == rise), best)
    except BhaError:
        return None
    return replace(best, names=tuple(fact.name for fact in held), renewal=renewal)


@dataclass(frozen=True)
class _Look:
    """Some rows and outputs of a recording in which ripples are looked at."""

    recording: Readings
    rows: slice
    dense: tuple[int, ...]
    renewal: float

    def simulated(self, arm: Arm, readings: Literal["curve", "steps"], rise: Rise) -> Array:
        """Outputs in the rows, from rest under the first pressures; shape (rows, C)."""
        drive, at = self.recording.drive_by(readings, rise)
        first, last = int(at[self.rows][0]), int(at[self.rows][-1]) + 1
        forces = None if drive.forces is None else drive.forces[first:last]
        part = Input(drive.time[first:last], drive.pressures[first:last], forces, drive.commanded)
        run = Simulation(arm, part).run(self.recording.time[self.rows])
        return predicted(self.recording, concatenate(list(run)))

    def ripples(self, tables: Sequence[Array]) -> Array:
        """Ripples of tables of outputs (rows, C) at the readings, over the noise; shape (readings, tables)."""
        recording, rows = self.recording, self.rows
        found = [np.empty((0, len(tables)))]
        for k in self.dense:
            good = np.flatnonzero(recording.usable[rows, k])
            time = recording.time[rows][good]
            forward = later(time)
            good, time = good[forward], time[forward]
            if len(good) < FEWEST:
                continue
            edge = 0.5 * _TIMES * self.renewal
            inside = (time > time[0] + edge) & (time < time[-1] - edge)
            noise = max(recording.facts[k].noise, recording.facts[k].quantum) or LEAST_NOISE
            found.append(
                np.column_stack([ripple(time, table[good, k], self.renewal)[inside] for table in tables]) / noise
            )
        return np.concatenate(found)

    @property
    def measured(self) -> Array:
        """The outputs in the rows, shape (rows, C)."""
        return self.recording.measured[self.rows]

    def left(self, arm: Arm, curve: Array, stepped: Array, rise: Rise) -> float:
        """Square of the ripple that some stairs leave, whatever the arm's masses, dampings and stiffnesses are."""
        tables = [self.measured - stepped, stepped - curve]
        for key in UNSURE:
            number = {
                path: VARIED * paths.get_value(arm.parameters, path) for path in paths.expand(arm.parameters, key)
            }
            if any(number.values()):
                varied = type(arm)(paths.with_values(arm.parameters, number))
                tables.append(self.simulated(varied, "steps", rise) - stepped)
        error, *causes = self.ripples(tables).T
        table = np.column_stack(causes)
        found = error - table @ np.linalg.lstsq(table, error, rcond=None)[0]
        return float(found @ found)


def _share(look: _Look, curve: Array, stepped: Array, rise: Rise) -> Stairs | None:
    error, caused = look.ripples([look.measured - curve, stepped - curve]).T
    square, product = float(caused @ caused), float(error @ caused)
    if not (np.isfinite(product) and square > 0.0):
        return None
    share = product / square
    variance = max(float(error @ error) - share * product, 0.0) / max(len(error) - 1, 1) / square
    return Stairs(share, max(float(np.sqrt(variance)), 1e-9), rise)


def ripple(time: Array, values: Array, renewal: float) -> Array:
    """What of ``values`` (m,) at ascending times comes and goes within a renewal, s."""
    for _ in range(_TIMES):
        area = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))])
        ends = [np.interp(time + shift * renewal, time, area) for shift in (-0.5, 0.5)]
        values = values - (ends[1] - ends[0]) / renewal
    return values


def _liveliest(recording: Readings) -> slice:
    """The rows of the longest stretch that is simulated, in which the pressures travel furthest."""
    time = recording.time
    if time[-1] - time[0] <= LONGEST:
        return slice(0, len(time))
    drive, at = recording.drive_by("curve", "linear")
    steps = np.abs(np.diff(drive.pressures[at], axis=0)).sum(axis=1)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    ends = np.searchsorted(time, time + LONGEST, side="right")
    first = int(np.argmax(travelled[ends - 1] - travelled))
    return slice(first, int(ends[first]))
