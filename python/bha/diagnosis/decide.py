"""The verdict: equivalent, a named effect, or a gap that nothing known explains. A wrong name is worse than the third.

What: the gap on held-out logs against what a right model with uncertain parameters would leave, and what the search
found against it.
Source: the error of a right model is sqrt(noise^2 + J Cov J^T + pressure-noise term); the last and first are in the
whitening, the middle one is added here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.holdout import Holdout, Prediction, rms_errors, share_removed
from bha.diagnosis.information import information
from bha.diagnosis.rules import MATERIAL
from bha.diagnosis.search import Search

if TYPE_CHECKING:
    from bha.checkup import Finding

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Thresholds:
    """Thresholds of the verdict; measured on tuning seeds, see docs/explanation/diagnosis.md.

    Attributes:
        deviations: standard deviations that the mean square has to lie above its expectation.
        model: relative uncertainty of the noise model, on the mean square.
        material: least gap, RMS over noise, that is worth a name. On the training logs the same, in the white residual,
            is a gap whatever the held-out logs say: uncertain parameters excuse an error there, not on the logs they
            were fitted to.
        closure: least share of the excess that several named effects must remove.
        half: the same of one effect alone, and where what is left would be no gap by itself, below ``material``.
        left: greatest error left over noise at which several effects with a closure below ``good_closure`` still count
            as an explanation.
        good_closure: closure from which on any error left is a matter of the effect's form.
        fine: gap over noise from which the sensors are so fine that no model of this kind comes near their noise: then
            the closure alone decides, and what is left is said.
    """

    deviations: float = 4.0
    model: float = 0.06
    material: float = MATERIAL
    closure: float = 0.7
    half: float = 0.5
    left: float = 2.5
    good_closure: float = 0.8
    fine: float = 100.0


def tolerant(limits: Thresholds, tolerance: float, noise: float) -> Thresholds:
    """The thresholds where errors beyond noise of ``tolerance``, m RMS, do not matter; ``noise`` is its RMS, m."""
    return replace(limits, material=max(limits.material, math.hypot(1.0, tolerance / noise)))


@dataclass(frozen=True)
class GapTest:
    """Whether the plain model's error on held-out logs is more than noise.

    Attributes:
        mean_square: of the white residual.
        expected: under a right model with parameters as uncertain as the training logs leave them.
        limit: greatest mean square that counts as no gap.
        ratio: RMS error over that of a right model, in m.
        significant: whether there is a gap.
    """

    mean_square: float
    expected: float
    limit: float
    ratio: float
    significant: bool


def gap_test(
    problem: Problem,
    holdout: Holdout,
    fit: Fit,
    prediction: Prediction,
    ratio: float,
    limits: Thresholds,
    more: float = 0.0,
) -> GapTest:
    """Test the gap of the plain model ``fit`` on the held-out logs; ``ratio`` is its RMS error over the noise's.

    ``more`` is what noise has in mean square there beyond that of the training logs.
    """
    covariance, counted = information(problem, fit).covariance, holdout.rows
    spread, rows = holdout.slopes(fit, prediction.states)[1][counted], int(np.count_nonzero(counted))
    expected, limit = allowance((spread.T @ spread) @ covariance / rows, rows, more, limits)
    significant = is_significant(prediction.mean_square, limit, ratio, fit.squares / problem.rows, limits)
    return GapTest(prediction.mean_square, expected, limit, ratio, significant)


def allowance(shares: Array, rows: int, more: float, limits: Thresholds) -> tuple[float, float]:
    """Mean square of white rows that a right model with uncertain parameters leaves, and the most that is no gap.

    What uncertain parameters leave is one normal number squared for each of a few directions: where logs of the fit
    leave one of them open, it scatters by as much as it is expected to be.

    Args:
        shares: what each coordinate and pair of them adds to the mean square, S^T S C / rows with the sensitivities S
            of the held-out logs and the covariance C of the coordinates, shape (size, size).
        rows: number of white rows.
        more: what noise has in mean square there beyond that of the training logs.
        limits: the thresholds.
    """
    expected = 1.0 + float(np.trace(shares)) + more
    deviation = math.sqrt(2.0 / rows + 2.0 * float(np.sum(shares * shares.T)))
    return expected, expected * (1.0 + limits.model) + limits.deviations * deviation


def is_significant(mean_square: float, limit: float, ratio: float, training: float, limits: Thresholds) -> bool:
    """Whether errors are a gap: mean squares on held-out and training logs, and the RMS over the noise's."""
    # A model that runs away at once has been compared with nothing: that is a gap, whatever is left of the error.
    if not np.isfinite(mean_square):
        return True
    return ratio > limits.material and (mean_square > limit or training > limits.material**2)


@dataclass(frozen=True)
class Decision:
    """Verdict and reason.

    Attributes:
        verdict: ``named``, ``equivalent``, ``unexplained`` or ``setup``.
        reason: in a sentence.
        closure: share of the excess on held-out logs that the effects remove.
    """

    verdict: str
    reason: str
    closure: float


