"""A fit, and what it is worth: a log that took no part, measured, and predicted before and after."""

import numpy as np

import bha
from bha.parameters import ArmParameters
from bha.plot import plot_prediction, write_figure

nominal = bha.robots.parameters("bha_nominal").to_mapping()
true = bha.Arm.from_parameters(ArmParameters.from_mapping({**nominal, "section": nominal["section"][:1]}))
guess = true.with_values({"section.1.mass": 1.0, "section.1.stiffness.1": 1000.0, "section.1.damping": 40.0})
logs = []
for seed in (1, 2):
    drive = bha.excite(true, duration=6.0, rate=50.0, free=["section.1.mass", "section.1.stiffness.1"], seed=seed)
    run = bha.simulate(true, bha.Input(drive.time, drive.pressures), times=drive.time)
    noisy = run.lengths + np.random.default_rng(seed).normal(scale=3e-4, size=run.lengths.shape)
    columns = {f"{name} [Pa]": p for name, p in zip(true.inputs, drive.pressures.T, strict=True)}
    columns |= {f"q1{k + 1} [m]": q for k, q in enumerate(noisy.T)}
    logs.append(bha.Log.from_arrays({"t [s]": drive.time, **columns}))
free = ["section.1.mass", "section.1.stiffness.1", "section.1.damping", "section.1.bending_stiffness.1"]
result = bha.identify(guess, logs[:1], free, holdout=logs[1:])
for estimate in result.estimates:
    print(f"{estimate.name}: {estimate.value:.4g} {estimate.unit}, 95 % {estimate.interval}")
write_figure(plot_prediction(result, 0), "identify.svg")
