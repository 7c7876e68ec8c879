"""Plotly figures of the report. Labels that come from files are escaped here: Plotly reads some HTML in text."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha import _core
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from bha.diagnosis.result import Diagnosis
    from bha.diagnosis.workflow import Investigation
    from bha.recordings import Observation

Array = NDArray[np.float64]

# Colours that stay apart in print and for the colour-blind (Okabe and Ito 2008).
MEASURED, BEFORE, AFTER, NOISE, ACCENT = "#222222", "#d55e00", "#0072b2", "#999999", "#009e73"
#: Points of a trace and frames of the animation at the most.
TRACE_POINTS, FRAMES = 1500, 80


def _plotly() -> Any:
    return import_extra("plotly.graph_objects", extra="report", purpose="The report of a diagnosis")


def _subplots(**options: Any) -> Any:
    module = import_extra("plotly.subplots", extra="report", purpose="The report of a diagnosis")
    return module.make_subplots(**options)


def _layout(figure: Any, height: int, *, titled: bool = False, **more: Any) -> Any:
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
    """Error on the held-out logs: noise, before, after."""
    go = _plotly()
    gap = found.gap
    names = (
        ["noise floor", "plain model", "with the named effects"]
        if found.verdict == "named"
        else ["noise floor", "plain model"]
    )
    values = [1e3 * gap.noise, 1e3 * gap.before, 1e3 * gap.after][: len(names)]
    bars = go.Bar(
        x=values,
        y=names,
        orientation="h",
        marker_color=[NOISE, BEFORE, AFTER][: len(names)],
        text=[f"{v:.3g} mm" for v in values],
        textposition="auto",
    )
    figure = go.Figure(bars)
    figure.update_yaxes(autorange="reversed")
    figure.update_xaxes(title="held-out error, RMS, mm")
    return _layout(figure, 220)


def bars_figure(rows: Sequence[dict[str, Any]], label: str, title: str) -> Any:
    """Error over noise of the plain model in groups, a line at one."""
    go = _plotly()
    names = [escape(str(r[label])) for r in rows]
    ratios = [r["ratio"] for r in rows]
    figure = go.Figure(go.Bar(x=names, y=ratios, marker_color=BEFORE))
    figure.add_hline(y=1.0, line_color=NOISE, line_dash="dot")
    figure.update_yaxes(title="error over noise", rangemode="tozero")
    figure.update_xaxes(title=title, type="category")
    return _layout(figure, 280)


def band_figure(rows: Sequence[dict[str, Any]]) -> Any:
    """Error over noise by frequency band."""
    return bars_figure([{**r, "name": f"{r['low']:g} to {r['high']:g}"} for r in rows], "name", "frequency, Hz")


def time_figure(rows: Sequence[dict[str, Any]]) -> Any:
    """Error over noise of the plain model along the logs."""
    go = _plotly()
    figure = go.Figure([go.Scatter(x=r["time"], y=r["ratio"], name=escape(r["log"]), mode="lines") for r in rows])
    figure.add_hline(y=1.0, line_color=NOISE, line_dash="dot")
    figure.update_xaxes(title="time in the log, s")
    figure.update_yaxes(title="error over noise", rangemode="tozero")
    return _layout(figure, 300)


def region_figure(rows: Sequence[dict[str, Any]]) -> Any:
    """Error over noise by region, of the quantities it depends on most."""
    go = _plotly()
    shown = [r for r in rows if r["p_value"] is not None][:6]
    figure = _subplots(
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
    return _layout(figure, 230 * max(1, -(-len(shown) // 2)), titled=True)


def candidates_figure(found: Diagnosis) -> Any:
    """What the best candidates would explain, and the held-out error of those that were refitted."""
    go = _plotly()
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
            textposition="auto",
        )
    )
    figure.update_xaxes(title="share of error explained, %")
    return _layout(figure, 120 + 24 * len(shown), showlegend=False)


def trace_figure(outcome: Investigation) -> Any:
    """Measured and simulated outputs of the worst channels of the first held-out log."""
    go = _plotly()
    record = outcome.holdout.problem.records[0]
    before = outcome.plain.prediction.outputs[0]
    after = outcome.best.prediction.outputs[0]
    named = outcome.diagnosis.verdict == "named"
    error = np.sqrt(np.nanmean((record.outputs - before) ** 2, axis=0))
    worst = sorted(np.argsort(-error)[:3].tolist())
    step = max(1, len(record.rows) // TRACE_POINTS)
    time = record.output_time[::step]
    figure = _subplots(
        rows=len(worst),
        cols=1,
        shared_xaxes=True,
        subplot_titles=[escape(record.channels[k]) for k in worst],
        vertical_spacing=0.07,
    )
    for row, k in enumerate(worst, start=1):
        lines = [("measured", record.outputs[::step, k], MEASURED), ("plain model", before[::step, k], BEFORE)]
        if named:
            lines.append(("with the named effects", after[::step, k], AFTER))
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
    return _layout(figure, 200 * len(worst) + 60, titled=True)


def error_figure(outcome: Investigation) -> Any:
    """RMS error over the first held-out log, low-passed as it was compared, in blocks of a quarter of a second."""
    go = _plotly()
    record = outcome.holdout.problem.records[0]
    width = max(1, round(0.25 / record.sample_time))
    count = len(record.rows) // width
    time = record.output_time[: count * width].reshape(count, width).mean(axis=1)

    def blocks(outputs: Array) -> list[float]:
        squares = np.mean((record.outputs - outputs)[: count * width] ** 2, axis=1).reshape(count, width)
        return [round(v, 5) for v in (1e3 * np.sqrt(squares.mean(axis=1))).tolist()]

    lines = [("plain model", outcome.plain.prediction.outputs[0], BEFORE)]
    if outcome.diagnosis.verdict == "named":
        lines.append(("with the named effects", outcome.best.prediction.outputs[0], AFTER))
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
    figure.update_yaxes(title="error, RMS, mm", type="log", dtick="D2")
    return _layout(figure, 300)


def arm_figure(outcome: Investigation) -> Any:
    """The arm moving on the first held-out log, measured against simulated: two side views."""
    go = _plotly()
    record = outcome.holdout.problem.records[0]
    rows = np.linspace(0, len(record.rows) - 1, min(FRAMES, len(record.rows))).round().astype(int)
    fit = outcome.plain.fit
    arm, observation = _core.Arm(fit.model.arm(fit.x)), record.observation.seen_by(fit.model.camera(fit.x))
    kinds = [("measured", record.outputs, MEASURED), ("plain model", outcome.plain.prediction.outputs[0], BEFORE)]
    if outcome.diagnosis.verdict == "named":
        kinds.append(("with the named effects", outcome.best.prediction.outputs[0], AFTER))
    curves = {name: [_backbone(arm, observation, outputs[row]) for row in rows] for name, outputs, _ in kinds}
    figure = _subplots(rows=1, cols=2, subplot_titles=("view along y", "view along x"), horizontal_spacing=0.12)
    for axis in (0, 1):
        for name, _, colour in kinds:
            curve = curves[name][0]
            line = go.Scatter(
                x=curve[:, axis].tolist(),
                y=curve[:, 2].tolist(),
                name=name,
                legendgroup=name,
                showlegend=axis == 0,
                mode="lines+markers",
                marker_size=4,
                line={"color": colour, "width": 4 if name == "measured" else 2},
            )
            figure.add_trace(line, row=1, col=axis + 1)
    frames = []
    for k, row in enumerate(rows):
        data = [
            go.Scatter(x=curves[name][k][:, axis].tolist(), y=curves[name][k][:, 2].tolist())
            for axis in (0, 1)
            for name, _, _ in kinds
        ]
        frames.append(go.Frame(data=data, name=f"{record.output_time[row]:.2f}"))
    figure.frames = frames
    points = np.concatenate([c for list_ in curves.values() for c in list_])
    reach = 1.1 * max(float(np.nanmax(np.abs(points[:, :2]))), 0.05)
    low, high = float(np.nanmin(points[:, 2])), float(np.nanmax(points[:, 2]))
    figure.update_xaxes(range=[-reach, reach], title="m")
    figure.update_yaxes(range=[high + 0.1 * (high - low), low - 0.1 * (high - low)])
    pace = float(np.median(np.diff(record.output_time[rows]))) * 1e3
    play = {"frame": {"duration": pace, "redraw": False}, "transition": {"duration": 0}, "fromcurrent": True}
    stop = {"frame": {"duration": 0, "redraw": False}, "mode": "immediate", "transition": {"duration": 0}}
    figure.update_layout(
        updatemenus=[
            {
                "type": "buttons",
                "direction": "left",
                "x": 0.0,
                "y": -0.18,
                "xanchor": "left",
                "yanchor": "top",
                "buttons": [
                    {"label": "play", "method": "animate", "args": [None, play]},
                    {"label": "stop", "method": "animate", "args": [[None], stop]},
                ],
            }
        ],
        sliders=[
            {
                "y": -0.3,
                "len": 1.0,
                "currentvalue": {"prefix": "t = ", "suffix": " s"},
                "steps": [{"label": f.name, "method": "animate", "args": [[f.name], stop]} for f in frames],
            }
        ],
    )
    return _layout(figure, 560, titled=True).update_layout(margin={"l": 50, "r": 20, "t": 70, "b": 150})


def _backbone(arm: Any, observation: Observation, outputs: Array) -> Array:
    """Backbone (points, 3) from the lengths where they tell it, else the base and the heads."""
    count = len(observation.rows)
    if int(np.linalg.matrix_rank(observation.rows)) == observation.rows.shape[1]:
        true = (outputs[:count] - observation.shifts) / observation.gains - observation.offsets
        lengths = np.linalg.lstsq(observation.rows, true, rcond=None)[0]
        try:
            return np.asarray(np.round(np.asarray(arm.shape(lengths, 8)).reshape(-1, 3), 5))
        except ValueError:
            return np.full((2, 3), np.nan)
    sections = sorted({o.section for o in observation.outputs if o.kind == "position"})
    seen = {(o.section, o.number): k for k, o in enumerate(observation.outputs) if o.kind == "position"}
    whole = [i for i in sections if all((i, axis) in seen for axis in (1, 2, 3))]
    columns = [seen[i, axis] for i in whole for axis in (1, 2, 3)]
    heads = observation.camera.base_positions(np.asarray(outputs[columns]).reshape(-1, 3))
    return np.asarray(np.round(np.concatenate([np.zeros((1, 3)), heads]), 5))
