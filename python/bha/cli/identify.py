"""``bha identify``: parameters from measured logs."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from bha.arm import Arm
from bha.cli.common import INTERRUPTED, arm_argument, json_option, print_json, progress_bar, reports_errors, say
from bha.cli.conditions import changes_in, session_option, sessions_in, with_option
from bha.cli.free import free_parameter
from bha.cli.identified import show, write_figures, write_parameters
from bha.cli.logs import columns_option, missing_option, pressures_option, read_logs, repair_option
from bha.cli.procedure import check_options, finish_procedure
from bha.errors import InputError
from bha.estimation.settings import Settings
from bha.identification.procedures import PROCEDURES, ProcedureName, carry_out
from bha.identification.stiffness import HIGHEST_ORDER
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
@with_option
@session_option
@click.option("--per-session", "per_session", metavar="PATH[=START[:LOW:HIGH]]", multiple=True,
              help="Parameter that is estimated once a session (may be repeated); all others are shared. A file is "
                   "written for each session.")  # fmt: skip
@click.option("--windows", metavar="S,S",
              help="Lengths of the simulated windows, stage by stage [s]; 'all' is a whole log. Left out: 0.75,6; "
              "6,all where commands go through pneumatics or a pressure lag.")  # fmt: skip
@click.option("--step", type=float, help="Step of the integrator [s]; chosen and checked if left out.")
@pressures_option
@missing_option
@columns_option
@repair_option
@click.option("--max-iterations", type=click.IntRange(1), default=40, show_default=True)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the redrawn pressure noise.")
@click.option("--plot", "plot", is_flag=True, help="Write figures beside --out (or beside the first log).")
@click.option("--procedure", type=click.Choice(PROCEDURES),
              help="In place of the joint fit one procedure of the paper's section IV, in its order: stiffness "
                   "(Fig. 8), bending (Fig. 9), damping (Fig. 10).")  # fmt: skip
@click.option("--section", "chosen", type=int, multiple=True,
              help="Section whose law a procedure finds (may be repeated); all if left out.")  # fmt: skip
@click.option("--order", type=click.IntRange(1, HIGHEST_ORDER), default=3, show_default=True,
              help="Highest power of the spring force curve.")  # fmt: skip
@json_option
@reports_errors
def identify_command(
    arm: Arm,
    logs: tuple[Path, ...],
    out: Path | None,
    holdouts: tuple[Path, ...],
    free: tuple[str, ...],
    withs: tuple[tuple[str, str], ...],
    sessions: tuple[str, ...],
    per_session: tuple[str, ...],
    windows: str | None,
    step: float | None,
    pressures: PressureSort | None,
    missing: bool,
    mapping: Path | None,
    repair: bool,
    max_iterations: int,
    seed: int,
    plot: bool,
    procedure: ProcedureName | None,
    chosen: tuple[int, ...],
    order: int,
    as_json: bool,
) -> None:
    """Identify parameters of ARM from measured logs with pressures and lengths or head positions.

    With --procedure the logs must hold what the paper's experiment does: for stiffness all bellows of a section
    inflated evenly in held steps, for bending bellows 2 and 3 evenly against bellows 1 in held steps to both sides, for
    damping free swings under constant pressures. Each begins with the file that the one before has written.

    A fit that does not converge says so, keeps its best point and ends with exit code 3. After Ctrl-C in the fit the
    point that it has reached is written, without intervals; the exit code is then 130.
    """
    check_target(out, keep=[*logs, *holdouts])  # before the work, lest it be lost
    check_options(click.get_current_context(), procedure)
    stem = (out or logs[0]).with_suffix("")
    if procedure is not None:
        with progress_bar(hidden=as_json) as bar:
            task = bar.add_task("reading logs", total=1.0)
            found = carry_out(
                arm,
                read_logs(arm, logs, pressures, missing, mapping),
                procedure,
                sections=chosen or None,
                order=order,
                progress=lambda text, done: bar.update(task, description=text, completed=done),
            )
        finish_procedure(found, out, stem if plot else None, as_json=as_json)
        return
    lengths = None if windows is None else _windows(windows)
    settings = Settings(windows=lengths, step=step, max_iterations=max_iterations, seed=seed)
    parameters = [free_parameter(text) for text in free] or None
    every = [*logs, *holdouts]
    changes, of_sessions = changes_in(withs, every), sessions_in(sessions, every)
    with progress_bar(hidden=as_json, time_left=False) as bar:
        task = bar.add_task("reading logs", total=1.0)
        read = read_logs(arm, every, pressures, missing, mapping)
        result = identify(
            arm,
            read[: len(logs)],
            parameters,
            holdout=read[len(logs) :],
            repair=repair,
            changes=changes,
            sessions=of_sessions,
            per_session=[free_parameter(text) for text in per_session],
            settings=settings,
            progress=lambda text, done: bar.update(task, description=text, completed=done),
        )
    written = [] if out is None else write_parameters(result, out)
    if plot:
        written += write_figures(result, stem)
    if as_json:
        recordings = [recording.to_mapping() for recording in read]
        print_json(result.summary() | {"recordings": recordings, "written": written})
    else:
        for recording in read:
            for text in recording.notes:
                say(f"{recording.name}: {text}")
        show(result)
        for path in written:
            click.echo(f"written: {path}")
    if result.interrupted:
        if not as_json and out is None:
            say("nothing is written: without --out there is nothing to go on from")
        sys.exit(INTERRUPTED)
    if not result.converged:
        sys.exit(NOT_CONVERGED)


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
