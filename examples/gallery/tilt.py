"""The paper's tilt (its Fig. 12): full model against the one without rotational energy and Coriolis forces."""

import bha
from bha.plot import plot_trajectories, write_figure

arm = bha.robots.load("bha_nominal")
log = bha.Log.read("examples/tilt.csv")
full = bha.simulate(arm, log, dt=0.005)
reduced = bha.simulate(arm.with_changes(rotational_energy=False, coriolis_forces=False), log, dt=0.005)
write_figure(plot_trajectories({"full": full, "reduced": reduced}), "tilt.svg")
