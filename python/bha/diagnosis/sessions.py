"""Logs that stand apart: what differs from day to day is in none of them, and hides what moves.

What: rest lengths, a camera's tripod, the weather set whole logs off. The fit takes up what its own logs have in
common; held-out logs of another day then err by a constant, and a swing loses its phase. Where the logs of the fit are
fitted nearly to their noise, held-out logs are simulated as their days were (:mod:`bha.diagnosis.days`), and what that
leaves decides whether there is a gap at all. Where nothing is named by errors as they are, they count beyond what other
rest lengths, another place of the camera and an offset of each channel would make, of each log its own, for every model
alike, to first order; and where that is much of what is missed, it is said.
Limits: a law that does not hold where held-out logs are errs by a constant, too, if these hardly move. So no gap is
excused by where logs stand unless they move about as much as those of the fit, and stand within a small part of the
arm's length beside them: a wrong law then errs otherwise from pose to pose. What bends otherwise each time remembers,
and that is physics.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.holdout import rms_errors, share_removed
from bha.diagnosis.unlogged import mean_error

if TYPE_CHECKING:
    from bha.diagnosis.decide import GapTest
    from bha.diagnosis.refit import Trial
    from bha.estimation.records import Record

Array = NDArray[np.float64]

#: Share of the excess error of logs that is gone in their sessions from which on they stand apart.
MUCH = 0.5
#: Part of the motion of the logs of the fit that those have which are excused for where they stand, and the part of the
#: arm's length by which they are off at the most.
MOVES_ALIKE, NEAR = 0.5, 0.03

#: Mean square of the white residual of the logs of a fit beyond which a model lacks more than the day of others: of
#: plain arms of the wide world it is two at most.
LACKS = 4.0


def stand_apart(trial: Trial, in_sessions: Trial, noise: float) -> str:
    """What is to be said where held-out logs err mostly by what sets sessions apart; empty where they do not.

    Args:
        trial: a model, by its errors as they are.
        in_sessions: the same by errors beyond what sets sessions apart.
        noise: error of a right model, m RMS.
    """
    before, after = (rms_errors(own.prediction)[0] for own in (trial, in_sessions))
    if share_removed(before, after, noise) < MUCH:
        return ""
    return (
        f"{stands_off(trial)}, most of what is missed: sessions that differ (rest lengths, camera, weather), or a law "
        "that does not hold where those logs are"
    )


def stands_off(trial: Trial) -> str:
    """How far held-out logs stand off, in words."""
    return f"held-out logs stand {1e3 * _off(trial):.2g} mm (RMS) beside where those of the fit say"


def excused(trial: Trial, train: Sequence[Record]) -> bool:
    """Whether held-out logs may stand where they do without a law being wrong: they move as the logs of the fit do."""
    rest = sum(section["bellows"][0]["rest_length"] for section in trial.fit.model.core["section"])
    least = min(_motion([record]) for record in trial.holdout.problem.records)
    return _off(trial) <= NEAR * rest and least >= MOVES_ALIKE * _motion(train)


def leaves_noise(gap: GapTest, training: float, material: float) -> bool:
    """Whether what the day of a log leaves of its errors is noise, not only as little as noise.

    A slow effect hides best in what every log has of its own. It may be as far from noise as the logs of the fit are,
    where that is no gap either.

    Args:
        gap: of the log on its day.
        training: mean square of the white residual of the logs of the fit.
        material: RMS over noise from which a gap is worth a name.
    """
    return not gap.significant and gap.mean_square <= max(gap.limit, min(training, material**2))


def _off(trial: Trial) -> float:
    return mean_error(list(zip(trial.holdout.problem.records, trial.prediction.outputs, strict=True)))


def _motion(records: Sequence[Record]) -> float:
    """RMS of what is read about the mean of each channel over all logs, m."""
    read = np.concatenate([np.where(record.usable, record.measured, np.nan) for record in records])
    return float(np.sqrt(np.nanmean((read - np.nanmean(read, axis=0)) ** 2)))
