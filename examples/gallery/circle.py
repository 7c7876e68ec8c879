"""A circle of the tip by two controllers; every mass and damping of the plant is off by 10 %."""

import bha
from bha.control import FeedbackLinearization, GravityPd, Sensors, tip_circle
from bha.plot import plot_tracking, write_figure

model = bha.robots.load("bha_nominal").with_changes(pneumatics="lag")
off = {}
for number, section in enumerate(model.parameters.sections, start=1):
    off |= {f"section.{number}.mass": 1.1 * section.mass, f"section.{number}.damping": 0.9 * section.damping}
plant = model.with_values(off)
reference = tip_circle(model, radius=0.10, max_velocity=0.4)
sensors = Sensors(length_noise=1e-4, pressure_noise=100.0, seed=1)
laws = {"PD + gravity": GravityPd(model), "full model": FeedbackLinearization(model)}
runs = {name: bha.simulate_closed_loop(plant, law, reference, sensors=sensors) for name, law in laws.items()}
write_figure(plot_tracking(runs), "circle.svg")
