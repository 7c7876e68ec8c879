"""Videos and animated pictures of an arm, without a browser."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bha.errors import InputError
from bha.support.extras import import_extra
from bha.support.files import check_target, written_whole
from bha.viewer.motions import drawn_gap, magnification
from bha.viewer.pages import RATE, picture_times
from bha.viewer.show import Show
from bha.viewer.still import Still

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.viewer.motions import Motion

#: What imageio is told of each kind of file; ``rate`` are pictures a second.
_KINDS: dict[str, Callable[[float], dict[str, Any]]] = {
    ".mp4": lambda rate: {"fps": rate, "codec": "libx264", "quality": 8},
    ".gif": lambda rate: {"duration": 1000.0 / rate, "loop": 0},
    ".webp": lambda rate: {"duration": 1000.0 / rate, "loop": 0},
}


def checked_video_path(path: str | os.PathLike[str]) -> Path:
    """The path of a video to be written.

    Raises:
        InputError: the folder does not exist, or the extension is none of ``.mp4``, ``.gif`` and ``.webp``.
    """
    target = Path(path)
    if target.suffix.lower() not in _KINDS:
        found = target.suffix or "(none)"
        raise InputError(f"{target}: unknown extension {found}; videos are written as {', '.join(_KINDS)}")
    check_target(target)
    return target


def write_video(
    path: str | os.PathLike[str],
    arm: Arm,
    motions: Sequence[Motion],
    *,
    speed: float = 1.0,
    rate: float = RATE,
    magnify: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write motions of an arm as a video, whole or not at all; the extension chooses the format.

    Args:
        path: ``.mp4`` (H.264), or an animated picture, ``.gif`` or ``.webp``.
        arm: the arm.
        motions: of :func:`bha.viewer.motions_of`, one at least.
        speed: how many seconds are played in one.
        rate: pictures for each second of playing.
        magnify: how many times as long as they are gaps are drawn; None: so that they are seen.
        progress: called with the fraction done.

    Raises:
        InputError: nothing moves, a rate or speed that is not positive, an unknown extension, a missing folder.
        MissingExtraError: matplotlib or imageio is not installed.
    """
    target = checked_video_path(path)
    if not motions:
        raise InputError("nothing moves: a video needs a log or a trajectory")
    imageio = import_extra("imageio.v2", extra="view", purpose="Writing videos")
    show, compared = Show(arm, motions), motions[0].measured is not None
    times = picture_times(show.start, show.end, rate=rate, speed=speed)
    still = Still(arm, compared=compared)
    drawn = float(magnification(motions, still.reach)) if magnify is None else magnify
    gap = f", {drawn_gap(drawn)}" if compared else ""
    kind = target.suffix.lower()
    with (
        written_whole(target) as temporary,
        # By name: what chooses by extension may not know that of a temporary file.
        imageio.get_writer(temporary, format=kind, mode="I", **_KINDS[kind](rate)) as writer,
    ):
        for k, time in enumerate(times):
            show.go_to(float(time))
            caption = f"{arm.name}: {motions[0].label}{gap}\nt = {time - show.start:.2f} s"
            writer.append_data(still.draw(show.moments(), caption, drawn))
            if progress is not None:
                progress((k + 1) / len(times))
    return target
