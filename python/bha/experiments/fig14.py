"""Fig. 14: a lateral swing, full and reduced model against the measurement."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bha.arm import Arm
from bha.experiments.compare import oscillation
from bha.experiments.fig10 import SHOWN
from bha.experiments.figures import swing_figure
from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Claim, Outcome, Table
from bha.experiments.procedures import lateral, swing_from_release
from bha.simulation import Input, simulate

Array = NDArray[np.float64]


def run(lab: Laboratory) -> Outcome:
    """A swing that the damping was not identified from."""
    release, log = lab.second_swing
    start, free = swing_from_release(log, release)
    time = free.time - free.time[0]
    lengths = free.lengths
    assert lengths is not None
    drive = Input.constant(free.pressures(lab.identified.inputs).mean(axis=0), float(time[-1]))

    def swung(arm: Arm) -> tuple[Array, Array, Array]:
        run = simulate(arm, drive, dt=1e-3, q0=start)
        rest = arm.forward_kinematics(arm.static_lengths(drive.pressures[0], start=start))[0][:, 0]
        return run.time, run.head_positions[:, :, 0] - rest, run.lengths

    deflection = {"measured": (time, lateral(lab.identified, free))}
    shown = {"measured": (time, lengths)}
    for label, arm in (("full model", lab.identified), ("reduced model", lab.reduced)):
        t, x, q = swung(arm)
        deflection[label], shown[label] = (t, x), (t, q)
    found = {label: oscillation(t, x[:, -1]) for label, (t, x) in deflection.items()}
    rows = min(len(t) for t, _ in deflection.values())
    tool = {label: x[:rows, -1] for label, (_, x) in deflection.items()}
    error = {k: float(np.sqrt(np.mean((x - tool["measured"]) ** 2))) for k, x in tool.items() if k != "measured"}
    apart = float(np.sqrt(np.mean((tool["full model"] - tool["reduced model"]) ** 2)))
    frequency, amplitude, damping = found["measured"]
    worst = max(abs(found[k][0] / frequency - 1) for k in error)
    rows_of_table = [
        [label, f"{f:.2f}", f"{1e3 * a:.0f}", f"{d:.3f}", f"{1e3 * error[label]:.1f}" if label in error else ""]
        for label, (f, a, d) in found.items()
    ]
    return Outcome(
        "fig14",
        "Fig. 14: lateral swing, full and reduced model",
        "A second swing, from a smaller force than the one the damping was identified from. The models start from the "
        "lengths measured at the release, at rest; deflections are counted from where each comes to rest.",
        [
            Claim(
                "frequency, amplitude and damping of the tool match during the large oscillations",
                f"frequency within {100 * worst:.0f} %, damping ratio {found['full model'][2]:.3f} and "
                f"{found['reduced model'][2]:.3f} against {damping:.3f}",
                worst < 0.1,
            ),
            Claim(
                "full and reduced model describe the motion alike",
                f"{1e3 * error['full model']:.1f} and {1e3 * error['reduced model']:.1f} mm RMS from the measurement, "
                f"{1e3 * apart:.1f} mm RMS apart, of {1e3 * amplitude:.0f} mm",
                max(error.values()) < 0.3 * amplitude,
            ),
        ],
        {
            "fig14": (
                swing_figure(deflection, shown, SHOWN),
                "Lateral deflection of the heads and a selection of bellows lengths: measured (solid), full model "
                "(dotted), reduced model (dashed).",
            )
        },
        [
            Table(
                ["", "frequency [Hz]", "greatest deflection [mm]", "damping ratio", "RMS error [mm]"],
                rows_of_table,
                "The tool's oscillation.",
            )
        ],
        {
            "frequency": frequency,
            "worst_frequency": worst,
            "full_error": error["full model"],
            "reduced_error": error["reduced model"],
            "apart": apart,
            "amplitude": amplitude,
        },
    )
