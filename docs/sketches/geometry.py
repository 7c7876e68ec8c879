"""Where things are on an arm: frames, pieces of a section, bellows, wires, markers; and what azimuth means.

The section hangs and is bent by more pressure in bellows 1, which is at 0 degrees: away from it, towards -x.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.patches import Arc, Circle, Rectangle

from bha.plot import write_figure
from bha.plot.style import COLORS, figure_of_size

BLACK, BLUE, ORANGE, _, RED, GREEN, *_ = COLORS
GREY = "#8C8C8C"
RADIUS, OUTER, BASE, LENGTH, HEAD, BENDING = 0.1, 0.035, 0.05, 0.34, 0.04, 0.75
WIRE = 0.155
TEXT = 8.5


def along(share: Any, beside: float = 0.0) -> np.ndarray:
    """Points (x, z) at shares of the arc, beside the centre line towards x; straight before 0 and behind 1."""
    share = np.asarray(share, dtype=float)
    turn = BENDING * np.clip(share, 0, 1)
    x = -LENGTH / BENDING * (1 - np.cos(turn))
    z = BASE + LENGTH / BENDING * np.sin(turn)
    straight = LENGTH * (share - np.clip(share, 0, 1))
    x, z = x - straight * np.sin(turn), z + straight * np.cos(turn)
    return np.stack([x + beside * np.cos(turn), z + beside * np.sin(turn)], axis=-1)


def label(axes: Any, text: str, at: tuple[float, float], of: Any = None, **options: Any) -> None:
    """A text, with a thin line to what it names."""
    line = None if of is None else {"arrowstyle": "-", "linewidth": 0.6, "color": GREY, "shrinkA": 1, "shrinkB": 1}
    axes.annotate(
        text,
        xy=at if of is None else of,
        xytext=at,
        fontsize=TEXT,
        arrowprops=line,
        **{"va": "center", "ha": "left", **options},
    )


def frame(axes: Any, origin: Any, turn: float, names: tuple[str, str], size: float = 0.07, color: str = BLACK) -> None:
    """The axes of a frame in the plane: the first turned from the right, the second from below."""
    for direction, name in (((np.cos(turn), np.sin(turn)), names[0]), ((-np.sin(turn), np.cos(turn)), names[1])):
        end = np.asarray(origin) + size * np.asarray(direction)
        axes.annotate(
            "", xy=end, xytext=origin, arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1.4, "shrinkA": 0}
        )
        axes.text(*(end + 0.018 * np.asarray(direction)), name, fontsize=TEXT, ha="center", va="center", color=color)


def measure(axes: Any, start: Any, end: Any) -> None:
    """A line with heads at both ends."""
    axes.annotate(
        "", xy=end, xytext=start, arrowprops={"arrowstyle": "<->", "linewidth": 0.8, "shrinkA": 0, "shrinkB": 0}
    )


def side(axes: Any) -> None:
    """The section from the side."""
    share = np.linspace(0, 1, 400)
    last, tip = along(1.0), along(1 + HEAD / LENGTH)
    # Bellows, as they look, and the two behind, which this view has in one place.
    for beside, color, order in ((-RADIUS / 2, GREY, 1.0), (RADIUS, BLUE, 2.0)):
        folds = OUTER * (0.8 + 0.2 * np.cos(2 * np.pi * 15 * share))
        edges = [np.array([along(s, beside + sign * f) for s, f in zip(share, folds, strict=True)]) for sign in (-1, 1)]
        outline = np.concatenate([edges[0], edges[1][::-1]])
        axes.fill(*outline.T, facecolor="white", edgecolor=color, linewidth=1.0, zorder=order)
    axes.plot(*along(share).T, color=BLACK, linewidth=1.2, linestyle=(0, (6, 2, 1, 2)), zorder=3)
    axes.plot(*np.array([along(-BASE / LENGTH), along(0)]).T, color=BLACK, linewidth=2.4, zorder=3)
    axes.plot(*np.array([last, tip]).T, color=BLACK, linewidth=2.4, zorder=3)
    axes.plot(*along(np.linspace(0, 1, 50), WIRE).T, color=RED, linewidth=1.4, linestyle=(0, (2, 1.5)), zorder=2.5)
    for at in (0.0, 1.0):
        axes.plot(*np.array([along(at, -RADIUS), along(at, WIRE)]).T, color=BLACK, linewidth=2.0, zorder=3)
    axes.fill_between([-0.19, 0.19], -0.03, 0, color=GREY, linewidth=0, zorder=0.5)
    axes.plot(*tip, "o", color=BLACK, markersize=4, zorder=4)
    frame(axes, (0, 0), 0.0, ("x", "z"), 0.085)
    frame(axes, tip, BENDING, ("x", "z"), 0.075)
    axes.plot(*(tip), marker="D", color=GREEN, markersize=6, zorder=5)

    label(axes, "base frame: z along the straight\narm; the world's without [base]", (0.24, 0.0), (0.08, 0.004))
    label(axes, "base_offset", (-0.07, 0.026), ha="right")
    measure(axes, (-0.055, 0), (-0.055, BASE))
    label(axes, "centre line: its length is the\nmean of the three lengths", (0.24, 0.30), along(0.66))
    label(axes, "bellows 1, length q11", (0.24, 0.15), along(0.3, RADIUS + 0.02))
    label(axes, "bellows 2 and 3\n(behind each other)", (-0.17, 0.17), along(0.42, -RADIUS / 2 - 0.02), ha="right")
    label(axes, "wire: a [[length_sensor]] with\nangle, radius, sections", (0.24, 0.22), along(0.55, WIRE), color=RED)
    label(axes, "head_offset", (0.1, 0.46), along(1 + 0.5 * HEAD / LENGTH))
    label(
        axes,
        "head 1 and its frame: x1, y1, z1 of a log.\n"
        "center_of_mass, force_point and payload\nare given in it. Section 2 begins here.",
        (0.06, 0.555),
        tip,
    )
    label(axes, "marker that a\ncamera sees", (-0.33, 0.5), tip, ha="center", color=GREEN)
    measure(axes, along(0.2), along(0.2, RADIUS))
    label(axes, "bellows_radius", (0.24, 0.09), along(0.2, 0.06))
    # The camera and its frame.
    camera = np.array([-0.36, 0.28])
    axes.add_patch(_rectangle(camera, 0.06, 0.045))
    frame(axes, camera, 0.0, ("", ""), 0.05, GREEN)
    label(axes, "camera: [sensors]\ncamera_position,\ncamera_axes", (-0.36, 0.375), ha="center", color=GREEN)
    axes.set_xlim(-0.47, 0.64)
    axes.set_ylim(0.6, -0.045)


def _rectangle(centre: np.ndarray, width: float, height: float) -> Any:
    return Rectangle(centre - (width, height), width, height, facecolor="white", edgecolor=GREEN, linewidth=1.2)


def across(axes: Any) -> None:
    """The section from its base, along z: x to the right, y down."""
    axes.add_patch(Circle((0, 0), RADIUS, fill=False, edgecolor=GREY, linewidth=0.8, linestyle=(0, (3, 2))))
    for number, degrees in enumerate((0, 120, 240), start=1):
        at = RADIUS * np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees))])
        color = BLUE if number == 1 else GREY
        fill = "#DCEAF5" if number == 1 else "white"
        axes.add_patch(Circle(at, OUTER, facecolor=fill, edgecolor=color, linewidth=1.4))
        axes.text(*at, f"{number}", fontsize=TEXT + 1, ha="center", va="center", weight="bold")
    frame(axes, (0, 0), 0.0, ("x", "y"), 0.04)
    axes.add_patch(Arc((0, 0), 0.05, 0.05, theta1=0, theta2=120, linewidth=0.9))
    axes.text(0.012, 0.062, "120°", fontsize=TEXT, ha="left")
    axes.annotate(
        "", xy=(-0.2, 0), xytext=(-0.02, 0), arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 2.2}
    )
    label(axes, "pressure in\nbellows 1 bends\nthe arm this way:\naway from it", (-0.22, 0.0), ha="right", color=BLUE)
    label(axes, "bellows_outer_radius", (0.16, -0.09), RADIUS * np.array([1, 0]) + OUTER * np.array([0.6, -0.8]))
    label(
        axes,
        "azimuth (angle) counts about z from\nx towards y: 0, 120, 240 degrees\nwhere the file says no other",
        (0.16, 0.085),
    )
    label(axes, "0°, on the x axis", (0.16, 0.0), (RADIUS + OUTER, 0))
    axes.set_xlim(-0.47, 0.64)
    axes.set_ylim(0.15, -0.16)


with figure_of_size(5.4, 5.35) as figure:
    figure.set_layout_engine("none")
    top, bottom = figure.add_axes((0, 0.335, 1, 0.645)), figure.add_axes((0, 0, 1, 0.31))
    for axes, draw, title in (
        (top, side, "One section from the side"),
        (bottom, across, "The same from its base, looking along z"),
    ):
        draw(axes)
        axes.set_aspect("equal", adjustable="box")
        axes.axis("off")
        axes.set_title(title, fontsize=TEXT + 1, weight="bold", loc="left", pad=2)
    write_figure(figure, "geometry.svg")
