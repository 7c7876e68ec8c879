"""A page of figures: ratios over all machines, seconds machine by machine, and what was run where."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

import plotly.graph_objects as go
from plotly.offline import get_plotlyjs

from .entry import Entry, Ratio, ratios

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 1200px; padding: 1rem; color: #222; }
.figures { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 0.8rem; }
.figures > div { min-width: 0; overflow: hidden; }
.scroll { overflow-x: auto; }
td, th { text-align: left; padding: 0.2rem 0.7rem 0.2rem 0; border-bottom: 1px solid #ddd; white-space: nowrap; }
@media (max-width: 720px) { .figures { grid-template-columns: minmax(0, 1fr); } }
"""
INTRODUCTION = """
<p>Medians of <code>make bench</code>, commit by commit. A ratio has both sides from one process, so that it compares
across machines; its bar reaches as far as the quartiles of both allow. Seconds compare on one machine only, and where
the load (processes that wanted to run) was much above zero, neither is worth much.</p>
"""
HEADINGS = ("commit", "committed", "measured", "processor", "cores", "system", "Python", "Rust", "load")
#: Of a figure, pixels.
HEIGHT = 320


def by_label(entries: list[Entry]) -> dict[str, list[tuple[Entry, Ratio]]]:
    """Label of a ratio -> the runs that have it, in their order."""
    found: dict[str, list[tuple[Entry, Ratio]]] = {}
    for entry in entries:
        for item in ratios(entry.rows):
            found.setdefault(item.label, []).append((entry, item))
    return found


def processors(entries: list[Entry]) -> dict[str, list[Entry]]:
    """Processor -> its runs, in their order."""
    found: dict[str, list[Entry]] = {}
    for entry in entries:
        found.setdefault(entry.machine.processor, []).append(entry)
    return found


def ratio_figure(label: str, series: list[tuple[Entry, Ratio]]) -> go.Figure:
    """A ratio over the commits, a colour for each processor."""
    figure = go.Figure()
    for processor in dict.fromkeys(entry.machine.processor for entry, _ in series):
        mine = [(entry, item) for entry, item in series if entry.machine.processor == processor]
        figure.add_scatter(
            x=[entry.label for entry, _ in mine],
            y=[item.value for _, item in mine],
            error_y={
                "array": [0.0 if item.high is None else item.high - item.value for _, item in mine],
                "arrayminus": [0.0 if item.low is None else item.value - item.low for _, item in mine],
            },
            hovertext=[f"{processor}, load {entry.load}" for entry, _ in mine],
            mode="lines+markers",
            name=processor,
        )
    # By the medians: on a busy machine the upper quartile of a short call is a hundred times it.
    figure.update_yaxes(range=[0, 1.4 * max(item.value for _, item in series)])
    return laid_out(figure, label, "first / second", [entry for entry, _ in series])


def seconds_figures(processor: str, entries: list[Entry]) -> Iterator[go.Figure]:
    """Medians on one processor, a figure for each table."""
    for table in dict.fromkeys(row.table for entry in entries for row in entry.rows):
        figure = go.Figure()
        lines: dict[str, list[tuple[str, float]]] = {}
        for entry in entries:
            for row in entry.rows:
                for side in row.sides if row.table == table else ():
                    lines.setdefault(f"{row.name}, {side.name}", []).append((entry.label, side.median))
        for name, points in lines.items():
            x, y = zip(*points, strict=True)
            figure.add_scatter(x=x, y=y, mode="lines+markers", name=name)
        figure.update_yaxes(type="log", exponentformat="SI", ticksuffix="s")
        figure.update_layout(showlegend=False)
        yield laid_out(figure, f"{table} ({processor})", "median", entries)


def laid_out(figure: go.Figure, title: str, unit: str, entries: list[Entry]) -> go.Figure:
    """What all figures have in common: commits in their order, at even distances; long titles in two lines."""
    words, lines = title.split(), [""]
    for word in words:
        if len(lines[-1]) + len(word) > 62:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    figure.update_layout(
        title={"text": "<br>".join(escape(line) for line in lines), "font": {"size": 13}},
        height=HEIGHT,
        margin={"l": 60, "r": 20, "t": 60, "b": 80},
        legend={"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0.0, "font": {"size": 10}},
        template="plotly_white",
    )
    order = list(dict.fromkeys(entry.label for entry in entries))
    figure.update_xaxes(type="category", categoryorder="array", categoryarray=order, tickangle=-30)
    figure.update_yaxes(title=unit)
    return figure


def described(entry: Entry) -> tuple[str, ...]:
    """An entry's row in the table of runs, under ``HEADINGS``."""
    machine = entry.machine
    run = (entry.commit[:8], entry.committed, entry.measured)
    place = (machine.processor, str(machine.cores), machine.system, machine.python, machine.rust)
    return (*run, *place, "" if entry.load is None else f"{entry.load:g}")


def page(entries: list[Entry]) -> str:
    """One HTML page that needs no network; what comes from files is escaped."""

    def block(title: str, figures: Iterator[go.Figure]) -> str:
        parts = (
            figure.to_html(full_html=False, include_plotlyjs=False, config={"displayModeBar": False})
            for figure in figures
        )
        return f"<h2>{escape(title)}</h2><div class='figures'>{''.join(f'<div>{part}</div>' for part in parts)}</div>"

    blocks = [block("Ratios", (ratio_figure(label, series) for label, series in by_label(entries).items()))]
    for processor, mine in processors(entries).items():
        blocks.append(block(f"Seconds on {processor}", seconds_figures(processor, mine)))
    heading = "".join(f"<th>{name}</th>" for name in HEADINGS)
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in described(entry))}</tr>" for entry in entries)
    return (
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'><title>Benchmarks of bha</title>"
        f"<style>{STYLE}</style><script>{get_plotlyjs()}</script></head><body><h1>Benchmarks of bha</h1>{INTRODUCTION}"
        f"{''.join(blocks)}<h2>Runs</h2><div class='scroll'><table><tr>{heading}</tr>{rows}</table></div>"
        "</body></html>\n"
    )
