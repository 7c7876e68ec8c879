"""The next of the first round, where what came first is refused: by left-out or held-out logs, or as there may be none.

What comes first fits the training logs best, with as many numbers as it has. A hose of six numbers stands before a
sensor's gain of one, of which it has a little; that there may be none of a hose says nothing of the gain.
"""

from __future__ import annotations

from bha.diagnosis.forward import forward
from bha.diagnosis.given import Given
from bha.diagnosis.holdout import share_brought
from bha.diagnosis.intervals import form_deviation, is_there
from bha.diagnosis.prune import prune
from bha.diagnosis.ranking import on_bound
from bha.diagnosis.refit import Trial, bic, correlation_length
from bha.diagnosis.search import Search


def instead(given: Given, search: Search) -> None:
    """Put the first of the first round that stands in the place of a best set that does not; else nothing changes.

    Held-out logs have no part in it. They are asked for more then (:func:`bha.diagnosis.decide.decide`), as they are
    for several effects.
    """
    if not search.rivals or len(set(search.best.key)) > 1 or stands(given, search.best):
        return
    found, first = search.best, search.rivals[0]
    doubtful = dict(search.doubtful)
    most = max(search.plain.fit.squares - t.fit.squares for t in first)
    refused = {first[0].key, found.key}
    for trial in first:
        drop = search.plain.fit.squares - trial.fit.squares
        if trial.key in refused or trial.fit.jacobian is None or drop < given.rules.like * most:
            continue
        refused.add(trial.key)
        search.best = trial
        search.notes.append(f"not {first[0].label}: next {trial.label}")
        prune(given, search)
        if not stands(given, search.best):
            continue
        forward(given, search)
        prune(given, search)
        if stands(given, search.best):
            search.second = True
            return
    # As it was, with what else is known of it.
    search.best, search.doubtful, search.whole = found, doubtful, None


def unrefuted(given: Given, search: Search) -> None:
    """Put the next in the place of one effect with which the held-out logs are predicted worse than without any.

    It is the first of those that training logs do not tell from what was found, by the criterion, and that the held-out
    logs do not refute: of a class that is not told apart one member goes, and they choose between none. They are asked
    for more then.
    """
    found, plain = search.best, search.plain.prediction
    if len(set(found.key)) != 1 or not search.rivals:
        return

    def share(trial: Trial) -> float:
        return share_brought(plain, plain, trial.prediction, given.noise)

    if share(found) >= 0.0:
        return
    correlation = correlation_length(given.problem, found.fit.residual)
    limit = bic(found, given.problem, correlation) + given.rules.even
    for trial in search.rivals[0]:
        even = trial.fit.jacobian is not None and bic(trial, given.problem, correlation) < limit
        if even and trial.key != found.key and share(trial) > 0.0 and stands(given, trial):
            search.notes.append(f"held-out logs refute {found.label}: {trial.label}, which is not told from it")
            search.best, search.second = trial, True
            return


def stands(given: Given, trial: Trial) -> bool:
    """Whether a set names something that is on no bound, and there is some of it."""
    if not trial.candidates or trial.fit.jacobian is None or on_bound(trial):
        return False
    form = form_deviation(given.problem, trial.fit, given.signatures, 0)
    # What logs disagree about is asked of it when it is named.
    return is_there(given.problem, trial, form, 0, closure=1.0)
