"""Thresholds of the search for effects."""

from __future__ import annotations

from dataclasses import dataclass

#: Mean square of the white residual below which what is left is noise.
NOISE_LEFT = 1.02
#: Least RMS error without a name over that with it for which the name is worth being said: the first one against the
#: noise, each further one against what the others, fitted again without it, leave.
MATERIAL = 1.3


@dataclass(frozen=True)
class Rules:
    """Thresholds of the search; measured on tuning seeds, see docs/explanation/diagnosis.md.

    Attributes:
        most: most effects.
        tried: candidates that are refitted in the first round, and in later ones.
        per_kind: candidates of one kind among them.
        beside: kinds that are refitted in the place of the best of the first round where that leaves much, and as many
            that come next.
        widened: kinds of which every section is refitted there.
        enter: greatest probability that the best of all candidates brings as much by chance, with which an effect is
            taken in: a true one stands out less while others are still missing.
        chance: the same with which it stays, and with which a further element of it is taken in.
        confirmed: an effect that is likelier by chance than that, though not than ``enter``, stays if it removes this
            share of the plain model's excess on the held-out logs.
        swap: drop of the criterion that swaps an effect for a look-alike.
        whole: least share of what is left beyond noise with which a further name answers all of it, so that it need not
            make the error smaller by ``shows``.
        even: distance of the criterion within which the better prediction of left-out training logs decides.
        share: least share of the plain model's excess error on left-out training logs that it has to remove.
        told: greatest mean square of left-out training logs, over that of the same logs as they are fitted, that says
            anything.
        worth: least share of the plain model's excess on the training logs for which a first effect is sought.
        shows: least error of the others, fitted again without an effect, over that with it, RMS in the white residual
            of left-out training logs: what one name leaves needs a second one only if it is a gap itself.
        near: a candidate is refitted if it promises at least this share of what the best one does.
        like: the same for a look-alike against what it would replace.
        crowd: kinds that do alike from which on those that promise little are refitted too.
        company: so many of them.
        bound: a candidate on a bound gives way to one that is not and brings at least this share of its gain.
        element: least share of what is left of the excess error, on training logs as they are fitted and as they are
            left out, that a further branch or stage has to remove.
        refined: a runner-up is refined too if it brings at least this share of what the first one brings.
        nearly: the same where the search begins once more, though what was found leaves little.
        narrow: share of its gain by which a narrower place has to be better, where the cost has several valleys.
        thorough: whether every refit goes to its end, and the form of what was found is asked further: not of an arm
            that remembers, of which no second name is asked.
        open: share of the plain model's excess on the training logs above which the effects found leave so much that
            the search begins again from a runner-up of the first round.
    """

    most: int = 4
    tried: tuple[int, int] = (4, 3)
    per_kind: int = 2
    beside: int = 4
    widened: int = 3
    enter: float = 0.05
    chance: float = 0.01
    confirmed: float = 0.3
    swap: float = 4.0
    whole: float = 0.85
    even: float = 6.0
    share: float = 0.025
    told: float = 5.0
    worth: float = 0.02
    shows: float = MATERIAL
    near: float = 0.25
    like: float = 0.6
    crowd: int = 3
    company: int = 20
    bound: float = 0.8
    element: float = 0.1
    refined: float = 0.7
    nearly: float = 0.95
    narrow: float = 0.2
    thorough: bool = True
    open: float = 0.1

    def enough(self, squares: float, rows: float) -> float:
        """Least drop of the sum of squares with which a further effect shows beside others that leave ``squares``.

        It makes the error smaller by ``shows``, or takes nearly all of a gap to the noise, of ``rows`` white rows.
        """
        shown = (1.0 - self.shows**-2) * squares
        return min(shown, self.whole * (squares - rows)) if squares >= self.shows**2 * rows else shown
