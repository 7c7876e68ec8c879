"""The arms that ship, at rest without pressure and bent."""

import numpy as np

import bha
from bha.plot import COLORS, figure_of_size, write_figure

arms = [bha.robots.load(name) for name in ("bha_nominal", "bha_hand", "asu_two_section_january")]
with figure_of_size(6.4, 3.6) as figure:
    panels = figure.subplots(1, len(arms), sharex=True, sharey=True)
    for axes, arm in zip(panels, arms, strict=True):
        high = arm.parameters.sections[0].pressure_range[1]
        at_rest = np.full(len(arm.inputs), arm.parameters.ambient_pressure)
        bent = at_rest.copy()
        bent[0] = 0.3 * arm.parameters.ambient_pressure + 0.7 * high
        for pressures, style in ((at_rest, "-"), (bent, "--")):
            line = arm.shape(arm.static_lengths(pressures), points_per_section=30)
            axes.plot(line[:, 0], line[:, 2], style, color=COLORS[1], linewidth=3)
        axes.set_title(arm.parameters.name, fontsize=9)
        axes.set(xlabel="x [m]", aspect="equal")
    panels[0].set_xlim(-0.35, 0.1)
    panels[0].set_ylabel("z [m]")
    panels[0].invert_yaxis()
    write_figure(figure, "arms.svg")
