"""The arm of a report: drawn in three dimensions, what is blamed in colour, moving as it was measured and simulated.

What: the first held-out log again, simulated by the model that the diagnosis ended with, from the initial state it was
compared from; each bellows as the curve through its centre, heads as points. Of the measured arm the backbone where
lengths tell it, else the heads.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.arm.bodies import bellows_lines, up_direction
from bha.diagnosis.figures import AFTER, BEFORE, MEASURED, NOISE
from bha.errors import BhaError
from bha.parameters import Place
from bha.recordings import Observation
from bha.simulation import simulate_batch
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from bha.diagnosis.result import Effect
    from bha.diagnosis.workflow import Investigation
    from bha.estimation.records import Record
    from bha.parameters.bellows import ResolvedBellows

Array = NDArray[np.float64]

#: Frames of the animation, and points of a bellows' curve.
FRAMES, POINTS = 60, 7
#: What is blamed.
CULPRIT = "#cc3311"
#: Kinds that sit at a head rather than in bellows.
AT_HEAD = frozenset({"payload", "tool_drag", "contact"})


def arm_figure(outcome: Investigation, arm: Arm) -> Any | None:
    """The arm moving on the first held-out log; None where the model runs away at once.

    Args:
        outcome: what was found.
        arm: the arm with what was found, as ``arm_diagnosed.toml`` has it.
    """
    record, trial = outcome.holdout.problem.records[0], outcome.best
    if not outcome.diagnosis.has_names:
        trial = outcome.plain
    rows = np.linspace(0, len(record.rows) - 1, min(FRAMES, len(record.rows))).round().astype(int)
    lengths = _lengths(arm, record, trial.prediction.states[0], rows)
    if lengths is None:
        return None
    return _animated(arm, record, rows, lengths, outcome.diagnosis.missing, named=outcome.diagnosis.has_names)


def _lengths(arm: Arm, record: Record, state: Array, rows: NDArray[np.intp]) -> Array | None:
    """Simulated lengths at some rows, m, shape (rows, 3n)."""
    times = record.time[rows]
    start = float(record.time[0])
    try:
        x0 = state[: 6 * arm.section_count]
        batch = simulate_batch(arm, record.drive, x0=x0, times=times, start=start, warn=False)
    except BhaError:
        return None
    lengths = np.asarray(batch.lengths)[0]
    finite = np.all(np.isfinite(lengths), axis=1)
    return lengths if np.all(finite) else None


def _animated(
    arm: Arm, record: Record, rows: NDArray[np.intp], lengths: Array, effects: Sequence[Effect], *, named: bool
) -> Any:
    go = import_extra("plotly.graph_objects", extra="report", purpose="The report of a diagnosis")
    blamed = {place for effect in effects for place in blamed_bellows(arm, effect)} if named else set()
    every = [(i, k) for i, section in enumerate(_bellows(arm)) for k in range(len(section))]
    heads_blamed = blamed_heads(arm, effects) if named else []
    # As the diagnosed arm's camera and wires see it: that is the one that is drawn.
    seen = Observation.of(arm.parameters, record.observation.outputs)
    base = np.asarray(arm.shape(lengths[0], 2)).reshape(-1, 3)[:1]

    def drawn(k: int) -> list[Array]:
        """Curves of one frame: bellows, blamed bellows, backbone and heads measured, simulated heads, blamed heads."""
        q = lengths[k]
        simulated = np.array([arm.point_pose(q, i)[1] for i in range(1, arm.section_count + 1)])
        measured = measured_curve(arm, seen, record.measured[rows[k]], base)
        return [
            _curves(arm, q, [b for b in every if b not in blamed]),
            _curves(arm, q, [b for b in every if b in blamed]),
            measured,
            simulated,
            simulated[heads_blamed] if heads_blamed else np.full((1, 3), np.nan),
        ]

    colour = AFTER if named else BEFORE
    model = "with what is named" if named else "plain model"
    looks: list[dict[str, Any]] = [
        {"name": f"bellows, {model}", "mode": "lines", "line": {"color": NOISE, "width": 8}},
        {"name": "what is named", "mode": "lines", "line": {"color": CULPRIT, "width": 10}, "showlegend": bool(blamed)},
        {"name": "measured", "mode": "lines+markers", "line": {"color": MEASURED, "width": 5}, "marker": {"size": 4}},
        {"name": f"heads, {model}", "mode": "markers", "marker": {"color": colour, "size": 6, "symbol": "circle-open"}},
        {
            "name": "what is named, at the head",
            "mode": "markers",
            "marker": {"color": CULPRIT, "size": 9, "symbol": "diamond"},
            "showlegend": bool(heads_blamed),
        },
    ]
    all_frames = [drawn(k) for k in range(len(rows))]
    traces = [go.Scatter3d(**_xyz(curve), **look) for curve, look in zip(all_frames[0], looks, strict=True)]
    frames = [
        go.Frame(
            data=[go.Scatter3d(**_xyz(curve)) for curve in curves],
            traces=list(range(len(looks))),
            name=f"{record.time[row]:.2f}",
        )
        for row, curves in zip(rows, all_frames, strict=True)
    ]
    figure = go.Figure(traces, frames=frames)
    points = np.concatenate([c for curves in all_frames for c in curves])
    _scene(figure, arm, points)
    _player(figure, float(np.median(np.diff(record.time[rows]))) if len(rows) > 1 else 0.1)
    return figure


def blamed_bellows(arm: Arm, effect: Effect) -> list[tuple[int, int]]:
    """Bellows (section, number, from 0) that an effect sits in; none of those that sit at a head."""
    place = Place.read(effect.where)
    if place is None or effect.kind in AT_HEAD or place.sort in ("sensors", "heads"):
        return []
    return place.bellows_in(arm.parameters.inputs_of_bellows)


def blamed_heads(arm: Arm, effects: Sequence[Effect]) -> list[int]:
    """Sections, from 0, at whose heads an effect sits."""
    found = set()
    for effect in effects:
        place = Place.read(effect.where)
        if place is not None and effect.kind in AT_HEAD:
            found |= {place.section - 1} if place.section is not None else set(range(arm.section_count))
    return sorted(found)


def _bellows(arm: Arm) -> list[tuple[ResolvedBellows, ...]]:
    return [section.resolved_bellows(i) for i, section in enumerate(arm.parameters.sections, start=1)]


def _curves(arm: Arm, lengths: Array, places: Sequence[tuple[int, int]]) -> Array:
    """Middles of bellows one after the other, m, rows of NaN between them."""
    nothing = np.full((1, 3), np.nan)
    lines = {i: bellows_lines(arm, i + 1, lengths, POINTS - 1) for i in {i for i, _ in places}}
    return np.concatenate([nothing, *(part for i, k in places for part in (lines[i][k], nothing))])


def measured_curve(arm: Arm, observation: Observation, outputs: Array, base: Array) -> Array:
    """The measured backbone where lengths tell it, else the base and the measured heads, m, in the base frame."""
    count = len(observation.rows)
    if count and int(np.linalg.matrix_rank(observation.rows)) == observation.rows.shape[1]:
        true = (outputs[:count] - observation.shifts) / observation.gains - observation.offsets
        lengths = np.linalg.lstsq(observation.rows, true, rcond=None)[0]
        try:
            return np.asarray(arm.shape(lengths, 8)).reshape(-1, 3)
        except ValueError:
            return np.full((1, 3), np.nan)
    seen = {(o.section, o.number): k for k, o in enumerate(observation.outputs) if o.kind == "position"}
    whole = [i for i in sorted({i for i, _ in seen}) if all((i, axis) in seen for axis in (1, 2, 3))]
    heads = outputs[[seen[i, axis] for i in whole for axis in (1, 2, 3)]].reshape(-1, 3)
    return np.concatenate([base, observation.camera.base_positions(heads)])


def _xyz(points: Array) -> dict[str, list[float | None]]:
    """Coordinates as Plotly has them: to a tenth of a millimetre, nothing where a curve ends."""
    return {
        axis: [None if math.isnan(v) else round(v, 4) for v in points[:, k].tolist()] for k, axis in enumerate("xyz")
    }


def _scene(figure: Any, arm: Arm, points: Array) -> None:
    """Equal axes that hold every frame, with what is up in space at the top."""
    up = up_direction(arm)
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    least = 0.5 * float(np.max(high - low))
    middle, half = 0.5 * (low + high), 0.55 * np.maximum(high - low, least)
    # From the side, a little from above.
    side = np.cross(up, (0.0, 1.0, 0.0) if abs(up[1]) < 0.9 else (1.0, 0.0, 0.0))
    eye = 1.6 * side + 1.1 * np.cross(side, up) + 0.45 * up
    figure.update_layout(
        scene={
            **{
                f"{axis}axis": {"title": f"{axis}, m", "range": [float(m - h), float(m + h)], "nticks": 5}
                for axis, m, h in zip("xyz", middle, half, strict=True)
            },
            "dragmode": "orbit",  # the turntable would have z at the top
            "aspectmode": "manual",
            "aspectratio": dict(zip("xyz", (half / np.max(half)).tolist(), strict=True)),
            "camera": {
                "up": dict(zip("xyz", up.tolist(), strict=True)),
                "eye": dict(zip("xyz", eye.tolist(), strict=True)),
            },
        },
        template="plotly_white",
        height=640,
        margin={"l": 0, "r": 0, "t": 10, "b": 110},
        font={"family": "system-ui, sans-serif", "size": 13},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.0, "x": 0},
    )


def _player(figure: Any, pace: float) -> None:
    """Play, stop and a slider; ``pace`` is the time between frames, s."""
    play = {"frame": {"duration": 1e3 * pace, "redraw": True}, "transition": {"duration": 0}, "fromcurrent": True}
    stop = {"frame": {"duration": 0, "redraw": True}, "mode": "immediate", "transition": {"duration": 0}}
    figure.update_layout(
        updatemenus=[
            {
                "type": "buttons",
                "direction": "left",
                "x": 0.0,
                "y": -0.03,
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
                "x": 0.2,
                "y": -0.02,
                "len": 0.78,
                "ticklen": 0,
                "minorticklen": 0,
                "currentvalue": {"prefix": "t = ", "suffix": " s"},
                "font": {"color": "rgba(0,0,0,0)"},
                "steps": [
                    {"label": frame.name, "method": "animate", "args": [[frame.name], stop]} for frame in figure.frames
                ],
            }
        ],
    )
