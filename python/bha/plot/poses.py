"""An arm in the poses of a trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from bha.errors import InputError
from bha.plot.shape import draw_projection, plot_shape
from bha.plot.style import axes_of_size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bha.arm import Arm
    from bha.runs.trajectory import Trajectory

#: Poses that are drawn where none are asked for; more cannot be told apart.
USUAL_POSES = 12


def plot_poses(
    arm: Arm,
    trajectory: Trajectory,
    *,
    times: ArrayLike | None = None,
    view: Literal["projections", "space", "xz", "yz"] = "projections",
    axes: Axes | None = None,
    title: str | None = None,
) -> Figure:
    """Plot the arm's backbone in poses of a trajectory, the later the darker; z as it hangs or stands.

    Args:
        arm: the arm.
        trajectory: its motion.
        times: of the poses, s, each the row nearest to it; a dozen rows from first to last if None.
        view: ``"projections"`` on the x-z and the y-z plane, ``"space"``, or one plane, ``"xz"`` or ``"yz"``.
        axes: the caller's axes, to be drawn into; for one plane.
        title: a line above the figure.

    Returns:
        The figure, that of ``axes`` where given.

    Raises:
        InputError: rows of another arm, none that has all lengths, an unknown view, axes with a view that is no plane.
        MissingExtraError: matplotlib is not installed.
    """
    if trajectory.section_count != arm.section_count:
        many = f"{trajectory.section_count} sections; {arm.name} has {arm.section_count}"
        raise InputError(f"trajectory: has {many}")
    known = np.flatnonzero(np.isfinite(trajectory.lengths).all(axis=1))
    if len(known) == 0:
        raise InputError("trajectory: has no row with all lengths")
    if times is None:
        rows = known[np.unique(np.linspace(0, len(known) - 1, USUAL_POSES).round().astype(int))]
    else:
        wanted = np.atleast_1d(np.asarray(times, dtype=np.float64))
        rows = known[np.abs(trajectory.time[known] - wanted[:, None]).argmin(axis=1)]
    moments = trajectory.time[rows]
    backbones = arm.shape(trajectory.lengths[rows])
    heads = arm.forward_kinematics(trajectory.lengths[rows])[0]
    hanging = arm.parameters.gravity[2] >= 0
    if view in ("projections", "space"):
        if axes is not None:
            raise InputError(f'axes: one for view "xz" or "yz"; "{view}" makes a figure of its own')
        return plot_shape(moments, backbones, heads, view=view, hanging=hanging, title=title)
    if view not in ("xz", "yz"):
        raise InputError(f'view: expected "projections", "space", "xz" or "yz", found {view!r}')
    with axes_of_size(axes, 3.6, 4.2) as panel:
        draw_projection(panel, "xy".index(view[0]), moments, backbones, heads, hanging=hanging)
        panel.set_ylabel("z [mm]")
        if title is not None:
            panel.set_title(title, loc="left")
        if axes is None:
            panel.legend(loc="best")
        figure = panel.get_figure(root=True)
        assert figure is not None
        return figure
