"""``bha identify`` and ``bha excite``."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from rich.table import Table

from bha.arm import Arm
from bha.cli.common import arm_argument, console, json_option, print_json, progress_bar, reports_errors, say, table
from bha.cli.logs import missing_option, pressures_option, read_logs, repair_option
from bha.errors import InputError
from bha.estimation.free import FreeParameter
from bha.estimation.refinement import Settings
from bha.identification.excitation import KINDS, Excitation, excite
from bha.identification.result import HeldOut, Identification
from bha.identification.workflow import identify
from bha.recordings import PressureSort
from bha.support.files import check_target

#: Exit code of a fit that did not converge; its best point is written all the same.
NOT_CONVERGED = 3


@click.command("identify")
@arm_argument
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", metavar="ARM_IDENTIFIED", type=click.Path(path_type=Path, dir_okay=False),
              help="Parameter file to write, with intervals and the logs' hashes.")  # fmt: skip
@click.option("--holdout", "holdouts", metavar="LOG", multiple=True, type=click.Path(path_type=Path),
              help="Log that takes no part in the fit and is predicted (may be repeated).")  # fmt: skip
@click.option("--free", "free", metavar="PATH[=START[:LOW:HIGH]]", multiple=True,
              help="Parameter to estimate, section.2.mass or section.*.damping (may be repeated). "
                   "If left out: mass, stiffness, bending stiffness and damping of every section; where heads are "
                   "measured the camera's frame, too.")  # fmt: skip
@click.option("--windows", metavar="S,S",
              help="Lengths of the simulated windows, stage by stage [s]; 'all' is a whole log. Left out: 0.75,6; "
              "6,all where commands go through pneumatics or a pressure lag.")  # fmt: skip
@click.option("--step", type=float, help="Step of the integrator [s]; chosen and checked if left out.")
@pressures_option
@missing_option
@repair_option
@click.option("--max-iterations", type=click.IntRange(1), default=40, show_default=True)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the redrawn pressure noise.")
@click.option("--plot", "plot", is_flag=True, help="Write figures beside --out (or beside the first log).")
@json_option
@reports_errors
def identify_command(
    arm: Arm,
    logs: tuple[Path, ...],
    out: Path | None,
    holdouts: tuple[Path, ...],
    free: tuple[str, ...],
    windows: str | None,
    step: float | None,
    pressures: PressureSort | None,
    missing: bool,
    repair: bool,
    max_iterations: int,
    seed: int,
    plot: bool,
    as_json: bool,
) -> None:
    """Identify parameters of ARM from measured logs with pressures and lengths or head positions.

    A fit that does not converge says so, keeps its best point and ends with exit code 3.
    """
    check_target(out)  # before the work, lest it be lost
    lengths = None if windows is None else _windows(windows)
    settings = Settings(windows=lengths, step=step, max_iterations=max_iterations, seed=seed)
    parameters = [_free(text) for text in free] or None
    with progress_bar(hidden=as_json) as bar:
        task = bar.add_task("reading logs", total=1.0)
        read = read_logs(arm, [*logs, *holdouts], pressures, missing)
        result = identify(
            arm,
            read[: len(logs)],
            parameters,
            holdout=read[len(logs) :],
            repair=repair,
            settings=settings,
            progress=lambda text, done: bar.update(task, description=text, completed=done),
        )
    if out is not None:
        result.parameters().write(out)
    if plot:
        figures = _write_figures(result, (out or logs[0]).with_suffix(""))
    if as_json:
        print_json(result.summary() | {"recordings": [recording.to_mapping() for recording in read]})
    else:
        for recording in read:
            for text in recording.notes:
                say(f"{recording.name}: {text}")
        _show(result)
        if out is not None:
            click.echo(f"written: {out}")
        for path in figures if plot else ():
            click.echo(f"written: {path}")
    if not result.converged:
        sys.exit(NOT_CONVERGED)


@click.command("excite")
@arm_argument
@click.option("--out", metavar="LOG", type=click.Path(path_type=Path, dir_okay=False),
              help="Log of commanded pressures to write (.csv, .csv.gz, .parquet).")  # fmt: skip
@click.option("--duration", type=float, default=60.0, show_default=True, help="[s]")
@click.option("--rate", type=float, default=200.0, show_default=True, help="Samples a second.")
@click.option("--kind", "kinds", type=click.Choice(KINDS), multiple=True, default=KINDS, show_default=True)
@click.option("--amplitude", type=float, default=0.6, show_default=True, help="Part of half the pressure range.")
@click.option("--highest-frequency", type=float, default=3.0, show_default=True, help="Of the multisine [Hz].")
@click.option("--noise", type=float, default=0.3, show_default=True, help="Of the length sensors [mm].")
@click.option("--free", "free", metavar="PATH", multiple=True, help="Parameter to judge (may be repeated).")
@click.option("--seed", type=int, default=0, show_default=True)
@json_option
@reports_errors
def excite_command(
    arm: Arm,
    out: Path | None,
    duration: float,
    rate: float,
    kinds: tuple[str, ...],
    amplitude: float,
    highest_frequency: float,
    noise: float,
    free: tuple[str, ...],
    seed: int,
    as_json: bool,
) -> None:
    """Propose pressures that make the parameters of ARM known, and predict how well."""
    check_target(out)
    proposal = excite(
        arm,
        duration=duration,
        rate=rate,
        kinds=kinds,
        amplitude=amplitude,
        highest_frequency=highest_frequency,
        free=[_free(text) for text in free] or None,
        noise=1e-3 * noise,
        seed=seed,
    )
    if out is not None:
        proposal.log().write(out)
    if as_json:
        print_json(
            {
                "arm": arm.name,
                "duration": duration,
                "log": out,
                "parameters": [vars(p) for p in proposal.prospects],
                "unknown": [c.text for c in proposal.unknown],
            }
        )
        return
    _show_prospects(proposal)
    if out is not None:
        click.echo(f"written: {out}")


def _windows(text: str) -> tuple[float | None, ...]:
    found: list[float | None] = []
    for part in text.split(","):
        if part.strip() == "all":
            found.append(None)
            continue
        try:
            length = float(part)
        except ValueError:
            length = float("nan")
        if not 0.0 < length < float("inf"):
            raise InputError(
                f"--windows {text}: {part!r}; positive numbers of seconds or 'all' are needed, as in 0.75,6"
            )
        found.append(length)
    return tuple(found)


def _free(text: str) -> FreeParameter:
    path, _, rest = text.partition("=")
    if not rest:
        return FreeParameter(path)
    try:
        numbers = [float(part) for part in rest.split(":")]
    except ValueError as error:
        raise InputError(f"--free {text}: numbers are needed after '=', as in section.1.mass=0.7:0.5:0.9") from error
    if len(numbers) not in (1, 3):
        raise InputError(f"--free {text}: a start, or start:low:high, is needed after '='")
    start, low, high = (*numbers, None, None)[:3]
    return FreeParameter(path, start=start, lower=low, upper=high)


def _show(result: Identification) -> None:
    out = console()
    outcome = result.refinement.outcome
    state = "converged" if outcome.converged else "NOT CONVERGED"
    say(
        f"{state} after {outcome.iterations} steps in {result.refinement.seconds:.1f} s ({outcome.message}); "
        f"{result.refinement.problem.model.method} with {1e3 * result.refinement.problem.model.step:g} ms"
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
    for warning in result.warnings:
        say(f"warning: {warning}")


def _held_out_table(held_out: tuple[HeldOut, ...]) -> Table:
    errors = table("held-out log", "channel", "before [mm]", "after [mm]", "noise [mm]")
    for held in held_out:
        rec = held.after.record
        for place, channel in enumerate(rec.channels):
            before, after = 1e3 * held.before.rms[place], 1e3 * held.after.rms[place]
            errors.add_row(rec.name, channel, f"{before:.3g}", f"{after:.3g}", f"{1e3 * rec.noise[place]:.2g}")
    return errors


def _show_prospects(proposal: Excitation) -> None:
    prospects = table("parameter", "unit", "value", "std. error", "")
    for p in proposal.prospects:
        share = f"{100 * p.standard_error / abs(p.value):.2g} %" if p.value else ""
        prospects.add_row(p.name, p.unit, f"{p.value:.4g}", f"{p.standard_error:.2g}", share if p.told else "not told")
    out = console()
    out.print(prospects)
    for combination in proposal.unknown:
        say(f"would stay unknown: {combination.text}")


def _write_figures(result: Identification, stem: Path) -> list[Path]:
    from bha.plot import identification as plots  # noqa: PLC0415  (figures need an extra)
    from bha.plot.style import write_figure  # noqa: PLC0415

    written = [write_figure(plots.plot_correlation(result), stem.with_name(f"{stem.name}_correlation.pdf"))]
    for number, held in enumerate(result.held_out):
        name = Path(held.after.record.name).name.partition(".")[0]
        path = stem.with_name(f"{stem.name}_heldout_{name}.pdf")
        written.append(write_figure(plots.plot_prediction(result, number), path))
    return written
