"""Fig. 10: damping from a lateral swing after a lost contact (section IV-E)."""

from __future__ import annotations

import numpy as np

from bha.experiments.figures import swing_figure
from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Claim, Outcome
from bha.experiments.procedures import fit_oscillation, lateral, simulated_swing, swing_from_release
from bha.runs.input import Input

#: Bellows 1 of every section: they lie in the plane of the swing.
SHOWN = (0, 3, 6)


def run(lab: Laboratory) -> Outcome:
    """Fit the damping and show the swing that it comes from."""
    fit = lab.paper.damping
    arm = lab.identified
    release, log = lab.swing
    start, free = swing_from_release(arm, log, release)
    time, measured = free.time - free.time[0], lateral(arm, free)
    lengths = free.lengths
    drive = Input.constant(free.pressures.mean(axis=0), float(time[-1]))
    model_time, swung, _ = simulated_swing(arm, drive, start)
    model = fit_oscillation(model_time, swung[:, -1])
    fitted = np.full_like(measured, np.nan)
    fitted[:, -1] = fit.measured.curve
    share = fit.measured.residual / fit.measured.amplitude
    damping = ", ".join(f"{d:.1f}" for d in fit.damping)
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
                f"{fit.measured.frequency:.2f} Hz, damping ratio {fit.measured.damping_ratio:.3f}: {damping} N s/m",
                abs(model.damping_ratio / fit.measured.damping_ratio - 1) < 0.02,
            ),
            Claim(
                "a least-squares fit describes the oscillation",
                f"{1e3 * fit.measured.residual:.1f} mm RMS of {1e3 * fit.measured.amplitude:.0f} mm are left",
                share < 0.1,
            ),
        ],
        {
            "fig10": (
                swing_figure(
                    {"measured": (time, measured), "fit": (time, fitted)}, {"measured": (time, lengths)}, SHOWN
                ),
                "Lateral deflection of the heads from where they come to rest, and a selection of bellows lengths. "
                "Dotted: the damped oscillation fitted to the tool's deflection.",
            )
        },
        numbers={
            "frequency": fit.measured.frequency,
            "model_frequency": model.frequency,
            "damping_ratio": fit.measured.damping_ratio,
            "model_damping_ratio": model.damping_ratio,
            "residual_share": share,
        },
    )
