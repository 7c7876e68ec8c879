"""One table of medians and ratios at the end of a benchmark run."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import pytest
from rich.console import Console
from rich.table import Table

from .rust import medians as rust_medians

UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))


def pretty(seconds: float) -> str:
    """Three digits and a unit."""
    factor, unit = next((f, u) for f, u in UNITS if seconds >= f or u == "ns")
    return f"{seconds / factor:.3g} {unit}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--rust``: run the benchmarks in Rust too."""
    parser.addoption("--rust", action="store_true", help="add the medians of `cargo bench --bench dynamics`")


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    session = getattr(config, "_benchmarksession", None)
    medians: dict[str, dict[str, dict[str, float]]] = defaultdict(lambda: defaultdict(dict))
    for bench in session.benchmarks if session else []:
        info = bench.extra_info
        if not bench.has_error and "table" in info:
            medians[info["table"]][info["row"]][info["side"]] = bench.stats.median * info.get("times", 1)
    if config.getoption("--rust"):
        for row, median in rust_medians("dynamics").items():
            medians["in Rust, three sections unless said"][row]["median"] = median
    if not medians:
        return
    table = Table("", "First", "Second", "First / second", title="Medians, both sides in one process")
    for name, rows in medians.items():
        table.add_section()
        table.add_row(f"[bold]{name}[/bold]")
        full = rows.get("full", {})
        for row, sides in rows.items():
            cells = [f"{side}: {pretty(value)}" for side, value in sides.items()]
            if name == "Table III":
                cells = [f"{cell} = {sides[side] / full[side]:.3f}" for cell, side in zip(cells, sides, strict=True)]
            values = list(sides.values())
            ratio = f"{values[0] / values[1]:.2f}" if len(values) == 2 else ""
            table.add_row(row, *cells, *([""] * (2 - len(cells))), ratio)
    Console(width=130).print(table)  # wide enough that no cell is cut
