"""A viewer that needs no server: one HTML file that plays what is shown, by itself and without a network."""

from __future__ import annotations

import html
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.errors import InputError
from bha.support.files import check_target, written_whole
from bha.viewer.app import serve, stop_serving
from bha.viewer.motions import drawn_gap, magnification
from bha.viewer.scene import Scene
from bha.viewer.show import Show

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.viewer.motions import Motion

Array = NDArray[np.float64]

#: Pictures a second that is shown, and the most in one file: some 10 kB each.
RATE, MOST_PICTURES = 25.0, 5000
#: Height in a notebook, pixels.
_NOTEBOOK_HEIGHT = 600


class Page:
    """A self-contained HTML page; in a notebook it shows itself, also where the kernel is on another computer."""

    def __init__(self, content: str) -> None:
        """Hold the page's text."""
        self.content = content

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the page, whole or not at all.

        Raises:
            InputError: the folder does not exist, or the file's name does not end in ``.html``.
        """
        target = checked_page_path(path)
        with written_whole(target) as temporary:
            temporary.write_text(self.content, encoding="utf-8")
        return target

    def __repr__(self) -> str:
        """Its size."""
        return f"<Page of {len(self.content) / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        content = html.escape(self.content, quote=True)
        return f'<iframe srcdoc="{content}" width="100%" height="{_NOTEBOOK_HEIGHT}" style="border:0"></iframe>'


def checked_page_path(path: str | os.PathLike[str]) -> Path:
    """The path of a page to be written.

    Raises:
        InputError: the folder does not exist, or the file's name does not end in ``.html``.
    """
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"{target}: unknown extension {target.suffix or '(none)'}; pages are written as .html")
    check_target(target)
    return target


def picture_times(start: float, end: float, *, rate: float, speed: float, most: int | None = None) -> Array:
    """The times, s, of pictures that play what happened from ``start`` to ``end``.

    Args:
        start: s.
        end: s.
        rate: pictures for each second of playing.
        speed: how many seconds are played in one.
        most: how many pictures are too many.

    Raises:
        InputError: a rate or speed that is not positive, or too many pictures.
    """
    for name, value in (("rate", rate), ("speed", speed)):
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: {value}; a number above 0 is needed")
    count = int(np.floor((end - start) / speed * rate + 1e-9)) + 1
    if most is not None and count > most:
        least = float(np.ceil(10.0 * (end - start) * rate / most) / 10.0)
        raise InputError(
            f"{end - start:g} s are {count} pictures, at most {most} are allowed; play them faster "
            f"(speed {least:g}), with fewer pictures a second (rate), or show a part of it"
        )
    return np.asarray(start + np.arange(count) * (speed / rate), dtype=np.float64)


def page(
    arm: Arm,
    motions: Sequence[Motion] = (),
    *,
    speed: float = 1.0,
    rate: float = RATE,
    magnify: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Page:
    """A page that plays motions of an arm; without any the arm at rest under ambient pressure.

    Args:
        arm: the arm.
        motions: of :func:`bha.viewer.motions_of`.
        speed: how many seconds are played in one.
        rate: pictures for each second of playing.
        magnify: how many times as long as they are gaps are drawn; None: so that they are seen.
        progress: called with the fraction done.

    Raises:
        InputError: a rate or speed that is not positive, or too many pictures.
        MissingExtraError: viser or matplotlib is not installed.
    """
    show = Show(arm, motions)
    times = picture_times(show.start, show.end, rate=rate, speed=speed, most=MOST_PICTURES)
    server = serve("127.0.0.1", 0)
    try:
        compared = bool(motions) and motions[0].measured is not None
        scene = Scene(server, arm, max(1, len(motions)), compared=compared)
        drawn = float(magnification(motions, scene.layout.reach)) if magnify is None else magnify
        scene.caption(f"{arm.name}; {drawn_gap(drawn)}" if compared else arm.name)
        scene.draw(show.moments(), drawn)
        recorder = server.get_scene_serializer()
        for k, time in enumerate(times[1:], start=1):
            recorder.insert_sleep(1.0 / rate)
            show.go_to(float(time))
            scene.draw(show.moments(), drawn)
            if progress is not None:
                progress(k / (len(times) - 1))
        if len(times) > 1:
            recorder.insert_sleep(1.0 / rate)
        return Page(recorder.as_html())
    finally:
        stop_serving(server)
