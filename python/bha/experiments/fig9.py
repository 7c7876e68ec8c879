"""Fig. 9: bending stiffness from poses bent to both sides (section IV-D)."""

from __future__ import annotations

import dataclasses

import numpy as np

from bha.experiments.laboratory import Laboratory, fit_bending
from bha.experiments.outcome import Claim, Outcome
from bha.experiments.virtual_arm import VirtualArm
from bha.identification.stiffness import StiffnessFit
from bha.plot.section_four import plot_bending


def run(lab: Laboratory) -> Outcome:
    """Identify the bending stiffness; measure the last section again without creep."""
    fits = lab.paper.bending_stiffness
    last = lab.design.section_count
    schedule, _ = lab.bending[last - 1]
    lab.note(f"measuring: bending of section {last}, material without creep")
    body = dataclasses.replace(lab.real.body, creep=())
    without = VirtualArm(lab.design, body, lab.real.sensors, seed=lab.real.seed)
    log = without.measure(schedule, number=20, step=lab.static_step)
    ideal = fit_bending(lab.paper.sprung, last, log, schedule)
    scatter, scatter_without = _scatter(fits[last - 1]), _scatter(ideal)
    linear = min(_explained(fit) for fit in fits)
    return Outcome(
        "fig9",
        "Fig. 9: bending stiffness",
        "Bellows 2 and 3 of one section work evenly against bellows 1, to both sides (φ = 0 and φ = π). Of the "
        "steady pressures the springs found before and the weight are taken off; what is left is the bending "
        "moment, here as the difference of pressure between the two sides that would make it.",
        [
            Claim(
                "linear in the bending angle",
                f"a line explains at least {100 * linear:.1f} % of the variance",
                linear > 0.9,
            ),
            Claim(
                "scatter comes from creep of the material",
                f"section {last}: {1e-2 * scatter:.1f} mbar RMS about the line, {1e-2 * scatter_without:.1f} mbar "
                "when the same arm does not creep",
                scatter > 1.5 * scatter_without,
            ),
        ],
        {
            "fig9": (
                plot_bending(fits, {last: ideal}),
                "Relative bending pressure against bending angle; negative angles bend to φ = π. Crosses: the same "
                "measurement on a virtual arm whose material does not creep.",
            )
        },
        numbers={"explained": linear, "scatter": scatter, "scatter_without_creep": scatter_without},
    )


def _scatter(fit: StiffnessFit) -> float:
    """RMS distance from the line, as a pressure, Pa."""
    return float(np.sqrt(np.mean(fit.residual**2)) * fit.pressure_per_moment)


def _explained(fit: StiffnessFit) -> float:
    return float(1.0 - np.var(fit.residual) / np.var(fit.ordinate))
