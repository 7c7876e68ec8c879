"""How much a diagnosis's priors weigh against a residual that is not noise."""

from __future__ import annotations

import numpy as np
import pytest

from bha.diagnosis.fit import evaluate, prior_weight, weighted, whole_logs
from bha.diagnosis.model import plain_model
from bha.estimation.bands import noise_model

from .synthetic import one_section, record_of


def test_a_residual_that_is_noise_leaves_the_prior_as_it_is() -> None:
    assert prior_weight(1.0, 60.0) == 1.0
    assert prior_weight(1.04, 10.0) == 1.0


@pytest.mark.parametrize("rate", [10.0, 100.0])
def test_the_same_error_weighs_the_prior_alike_at_any_rate(rate: float) -> None:
    """What errs together is a time, not a number of rows: information about the parameters is that of the time."""
    time = np.arange(0.0, 20.0, 1.0 / rate)
    rng = np.random.default_rng(3)
    measured = 0.15 + 1e-4 * rng.standard_normal((len(time), 3)) + 5e-3 * np.sin(0.7 * time)[:, None]
    record = record_of(time, measured, np.full((len(time), 3), 1.2e5), 1e-3)
    model = plain_model(one_section()).on([record])
    state = np.concatenate([np.full(3, 0.15), np.zeros(3)])
    problem = whole_logs(model, noise_model([record], [[]]), [state])
    fit = evaluate(problem, model, np.zeros(model.size), [state])
    found = weighted(problem, fit)
    # White rows lie at most 1/60 s apart; a third of a second of them errs together.
    together = min(rate, 60.0) / 3.0
    assert found.trust == pytest.approx(1.0 + together * (fit.squares / problem.rows - 1.05), rel=0.02)
    assert found.cost == pytest.approx(fit.squares + found.trust * fit.prior)
