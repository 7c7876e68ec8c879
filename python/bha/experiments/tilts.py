"""Figs. 12 and 13: tilting section 1 by pressure, measured against the dynamic and against the static models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from bha.experiments.compare import (
    greatest_tool_error,
    length_error,
    of_both_arms,
    static_trajectory,
    tool_error,
    tool_travel,
)
from bha.experiments.figures import tilt_figure
from bha.experiments.laboratory import Laboratory
from bha.experiments.outcome import Claim, Outcome, Table
from bha.runs.trajectory import Trajectory
from bha.simulation.single import simulate

#: Models beside the paper's: r_S where the section balances, not at the centre of its head; masses along the section.
CENTRAL, SPREAD = "full, mass at the sections' centres", "full, masses along the sections"
#: The arms of Figs. 13 and 14: where the mass of their sections is.
AT_HEADS, ALONG = "mass in the heads", "mass along the arcs"
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
    models = {
        "full": full,
        "reduced": reduced,
        "full, `work_conjugate`": conjugate,
        CENTRAL: simulate(lab.balanced.arm, log),
        SPREAD: simulate(lab.spread.arm, log),
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
    """Static models against two measurements: of the arm with its mass at the heads, and spread along its sections."""
    cases = {AT_HEADS: _against_statics(lab.lumped), ALONG: _against_statics(lab)}
    claims = []
    for where, found in cases.items():
        error, peak, travel = found.error, found.peak, found.travel
        coupled, decoupled = (f"{1e3 * error[name]:.1f} mm" for name in ("static coupled", "static decoupled"))
        claims += [
            Claim(
                f"static models cannot describe the motions that well ({where})",
                f"tool {coupled} (coupled) and {decoupled} (decoupled) RMS off, the full model "
                f"{1e3 * error['full']:.1f} mm; travel {1e3 * travel:.0f} mm",
                found.statics > 1.5 * error["full"],
            ),
            Claim(
                f"the coupled static model has large errors during motions ({where})",
                f"up to {1e3 * peak['static coupled']:.0f} mm, {100 * peak['static coupled'] / travel:.0f} % of the "
                "travel; it does not see the swing at all",
                peak["static coupled"] > 0.2 * travel,
            ),
        ]
    spread = cases[ALONG]
    claims.append(
        Claim(
            "(ours) it is the place of the mass that brings the full model so close to the static ones, as in Fig. 14",
            f"with each section's mass along its arc {1e3 * spread.error[SPREAD]:.1f} mm RMS and up to "
            f"{1e3 * spread.peak[SPREAD]:.0f} mm are left",
            spread.statics > 1.5 * spread.error[SPREAD],
        )
    )
    rows = [[name, *(text for found in cases.values() for text in _cells(found, name))] for name in spread.models]
    travels = " and ".join(f"{1e3 * found.travel:.0f} mm ({where})" for where, found in cases.items())
    shown = ("static coupled", "static decoupled")
    return Outcome(
        "fig13",
        "Fig. 13: tilting, static models",
        "Section 1 is tilted to and fro by its bellows 1, once a second. The static coupled model solves "
        "N(q, 0) = τ(q, p) (62) for every measured pressure; the decoupled one balances springs and pressures "
        "alone, without gravity and bending. Two arms are measured, alike but for one thing: each section's mass in "
        "its head, where the paper's model has it, or spread along its arc as in all other experiments here. Each is "
        "identified by section IV from measurements of its own.",
        claims,
        {
            stem: (
                tilt_figure({"measured": found.measured} | {name: found.models[name] for name in shown}),
                f"Measured (solid), static coupled (dotted) and static decoupled (dashed); {where}.",
            )
            for stem, (where, found) in zip(("fig13_at_heads", "fig13"), cases.items(), strict=True)
        },
        [
            Table(
                ["model", *(f"{what}, {where} [mm]" for where in cases for what in ("tool, RMS", "tool, greatest"))],
                rows,
                f"Distance from the measurement; the tool moves by {travels}.",
            )
        ],
        of_both_arms(cases[AT_HEADS].numbers, spread.numbers | {"spread_error": spread.error[SPREAD]}),
    )


@dataclass(frozen=True)
class _Tilting:
    """One arm's measurement of Fig. 13 and the models beside it; errors of the tool in m by model."""

    measured: Trajectory
    models: Mapping[str, Trajectory]
    travel: float
    error: Mapping[str, float]
    peak: Mapping[str, float]

    @property
    def statics(self) -> float:
        """The smaller RMS error of the two static models, m."""
        return min(self.error["static coupled"], self.error["static decoupled"])

    @property
    def numbers(self) -> dict[str, float]:
        """What the claims rest on, m."""
        return {
            "travel": self.travel,
            "full_error": self.error["full"],
            "coupled_error": self.error["static coupled"],
            "decoupled_error": self.error["static decoupled"],
            "coupled_peak": self.peak["static coupled"],
            "full_peak": self.peak["full"],
        }


def _against_statics(lab: Laboratory) -> _Tilting:
    log = lab.tilting
    measured = lab.measured(log)[::STRIDE]
    arm = lab.identified
    models = {
        "static coupled": static_trajectory(arm, measured, lambda p, start: arm.static_lengths(p, start=start)),
        "static decoupled": static_trajectory(arm, measured, lambda p, _: arm.static_lengths(p, coupled=False)),
        "full": simulate(arm, log)[::STRIDE],
    }
    if lab.is_spread:
        models |= {
            name: simulate(arm, log)[::STRIDE] for name, arm in ((CENTRAL, lab.balanced.arm), (SPREAD, lab.spread.arm))
        }
    return _Tilting(
        measured,
        models,
        tool_travel(measured),
        {name: tool_error(model, measured) for name, model in models.items()},
        {name: greatest_tool_error(model, measured) for name, model in models.items()},
    )


def _cells(found: _Tilting, name: str) -> tuple[str, str]:
    if name not in found.models:
        return "", ""
    return f"{1e3 * found.error[name]:.1f}", f"{1e3 * found.peak[name]:.0f}"
