"""How to fit."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from bha.estimation.problem import HUBER
from bha.runs.options import Method

#: Rows of an arm that creeps, s, and deviations of its initial lengths, m, and rates, m/s.
CREEPING_INTERVAL, CREEPING_STATES = 0.1, (1e-3, 5e-3)
#: What its model leaves lasts for 1.6 s, sixteen rows.
LASTING = 4.0


@dataclass(frozen=True)
class Settings:
    """How to fit.

    Attributes:
        windows: lengths of the windows of the successive stages, s; None in it is a whole log. None in its place: 0.75
            and 6 s; 6 s and whole logs where pressures have a memory of what was before a window (commands through
            pneumatics, a pressure lag): behind valves and chambers (``full``) a window begins as if they had been at
            rest, and to know a lag's past takes as long as a short window.
        huber: Huber's constant, in scales of the residuals; infinite for plain least squares.
        step: step of the integrator, s; chosen and checked if None.
        method: the integrator, ``"rk4"`` or ``"ros2"``; chosen if None (``"rk4"`` where only ``step`` is given).
        interval: rows closer together than this are thinned, s; what drives the arm keeps all its samples.
        max_iterations: most steps of the last stage (and at most 12 of the earlier ones).
        threads: threads of the simulations; all cores if None.
        state_deviation: standard deviations of initial lengths (m) and rates (m/s) of a window about what was measured
            there; as wide as :func:`bha.estimation.problem.state_deviations` if None. A model with a gap needs narrow
            ones where windows are long: initial states would make up for the gap, and a log that is predicted from its
            start has none to make up with.
        prediction_error: whether the noises are estimated with the model in a last stage, and residuals weighed by
            them; output error alone if not. None: where an arm of one section is driven by measured pressures and
            its lengths are measured; with more sections the search for sizes takes longer than the fit.
        draws: redrawn pressure noises for the standard errors; 0 leaves pressure noise out.
        seed: of the redrawn noises.
        lasting: by how much what the model leaves, beyond the noise, weighs less than an error that is another one in
            each row: the root of the number of rows for which it lasts. Priors count for more as it grows.
        pooled: whether what the model leaves weighs alike in all channels of a kind and all logs, by its root mean
            square, instead of in each by its robust spread. Where a model lacks physics in all it shows, a channel or a
            log that it happens to meet would else outweigh those that it misses.
    """

    windows: tuple[float | None, ...] | None = None
    huber: float = HUBER
    step: float | None = None
    method: Method | None = None
    interval: float = 0.0
    max_iterations: int = 40
    threads: int | None = None
    state_deviation: tuple[float, float] | None = None
    prediction_error: bool | None = None
    draws: int = 24
    seed: int = 0
    lasting: float = 1.0
    pooled: bool = False


def of_an_arm_that_creeps(settings: Settings) -> Settings:
    """Whole logs, from where they begin: what its model lacks lasts for seconds and must not become initial states.

    It is missed in all that is seen: no log and no channel is an outlier or a better one.
    """
    return replace(
        settings,
        windows=(None,),
        huber=math.inf,
        pooled=True,
        interval=max(settings.interval, CREEPING_INTERVAL),
        lasting=max(settings.lasting, LASTING),
        state_deviation=settings.state_deviation or CREEPING_STATES,
    )
