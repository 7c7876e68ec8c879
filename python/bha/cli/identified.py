"""What ``bha identify`` shows: estimates, what is left, held-out logs; and its figures."""

from __future__ import annotations

from pathlib import Path

from rich.table import Table

from bha.cli.common import console, say, table
from bha.identification.result import HeldOut, Identification

#: Combinations of parameters that logs do not tell: so many are shown.
_COMBINATIONS = 4


def show(result: Identification) -> None:
    """Print a result."""
    out = console()
    outcome, integration = result.refinement.outcome, result.refinement.problem.model.integration
    state = "INTERRUPTED" if outcome.interrupted else "converged" if outcome.converged else "NOT CONVERGED"
    say(
        f"{state} after {outcome.iterations} steps in {result.refinement.seconds:.1f} s ({outcome.message}); "
        f"{integration.method} with {1e3 * integration.step:g} ms"
    )
    estimates = table("parameter", "unit", "start", "estimate", "std. error", "95 % interval", "", running=[""])
    for e in result.estimates:
        note = "at its bound" if e.at_bound else "" if e.identified else "not told by these logs"
        estimates.add_row(
            e.name, e.unit, f"{e.start:.4g}", f"{e.value:.4g}", f"{e.standard_error:.2g}",
            f"{e.interval[0]:.4g} to {e.interval[1]:.4g}", note,
        )  # fmt: skip
    out.print(estimates)
    left = table("log", "channel", "left [mm]", "noise [mm]", "correlated over [s]", "white", "follows")
    for r in result.residuals:
        left.add_row(
            r.record, r.channel, f"{1e3 * r.rms:.3g}", f"{1e3 * r.noise:.3g}", f"{r.correlation_time:.3g}",
            "yes" if r.white else "no", f"{r.follows} ({r.follows_by:.2f})",
        )  # fmt: skip
    out.print(left)
    if result.held_out:
        out.print(_held_out_table(result.held_out))
    for note in result.notes:
        say(f"note: {note}")
    # The worst come first; one after the other they would fill a screen, and each says less than the one before.
    more = [f"not identified: {combination.text}" for combination in result.unknown[_COMBINATIONS:]]
    for warning in result.warnings:
        if warning not in more:
            say(f"warning: {warning}")
    if more:
        say(f"warning: not identified: {len(more)} more of the kind; --json has them all")


def _held_out_table(held_out: tuple[HeldOut, ...]) -> Table:
    errors = table("held-out log", "channel", "before [mm]", "after [mm]", "left open [mm]", "noise [mm]")
    for held in held_out:
        rec = held.after.record
        for place, channel in enumerate(rec.channels):
            before, after = 1e3 * held.before.rms[place], 1e3 * held.after.rms[place]
            unsure = f"{1e3 * held.open[place]:.2g}"
            errors.add_row(rec.name, channel, f"{before:.3g}", f"{after:.3g}", unsure, f"{1e3 * rec.noise[place]:.2g}")
    return errors


def write_parameters(result: Identification, out: Path) -> list[Path]:
    """Write the parameter file, or one for each session where numbers differ between these; returns the paths."""
    if not result.sessions:
        result.parameters().write(out)
        return [out]
    paths = [out.with_name(f"{out.stem}_{session}{out.suffix}") for session in result.sessions]
    for session, path in zip(result.sessions, paths, strict=True):
        result.parameters(session).write(path)
    return paths


def write_figures(result: Identification, stem: Path) -> list[Path]:
    """Write the figures of a result beside ``stem``; returns their paths."""
    from bha.plot import identification as plots  # noqa: PLC0415  (figures need an extra)
    from bha.plot.style import write_figure  # noqa: PLC0415

    written = [write_figure(plots.plot_correlation(result), stem.with_name(f"{stem.name}_correlation.pdf"))]
    for number, held in enumerate(result.held_out):
        name = Path(held.after.record.name).name.partition(".")[0]
        path = stem.with_name(f"{stem.name}_heldout_{name}.pdf")
        written.append(write_figure(plots.plot_prediction(result, number), path))
    return written
