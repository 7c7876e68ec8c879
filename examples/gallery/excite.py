"""What to command: pressures that make parameters known, within the limits of every input."""

import bha
from bha.plot import COLORS, figure_of_size, write_figure

arm = bha.robots.load("bha_nominal")
proposal = bha.excite(arm, duration=10.0, rate=50.0, seed=1)
with figure_of_size(6.4, 3.0) as figure:
    panels = figure.subplots(1, 3, sharey=True)
    for number, axes in enumerate(panels):
        for k in range(3):
            pressures = proposal.pressures[:, 3 * number + k] / 1e5
            axes.plot(proposal.time, pressures, color=COLORS[k], linewidth=0.9, label=f"bellows {k + 1}")
        axes.set(title=f"section {number + 1}", xlabel="t [s]")
    panels[0].set_ylabel("pressure, absolute [bar]")
    panels[0].legend(fontsize=6)
    write_figure(figure, "excite.svg")
