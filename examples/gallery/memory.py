"""What the material remembers: one bellows length under a slow triangle of pressure, third cycle."""

import numpy as np

import bha
from bha.plot import COLORS, figure_of_size, write_figure

arm = bha.robots.load("bha_nominal")
time = np.linspace(0.0, 24.0, 2401)
triangle = 1.1e5 + 6e4 * np.interp(time % 8.0, [0.0, 4.0, 8.0], [0.0, 1.0, 0.0])
drive = bha.Input(time, np.repeat(triangle[:, None], 9, axis=1))
effects = {
    "as the paper has it": [],
    "creep": [{"kind": "creep", "where": "all", "stiffness": 300.0, "tau": 2.0}],
    "hysteresis": [{"kind": "hysteresis", "where": "all", "amplitude": 8.0, "yield": 0.01}],
}
with figure_of_size(5.2, 3.6) as figure:
    axes = figure.subplots()
    styles = zip(COLORS[:3], ("-", "--", ":"), strict=True)
    for (name, added), (color, style) in zip(effects.items(), styles, strict=True):
        run = bha.simulate(arm.with_effects(added), drive, times=time)
        axes.plot(triangle[1600:] / 1e5, 1e3 * run.lengths[1600:, 0], style, color=color, label=name, linewidth=1.3)
    axes.set(xlabel="pressure, absolute [bar]", ylabel="length of bellows 11 [mm]")
    axes.legend()
    write_figure(figure, "memory.svg")
