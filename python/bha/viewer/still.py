"""Still pictures of an arm without a browser, by matplotlib: for videos and documents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bha.arm.bodies import up_direction
from bha.support.extras import import_extra
from bha.viewer.colors import BASE, BESIDE, MEASURED, RIGID, Colors, PressureScale
from bha.viewer.geometry import Picture, axes_with_z, base_frame, layout_of, picture
from bha.viewer.motions import magnification
from bha.viewer.show import Show
from bha.viewer.solids import Mesh, Solids, convolution, cylinder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bha.arm import Arm
    from bha.viewer.motions import Moment, Motion

Array = NDArray[np.float64]

#: Of the picture: pixels across and high (multiples of 16, as codecs want them), pixels an inch of text.
WIDTH, HEIGHT, _DENSITY = 960, 720, 120
#: Sides and rings of meshes that are coarse enough to be drawn many times, and fine enough to be sorted by depth.
_FOLD, _PLATE = (12, 2), (28, 5)
#: Where the eye is, degrees; where the light comes from beside it, and how dark what is turned away.
_ELEVATION, _AZIMUTH, _LIGHT, _DARK = 14.0, -60.0, (0.3, -0.5, 0.8), 0.45
#: Opacity of arms beside the first one.
_BESIDE = 0.25
#: Half of the side of the cube that is seen, over the arm's length, and where its middle is along it.
_HALF, _MIDDLE = 0.7, 0.62
PASCAL_PER_KILOPASCAL = 1e3


class Still:
    """Draws moments of arms, always from the same place."""

    def __init__(self, arm: Arm, *, compared: bool = False) -> None:
        """Prepare the picture.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        import_extra("matplotlib", extra="view", purpose="Drawing arms")
        from bha.plot.figure import ShownFigure  # noqa: PLC0415  (matplotlib is there)

        agg = import_extra("matplotlib.backends.backend_agg", extra="view", purpose="Drawing arms")
        self._art = import_extra("mpl_toolkits.mplot3d.art3d", extra="view", purpose="Drawing arms")
        self._layout, self._scale, self._compared = layout_of(arm), PressureScale.of(arm), compared
        self._world = axes_with_z(up_direction(arm))
        self._fold, self._plate = convolution(*_FOLD), cylinder(*_PLATE)
        self.figure = ShownFigure(figsize=(WIDTH / _DENSITY, HEIGHT / _DENSITY), dpi=_DENSITY)
        self._canvas = agg.FigureCanvasAgg(self.figure)
        self._axes: Any = self.figure.add_axes((0.0, 0.0, 1.0, 1.0), projection="3d", computed_zorder=False)
        self._stand()
        self._legend()
        self._drawn: list[Any] = []
        self._caption = self.figure.text(0.02, 0.97, "", va="top", fontsize=10)

    @property
    def reach(self) -> float:
        """Length of the arm with all sections at their longest, m."""
        return self._layout.reach

    def _stand(self) -> None:
        """What stays: the cube that is seen, where from, the axes of the base."""
        arm, axes, size = self._layout.arm, self._axes, self._layout.size
        rotation, origin = base_frame(arm)
        middle = (origin + _MIDDLE * size * rotation[:, 2]) @ self._world
        for k, limit in enumerate((axes.set_xlim, axes.set_ylim, axes.set_zlim)):
            limit(middle[k] - _HALF * size, middle[k] + _HALF * size)
        axes.set_box_aspect((1.0, 1.0, 1.0), zoom=1.12)
        axes.view_init(elev=_ELEVATION, azim=_AZIMUTH)
        axes.set_proj_type("ortho")
        axes.set_axis_off()
        length = 1.5 * self._layout.width
        for k, color in enumerate(("#d62728", "#2ca02c", "#1f4fd6")):
            line = np.stack([origin, origin + length * rotation[:, k]]) @ self._world
            axes.plot(*line.T, color=color, linewidth=1.6, zorder=2)

    def _legend(self) -> None:
        """The colours of the pressures."""
        bar = self.figure.add_axes((0.06, 0.07, 0.26, 0.022))
        bar.imshow(self._scale.table[None], aspect="auto", extent=(self._scale.low, self._scale.high, 0.0, 1.0))
        bar.set_yticks([])
        ends = [self._scale.low, self._scale.high]
        bar.set_xticks(ends, [f"{end / PASCAL_PER_KILOPASCAL:.0f}" for end in ends], fontsize=8)
        bar.set_xlabel("pressure [kPa, absolute]", fontsize=8, labelpad=-8)
        for spine in bar.spines.values():
            spine.set_visible(False)

    def draw(self, moments: Sequence[Moment], caption: str = "", magnify: float = 1.0) -> NDArray[np.uint8]:
        """A picture of a moment of each arm, shape (HEIGHT, WIDTH, 3); the gap of the first ``magnify`` times as long.

        What is not known is not drawn.
        """
        for artist in self._drawn:
            artist.remove()
        self._drawn = []
        triangles, colors = [np.empty((0, 3, 3))], [np.empty((0, 4))]
        for k, moment in enumerate(moments):
            if np.isfinite(moment.lengths).all():
                shown = picture(self._layout, moment.lengths)
                for surface, paint in self._surfaces(shown, moment, None if k == 0 else BESIDE[(k - 1) % len(BESIDE)]):
                    triangles.append(surface)
                    colors.append(paint)
        # All in one collection, which sorts them by depth.
        bodies = self._art.Poly3DCollection(
            np.concatenate(triangles), facecolors=np.concatenate(colors), linewidths=0.0, antialiaseds=False, zorder=1
        )
        bodies.set_rasterized(True)  # in a vector file thousands of triangles were too many
        self._drawn.append(self._axes.add_collection3d(bodies))
        if self._compared:
            self._draw_gap(moments[0], magnify)
        self._caption.set_text(caption)
        self._canvas.draw()
        return np.array(self._canvas.buffer_rgba())[..., :3]

    def _draw_gap(self, moment: Moment, magnify: float) -> None:
        color = np.array(MEASURED) / 255.0
        known = np.isfinite(moment.measured).all(axis=-1)
        for head in np.flatnonzero(known):
            start, gap = moment.heads[head] @ self._world, magnify * moment.gap[head] @ self._world
            self._drawn.append(self._axes.quiver(*start, *gap, color=color, linewidth=2.0, zorder=4))
            ball = moment.measured[head] @ self._world
            self._drawn += self._axes.plot(*ball[None].T, "o", color=color, markersize=5.0, zorder=3)

    def _surfaces(
        self, shown: Picture, moment: Moment, color: tuple[int, int, int] | None
    ) -> list[tuple[Array, Array]]:
        """Triangles (t, 3, 3) in the picture's axes and their colours (t, 4), of bellows and of the rest."""
        if color is None:
            folds = self._scale.colors(moment.pressures[self._layout.fold_inputs])
            plates = np.tile(np.array(RIGID, dtype=np.uint8), (len(shown.plates), 1))
            plates[0] = BASE
        else:
            folds = np.tile(np.array(color, dtype=np.uint8), (len(shown.folds), 1))
            plates = np.tile(np.array(color, dtype=np.uint8), (len(shown.plates), 1))
        opacity = 1.0 if color is None else _BESIDE
        return [
            self._surface(self._fold, shown.folds, folds, opacity),
            self._surface(self._plate, shown.plates, plates, opacity),
        ]

    def _surface(self, mesh: Mesh, solids: Solids, colors: Colors, opacity: float) -> tuple[Array, Array]:
        corners = (solids.placed(mesh) @ self._world)[:, mesh.faces]  # (copies, faces, 3, 3)
        normals = np.cross(corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :])
        normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
        light = np.array(_LIGHT) / np.linalg.norm(_LIGHT)
        bright = _DARK + (1.0 - _DARK) * (0.5 + 0.5 * normals @ light)
        paint = np.empty((*bright.shape, 4))
        paint[..., :3] = bright[..., None] * colors[:, None] / 255.0
        paint[..., 3] = opacity
        # What is turned away from the eye is hidden by the rest of its body: drawn, it could be sorted before that.
        elevation, azimuth = np.radians((_ELEVATION, _AZIMUTH))
        eye = (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation))
        seen = normals @ np.array(eye) > 0.0
        return corners[seen], paint[seen]


def draw_arm(
    arm: Arm,
    motions: Sequence[Motion] = (),
    *,
    time: float | None = None,
    magnify: float | None = None,
    caption: str = "",
) -> Figure:
    """An arm at a moment of motions, without a browser; at rest under ambient pressure without any.

    Args:
        arm: the arm.
        motions: of :func:`bha.viewer.motions_of`.
        time: s, by the clock of the first motion; its start if None.
        magnify: how many times as long as they are gaps are drawn; None: so that they are seen.
        caption: text above.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    show = Show(arm, motions)
    if time is not None:
        show.go_to(time)
    still = Still(arm, compared=bool(motions) and motions[0].measured is not None)
    drawn = float(magnification(motions, still.reach)) if magnify is None else magnify
    still.draw(show.moments(), caption, drawn)
    return still.figure
