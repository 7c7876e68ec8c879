"""How an arm swings: modes of the linearization at rest, as it is blown up."""

import numpy as np

import bha
from bha.plot import COLORS, figure_of_size, write_figure

arm = bha.robots.load("bha_nominal")
pressures = np.linspace(1.0e5, 1.8e5, 25)
modes = []
for p in pressures:
    rest = arm.static_lengths([p] * 9)
    A, _ = arm.linearize(rest, np.zeros(9), [p] * 9)
    found = np.linalg.eigvals(A)
    modes.append(np.sort(found[found.imag > 1e-6].imag)[:6] / (2 * np.pi))
with figure_of_size(5.2, 3.6) as figure:
    axes = figure.subplots()
    axes.plot(pressures / 1e5, modes, "o", color=COLORS[1], markersize=3)
    axes.set(xlabel="pressure in all bellows, absolute [bar]", ylabel="frequency [Hz]", yscale="log")
    axes.set_yticks([2, 3, 5, 10, 15], ["2", "3", "5", "10", "15"])
    axes.grid(True, which="both", color="#E0E0E0")
    write_figure(figure, "modes.svg")
