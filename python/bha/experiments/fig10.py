"""Fig. 10: damping from a lateral swing after a lost contact (section IV-E)."""

from __future__ import annotations

from bha.experiments.compare import oscillation
from bha.experiments.figures import swing_figure
from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Claim, Outcome
from bha.experiments.procedures import lateral, swing_from_release
from bha.simulation import Input, simulate

#: Bellows 1 of every section: they lie in the plane of the swing.
SHOWN = (0, 3, 6)


def run(lab: Laboratory) -> Outcome:
    """Fit the damping and show the swing that it comes from."""
    fit = lab.damping
    release, log = lab.swing
    start, free = swing_from_release(log, release)
    time = free.time - free.time[0]
    measured = lateral(lab.identified, free)
    lengths = free.lengths
    assert lengths is not None
    drive = Input.constant(free.pressures(lab.identified.inputs).mean(axis=0), float(time[-1]))
    model = simulate(lab.identified, drive, dt=2e-3, q0=start)
    rest = lab.identified.static_lengths(drive.pressures[0], start=start)
    fitted = model.head_positions[:, :, 0] - lab.identified.forward_kinematics(rest)[0][:, 0]
    frequency, greatest, damping = oscillation(time, measured[:, -1])
    model_frequency, _, model_damping = oscillation(model.time, fitted[:, -1])
    damped = ", ".join(f"{d:.1f}" for d in fit.damping)
    return Outcome(
        "fig10",
        "Fig. 10: damping",
        "A lateral force at the tool loses contact and the arm swings, pressures staying as they are. One damping "
        "for the bellows of each section follows by least squares between the deflections of all heads, measured "
        "and simulated.",
        [
            Claim(
                "damping follows from frequency and decay of the oscillation",
                f"{damped} N s/m; {1e3 * fit.residual:.1f} mm RMS of {1e3 * greatest:.0f} mm are left",
                fit.residual < 0.15 * greatest,
            ),
            Claim(
                "linear damping describes the decay",
                f"damping ratio {model_damping:.3f} of the model, {damping:.3f} measured",
                abs(model_damping - damping) < 0.3 * damping,
            ),
        ],
        {
            "fig10": (
                swing_figure(
                    {"measured": (time, measured), "fit": (model.time, fitted)},
                    {"measured": (time, lengths), "fit": (model.time, model.lengths)},
                    SHOWN,
                ),
                "Lateral deflection of the heads from where they come to rest, and a selection of bellows lengths; "
                "measured (solid) and the model with the fitted damping (dotted).",
            )
        },
        numbers={
            "frequency": frequency,
            "model_frequency": model_frequency,
            "damping_ratio": damping,
            "model_damping_ratio": model_damping,
            "residual": fit.residual,
        },
    )
