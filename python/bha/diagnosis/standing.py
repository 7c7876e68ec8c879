"""Logs in which nothing is commanded and nothing moves: they show one pose, and there is nothing that a model misses.

What: an arm that is held where it stands is the model of such logs: it errs by no more than sensors do, or than an arm
is described at all. Which numbers put it there one pose does not tell: rest lengths, plates, markers, the camera,
weight; a fit of them would be a guess, and springs, damping, lags and memory show only in what moves. So nothing is
fitted, the verdict is equivalent, and where the file's arm would stand elsewhere, or have no room for its bellows
between its plates, that is said.
Limits: pressures and poses alike in all logs. Logs that stand under different pressures tell springs, and logs that
stand elsewhere under the same ones have a gap: both are diagnosed like any others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.checkup.facts import STEADY_PRESSURE, STEADY_TIME
from bha.diagnosis.baseline import without_room
from bha.diagnosis.decide import faults_in_words
from bha.diagnosis.describe import log_facts
from bha.diagnosis.preparation import LEAST_NOISE_SHARE, records_of
from bha.diagnosis.result import Diagnosis, Gap, plain
from bha.diagnosis.rules import MATERIAL
from bha.diagnosis.words import number
from bha.errors import BhaError
from bha.recordings.pose import pose, tells_state

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.checkup import Finding
    from bha.estimation.records import Record
    from bha.recordings import Recording

Array = NDArray[np.float64]

#: What says nothing, and what would.
UNTOLD = (
    "they show one pose, and tell nothing of springs, damping, lags, memory or any effect; logs that move would (bha "
    "excite writes pressures for them)"
)
#: Deviation of a measured pose against that which the pressures hold, m: what is measured decides.
_SURE = 1e-4


@dataclass(frozen=True, eq=False)
class Standing:
    """Logs in which an arm stands.

    Attributes:
        train: the training logs.
        held: the held-out logs.
        pose: the mean reading of each channel on the training logs, m, shape (C,).
        pressures: the mean pressures of the training logs, Pa, shape (inputs,).
        error: of an arm that is held there, on the held-out logs, m RMS.
        noise: of the sensors there, or how finely an arm is described where that is more, m RMS.
    """

    train: tuple[Record, ...]
    held: tuple[Record, ...]
    pose: Array
    pressures: Array
    error: float
    noise: float


def standing(logs: Sequence[Recording], holdout_logs: Sequence[Recording]) -> Standing | None:
    """The logs as ones in which the arm stands; None where pressures, forces or outputs move, in a log or between logs.

    An output stands where what it has about its mean on the training logs is no gap: at most 1.3 times the noise of its
    sensor or the finest that an arm is described, 0.03 % of what its kind may travel.

    Raises:
        InputError: the logs are none that can be diagnosed.
    """
    every = [*logs, *holdout_logs]
    if not _held(every):
        return None
    train, held = records_of(logs, holdout_logs)
    mean = np.nanmean(np.concatenate([_readings(record) for record in train]), axis=0)
    squares, noises = [], []
    for record in [*train, *held]:
        square = np.nanmean((_readings(record) - mean) ** 2, axis=0)
        least = finest(record, every[0].arm)
        if record.drive.forces is not None or record.changes or not np.all(square <= (MATERIAL * least) ** 2):
            return None
        squares.append(square)
        noises.append(least**2)
    pressures = np.mean([record.drive.pressures.mean(axis=0) for record in train], axis=0)
    own = slice(len(train), None)
    error, noise = (float(np.sqrt(np.mean(part[own]))) for part in (squares, noises))
    return Standing(tuple(train), tuple(held), mean, pressures, error, noise)


def finest(record: Record, arm: Arm) -> Array:
    """Noise of each channel, or how finely an arm is described: a share of what its kind may travel; m, shape (C,)."""
    spans = np.array([np.ptp(section.length_range) for section in arm.parameters.sections])
    travel = np.where(record.observation.is_length, spans.max(), spans.sum())
    return np.asarray(np.maximum(record.noise, LEAST_NOISE_SHARE * travel))


def _readings(record: Record) -> Array:
    """Readings that count, NaN for others, shape (k, C)."""
    return np.where(record.usable, record.measured, np.nan)


def _held(recordings: Sequence[Recording]) -> bool:
    """Whether no pressure moves, in a log or between logs: means over a second, by what a check calls steady."""
    spans = np.array([np.ptp(section.pressure_range) for section in recordings[0].arm.parameters.sections])
    means = []
    for recording in recordings:
        time, pressures = recording.drive.time, recording.drive.pressures
        edges = np.searchsorted(time, np.arange(time[0], time[-1], STEADY_TIME))
        counts = np.diff([*edges, len(time)])[:, None]
        means.append(np.add.reduceat(pressures, edges, axis=0) / counts)
    found = np.concatenate(means)
    return bool(np.all(np.ptp(found, axis=0) <= STEADY_PRESSURE * spans.min()))


def diagnosis(arm: Arm, found: Standing, faults: Sequence[Finding] = (), tolerance: float = 0.0) -> Diagnosis:
    """What is to be said of logs in which the arm stands.

    Args:
        arm: the file's arm.
        found: the logs.
        faults: by what logs and file do not belong together.
        tolerance: what does not matter, m.
    """
    what = "nothing is commanded and nothing moves in these logs, so that there is nothing that a model could miss"
    reason = f"{what}: {UNTOLD}"
    if faults:
        reason = f"{reason}; but {faults_in_words(faults)}"
    return Diagnosis.model_validate(
        {
            "schema": "bha-diagnosis/2",
            "verdict": "equivalent",
            "reason": reason,
            "effects": [],
            "gap": Gap(
                noise=found.noise,
                before=found.error,
                after=found.error,
                holdout=[record.name for record in found.held],
                significant=False,
                excess=0.0,
                excess_limit=0.0,
                tolerance=tolerance,
            ),
            "where": {},
            "candidates": [],
            "residual": {"notes": ["the error is that of an arm that is held where the training logs show it"]},
            "excitation": {"classes": [], "least_visible": [], "next_experiment": "any motion"},
            "plain": {},
            "setup": [*(fault.in_a_line() for fault in faults), *elsewhere(arm, found)],
            "logs": [plain(log_facts(r, "training")) for r in found.train]
            + [plain(log_facts(r, "held out")) for r in found.held],
        }
    )


def elsewhere(arm: Arm, found: Standing) -> list[str]:
    """Where the file's arm would stand otherwise: how far off, and whether its plates leave room; a text each."""
    record = found.train[0]
    observation = record.observation
    texts = []
    try:
        shown, _ = observation.at(arm, arm.static_lengths(found.pressures))
    except BhaError:
        texts.append("the file's arm has no pose that these pressures hold")
    else:
        off = np.abs(shown - found.pose)
        most = int(np.argmax(off))
        if off[most] > MATERIAL * finest(record, arm)[most]:
            texts.append(
                f"where the arm stands, {record.channels[most]} is {number(float(off[most]), 'm')} from where the "
                "file's arm would have it; which of rest lengths, plates, markers, camera, weight and the pressures' "
                "zero is otherwise than in the file one pose does not tell"
            )
    if tells_state(observation, len(arm.parameters.sections)):
        sure = np.full(len(found.pose), _SURE)
        if short := without_room(pose(arm, arm.parameters, observation, found.pose, sure, found.pressures)):
            section, length = short
            texts.append(
                f"the bellows of section {section} would be {number(length, 'm')} long by the file's arm: base_offset "
                "and head_offset leave no room between what was measured, so that plates or markers are not where the "
                "file says; measure them again before logs that move are diagnosed"
            )
    return texts
