"""Logs that stand apart: what differs from day to day is in none of them, and hides what moves.

What: rest lengths, a camera's tripod, the weather set whole logs off. The fit takes up what its own logs have in
common; held-out logs of another day then err by a constant. Where that is most of what the best model leaves it is
said, and what is named may be so by errors about the mean of each log and channel, for every model alike.
Limits: a plain model that fits its own logs and fails elsewhere errs by a constant, too. So nothing is called
equivalent by errors about means.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bha.diagnosis.unlogged import MOST_OFFSET, mean_error, offset_of

if TYPE_CHECKING:
    from bha.diagnosis.refit import Trial


def stand_apart(best: Trial) -> str:
    """What is to be said where held-out logs err mostly by a constant under the best model; empty where they do not."""
    logs = list(zip(best.holdout.problem.records, best.prediction.outputs, strict=True))
    if not np.isinf(best.prediction.until).all() or offset_of(logs) < MOST_OFFSET:
        return ""
    return (
        f"held-out logs stand {1e3 * mean_error(logs):.2g} mm (RMS) beside where those of the fit say, most of what is "
        "missed: sessions that differ (rest lengths, camera, weather), or a law that does not hold where those logs are"
    )
