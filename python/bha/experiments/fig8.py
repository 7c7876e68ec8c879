"""Fig. 8: longitudinal stiffness from steady states at even pressures (section IV-C)."""

from __future__ import annotations

import numpy as np

from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Claim, Outcome
from bha.plot.section_four import plot_stiffness


def run(lab: Laboratory) -> Outcome:
    """Identify the spring curves and compare them with those the virtual arm was built with."""
    fits = lab.paper.stiffness
    truth, scatter, bent, rising = [], [], [], []
    for fit, section in zip(fits, lab.design.parameters.sections, strict=True):
        measured = fit.rest_length + fit.abscissa
        lengths = np.linspace(measured.min(), measured.max(), 200)
        extension = lengths - section.rest_length
        truth.append((lengths, np.asarray(sum(k * extension ** (j + 1) for j, k in enumerate(section.stiffness)))))
        scatter.append(float(np.sqrt(np.mean(fit.residual**2))))
        straight = np.polyfit(measured, fit.ordinate, 1)
        bent.append(float(np.sqrt(np.mean((fit.ordinate - np.polyval(straight, measured)) ** 2))))
        rising.append(float(np.abs(fit.curve(lengths - fit.rest_length) - truth[-1][1]).max()))
    span = max(float(np.ptp(fit.ordinate)) for fit in fits)
    ratio = min(b / s for b, s in zip(bent, scatter, strict=True))
    low = 1e3 * min(f.rest_length + f.abscissa.min() for f in fits)
    high = 1e3 * max(f.rest_length + f.abscissa.max() for f in fits)
    return Outcome(
        "fig8",
        "Fig. 8: longitudinal stiffness",
        "All bellows are inflated evenly, so that no section bends, and held at several lengths, going up and "
        "coming down. The spring force of a bellows is A_P (p − p_amb) and its share of the weight below it; a "
        "polynomial of third order goes through the points. Up and down differ a little: the material creeps.",
        [
            Claim(
                "the spring force is a nonlinear function of the length",
                f"a straight line misses the points {ratio:.0f} times as far as the curve does",
                ratio > 2,
            ),
            Claim(
                "it can be identified from steady pressures at several lengths",
                f"curve at most {max(rising):.1f} N off that of the virtual arm, of {span:.0f} N",
                max(rising) < 0.05 * span,
            ),
        ],
        {
            "fig8": (
                plot_stiffness(fits, truth),
                f"Spring force of one bellows at steady states between {low:.0f} and {high:.0f} mm (circles), fitted "
                "curve (dashed), and the curve that the virtual arm was built with (grey).",
            )
        },
        numbers={"nonlinearity": ratio, "largest_error": max(rising), "span": span},
    )
