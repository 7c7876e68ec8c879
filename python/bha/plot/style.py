"""The look of all figures: colours, line styles, sizes; and what every figure needs done.

Figures are built as ``matplotlib.figure.Figure`` objects, never through ``pyplot``: no window system is asked for, no
figure stays in a global list, and the caller's own settings are not touched.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError
from bha.plot.settings import settings_in_force
from bha.support.extras import import_extra
from bha.support.files import written_whole

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bha.runs.trajectory import Trajectory

# Okabe-Ito, the colours that also differ in brightness first: apart for colour-blind eyes and in grey print.
COLORS = ("#000000", "#0072B2", "#E69F00", "#56B4E9", "#D55E00", "#009E73", "#CC79A7", "#F0E442")

# Line styles of the paper's Figs. 12 and 14. Labels without a style of their own take the next free one.
SOLID, DOTTED, DASHED, DASH_DOTTED = "-", (0, (1, 1.3)), (0, (5, 2)), (0, (6, 1.5, 1, 1.5))
STYLE_OF_LABEL: Mapping[str, Any] = {"measured": SOLID, "full": DOTTED, "reduced": DASHED}

PASCAL_PER_BAR = 1e5
MILLIMETRES_PER_METRE = 1e3
# More points than this in a line are more than a printed page can show.
MOST_POINTS = 4000
#: Width of a figure of three panels, inches.
WIDTH = 7.2


@contextmanager
def figure_of_size(width: float, height: float) -> Iterator[Figure]:
    """A new figure, in inches, with the settings of this package in force inside the block and only there.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    with settings_in_force():
        from bha.plot.figure import ShownFigure  # noqa: PLC0415  (matplotlib is there)

        yield ShownFigure(figsize=(width, height), layout="constrained")


@contextmanager
def axes_of_size(axes: Axes | None, width: float, height: float) -> Iterator[Axes]:
    """The caller's axes, with the caller's settings; without any those of a new figure, as :func:`figure_of_size`.

    Raises:
        InputError: something that is no axes of matplotlib.
        MissingExtraError: matplotlib is not installed.
    """
    if axes is None:
        with figure_of_size(width, height) as figure:
            yield figure.add_subplot()
        return
    kind = import_extra("matplotlib.axes", extra="plot", purpose="Plotting").Axes
    if not isinstance(axes, kind):
        raise InputError(f"axes: {type(axes).__name__}; Axes of matplotlib are needed")
    yield axes


def write_figure(figure: Figure, path: str | os.PathLike[str]) -> Path:
    """Write a figure to a file, whole or not at all; the extension chooses the format (.pdf, .svg, .png).

    The same figure gives the same bytes: no date is written.

    Raises:
        InputError: unknown extension, or a folder that does not exist.
    """
    path = Path(path)
    undated: dict[str, dict[str, Any]] = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}, ".png": {}}
    kind = path.suffix.lower()
    if kind not in undated:
        raise InputError(f"{path}: unknown extension {kind or '(none)'}; figures are written as .pdf, .svg or .png")
    with written_whole(path) as temporary, settings_in_force():
        figure.savefig(temporary, format=kind[1:], metadata=undated[kind])
    return path


def line_styles(labels: list[str]) -> dict[str, Any]:
    """A line style for each label: the paper's for its names (also as first word: "full model"), else the next free."""
    styles = {label: STYLE_OF_LABEL.get(label.split()[0].lower()) if label.split() else None for label in labels}
    taken = [style for style in styles.values() if style is not None]
    free = cycle([style for style in (SOLID, DOTTED, DASHED, DASH_DOTTED) if style not in taken] or [SOLID])
    return {label: next(free) if style is None else style for label, style in styles.items()}


def line_options(style: Any, color: str, alone: bool = False) -> dict[str, Any]:
    """Keywords of a line. A solid one beside others is broad and pale and lies below: dots and dashes on it show."""
    if style != SOLID:
        return {"linestyle": style, "color": color, "linewidth": 1.4 if style == DOTTED else 1.1, "zorder": 2.4}
    if alone:
        return {"linestyle": style, "color": color, "linewidth": 1.0, "zorder": 2.2}
    return {"linestyle": style, "color": _pale(color), "linewidth": 2.2, "zorder": 2.0}


def _pale(color: str) -> tuple[float, ...]:
    """The colour thinned with white; opaque, so that crossings do not darken."""
    return tuple(1.0 - 0.45 * (1.0 - int(color[at : at + 2], 16) / 255.0) for at in (1, 3, 5))


def draw(axes: Axes, time: NDArray[np.float64], values: NDArray[np.float64], **options: Any) -> None:
    """Draw one line; of very long ones the least and greatest value of each stretch, so that no peak is lost.

    A value between missing ones, as of a sensor that is read more rarely than the rest, makes no line: it is a dot.
    """
    if len(time) > MOST_POINTS:
        stretches = np.array_split(np.arange(len(time)), MOST_POINTS // 2)
        filled = np.nan_to_num(values, nan=np.inf)
        least = [stretch[np.argmin(filled[stretch])] for stretch in stretches]
        filled = np.nan_to_num(values, nan=-np.inf)
        greatest = [stretch[np.argmax(filled[stretch])] for stretch in stretches]
        kept = np.unique([*least, *greatest])
        time, values = time[kept], values[kept]
    (line,) = axes.plot(time, values, **options)
    beside = np.pad(np.isfinite(values), 1)
    alone = beside[1:-1] & ~beside[:-2] & ~beside[2:]
    if alone.any():
        axes.plot(time[alone], values[alone], linestyle="none", marker=".", markersize=2.0, color=line.get_color())


def legend_above(figure: Figure, styles: Mapping[str, Mapping[str, Any]], numbered: str, count: int = 3) -> None:
    """Above all panels: line styles by label, then the colours by number."""
    lines = import_extra("matplotlib.lines", extra="plot", purpose="Plotting")
    handles = [lines.Line2D([], [], label=label, **options) for label, options in styles.items()]
    handles += [
        lines.Line2D([], [], color=COLORS[k], linewidth=3, solid_capstyle="butt",
                     label=str(k + 1) if k else f"{numbered} 1")
        for k in range(count)
    ]  # fmt: skip
    figure.legend(handles=handles, loc="outside upper left", ncols=len(handles), columnspacing=1.6)


def check_trajectories(trajectories: Mapping[str, Trajectory]) -> Trajectory:
    """The first of the trajectories, after checking that there is one and that all have its number of sections.

    Raises:
        InputError: none given, one without rows, or different numbers of sections.
    """
    if not trajectories:
        raise InputError("nothing to plot: give at least one trajectory, as {label: trajectory}")
    first = next(iter(trajectories.values()))
    for label, trajectory in trajectories.items():
        if len(trajectory) == 0:
            raise InputError(f"trajectory {label!r} has no rows to plot")
        if trajectory.section_count != first.section_count:
            raise InputError(
                f"trajectory {label!r} has {trajectory.section_count} sections, the first has {first.section_count}; "
                "plot arms with different numbers of sections in figures of their own"
            )
    return first
