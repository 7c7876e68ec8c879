"""Plotly figures of the report. Labels that come from files are escaped here: Plotly reads some HTML in text."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.support.extras import import_extra

if TYPE_CHECKING:
    from bha.diagnosis.result import Diagnosis
    from bha.diagnosis.workflow import Investigation

Array = NDArray[np.float64]

# Colours that stay apart in print and for the colour-blind (Okabe and Ito 2008).
MEASURED, BEFORE, AFTER, NOISE, ACCENT = "#222222", "#d55e00", "#0072b2", "#999999", "#009e73"
#: Factor to either side up to which an interval of an estimate is drawn.
WIDEST = 20.0
#: Points of a trace at the most.
TRACE_POINTS = 1500


def plotly() -> Any:
    """Plotly's graph objects."""
    return import_extra("plotly.graph_objects", extra="report", purpose="The report of a diagnosis")


def subplots(**options: Any) -> Any:
    """A figure of several panels."""
    module = import_extra("plotly.subplots", extra="report", purpose="The report of a diagnosis")
    return module.make_subplots(**options)


def layout(figure: Any, height: int, *, titled: bool = False, **more: Any) -> Any:
    """The figure as those of the report are: font, margins, legend above."""
    figure.update_layout(
        template="plotly_white",
        height=height,
        margin={"l": 60, "r": 20, "t": 60 if titled else 34, "b": 50},
        font={"family": "system-ui, sans-serif", "size": 13},
        # Above the titles of the panels, whatever the height.
        legend={
            "orientation": "h",
            "yanchor": "bottom",
            "y": 1.0 + (30.0 if titled else 4.0) / (height - 100.0),
            "x": 0,
        },
        **more,
    )
    figure.update_yaxes(automargin=True)
    return figure


def gap_figure(found: Diagnosis) -> Any:
    """Error on the held-out logs in the order of the story: before, after, what noise makes."""
    go = plotly()
    gap = found.gap
    rows = [
        ("plain model", gap.before, BEFORE),
        ("with what is named", gap.after, AFTER),
        ("noise alone", gap.noise, NOISE),
    ]
    if not found.has_names:
        del rows[1]
    if found.residual_force is not None and found.residual_force.table is not None:
        rows.insert(1, ("residual table", found.residual_force.table.after, ACCENT))
    bars = go.Bar(
        x=[1e3 * value for _, value, _ in rows],
        y=[name for name, _, _ in rows],
        orientation="h",
        marker_color=[colour for _, _, colour in rows],
        text=[f"{1e3 * value:.3g} mm" for _, value, _ in rows],
        textposition="outside",
        cliponaxis=False,
    )
    figure = go.Figure(bars)
    figure.update_yaxes(autorange="reversed")
    figure.update_xaxes(title="error, RMS, mm", range=[0.0, 1.35e3 * max(v for _, v, _ in rows)])
    return layout(figure, 200)


def bars_figure(rows: Sequence[dict[str, Any]], label: str, title: str) -> Any:
    """Error over noise of the plain model in groups, a line at one."""
    go = plotly()
    names = [escape(str(r[label])) for r in rows]
    ratios = [r["ratio"] for r in rows]
    figure = go.Figure(go.Bar(x=names, y=ratios, marker_color=BEFORE))
    figure.add_hline(y=1.0, line_color=NOISE, line_dash="dot")
    figure.update_yaxes(title="error over noise", rangemode="tozero")
    figure.update_xaxes(title=title, type="category")
    return layout(figure, 280)


def band_figure(rows: Sequence[dict[str, Any]]) -> Any:
    """Error over noise by frequency band."""
    return bars_figure([{**r, "name": f"{r['low']:g} to {r['high']:g}"} for r in rows], "name", "frequency, Hz")


def time_figure(rows: Sequence[dict[str, Any]]) -> Any:
    """Error over noise of the plain model along the logs."""
    go = plotly()
    figure = go.Figure([go.Scatter(x=r["time"], y=r["ratio"], name=escape(r["log"]), mode="lines") for r in rows])
    figure.add_hline(y=1.0, line_color=NOISE, line_dash="dot")
    figure.update_xaxes(title="time in the log, s")
    figure.update_yaxes(title="error over noise", rangemode="tozero")
    return layout(figure, 300)


