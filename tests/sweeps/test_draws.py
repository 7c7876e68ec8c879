"""Draws: each distribution against SciPy's, each run by its number alone, grids in the order of itertools."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import bha.sweeps
from bha.sweeps.draws import grid_rows, key_of, monte_carlo_rows, quantile, uniforms
from bha.sweeps.variable import Variable

from .small_sweeps import spec

PROBABILITIES = [1e-12, 0.01, 0.3, 0.5, 0.9, 1 - 1e-12]


@pytest.mark.parametrize(
    ("keys", "law"),
    [
        ({"distribution": "uniform", "low": -2.0, "high": 3.0}, stats.uniform(-2.0, 5.0)),
        ({"distribution": "log_uniform", "low": 1e-3, "high": 1e2}, stats.loguniform(1e-3, 1e2)),
        ({"distribution": "normal", "mean": 3.0, "standard_deviation": 0.5}, stats.norm(3.0, 0.5)),
        (
            {"distribution": "normal", "mean": 3.0, "standard_deviation": 0.5, "low": 2.0, "high": 3.1},
            stats.truncnorm(-2.0, 0.2, 3.0, 0.5),
        ),
        ({"distribution": "normal", "mean": 0.0, "standard_deviation": 1.0, "low": 4.0}, stats.truncnorm(4.0, np.inf)),
        ({"distribution": "log_normal", "median": 2.0, "log_standard_deviation": 0.3}, stats.lognorm(0.3, scale=2.0)),
    ],
)
def test_distributions_are_those_of_scipy(keys: dict[str, Any], law: Any) -> None:
    variable = Variable.model_validate({"what": "x", **keys})
    found = [quantile(variable, u) for u in PROBABILITIES]
    np.testing.assert_allclose(found, law.ppf(PROBABILITIES), rtol=1e-9)


def test_choice_follows_its_weights() -> None:
    variable = Variable.model_validate(
        {"what": "x", "distribution": "choice", "values": [5.0, 6.0, 7.0, 8.0], "weights": [0.0, 1.0, 3.0, 0.0]}
    )
    places = [quantile(variable, u) for u in (2.0**-53, 0.2499, 0.2501, 1 - 2.0**-53)]
    assert places == [1, 1, 2, 2]


def test_uniforms_are_uniform_and_open() -> None:
    key = key_of(3)
    rows = np.array([uniforms(key, run, 3) for run in range(4000)])
    assert rows.min() > 0.0
    assert rows.max() < 1.0
    for column in rows.T:
        assert stats.kstest(column, "uniform").pvalue > 1e-3
    assert np.abs(np.corrcoef(rows.T) - np.eye(3)).max() < 0.06
    assert np.abs(np.corrcoef(rows[:-1, 0], rows[1:, 0])[0, 1]) < 0.06


def test_a_run_has_its_own_part_of_the_counter() -> None:
    """The same words as one stream that is moved on by 2^192 blocks a run."""
    generator = np.random.Philox(key=key_of(11))
    generator.advance(5 * 2**192)
    words = generator.random_raw(6)
    np.testing.assert_array_equal(uniforms(key_of(11), 5, 6), ((words >> np.uint64(12)).astype(float) + 0.5) * 2.0**-52)


def test_the_number_of_a_run_alone_decides(tmp_path: Path) -> None:
    mapping = spec(tmp_path)
    whole = bha.sweeps.draw(mapping, 0, 200)
    np.testing.assert_array_equal(bha.sweeps.draw(mapping, 130, 7), whole[130:137])
    longer = spec(tmp_path, vary=[*mapping["vary"], {**mapping["vary"][1], "what": "input.amplitude"}])
    np.testing.assert_array_equal(bha.sweeps.draw(longer, 0, 200)[:, :2], whole)
    other = bha.sweeps.draw(spec(tmp_path, seed=8), 0, 200)
    assert not np.any(other == whole)


def test_draws_stay_what_they_were() -> None:
    """A published sweep must come out again: these numbers never change."""
    variable = Variable.model_validate({"what": "x", "distribution": "uniform", "low": 0.0, "high": 1.0})
    rows = monte_carlo_rows([variable, variable], seed=1, first=1_000_000, count=2)
    fixed = [[0.10734340854821511, 0.4218444585453841], [0.6545590214565314, 0.9998857614674374]]
    np.testing.assert_allclose(rows, fixed, rtol=1e-15)


def test_grid_is_the_product_last_fastest() -> None:
    sizes = (3, 2, 4)
    expected = list(itertools.product(*map(range, sizes)))
    np.testing.assert_array_equal(grid_rows(sizes, 0, 24), expected)
    np.testing.assert_array_equal(grid_rows(sizes, 7, 9), expected[7:16])


def test_grid_values(tmp_path: Path) -> None:
    vary = [
        {"what": "section.1.mass", "values": [0.9, 0.7]},
        {"what": "section.1.damping", "low": 1.0, "high": 100.0, "count": 3, "spacing": "log"},
        {"what": "input.offset", "low": -1.0, "high": 1.0, "count": 3},
    ]
    mapping = spec(tmp_path, kind="grid", runs=None, seed=None, vary=vary)
    found = bha.sweeps.draw(mapping, 0, 18)
    np.testing.assert_allclose(found, list(itertools.product([0.9, 0.7], [1.0, 10.0, 100.0], [-1.0, 0.0, 1.0])))
    with pytest.raises(bha.InputError, match="the sweep has runs 0 to 17"):
        bha.sweeps.draw(mapping, 10, 9)
