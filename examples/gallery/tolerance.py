"""What tolerances of manufacture do to the tip: 512 arms that rest under one set of pressures."""

import bha
from bha.plot import figure_of_size, write_figure
from bha.sweeps import read

scatter = {"relative": True, "distribution": "normal", "mean": 1.0}
spec = {
    "schema": "bha-sweep/1",
    "arm": "bha_nominal",
    "kind": "monte_carlo",
    "runs": 512,
    "metrics": ["final_tip_x", "final_tip_z"],
    "input": {"pressures": [1.8e5, 1.2e5, 1.2e5] * 3},
    "simulation": {"duration": 0.01},  # it rests under these pressures
    "vary": [
        {"what": "section.*.stiffness.1", "standard_deviation": 0.03, **scatter},
        {"what": "section.*.mass", "standard_deviation": 0.02, **scatter},
        {"what": "section.3.terminal_area", "standard_deviation": 0.02, **scatter},
    ],
}
bha.sweep(spec, "tolerance")
table = read("tolerance")
x, z, stiffness = (table.column(name).to_numpy() for name in ("final_tip_x", "final_tip_z", "section.*.stiffness.1"))
with figure_of_size(5.2, 3.6) as figure:
    axes = figure.subplots()
    points = axes.scatter(1e3 * x, 1e3 * z, c=100 * (stiffness - 1), s=8, cmap="cividis")
    figure.colorbar(points, label="stiffness beside that of the file [%]")
    axes.set(xlabel="tip x [mm]", ylabel="tip z [mm]")
    axes.invert_yaxis()  # it hangs: z points down
    write_figure(figure, "tolerance.svg")
