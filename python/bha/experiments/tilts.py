"""Figs. 12 and 13: tilting section 1 by pressure, measured against the dynamic and against the static models."""

from __future__ import annotations

from bha.experiments.compare import greatest_tool_error, length_error, static_trajectory, tool_error, tool_travel
from bha.experiments.figures import tilt_figure
from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Claim, Outcome, Table
from bha.simulation.single import simulate

#: The model beside the paper's: r_S where the section balances, not at the centre of its head.
CENTRAL = "full, mass at the sections' centres"
#: Every how many milliseconds the static models are solved and lines are drawn.
STRIDE = 5


def fig12(lab: Laboratory) -> Outcome:
    """Full and reduced model against the measurement."""
    log = lab.tilt
    measured = lab.measured(log)
    full = simulate(lab.identified, log)
    reduced = simulate(lab.reduced, log)
    conjugate = simulate(lab.identified.with_changes(force_model="work_conjugate"), log)
    travel = tool_travel(measured)
    errors = {"full": tool_error(full, measured), "reduced": tool_error(reduced, measured)}
    apart = tool_error(reduced, full)
    balanced = simulate(lab.balanced.arm, log)
    models = {
        "full": full,
        "reduced": reduced,
        "full, `work_conjugate`": conjugate,
        CENTRAL: balanced,
    }
    table = Table(
        ["model", "tool, RMS [mm]", "bellows lengths, RMS [mm]"],
        [
            [name, f"{1e3 * tool_error(model, measured):.1f}", f"{1e3 * length_error(model, measured):.1f}"]
            for name, model in models.items()
        ],
        f"Distance from the measurement over 10 s; the tool moves by {1e3 * travel:.0f} mm.",
    )
    return Outcome(
        "fig12",
        "Fig. 12: tilting, full and reduced model",
        "First the pressure of bellows 1 of section 1 rises, then that of all its bellows; sections 2 and 3 are "
        "extended to make the inertia larger. The models are driven by the measured pressures and start at rest.",
        [
            Claim(
                "both models are good approximations of the measured trajectories",
                f"tool within {1e3 * errors['full']:.1f} mm (full) and {1e3 * errors['reduced']:.1f} mm (reduced) "
                f"RMS of {1e3 * travel:.0f} mm travel",
                max(errors.values()) < 0.1 * travel,
            ),
            Claim(
                "the approximations lead to very small changes in the simulation",
                f"full and reduced model are {1e3 * apart:.1f} mm RMS apart",
                apart < 0.5 * errors["full"],
            ),
        ],
        {
            "fig12": (
                tilt_figure(
                    {"measured": measured[::STRIDE], "full model": full[::STRIDE], "reduced model": reduced[::STRIDE]}
                ),
                "Measured (solid), full model (dotted) and reduced model (dashed).",
            )
        },
        [table],
        {"travel": travel, "apart": apart, **{f"{name}_error": error for name, error in errors.items()}},
    )


def fig13(lab: Laboratory) -> Outcome:
    """Static models against the measurement."""
    log = lab.tilting
    measured = lab.measured(log)[::STRIDE]
    arm = lab.identified
    coupled = static_trajectory(arm, measured, lambda p, start: arm.static_lengths(p, start=start))
    decoupled = static_trajectory(arm, measured, lambda p, _: arm.static_lengths(p, coupled=False))
    models = {
        "static coupled": coupled,
        "static decoupled": decoupled,
        "full": simulate(arm, log)[::STRIDE],
        CENTRAL: simulate(lab.balanced.arm, log)[::STRIDE],
    }
    travel = tool_travel(measured)
    error = {name: tool_error(model, measured) for name, model in models.items()}
    peak = {name: greatest_tool_error(model, measured) for name, model in models.items()}
    rows = [
        [name, f"{1e3 * error[name]:.1f}", f"{1e3 * peak[name]:.0f}", f"{1e3 * length_error(model, measured):.1f}"]
        for name, model in models.items()
    ]
    static = (error["static coupled"], error["static decoupled"])
    return Outcome(
        "fig13",
        "Fig. 13: tilting, static models",
        "Section 1 is tilted to and fro by its bellows 1, once a second. The static coupled model solves "
        "N(q, 0) = τ(q, p) (62) for every measured pressure; the decoupled one balances springs and pressures "
        "alone, without gravity and bending.",
        [
            Claim(
                "static models cannot describe the motions that well",
                f"tool {1e3 * static[0]:.1f} mm (coupled) and {1e3 * static[1]:.1f} mm (decoupled) RMS off, the full "
                f"model {1e3 * error['full']:.1f} mm; travel {1e3 * travel:.0f} mm",
                min(static) > 1.5 * error["full"],
            ),
            Claim(
                "the coupled static model has large errors during motions",
                f"up to {1e3 * peak['static coupled']:.0f} mm, {100 * peak['static coupled'] / travel:.0f} % of the "
                "travel; it does not see the swing at all",
                peak["static coupled"] > 0.2 * travel,
            ),
            Claim(
                "(ours) what brings the full model so close to the static ones is the place of the mass, as in Fig. 14",
                f"with each section's mass at its centre of mass {1e3 * error[CENTRAL]:.1f} mm RMS and up to "
                f"{1e3 * peak[CENTRAL]:.0f} mm are left",
                min(static) > 1.5 * error[CENTRAL],
            ),
        ],
        {
            "fig13": (
                tilt_figure({"measured": measured, "static coupled": coupled, "static decoupled": decoupled}),
                "Measured (solid), static coupled (dotted) and static decoupled (dashed).",
            )
        },
        [
            Table(
                ["model", "tool, RMS [mm]", "tool, greatest [mm]", "bellows lengths, RMS [mm]"],
                rows,
                f"Distance from the measurement; the tool moves by {1e3 * travel:.0f} mm.",
            )
        ],
        {
            "travel": travel,
            "full_error": error["full"],
            "central_error": error[CENTRAL],
            "coupled_error": static[0],
            "decoupled_error": static[1],
            "coupled_peak": peak["static coupled"],
            "full_peak": peak["full"],
        },
    )
