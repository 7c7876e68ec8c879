"""The bench of recovery: what its table says of repeats whose coverage is known, and that a run goes on."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))

from benches.identify_recovery import repeats
from benches.identify_recovery.logs import Condition
from benches.identify_recovery.table import cells, rejected, text


def lines(coverage: float, bias: float, count: int = 100) -> list[dict[str, Any]]:
    """Repeats with errors of 1 % about a bias, and intervals of which a share holds."""
    random = np.random.default_rng(4)
    made: list[dict[str, Any]] = []
    for seed in range(count):
        parameters = {
            f"p{k}": {
                "true": 2.0,
                "value": 2.0 * (1.0 + bias + 0.01 * random.standard_normal()),
                "error": 0.02,
                "inside": bool(seed < coverage * count),
            }
            for k in range(6)
        }
        made.append({"condition": "a", "seed": seed, "seconds": 1.0, "converged": True, "parameters": parameters})
    return made


@pytest.mark.parametrize(("coverage", "count"), [(0.95, 0), (0.90, 0), (0.79, 6)])
def test_cells_are_rejected_only_where_the_binomial_test_says_so(coverage: float, count: int) -> None:
    made = cells(lines(coverage, 0.0))
    assert len(rejected(made)) == count
    assert all(c.bounds[0] < coverage < c.bounds[1] for c in made)


def test_bias_counts_where_it_is_more_than_its_own_error_and_a_percent() -> None:
    assert all(c.unbiased for c in cells(lines(0.95, 0.005)))
    assert not any(c.unbiased for c in cells(lines(0.95, 0.03)))
    assert "6 biased" in text(lines(0.95, 0.03))


def test_a_run_goes_on_where_it_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store, done = tmp_path / "repeats.jsonl", []

    def repeat(condition: Condition, seed: int) -> dict[str, Any]:
        done.append((condition.name, seed))
        return {"condition": condition.name, "seed": seed}

    monkeypatch.setattr(repeats, "repeat", repeat)
    conditions = [Condition("a"), Condition("b")]
    repeats.run(store, conditions, range(2))
    with store.open("a") as file:
        file.write('{"condition": "a", "se')
    repeats.run(store, conditions, range(3))
    assert done == [("a", 0), ("b", 0), ("a", 1), ("b", 1), ("a", 2), ("b", 2)]
    assert [line["seed"] for line in repeats.read(store)] == [0, 0, 1, 1, 2, 2]