def decide(search: Search, gap: GapTest, noise: float, limits: Thresholds, tolerance: float = 0.0) -> Decision:
    """The verdict on a finished or interrupted search.

    Args:
        search: the search.
        gap: the test of the gap.
        noise: RMS error of a right model on the held-out logs, m.
        limits: the thresholds.
        tolerance: what does not matter, m; for the reason.
    """
    if not np.isfinite(gap.mean_square):
        return Decision(
            "unexplained",
            "the re-identified plain model runs away on the held-out logs before enough of them is compared; "
            "identify the arm first (bha identify), so that the search starts near to it",
            0.0,
        )
    before, after = rms_errors(search.plain.prediction, search.best.prediction)
    closure, left = share_removed(before, after, noise), after / noise
    if not gap.significant:
        return Decision(
            "equivalent",
            f"on the held-out logs the re-identified plain model errs by {gap.ratio:.2f} times what noise alone makes; "
            f"mean square of the white residual {gap.mean_square:.2f}, limit {gap.limit:.2f}"
            + _too_much_noise(gap, limits)
            + _left_open(gap, limits)
            + (f"; up to {limits.material:.2f} times does not matter" if tolerance else ""),
            closure,
        )
    if not search.best.candidates:
        return Decision(
            "unexplained", "there is a gap, and no effect of the catalogue earns its place in explaining it", 0.0
        )
    # Several names for a part of a gap are a form that none of them has. One that stands out from all others, beside
    # which none is needed, is there whatever else is: disturbances, and forms other than the catalogue's. One in the
    # place of a name that was refused does not stand out, and neither does one that chance may bring.
    doubtful = any(key in search.doubtful for key in search.best.key)
    alone = len(set(search.best.key)) == 1 and not search.second and not doubtful
    if closure < (limits.half if alone or left < limits.material else limits.closure):
        return Decision(
            "unexplained",
            f"the best known effects ({search.best.label}) remove {100 * closure:.0f} % of the excess error on held-out"
            " logs only",
            closure,
        )
    removed = f"{100 * closure:.0f} % of the excess error on held-out logs is removed"
    fine = gap.ratio > limits.fine
    partly = closure < limits.good_closure and left > limits.left
    if partly and not alone and not fine:
        return Decision(
            "unexplained",
            f"the best known effects ({search.best.label}) leave an error of {left:.1f} times the noise "
            f"({100 * closure:.0f} % of the excess removed)",
            closure,
        )
    rest = f"; what is left is {left:.2g} times the noise and not explained" if fine or partly else ""
    return Decision("named", removed + rest, closure)


def _left_open(gap: GapTest, limits: Thresholds) -> str:
    """Where errors far above the noise are no gap, since the plain numbers are not told so far, and that is said."""
    if gap.ratio <= limits.material:
        return ""
    return (
        f", {gap.expected:.2f} to be expected: the training logs do not tell the plain numbers that these ask for; log "
        "motions like them too"
    )


def _too_much_noise(gap: GapTest, limits: Thresholds) -> str:
    """Where the logs hold far less than the noise that is assumed, a gap may hide below it, and that is said."""
    if gap.mean_square >= 1.0 / limits.material**2:
        return ""
    return ", which is less than noise alone should make: the noise is taken for too great, and hides gaps of its size"


def faults_in_words(faults: Sequence[Finding]) -> str:
    """By what logs and file do not belong together, in a sentence without its end."""
    first = faults[0]
    cause = f" ({first.explanations[0].what})" if first.explanations else ""
    more = f", and {len(faults) - 1} more" if len(faults) > 1 else ""
    where = f"{first.where}: " if first.kind == "wiring" and first.where != "all logs" else ""
    return f"logs and file do not belong together: {where}{first.what}{cause}{more}; mend that first, see bha check"


def untold(verdict: Decision, label: str) -> Decision:
    """The verdict where the effects ``label`` would be named, and their sizes are not told from none."""
    reason = (
        f"{label} would remove {100 * verdict.closure:.0f} % of the excess error on held-out logs, but by the interval "
        "of its size there may be none of it"
    )
    return Decision("unexplained", reason, verdict.closure)


def without_faults(verdict: Decision, faults: Sequence[Finding]) -> Decision:
    """The verdict on logs of which a check has found ``faults``: no physics is blamed before they are mended.

    ``equivalent`` stays, for nothing is blamed there, and says them.
    """
    if not faults:
        return verdict
    text = faults_in_words(faults)
    if verdict.verdict == "equivalent":
        # What the file has wrong hides in the plain numbers: they predict, and are not the arm's.
        return replace(verdict, reason=f"{verdict.reason}; but {text}")
    return Decision("setup", text if verdict.verdict == "named" else f"{text}; {verdict.reason}", verdict.closure)
