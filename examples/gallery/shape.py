"""An arm in space while one pressure after the other rises."""

import numpy as np

import bha
from bha.plot import plot_shape, write_figure

arm = bha.robots.load("bha_nominal")
time = np.linspace(0.0, 1.2, 7)
pressures = np.full((7, 9), 1.3e5)
pressures[:, 0] += 8e4 * time  # bellows 1 of section 1
pressures[:, 7] += 6e4 * time  # bellows 2 of section 3
lengths = np.array([arm.static_lengths(p) for p in pressures])
heads, _ = arm.forward_kinematics(lengths)
write_figure(plot_shape(time, arm.shape(lengths, points_per_section=20), heads, view="space"), "shape.svg")
