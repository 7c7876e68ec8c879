"""What a search for effects is given; alike in all its steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from bha.diagnosis.cache import Cache
from bha.diagnosis.candidate import Ranges
from bha.diagnosis.fit import Fit, Problem
from bha.diagnosis.holdout import Holdout
from bha.diagnosis.rules import Rules
from bha.diagnosis.screen import Signatures, probe

Say = Callable[[str], None]


@dataclass(frozen=True)
class Given:
    """What a search is given.

    Attributes:
        problem: the training logs.
        holdout: the held-out logs; they decide nothing but certify.
        signatures: what each candidate would do, about the plain fit.
        ranges: ranges of the numbers of effects.
        rules: its thresholds.
        noise: RMS error of a right model on the held-out logs, m.
        say: called with what is being done.
    """

    problem: Problem
    holdout: Holdout
    signatures: Signatures
    ranges: Ranges
    rules: Rules
    noise: float
    say: Say

    def about(self, fit: Fit, what: str) -> Given:
        """The same with the signatures of all candidates about another fit; ``what`` it is, in words."""

        def tell(share: float) -> None:
            self.say(f"screening all candidates {what} ({100.0 * share:.0f} %)")

        plans = list({id(c.plan): c.plan for c in self.signatures.candidates}.values())
        return replace(self, signatures=probe(self.problem, fit, plans, tell, Cache(None, "")))
