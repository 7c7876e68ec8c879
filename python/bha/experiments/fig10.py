"""Fig. 10: damping from a lateral swing after a lost contact (section IV-E)."""

from __future__ import annotations

import numpy as np

from bha.experiments.laboratory import Laboratory
from bha.experiments.measured import lateral, seen
from bha.experiments.outcome import Claim, Outcome
from bha.plot.section_four import swing_figure

#: Bellows 1 of every section: they lie in the plane of the swing.
SHOWN = (0, 3, 6)


def run(lab: Laboratory) -> Outcome:
    """Fit the damping and show the swing that it comes from."""
    fit = lab.paper.damping
    (swing,), (found,), (model,) = fit.swings, fit.measured, fit.modelled
    _, log = lab.swing
    measured, lengths = lateral(swing), seen(lab.weighed, log).lengths[swing.stretch.first :]
    fitted = np.full_like(measured, np.nan)
    fitted[:, -1] = found.fitted
    share = found.residual / found.amplitude
    damping = ", ".join(f"{d:.1f}" for d, _ in fit.damping.values())
    return Outcome(
        "fig10",
        "Fig. 10: damping",
        "A lateral force at the tool loses contact and the arm swings; the pressures stay as they are. A damped "
        "oscillation is fitted to the tool's deflection by least squares; then the bellows' damping is chosen such "
        "that the model's swing decays alike. One swing gives one number, the ratio of damping to stiffness, taken "
        "to be the same in all sections.",
        [
            Claim(
                "linear damping follows from the frequency and the decay of the oscillation",
                f"{found.frequency:.2f} Hz, damping ratio {found.damping_ratio:.3f}: {damping} N s/m",
                abs(model.damping_ratio / found.damping_ratio - 1) < 0.02,
            ),
            Claim(
                "a least-squares fit describes the oscillation",
                f"{1e3 * found.residual:.1f} mm RMS of {1e3 * found.amplitude:.0f} mm are left",
                share < 0.1,
            ),
        ],
        {
            "fig10": (
                swing_figure(
                    {"measured": (swing.time, measured), "fit": (swing.time, fitted)},
                    {"measured": (swing.time, lengths)},
                    SHOWN,
                ),
                "Lateral deflection of the heads from where they come to rest, and a selection of bellows lengths. "
                "Dotted: the damped oscillation fitted to the tool's deflection.",
            )
        },
        numbers={
            "frequency": found.frequency,
            "model_frequency": model.frequency,
            "damping_ratio": found.damping_ratio,
            "model_damping_ratio": model.damping_ratio,
            "residual_share": share,
        },
    )
