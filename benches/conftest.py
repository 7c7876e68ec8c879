"""One table of medians and ratios at the end of a benchmark run, and its entry in the history."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from rich.table import Table

from .history import here
from .history.entry import AGAINST_FIRST_ROW, Entry, Row, Side, file_name, first_to_second, to_first_row, to_json
from .rust import medians as rust_medians

UNITS = ((1.0, "s"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns"))
#: How busy the machine was before the benchmarks were.
LOAD = here.load()


def pretty(seconds: float) -> str:
    """Three digits and a unit."""
    factor, unit = next((f, u) for f, u in UNITS if seconds >= f or u == "ns")
    return f"{seconds / factor:.3g} {unit}"


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--rust``: run the benchmarks in Rust too; ``--history``: keep what was measured."""
    parser.addoption("--rust", action="store_true", help="add the medians of `cargo bench --bench dynamics`")
    parser.addoption("--history", type=Path, metavar="FOLDER", help="write an entry of this commit and machine there")


def measured(benchmarks: list[Any]) -> list[Row]:
    """What ran, table by table, in the order in which it ran."""
    rows: dict[str, dict[str, list[Side]]] = defaultdict(lambda: defaultdict(list))
    for bench in benchmarks:
        info = bench.extra_info
        if not bench.has_error and "table" in info:
            median, low, high = (
                float(value) * info.get("times", 1) for value in (bench.stats.median, bench.stats.q1, bench.stats.q3)
            )
            rows[info["table"]][info["row"]].append(Side(info["side"], median, low, high))
    return [Row(table, name, tuple(sides)) for table, named in rows.items() for name, sides in named.items()]


def printed(rows: list[Row]) -> Table:
    """Medians and ratios."""
    to_first = {(item.row, item.sides.partition(",")[0]): item.value for item in to_first_row(rows)}
    table = Table("", "First", "Second", "First / second", title="Medians, both sides in one process")
    for name in dict.fromkeys(row.table for row in rows):
        table.add_section()
        table.add_row(f"[bold]{name}[/bold]")
        for row in (row for row in rows if row.table == name):
            cells = [f"{side.name}: {pretty(side.median)}" for side in row.sides]
            if name == AGAINST_FIRST_ROW:
                factors = [to_first.get((row.name, side.name), 1.0) for side in row.sides]
                cells = [f"{cell} = {factor:.3f}" for cell, factor in zip(cells, factors, strict=True)]
            both = first_to_second(row)
            table.add_row(row.name, *cells, *([""] * (2 - len(cells))), f"{both.value:.2f}" if both else "")
    return table


def kept(rows: list[Row], folder: Path) -> str:
    """Write the run's entry; what to tell of it. A run of sources that no commit has is measured, not kept."""
    try:
        commit, committed = here.commit()
    except ValueError as error:
        return f"not kept: {error}"
    entry = Entry(commit, committed, here.now(), LOAD, here.machine(), tuple(rows))
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / file_name(entry)
    path.write_text(to_json(entry), encoding="utf-8")
    return f"kept: {path}"


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """The table, and where it is kept."""
    session = getattr(config, "_benchmarksession", None)
    rows = measured(session.benchmarks if session else [])
    if config.getoption("--rust"):
        found = rust_medians("dynamics").items()
        rows += [Row("in Rust, three sections unless said", row, (Side("median", median),)) for row, median in found]
    if not rows:
        return
    Console(width=130).print(printed(rows))  # wide enough that no cell is cut
    if folder := config.getoption("--history"):
        terminalreporter.write_line(kept(rows, folder))
