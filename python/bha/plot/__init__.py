"""Figures (extra ``plot``): of trajectories, shapes, errors and checks; vector files or pictures."""

from __future__ import annotations

from bha.plot.checkup import plot_checkup
from bha.plot.errors import plot_errors
from bha.plot.gap import plot_gap
from bha.plot.identification import plot_correlation, plot_prediction
from bha.plot.poses import plot_poses
from bha.plot.shape import plot_shape
from bha.plot.style import COLORS, figure_of_size, write_figure
from bha.plot.tracking import plot_tracking
from bha.plot.trajectories import plot_trajectories

__all__ = [
    "COLORS",
    "figure_of_size",
    "plot_checkup",
    "plot_correlation",
    "plot_errors",
    "plot_gap",
    "plot_poses",
    "plot_prediction",
    "plot_shape",
    "plot_tracking",
    "plot_trajectories",
    "write_figure",
]
