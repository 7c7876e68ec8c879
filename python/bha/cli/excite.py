"""``bha excite``: what to measure."""

from __future__ import annotations

from pathlib import Path

import click

from bha.arm import Arm
from bha.cli.common import arm_argument, console, json_option, print_json, read_json, reports_errors, say, table
from bha.cli.free import free_parameter
from bha.estimation.programme import EVERY_KIND
from bha.identification.excitation import Excitation, excite
from bha.support.files import check_target


@click.command("excite")
@arm_argument
@click.option("--out", metavar="LOG", type=click.Path(path_type=Path, dir_okay=False),
              help="Log of commanded pressures to write (.csv, .csv.gz, .parquet).")  # fmt: skip
@click.option("--duration", type=float, default=60.0, show_default=True, help="[s]")
@click.option("--rate", type=float, default=200.0, show_default=True, help="Samples a second.")
@click.option("--kind", "kinds", type=click.Choice(EVERY_KIND), multiple=True,
              help="Pieces in their order (may be repeated); hold, multisine, release if left out. With --after "
                   "those that may be chosen, all if left out.")  # fmt: skip
@click.option("--amplitude", type=float, default=0.6, show_default=True, help="Part of half the pressure range.")
@click.option("--highest-frequency", type=float, default=3.0, show_default=True, help="Of the multisine [Hz].")
@click.option("--noise", type=float, default=0.3, show_default=True, help="Of the length sensors [mm].")
@click.option("--free", "free", metavar="PATH", multiple=True, help="Parameter to judge (may be repeated).")
@click.option("--after", metavar="RESULT.json", type=click.Path(path_type=Path, dir_okay=False),
              help="What the last bha identify --json has printed: pieces are chosen that tell what it could not, for "
                   "the channels that it had. ARM is the file that it has written.")  # fmt: skip
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
    after: Path | None,
    seed: int,
    as_json: bool,
) -> None:
    """Propose pressures that make the parameters of ARM known, and predict how well."""
    check_target(out)
    proposal = excite(
        arm,
        duration=duration,
        rate=rate,
        kinds=kinds or None,
        amplitude=amplitude,
        highest_frequency=highest_frequency,
        free=[free_parameter(text) for text in free] or None,
        noise=1e-3 * noise,
        seed=seed,
        after=None if after is None else read_json(after),
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
                "pieces": proposal.pieces,
                "advice": proposal.advice,
            }
        )
        return
    _show_prospects(proposal)
    if out is not None:
        click.echo(f"written: {out}")


def _show_prospects(proposal: Excitation) -> None:
    after = any(p.before is not None for p in proposal.prospects)
    prospects = table("parameter", "unit", "value", *(["before"] if after else []), "std. error", "")
    for p in proposal.prospects:
        share = f"{100 * p.standard_error / abs(p.value):.2g} %" if p.value else ""
        before = [] if not after else ["" if p.before is None else f"{p.before:.2g}"]
        note = share if p.told else "not told"
        prospects.add_row(p.name, p.unit, f"{p.value:.4g}", *before, f"{p.standard_error:.2g}", note)
    out = console()
    out.print(prospects)
    say("pieces: " + ", ".join(proposal.pieces))
    for combination in proposal.unknown:
        say(f"would stay unknown: {combination.text}")
    for text in proposal.advice:
        say(text)
