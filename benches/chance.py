"""How often the search's tests find an effect that is not there, and one that is, in residuals with a memory.

``python -m benches.chance``. No arms: the residuals are drawn, six channels over three logs of 40 s at 10 rows a
second, their memory a first-order one (none for 0 s), the channels alone or all sharing one error. 120 candidates have
smooth random signatures of the time scale of a motion. ``false`` is how often the best of all of them is found where
none is there, ``true`` how often the right one is where it makes up 5 % of the sum of squares.

- ``family``: :class:`bha.diagnosis.screen.Screening`, p at most 0.01, draws with the memory of the residual.
- ``criterion``: drop of the Bayesian information criterion by 10, with the effective sample size of the memory.
- ``regression``: :func:`bha.diagnosis.follows.follows` on three banks of 40 regressors, two of a time scale of 1 s
  and one of 0.3 s, p at most 0.01 and a share of 5 %; true where a fifth of the sum of squares is a mixture of
  one bank.
"""

from __future__ import annotations

import argparse
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bha.diagnosis.candidate import Candidate
from bha.diagnosis.catalogue import available
from bha.diagnosis.follows import follows
from bha.diagnosis.logged import Cells
from bha.diagnosis.memory import by_log, numbers_per_independent
from bha.diagnosis.screen import Signatures, score

Array = NDArray[np.float64]

LOGS, ROWS, STEP, CHANNELS, CANDIDATES = 3, 400, 0.1, 6, 120
MEMORIES = (0.0, 0.2, 1.0, 3.0, 8.0)
SHARE = 0.05
REGRESSORS, TIMES = 40, {"pose": 1.0, "past": 1.0, "rates": 0.3}


def correlated(rng: np.random.Generator, memory: float, channels: int, together: bool) -> Array:
    """A first-order process of variance one, shape (rows, channels); all channels the same if ``together``."""
    keep = np.exp(-STEP / memory) if memory else 0.0
    lead = int(5.0 * memory / STEP) + 1
    drawn = rng.standard_normal((ROWS + lead, 1 if together else channels))
    made = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], drawn, axis=0)[lead:]
    return np.repeat(made, channels, axis=1) if together else np.asarray(made)


def problem() -> Any:
    """What a screening asks of logs."""
    time = (np.arange(ROWS) + 0.5) * STEP
    size = ROWS * CHANNELS
    return SimpleNamespace(
        whiteners=[SimpleNamespace(kept=ROWS, time=time)] * LOGS,
        slices=lambda: [slice(k * size, (k + 1) * size) for k in range(LOGS)],
        rows=LOGS * size,
        state_precision=np.ones(1),
    )


def fit(residual: Array, nuisance: Array) -> Any:
    """What a screening asks of a fit: its residual, and what plain parameters and initial states can do."""
    states = tuple(np.zeros((ROWS * CHANNELS, 1)) for _ in range(LOGS))
    model = SimpleNamespace(coordinates=[SimpleNamespace(prior_weight=1.0)] * nuisance.shape[1])
    return SimpleNamespace(residual=residual, jacobian=nuisance, state_jacobians=states, trust=1.0, model=model)


def all_logs(rng: np.random.Generator, memory: float, together: bool) -> Array:
    """The same of all logs, one vector."""
    return np.concatenate([correlated(rng, memory, CHANNELS, together).ravel() for _ in range(LOGS)])


def once(seed: int, memory: float, together: bool, share: float) -> tuple[bool, bool]:
    """Whether each test finds an effect (the right one where there is one)."""
    rng = np.random.default_rng(seed)
    plan = next(p for p in available(None) if p.kind == "length_offset")
    table = np.column_stack([all_logs(rng, 1.0, False) for _ in range(CANDIDATES)])
    nuisance = 5.0 * np.column_stack([all_logs(rng, 1.0, False) for _ in range(8)])
    candidates = tuple(Candidate(plan, f"bellows {k}", {}) for k in range(CANDIDATES))
    signatures = Signatures(candidates, tuple(((k,),) for k in range(CANDIDATES)), table.astype(np.float32))
    strength = np.sqrt(share / (1.0 - share))
    residual = all_logs(rng, memory, together) + strength * table[:, 0]
    logs = problem()
    found = score(logs, fit(residual, nuisance), signatures, seed)
    best = found.ranking[0]
    right = share == 0.0 or best.candidate.where == "bellows 0"
    family = found.chance(best.score) <= 0.01
    effective = logs.rows / numbers_per_independent(*by_log(logs, residual))
    criterion = -effective * np.log(1.0 - best.share) - np.log(effective) >= 10.0
    return bool(family and right), bool(criterion and right)


def followed(seed: int, memory: float, together: bool, share: float) -> bool:
    """Whether the regression finds that errors follow something."""
    rng = np.random.default_rng([seed, 5])
    mixture = rng.standard_normal((REGRESSORS, CHANNELS)) / np.sqrt(REGRESSORS)
    made = []
    for _ in range(LOGS):
        banks = {name: correlated(rng, time, REGRESSORS, False) for name, time in TIMES.items()}
        errors = correlated(rng, memory, CHANNELS, together)
        errors = errors + np.sqrt(share / (1.0 - share)) * banks["rates"] @ mixture
        about = {name: table - table.mean(axis=0) for name, table in banks.items()}
        made.append(Cells(errors - errors.mean(axis=0), about, STEP))
    found = follows(made, seed)
    return found is not None and found.chance <= 0.01 and found.share >= SHARE


def main() -> None:
    """Read the command line, print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=200)
    parser.add_argument("--first-seed", type=int, default=0)
    options = parser.parse_args()
    print("| memory, s | channels | family: false | true | criterion: false | true | regression: false | true |")
    print("|---|---|---|---|---|---|---|---|")
    for together in (False, True):
        for memory in MEMORIES:
            seeds = range(options.first_seed, options.first_seed + options.repeats)
            rates = [np.mean([once(s, memory, together, v) for s in seeds], axis=0) for v in (0.0, SHARE)]
            regression = [np.mean([followed(s, memory, together, v) for s in seeds]) for v in (0.0, 0.2)]
            rates = [(*rate, own) for rate, own in zip(rates, regression, strict=True)]
            cells = " | ".join(f"{rates[0][k]:.3f} | {rates[1][k]:.2f}" for k in range(3))
            print(f"| {memory:g} | {'one error' if together else 'alone'} | {cells} |", flush=True)


if __name__ == "__main__":
    main()
