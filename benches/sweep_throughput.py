"""What a million trajectories of 1 s cost in a sweep: measured on some hundred of them, on one thread, and scaled.

Processor time, the least of some repeats: other programs on the computer make it longer, never shorter. The nominal
three-section arm is let go from a bent pose; every run has its own masses, dampings and pressures (its own arm), or its
own pressures only (one arm for all). Rows every 10 ms, five metrics. "Error" is the greatest difference of the final
tip displacement from runs with a relative tolerance of 1e-11. Reading the spec and writing Parquet are not part of it.

    python -m benches.sweep_throughput --runs 256
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import bha.sweeps
from bha import _core
from bha.sweeps import group
from bha.sweeps.plan import Plan

BENT = [1.6e5, 1.0e5, 1.0e5] * 3
INPUT = {"what": "input.offset", "distribution": "uniform", "low": -2e3, "high": 2e3}
ARM = [
    {"what": f"section.{k}.mass", "relative": True, "distribution": "normal", "mean": 1.0, "standard_deviation": 0.1}
    for k in (1, 2, 3)
] + [
    {"what": "section.*.damping", "relative": True, "distribution": "log_normal", "median": 1.0,
     "log_standard_deviation": 0.2},
]  # fmt: skip
METRICS = ["max_tip_displacement", "final_tip_displacement", "settling_time", "peak_rate", "final_energy"]
METHODS: dict[str, dict[str, Any]] = {
    "dopri5, rtol 1e-6": {"method": "dopri5"},
    "dopri5, rtol 1e-4": {"method": "dopri5", "rtol": 1e-4, "atol": 1e-6},
    "rk4, 2.5 ms": {"method": "rk4", "step": 2.5e-3},
    "rk4, 5 ms": {"method": "rk4", "step": 5e-3},
}


def plan(runs: int, vary: list[dict[str, Any]], how: dict[str, Any]) -> Plan:
    return bha.sweeps.make_plan(
        {
            "schema": "bha-sweep/1",
            "arm": "bha_nominal",
            "kind": "monte_carlo",
            "runs": runs,
            "seed": 1,
            "metrics": METRICS,
            "input": {"pressures": [1.2e5] * 9},
            "initial": {"pressures": BENT},
            "simulation": {"duration": 1.0, "dt": 0.01, **how},
            "vary": vary,
        }
    )


@contextmanager
def timed(parts: dict[str, float], names: dict[str, str]) -> Iterator[None]:
    """Add up the processor time that functions of ``bha.sweeps.group`` take; ``names`` maps them to parts."""

    def wrapped(function: Callable[..., Any], part: str) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            started = time.process_time()
            try:
                return function(*args, **kwargs)
            finally:
                parts[part] += time.process_time() - started

        return call

    originals = {name: getattr(group, name) for name in names}
    for name, part in names.items():
        setattr(group, name, wrapped(originals[name], part))
    try:
        yield
    finally:
        for name, function in originals.items():
            setattr(group, name, function)


def measure(made: Plan, repeats: int) -> tuple[dict[str, float], np.ndarray]:
    """Processor seconds a run by part, those of the fastest repeat, and the final tip displacements."""
    group.run_group(made, 0, min(made.runs, made.group))  # what is loaded or built only once
    return min((measure_once(made) for _ in range(repeats)), key=lambda result: result[0]["all"])


def measure_once(made: Plan) -> tuple[dict[str, float], np.ndarray]:
    """One repeat."""
    parts: dict[str, float] = defaultdict(float)
    with timed(parts, {"member": "arms and inputs", "simulate_batch": "simulation", "evaluate": "metrics"}):
        started = time.process_time()
        table = group.joined([group.run_partition(made, partition) for partition in range(made.partitions)])
        parts["all"] = time.process_time() - started
    assert set(table["status"]) == {"ok"}
    return {part: seconds / made.runs for part, seconds in parts.items()}, table["final_tip_displacement"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=256, help="runs a row of the table")
    parser.add_argument("--repeats", type=int, default=3, help="the fastest of so many counts")
    arguments = parser.parse_args()
    runs, repeats = arguments.runs, arguments.repeats
    widest = _core.instruction_sets()[-1]
    out = Table(title=f"1 s of the nominal arm, {runs} runs measured, scaled to a million; rk4 abreast: {widest}")
    headings = (
        "What varies",
        "Method",
        "ms a run",
        "arms",
        "simulation",
        "metrics",
        "core-hours a million",
        "error [mm]",
    )
    for heading in headings:
        out.add_column(heading, justify="left" if heading in headings[:2] else "right")
    for name, vary in (("pressures", [INPUT]), ("arm and pressures", [*ARM, INPUT])):
        checked = min(runs, 64)
        exact = measure(plan(checked, vary, {"method": "dopri5", "rtol": 1e-11, "atol": 1e-13}), 1)[1]
        for method, how in METHODS.items():
            parts, tips = measure(plan(runs, vary, how), repeats)
            milliseconds = [f"{1e3 * parts[part]:.2f}" for part in ("all", "arms and inputs", "simulation", "metrics")]
            hours = f"{parts['all'] * 1e6 / 3600:.2f}"
            out.add_row(name, method, *milliseconds, hours, f"{1e3 * np.abs(tips[:checked] - exact).max():.2g}")
        out.add_section()
    Console(width=130).print(out)


if __name__ == "__main__":
    main()
