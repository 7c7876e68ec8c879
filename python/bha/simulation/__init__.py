"""Simulation of what was measured or made up: one run, many abreast, and their derivatives."""
