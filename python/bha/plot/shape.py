"""The shape of an arm at several times: its backbone in two projections or in space."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.errors import InputError
from bha.plot.style import MILLIMETRES_PER_METRE, figure_of_size
from bha.support.extras import import_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_shape(
    times: ArrayLike,
    backbones: ArrayLike,
    heads: ArrayLike | None = None,
    *,
    view: Literal["projections", "space"] = "projections",
    hanging: bool = True,
    title: str | None = None,
) -> Figure:
    """Plot the backbone of an arm at several times, the later the darker.

    Args:
        times: s, shape (m,).
        backbones: points along the backbone in the world from base to tip, m, shape (m, points, 3).
        heads: positions of the heads in the world, m, shape (m, n, 3), drawn as dots; None draws none.
        view: ``"projections"`` on the x-z and the y-z plane, or ``"space"``.
        hanging: draw z downwards, as an arm hangs in a world with z along gravity.
        title: a line above the figure.

    Raises:
        InputError: shapes that do not fit together, or an unknown view.
        MissingExtraError: matplotlib is not installed.
    """
    moments = np.asarray(times, dtype=np.float64)
    lines = _points("backbones", backbones, moments)
    dots = np.empty((len(moments), 0, 3)) if heads is None else _points("heads", heads, moments)
    if view not in ("projections", "space"):
        raise InputError(f'view: expected "projections" or "space", found {view!r}')

    colors = _by_time(len(moments))
    if view == "space":
        return _in_space(moments, lines, dots, colors, hanging, title)
    return _projections(moments, lines, dots, colors, hanging, title)


def _projections(
    times: NDArray[np.float64],
    lines: NDArray[np.float64],
    dots: NDArray[np.float64],
    colors: NDArray[np.float64],
    hanging: bool,
    title: str | None,
) -> Figure:
    with figure_of_size(6.4, 4.2) as figure:
        left = figure.add_subplot(1, 2, 1)
        right = figure.add_subplot(1, 2, 2, sharex=left, sharey=left)
        for axes, axis in ((left, 0), (right, 1)):
            _project(axes, axis, times, lines, dots, colors)
            axes.set_aspect("equal", adjustable="box")
        left.set_ylabel("z [mm]")
        right.tick_params(labelleft=False)
        if hanging:
            left.invert_yaxis()
        handles, _ = left.get_legend_handles_labels()
        figure.legend(handles=handles, loc="outside right upper", title=title, alignment="left")
    return figure


def draw_projection(
    axes: Axes, axis: int, times: ArrayLike, backbones: ArrayLike, heads: ArrayLike, *, hanging: bool
) -> None:
    """Draw backbones on one plane into given axes, as :func:`plot_shape` does: x-z if ``axis`` is 0, y-z if it is 1."""
    moments = np.asarray(times, dtype=np.float64)
    lines, dots = _points("backbones", backbones, moments), _points("heads", heads, moments)
    _project(axes, axis, moments, lines, dots, _by_time(len(moments)))
    axes.set_aspect("equal", adjustable="datalim")
    if hanging and not axes.yaxis_inverted():
        axes.invert_yaxis()


def _project(
    axes: Axes,
    axis: int,
    times: NDArray[np.float64],
    lines: NDArray[np.float64],
    dots: NDArray[np.float64],
    colors: NDArray[np.float64],
) -> None:
    for time, line, dot, color in zip(times, lines, dots, colors, strict=True):
        axes.plot(line[:, axis], line[:, 2], color=color, linewidth=1.6, label=f"t = {time:.3g} s")
        axes.plot(dot[:, axis], dot[:, 2], "o", color=color, markersize=3.5)
    axes.plot(lines[0, 0, axis], lines[0, 0, 2], "s", color="black", markersize=5, clip_on=False)
    axes.set_xlabel(f"{'xy'[axis]} [mm]")


def _by_time(count: int) -> NDArray[np.float64]:
    """From light to dark: later is darker also in grey print. Both ends are cut, white lines would not be seen."""
    colormaps = import_extra("matplotlib", extra="plot", purpose="Plotting").colormaps
    return np.asarray(colormaps["cividis_r"](np.linspace(0.12, 1.0, count)))


def _in_space(
    times: NDArray[np.float64],
    lines: NDArray[np.float64],
    dots: NDArray[np.float64],
    colors: NDArray[np.float64],
    hanging: bool,
    title: str | None,
) -> Figure:
    import_extra("mpl_toolkits.mplot3d", extra="plot", purpose="Plotting")
    with figure_of_size(5.6, 4.6) as figure:
        axes: Any = figure.add_subplot(projection="3d")
        for time, line, dot, color in zip(times, lines, dots, colors, strict=True):
            axes.plot(*line.T, color=color, linewidth=1.6, label=f"t = {time:.3g} s")
            axes.plot(*dot.T, "o", color=color, markersize=3.5)
        axes.plot(*lines[0, 0], "s", color="black", markersize=5)
        # A plane motion must not squeeze the axis across it: x and y get the greater of both spans.
        low, high = lines[..., :2].min(axis=(0, 1)), lines[..., :2].max(axis=(0, 1))
        half = max(0.55 * float(np.max(high - low)), 0.2 * float(np.ptp(lines[..., 2])))
        axes.set_xlim(*((low + high)[0] / 2 + np.array([-half, half])))
        axes.set_ylim(*((low + high)[1] / 2 + np.array([-half, half])))
        bottom, top = axes.get_zlim()
        axes.set_zlim(*((top, bottom) if hanging else (bottom, top)))
        # Equal millimetres on all axes; a bit smaller than the default, which cuts labels off.
        axes.set_box_aspect((2 * half, 2 * half, top - bottom), zoom=0.85)
        for name, axis in (("x", axes.xaxis), ("y", axes.yaxis), ("z", axes.zaxis)):
            axis.set_label_text(f"{name} [mm]")
            axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
            axis.set_major_locator(import_extra("matplotlib.ticker", extra="plot", purpose="Plotting").MaxNLocator(4))
        axes.view_init(elev=18, azim=-60)
        handles, _ = axes.get_legend_handles_labels()
        figure.legend(handles=handles, loc="outside right upper", title=title, alignment="left")
    return figure


def _points(name: str, points: ArrayLike, times: NDArray[np.float64]) -> NDArray[np.float64]:
    array = np.asarray(points, dtype=np.float64)
    if times.ndim != 1 or len(times) == 0:
        raise InputError(f"times: expected shape (m,) with m >= 1, found {times.shape}")
    if array.ndim != 3 or array.shape[0] != len(times) or array.shape[2] != 3:
        raise InputError(f"{name}: expected shape ({len(times)}, points, 3), found {array.shape}")
    return array * MILLIMETRES_PER_METRE
