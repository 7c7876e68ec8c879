"""Boxes and arrows, for the sketches of this folder.

Units are characters and lines of text, so that a box fits what stands in it. Colours are those of the figures of the
package; what they tell is said by words or shapes too.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from matplotlib.patches import FancyBboxPatch

from bha.plot.style import COLORS, figure_of_size

#: Pale fills of boxes, by what they are; dark enough to be apart in grey print.
FILLS = {"model": "#DCEAF5", "measured": "#FBE9C6", "outcome": "#D9EFE7", "": "#FFFFFF"}
INK = COLORS[0]
#: Inches a unit across and down, at the size of the text.
ACROSS, DOWN = 0.075, 0.17
TEXT = 8.5


@dataclass(frozen=True)
class Box:
    """A box about (x, y), with a title and text below it; what it is chooses its fill."""

    x: float
    y: float
    title: str
    text: str = ""
    kind: str = ""
    width: float = 0.0

    @property
    def lines(self) -> list[str]:
        """What stands below its title."""
        return self.text.splitlines()

    @property
    def half_width(self) -> float:
        """Half of its width, in units."""
        longest = max(len(self.title) * 1.08, *(len(line) for line in self.lines), 1)
        return (self.width or longest + 3) / 2

    @property
    def half_height(self) -> float:
        """Half of its height, in units."""
        return (1 + len(self.lines) + 0.7) / 2


class Sketch:
    """Axes in units of text, y downwards."""

    def __init__(self, axes: Any, width: float, height: float) -> None:
        self.axes = axes
        axes.set_xlim(0, width)
        axes.set_ylim(height, 0)
        axes.axis("off")

    def box(self, box: Box) -> Box:
        """Draw a box."""
        w, h = box.half_width, box.half_height
        self.axes.add_patch(
            FancyBboxPatch(
                (box.x - w, box.y - h),
                2 * w,
                2 * h,
                boxstyle="round,pad=0,rounding_size=0.4",
                mutation_aspect=ACROSS / DOWN,
                facecolor=FILLS[box.kind],
                edgecolor=INK,
                linewidth=0.8,
            )
        )
        top = box.y - len(box.lines) / 2
        self.text(box.x, top, box.title, weight="bold")
        for number, line in enumerate(box.lines, start=1):
            self.text(box.x, top + number, line)
        return box

    def text(self, x: float, y: float, text: str, **options: Any) -> None:
        """Write about (x, y), or beside it where ``ha`` says so."""
        self.axes.text(x, y, text, **{"ha": "center", "va": "center", "fontsize": TEXT, "color": INK, **options})

    def arrow(
        self, *points: tuple[float, float], text: str = "", at: tuple[float, float] | None = None, **options: Any
    ) -> None:
        """A line through points with a head at the last one, and a word at ``at``."""
        style = {"color": INK, "linewidth": 1.0, **options}
        for start, end in pairwise(points[:-1]):
            self.axes.plot(*zip(start, end, strict=True), solid_capstyle="butt", **style)
        self.axes.annotate(
            "",
            xy=points[-1],
            xytext=points[-2],
            arrowprops={"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0, "mutation_scale": 9, **style},
        )
        if text:
            x, y = at or ((points[0][0] + points[1][0]) / 2, (points[0][1] + points[1][1]) / 2)
            self.text(x, y, text, bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0})

    def down(self, *boxes: Box) -> None:
        """Arrows from box to box, straight down."""
        for above, below in pairwise(boxes):
            self.arrow((below.x, above.y + above.half_height), (below.x, below.y - below.half_height))


@contextmanager
def sketch(width: float, height: float) -> Iterator[tuple[Any, Sketch]]:
    """A figure of so many units, and the sketch in it."""
    with figure_of_size(width * ACROSS, height * DOWN) as figure:
        figure.set_layout_engine("none")
        yield figure, Sketch(figure.add_axes((0, 0, 1, 1)), width, height)
