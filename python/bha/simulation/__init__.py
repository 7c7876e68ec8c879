"""Simulation of what was measured or made up: one run, many abreast, and their derivatives."""

from bha.simulation.batch import Batch, simulate_batch
from bha.simulation.derivatives import Sensitivities, parameter_names, sensitivities
from bha.simulation.single import simulate

__all__ = ["Batch", "Sensitivities", "parameter_names", "sensitivities", "simulate", "simulate_batch"]
