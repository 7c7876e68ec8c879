"""An arm under the pressures of a log, beside where another arm's heads were under them."""

import numpy as np

import bha
from bha.plot import write_figure
from bha.viewer import draw_arm, motions_of

arm = bha.robots.load("bha_nominal")
time = np.linspace(0.0, 6.0, 301)
pressures = 1.1e5 + 5e4 * np.sin(0.4 * time[:, None] + np.arange(9)) ** 2
softer = arm.with_values({"section.2.stiffness.1": 700.0, "section.3.stiffness.1": 500.0})
measured = bha.simulate(softer, bha.Input(time, pressures), times=time).head_positions
columns = {"t [s]": time}
columns |= {f"{name} [Pa]": pressures[:, k] for k, name in enumerate(arm.inputs)}
columns |= {f"{axis}{s + 1} [m]": measured[:, s, k] for s in range(3) for k, axis in enumerate("xyz")}
motions = motions_of(arm, [bha.Log.from_arrays(columns)])
write_figure(draw_arm(arm, motions, time=4.0), "viewer.svg")
