"""Two tubes were exchanged: the check sees it in the motions and names the line that repairs it."""

import numpy as np

import bha
from bha.plot import plot_checkup, write_figure

arm = bha.robots.load("bha_nominal")
time = np.arange(0.0, 20.0, 0.02)
waves = 1.3e5 + 2e4 * np.sin(2 * np.pi * np.linspace(0.13, 0.47, 9) * time[:, None])
run = bha.simulate(arm, bha.Input(time, waves), times=time)
logged = dict(zip(arm.inputs, waves.T, strict=True))
logged["p11"], logged["p12"] = logged["p12"], logged["p11"]
columns = {f"{name} [Pa]": values for name, values in logged.items()}
columns |= {f"{axis}{k + 1} [m]": run.head_positions[:, k, "xyz".index(axis)] for k in range(3) for axis in "xyz"}
found = bha.check(arm, bha.Log.from_arrays({"t [s]": time, **columns}))
print(found)
write_figure(plot_checkup(found), "tubes.svg")
