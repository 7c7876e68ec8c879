"""Specs changed at random: the package's own errors at once, or a plan whose numbers are finite."""

from __future__ import annotations

import copy
import math
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import bha
import bha.sweeps

from .small_sweeps import one_section, spec, toml

pytest.importorskip("pyarrow")

NUMBERS = st.sampled_from(
    [0, -1, 1, 2, 64, 10**12, 10**30, 10**400, 0.0, -0.0, 1e-300, 5e-324, -1e308, 1e308, math.inf, -math.inf, math.nan]
)
VALUES = (
    NUMBERS
    | st.floats()
    | st.integers()
    | st.booleans()
    | st.sampled_from(
        ["", "normal", "log_normal", "log_uniform", "uniform", "choice", "grid", "hold", "ros2", "x\0y", "²"]
    )
    | st.none()
    | st.lists(NUMBERS, max_size=4)
    | st.dictionaries(st.text(max_size=3), NUMBERS, max_size=2)
)
KEYS = [
    *("distribution", "low", "high", "mean", "standard_deviation", "median", "log_standard_deviation", "values"),
    *("weights", "count", "spacing", "relative", "what", "kind", "runs", "seed", "duration", "dt", "step", "pressures"),
    *("lengths", "velocities", "logs", "partition_size", "metrics", "settling_band", "arm", "schema", "vary", "²"),
]
LAWS = [
    {"distribution": "uniform", "low": 0.5, "high": 0.9},
    {"distribution": "log_uniform", "low": 0.5, "high": 0.9},
    {"distribution": "normal", "mean": 0.75, "standard_deviation": 0.05},
    {"distribution": "log_normal", "median": 0.75, "log_standard_deviation": 0.1},
    {"distribution": "choice", "values": [0.7, 0.8], "weights": [1.0, 2.0]},
    {"low": 0.5, "high": 0.9, "count": 5},
    {"low": 0.5, "high": 0.9, "count": 5, "spacing": "log"},
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("mutations")
    one_section().save(made / "arm.toml")
    return made


def tables(mapping: dict[str, Any]) -> list[dict[str, Any]]:
    """Every table of a spec, the whole one first."""
    inner = [value for value in mapping.values() if isinstance(value, dict)]
    varied = mapping.get("vary")
    return [mapping, *inner, *(t for t in varied if isinstance(t, dict))] if isinstance(varied, list) else [mapping]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(data=st.data())
def test_any_spec_is_refused_or_has_finite_draws(folder: Path, data: st.DataObject) -> None:
    law = data.draw(st.sampled_from(LAWS))
    grid = "count" in law
    mapping = spec(folder, kind="grid" if grid else "monte_carlo", runs=None if grid else 200)
    mapping = copy.deepcopy({k: v for k, v in mapping.items() if not (grid and k == "seed")})
    mapping["vary"] = [{"what": "section.1.mass", **law}]
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.sampled_from(tables(mapping)))
        name = data.draw(st.sampled_from(sorted(place)) | st.sampled_from(KEYS)) if place else "low"
        if data.draw(st.integers(0, 5)) == 0:
            place.pop(name, None)
        else:
            place[name] = data.draw(VALUES)
    begin = time.monotonic()
    try:
        plan = bha.sweeps.make_plan(mapping)
        for first in {0, max(plan.runs - 3, 0)}:
            draws = plan.draws(first, min(3, plan.runs))
            assert np.isfinite(draws).all(), mapping
        assert sum(len(times) for times in plan.times) < 10**7
    except bha.BhaError:
        pass
    assert time.monotonic() - begin < 10.0


@settings(max_examples=150, deadline=None, derandomize=True)
@given(data=st.data())
def test_any_file_is_refused_or_read(folder: Path, data: st.DataObject) -> None:
    path = toml(spec(folder), folder / "sweep.toml")
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(content) - 1))
        match data.draw(st.sampled_from(["flip", "cut", "insert", "double"])):
            case "flip":
                content[place] ^= 1 << data.draw(st.integers(0, 7))
            case "cut":
                del content[place : place + data.draw(st.integers(1, 20))]
            case "insert":
                content[place:place] = data.draw(st.sampled_from([b"9" * 5000, b"[" * 3000, b"1e999", b"\0", b"\n[["]))
            case "double":
                content += content[place : place + 60]
        if not content:
            break
    path.write_bytes(bytes(content))
    with suppress(bha.BhaError):
        bha.sweeps.make_plan(path)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"log_standard_deviation": 1e30}, r"log_standard_deviation: found 1e\+30: draws from 0 to inf"),
        ({"log_standard_deviation": 90.0}, r"log_standard_deviation: found 90.0: draws from .* to inf"),
        ({"distribution": "normal", "mean": 1e308, "standard_deviation": 1e308}, "standard_deviation: found"),
        ({"distribution": "uniform", "low": -1e308, "high": 1e308}, "high: found"),
        ({"distribution": "log_uniform", "low": 1e-300, "high": 1e300}, "high: found"),
        (
            {"distribution": "choice", "values": [1.0, 2.0], "weights": [1e308, 1e308]},
            "weights: found .* too great to compute with",
        ),
    ],
)
def test_draws_that_no_number_can_hold(folder: Path, change: dict[str, Any], text: str) -> None:
    law = change if "distribution" in change else {"distribution": "log_normal", "median": 1.0, **change}
    with pytest.raises(bha.ParameterError, match=text):
        bha.sweeps.make_plan(spec(folder, vary=[{"what": "section.1.mass", **law}]))


@pytest.mark.parametrize(
    ("simulation", "text"),
    [
        ({"duration": 1e30}, r"a run of 1e.30 s under the input would have 2e\+32 rows; allowed: at most"),
        ({"duration": math.inf}, "duration: found inf; allowed: a number > 0"),
        ({"duration": 1.0, "dt": 1e-12}, r"dt: found 1e-12: .* 1e\+12 rows"),
        ({"duration": 1.0, "dt": math.inf}, "dt: found inf; allowed: a number > 0"),
        ({"duration": 1.0, "dt": 2.0}, "dt: found 2.0; allowed: at most the duration"),
    ],
)
def test_rows_that_no_memory_holds(folder: Path, simulation: dict[str, Any], text: str) -> None:
    with pytest.raises(bha.ParameterError, match=text):
        bha.sweeps.make_plan(spec(folder, simulation=simulation))


def test_long_lists_of_a_grid_are_not_made(folder: Path) -> None:
    vary = [{"what": "section.1.mass", "low": 0.5, "high": 0.9, "count": 10**12}]
    mapping = spec(folder, kind="grid", runs=None, seed=None, vary=vary)
    drawn = bha.sweeps.draw(mapping, 10**12 - 2, 2)
    assert drawn[1, 0] == 0.9
    assert drawn[0, 0] == pytest.approx(0.9, rel=1e-11)
    with pytest.raises(bha.ParameterError, match=r"partition_size: found 1073741824; allowed: .* at most 1048576"):
        bha.sweeps.make_plan({**mapping, "partition_size": 1 << 30})


@pytest.mark.parametrize(("spacing", "reference"), [("linear", np.linspace), ("log", np.geomspace)])
def test_grids_are_those_of_numpy_to_the_last_digit(folder: Path, spacing: str, reference: Any) -> None:
    for count in (1, 2, 7, 100):
        vary = [{"what": "section.1.mass", "low": 0.1, "high": 0.7, "count": count, "spacing": spacing}]
        drawn = bha.sweeps.draw(spec(folder, kind="grid", runs=None, seed=None, vary=vary), 0, count)
        np.testing.assert_array_equal(drawn[:, 0], reference(0.1, 0.7, count))
