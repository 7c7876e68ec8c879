"""Where the tip can rest: ten thousand sets of pressures, each within the limits of its input."""

import numpy as np

import bha
from bha.plot import figure_of_size, write_figure

arm = bha.robots.load("bha_nominal")
random = np.random.default_rng(1)
low, high = np.repeat([section.pressure_range for section in arm.parameters.sections], 3, axis=0).T
lengths = np.array([arm.static_lengths(p) for p in random.uniform(low, high, size=(10_000, 9))])
tips = arm.forward_kinematics(lengths)[0][:, -1]

with figure_of_size(6.4, 3.4) as figure:
    side, above = figure.subplots(1, 2)
    for axes, (a, b) in ((side, (0, 2)), (above, (0, 1))):
        axes.hexbin(tips[:, a], tips[:, b], gridsize=60, bins="log", mincnt=1, cmap="cividis")
        axes.set(xlabel=f"{'xyz'[a]} [m]", ylabel=f"{'xyz'[b]} [m]", aspect="equal")
    side.invert_yaxis()  # it hangs: z points down
    side.set_title("from the side")
    above.set_title("along z")
    write_figure(figure, "workspace.svg")
