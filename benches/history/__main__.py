"""``python -m benches.history [FOLDER] [--out PAGE]``: how ratios went from commit to commit, printed and drawn."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from .entry import Entry, read_folder
from .page import by_label, page

ENTRIES = Path(__file__).parent / "entries"
#: Columns of the printed table.
LAST = 4


def summary(entries: list[Entry]) -> Table:
    """Ratios of the last runs, and how much the last one differs from that before it."""
    shown = entries[-LAST:]
    table = Table("Ratio", title="First / second, medians of one process")
    for entry in shown:
        table.add_column(f"{entry.label}\n{entry.machine.processor}\nload {entry.load}", justify="right")
    table.add_column("change", justify="right")
    for label, series in by_label(entries).items():
        values = {entry: item.value for entry, item in series}
        cells = [f"{values[entry]:.3g}" if entry in values else "" for entry in shown]
        pair = [item.value for _, item in series[-2:]]
        change = f"{100 * (pair[1] / pair[0] - 1):+.0f} %" if len(pair) == 2 and shown[-1] in values else ""
        table.add_row(label, *cells, change)
    return table


@click.command()
@click.argument("folder", type=click.Path(path_type=Path, exists=True, file_okay=False), default=ENTRIES)
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), default=Path("out/benchmarks.html"))
def main(folder: Path, out: Path) -> None:
    """Print the last ratios of FOLDER's entries and draw all of them onto one page."""
    try:
        entries = read_folder(folder)
    except ValueError as error:
        raise click.ClickException(str(error)) from error
    if not entries:
        raise click.ClickException(f"{folder} has no entries; `make bench` writes one")
    Console(width=None if Console().is_terminal else 150).print(summary(entries))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(page(entries), encoding="utf-8")
    click.echo(f"Written: {out}")


if __name__ == "__main__":
    main()
