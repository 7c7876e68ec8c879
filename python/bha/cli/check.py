"""``bha check``: what logs hold, and whether they and an arm's file belong together."""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from bha.arm import Arm
from bha.checkup import Checkup, check_recordings, repaired
from bha.checkup.facts import Channel
from bha.cli.common import arm_argument, console, json_option, print_json, progress_bar, reports_errors, table
from bha.cli.logs import columns_option, missing_option, pressures_option, read_logs, repair_option
from bha.recordings import PressureSort


@click.command()
@arm_argument
@click.argument("logs", metavar="LOG...", nargs=-1, required=True, type=click.Path(path_type=Path))
@pressures_option
@missing_option
@columns_option
@repair_option
@click.option("--plot", metavar="FILE", type=click.Path(path_type=Path, dir_okay=False),
              help="Draw what the logs hold to this file (.png, .pdf, .svg; extra plot).")  # fmt: skip
@json_option
@reports_errors
def check(
    arm: Arm,
    logs: tuple[Path, ...],
    pressures: PressureSort | None,
    missing: bool,
    mapping: Path | None,
    repair: bool,
    plot: Path | None,
    as_json: bool,
) -> None:
    """Check whether ARM (a parameter file or a shipped arm) and its LOGs belong together.

    Ranges, units, gauge for absolute pressure, numbers of the file, sign of gravity, exchanged tubes and sensors,
    azimuth, camera. Each finding comes with its evidence and the line that repairs it. With --repair what a machine can
    mend is said to be mended, and what is found is what is left then.
    """
    with progress_bar(hidden=as_json) as bar:
        bar.add_task("reading", total=None)
        read = read_logs(arm, logs, pressures, missing, mapping)
        found = repaired(arm, read) if repair else check_recordings(arm, read)
    if plot is not None:
        from bha.plot import plot_checkup, write_figure  # noqa: PLC0415  (an optional extra)

        write_figure(plot_checkup(found), plot)
    if as_json:
        print_json({**found.to_mapping(), "written": [] if plot is None else [plot]})
        return
    _print(found)
    if plot is not None:
        console().print(f"Written: {plot}", highlight=False, markup=False, soft_wrap=True)


def _print(found: Checkup) -> None:
    out = console()
    overview = table("Log", "s", "rows/s", "pressures", "steps", "steady [s]")
    for log in found.logs:
        steady = sum(b - a for a, b in log.steady)
        steps = sum(channel.steps for channel in log.channels)
        overview.add_row(
            log.name, f"{log.duration:.4g}", f"{log.rate:.4g}", log.pressures.split()[0], str(steps), f"{steady:.3g}"
        )
    out.print(overview)
    channels = table("Channel", "from", "to", "unit", "1/s", "held", "grid", "noise")
    for name in dict.fromkeys(channel.name for log in found.logs for channel in log.channels):
        channels.add_row(name, *_row([c for log in found.logs for c in log.channels if c.name == name]))
    out.print(channels)
    counts = [
        sum(finding.severity == severity for finding in found.findings) for severity in ("fault", "warning", "note")
    ]
    words = ", ".join(f"{n} {w}{'s' * (n != 1)}" for n, w in zip(counts, ("fault", "warning", "note"), strict=True))
    out.print(f"[bold]{words}[/bold]", highlight=False)
    for text in found.repairs:
        out.print(text, highlight=False, markup=False, soft_wrap=True)
    out.print(str(found), highlight=False, markup=False, soft_wrap=True)


def _row(channels: list[Channel]) -> list[str]:
    """One channel over all logs: its whole range, the slowest rate, the most of the rest."""
    unit = channels[0].unit
    scale, shown = {"Pa": (1e-3, "kPa"), "m": (1e3, "mm")}.get(unit, (1.0, unit))
    low = float(np.nanmin([c.lowest for c in channels]))
    high = float(np.nanmax([c.highest for c in channels]))
    held = max(c.held for c in channels)
    grid, noise = (scale * max(getattr(c, key) for c in channels) for key in ("quantum", "noise"))
    return [
        f"{scale * low:.4g}",
        f"{scale * high:.4g}",
        shown,
        f"{min(c.rate for c in channels):.3g}",
        f"{100 * held:.0f} %" if held > 0.0 else "",
        f"{grid:.2g}" if grid > 0.0 else "",
        f"{noise:.2g}" if noise > 0.0 else "",
    ]
