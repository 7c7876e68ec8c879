"""``bha view``: an arm in the browser, or as a page or a video."""

from __future__ import annotations

import webbrowser
from pathlib import Path

import click

from bha.arm import Arm
from bha.cli.common import arm_argument, progress_bar, reports_errors, say
from bha.cli.logs import missing_option, pressures_option
from bha.recordings import PressureSort
from bha.viewer import Viewer, checked_page_path, checked_video_path, motions_of, page, part, write_video
from bha.viewer.pages import RATE


@click.command()
@arm_argument
@click.argument("sources", metavar="[LOG|TRAJECTORY]...", nargs=-1, type=click.Path(path_type=Path))
@pressures_option
@missing_option
@click.option("--port", type=int, help="Where to serve; 0: any that is free; left out: 8080 or the next free one.")
@click.option("--host", default="127.0.0.1", show_default=True,
              help="Who may see it: 127.0.0.1 this computer, 0.0.0.0 every one that can reach it.")  # fmt: skip
@click.option("--browser/--no-browser", default=True, show_default=True, help="Open it in the browser.")
@click.option("--page", "page_path", metavar="FILE", type=click.Path(path_type=Path, dir_okay=False),
              help="Write one .html file that plays by itself, without a network, and end.")  # fmt: skip
@click.option("--video", "video_path", metavar="FILE", type=click.Path(path_type=Path, dir_okay=False),
              help="Write a video (.mp4) or an animated picture (.gif, .webp), and end.")  # fmt: skip
@click.option("--from", "start", type=float, help="Show the log from here on [s after its start].")
@click.option("--to", "end", type=float, help="Show the log up to here [s after its start].")
@click.option("--speed", type=float, default=1.0, show_default=True,
              help="Of pages and videos: how many seconds are played in one.")  # fmt: skip
@click.option("--rate", type=float, default=RATE, show_default=True,
              help="Of pages and videos: pictures for each second of playing.")  # fmt: skip
@reports_errors
def view(
    arm: Arm,
    sources: tuple[Path, ...],
    pressures: PressureSort | None,
    missing: bool,
    port: int | None,
    host: str,
    browser: bool,
    page_path: Path | None,
    video_path: Path | None,
    start: float | None,
    end: float | None,
    speed: float,
    rate: float,
) -> None:
    """Show ARM (a parameter file or the name of a shipped arm) in the browser.

    Without files the arm moves under pressures that are set by hand. A LOG drives a simulation, beside which stand the
    heads that it has measured, with the gap as arrows. A TRAJECTORY (.npz, or a table with the rates of all lengths) is
    shown as it is. Of several files the first is drawn in the colours of its pressures, others as glass. Ctrl-C ends.
    """
    # Before the work, lest it be lost.
    if page_path is not None:
        checked_page_path(page_path)
    if video_path is not None:
        checked_video_path(video_path)
    with progress_bar() as bar:
        task = bar.add_task("reading and simulating", total=None)
        motions = part(motions_of(arm, sources, pressures=pressures, missing=missing), start, end)
        written = []

        def drawn(done: float) -> None:
            bar.update(task, completed=done)

        if page_path is not None:
            bar.reset(task, description="drawing the page", total=1.0)
            written.append(page(arm, motions, speed=speed, rate=rate, progress=drawn).write(page_path))
        if video_path is not None:
            bar.reset(task, description="drawing the video", total=1.0)
            written.append(write_video(video_path, arm, motions, speed=speed, rate=rate, progress=drawn))
    if written:
        say("Written: " + ", ".join(map(str, written)))
        return
    with Viewer(arm, motions, host=host, port=port) as viewer:
        say(f"{arm.name} at {viewer.url}; Ctrl-C ends")
        if browser and not webbrowser.open(viewer.url):
            say("No browser could be opened here; open that address in one.")
        viewer.wait()