def region_figure(rows: Sequence[dict[str, Any]]) -> Any:
    """Error over noise by region, of the quantities it depends on most."""
    go = plotly()
    shown = [r for r in rows if r["p_value"] is not None][:6]
    figure = subplots(
        rows=max(1, -(-len(shown) // 2)),
        cols=2,
        subplot_titles=[f"{escape(r['name'])}, p = {r['p_value']:.3f}" for r in shown],
        vertical_spacing=0.16,
    )
    for k, r in enumerate(shown):
        centre = [(a + b) / 2 for a, b in zip(r["edges"][:-1], r["edges"][1:], strict=True)]
        line = go.Scatter(x=centre, y=r["ratio"], mode="lines+markers", line_color=BEFORE, showlegend=False)
        figure.add_trace(line, row=k // 2 + 1, col=k % 2 + 1)
        figure.update_xaxes(title=r["unit"], row=k // 2 + 1, col=k % 2 + 1)
    figure.update_yaxes(rangemode="tozero")
    return layout(figure, 230 * max(1, -(-len(shown) // 2)), titled=True)


def candidates_figure(found: Diagnosis) -> Any:
    """What the best candidates would explain, and the held-out error of those that were refitted."""
    go = plotly()
    shown = list(reversed(found.candidates[:15]))
    names = [escape(f"{c.kind} at {c.where}") for c in shown]
    refitted = [c.holdout for c in shown]
    figure = go.Figure(
        go.Bar(
            x=[100.0 * c.score for c in shown],
            y=names,
            orientation="h",
            marker_color=[ACCENT if r is not None else NOISE for r in refitted],
            text=["" if r is None else f"{1e3 * r:.3g} mm" for r in refitted],
            textposition="outside",
            cliponaxis=False,
        )
    )
    # Room for a number behind the longest bar on a narrow page, too.
    longest = max((100.0 * c.score for c in shown), default=0.0)
    figure.update_xaxes(title="share of the error, %", range=[0.0, 1.6 * max(longest, 1.0)])
    return layout(figure, 120 + 24 * len(shown), showlegend=False)


def trace_figure(outcome: Investigation) -> Any:
    """Measured and simulated outputs of the worst channels of the first held-out log."""
    go = plotly()
    record = outcome.holdout.problem.records[0]
    before = outcome.plain.prediction.outputs[0]
    after = outcome.best.prediction.outputs[0]
    named = outcome.diagnosis.has_names
    error = np.sqrt(np.nanmean((record.measured - before) ** 2, axis=0))
    worst = sorted(np.argsort(-error)[:3].tolist())
    step = max(1, len(record.rows) // TRACE_POINTS)
    time = record.time[::step]
    figure = subplots(
        rows=len(worst),
        cols=1,
        shared_xaxes=True,
        subplot_titles=[escape(record.channels[k]) for k in worst],
        vertical_spacing=0.07,
    )
    for row, k in enumerate(worst, start=1):
        lines = [("measured", record.measured[::step, k], MEASURED), ("plain model", before[::step, k], BEFORE)]
        if named:
            lines.append(("with what is named", after[::step, k], AFTER))
        for name, y, colour in lines:
            line = go.Scatter(
                x=np.round(time, 4).tolist(),
                y=np.round(1e3 * y, 4).tolist(),
                name=name,
                legendgroup=name,
                showlegend=row == 1,
                line={"color": colour, "width": 1.5},
            )
            figure.add_trace(line, row=row, col=1)
        figure.update_yaxes(title="mm", row=row, col=1)
    figure.update_xaxes(title=f"time, s ({escape(record.name)})", row=len(worst), col=1)
    return layout(figure, 200 * len(worst) + 60, titled=True)


def error_figure(outcome: Investigation) -> Any:
    """RMS error over the first held-out log, low-passed as it was compared, in blocks of a quarter of a second."""
    go = plotly()
    record = outcome.holdout.problem.records[0]
    width = max(1, round(0.25 / record.sample_time))
    count = len(record.rows) // width
    time = record.time[: count * width].reshape(count, width).mean(axis=1)

    def blocks(outputs: Array) -> list[float]:
        squares = np.mean((record.measured - outputs)[: count * width] ** 2, axis=1).reshape(count, width)
        return [round(v, 5) for v in (1e3 * np.sqrt(squares.mean(axis=1))).tolist()]

    lines = [("plain model", outcome.plain.prediction.outputs[0], BEFORE)]
    if outcome.diagnosis.has_names:
        lines.append(("with what is named", outcome.best.prediction.outputs[0], AFTER))
    figure = go.Figure(
        [
            go.Scatter(x=np.round(time, 3).tolist(), y=blocks(y), name=name, line_color=colour)
            for name, y, colour in lines
        ]
    )
    # A trace, since a labelled line loses its label on a logarithmic axis.
    level, ends = 1e3 * outcome.diagnosis.gap.noise, [float(time[0]), float(time[-1])]
    figure.add_trace(
        go.Scatter(x=ends, y=[level, level], name="noise floor (all rows)", line={"color": NOISE, "dash": "dot"})
    )
    figure.update_xaxes(title=f"time, s ({escape(record.name)})")
    values = [v for line in figure.data for v in line.y if v > 0.0]
    _decades(figure.update_yaxes, values, title="error, RMS, mm")
    return layout(figure, 300)


def spectrum_figure(found: Diagnosis) -> Any | None:
    """Spectra of the errors on the held-out logs against what noise makes; None where there are none."""
    spectrum = found.residual.get("spectrum")
    if not spectrum:
        return None
    go = plotly()
    lines: list[tuple[str, str, str, str | None]] = [("plain model", "before", BEFORE, None)]
    if found.has_names:
        lines.append(("with what is named", "after", AFTER, None))
    lines.append(("noise alone", "noise", NOISE, "dot"))
    frequency = [round(v, 4) for v in spectrum["frequency"]]
    figure, values = go.Figure(), []
    for name, key, colour, dash in lines:
        density = [1e3 * float(np.sqrt(v)) for v in spectrum[key]]
        values += [v for v in density if v > 0.0]
        figure.add_trace(
            go.Scatter(
                x=frequency,
                y=[float(f"{v:.4g}") for v in density],
                name=name,
                mode="lines",
                line={"color": colour, "dash": dash, "shape": "hvh" if key == "noise" else "linear"},
            )
        )
    _decades(figure.update_xaxes, frequency, title="frequency, Hz")
    _decades(figure.update_yaxes, values, title="error, mm per root Hz")
    return layout(figure, 320)


def estimates_figure(found: Diagnosis) -> Any | None:
    """Estimates of the plain parameters over what the file said, with 95 % intervals; None if none divides."""
    rows = [(name, e) for name, e in found.plain.items() if e.start and e.value / e.start > 0.0]
    if not rows:
        return None
    go = plotly()
    rows.reverse()
    ratios = [e.value / e.start for _, e in rows if e.start]
    ends = [
        tuple(sorted(v / e.start for v in e.ci95)) if e.ci95 and e.start else (r, r)
        for (_, e), r in zip(rows, ratios, strict=True)
    ]
    # A logarithmic axis, on which twice and half are alike: an interval down to nothing ends where that begins.
    ends = [(max(low, r / WIDEST), min(high, r * WIDEST)) for r, (low, high) in zip(ratios, ends, strict=True)]
    figure = go.Figure(
        go.Scatter(
            x=ratios,
            y=[escape(name) for name, _ in rows],
            mode="markers",
            marker={"color": AFTER, "size": 8},
            error_x={
                "type": "data",
                "symmetric": False,
                "array": [max(high - r, 0.0) for r, (_, high) in zip(ratios, ends, strict=True)],
                "arrayminus": [max(r - low, 0.0) for r, (low, _) in zip(ratios, ends, strict=True)],
                "color": AFTER,
            },
        )
    )
    figure.add_vline(x=1.0, line_color=NOISE, line_dash="dot")
    reached = [1.0, *ratios, *(v for pair in ends for v in pair)]
    ticks = _ratios(min(reached), max(reached))
    figure.update_xaxes(
        title="estimate / file",
        type="log",
        tickvals=ticks,
        ticktext=[f"{t:.3g}" for t in ticks],
    )
    return layout(figure, 110 + 22 * len(rows), showlegend=False)


def _ratios(low: float, high: float) -> list[float]:
    """Ticks of a logarithmic axis about one, finer where it is short."""
    reach = max(high, 1.0 / low)
    for ticks in ([0.8, 0.9, 1.0, 1.1, 1.2], [0.5, 0.7, 1.0, 1.4, 2.0], [0.2, 0.5, 1.0, 2.0, 5.0]):
        if reach < 1.3 * ticks[-1]:
            return ticks
    return [0.05, 0.2, 1.0, 5.0, 20.0]


def _decades(update: Callable[..., Any], values: Sequence[float], title: str) -> None:
    """A logarithmic axis with ticks at decades, or as many between them as three of them need within the values."""
    ticks = decade_ticks(min(values, default=1.0), max(values, default=1.0))
    update(title=title, type="log", tickvals=ticks, ticktext=[f"{t:.3g}" for t in ticks])


def decade_ticks(low: float, high: float) -> list[float]:
    """Ticks of a logarithmic axis over values from ``low`` to ``high``, and beyond to whole decades."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    even = [[step * k for k in range(round(1.0 / step), round(10.0 / step))] for step in (1.0, 0.5, 0.1)]
    ticks: list[float] = []
    for digits in ([1.0], [1.0, 2.0, 5.0], *even):
        ticks = [d * 10.0**k for k in range(first, last + 1) for d in digits]
        if sum(low <= tick <= high for tick in ticks) >= 3:
            break
    return ticks
