"""Pictures and videos without a browser."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from bha.errors import InputError, MissingExtraError
from bha.viewer import motions_of, write_video
from bha.viewer.still import HEIGHT, WIDTH, Still

from . import made_log as made

pytest.importorskip("matplotlib")


def colored(picture: np.ndarray) -> np.ndarray:  # type: ignore[type-arg]
    """Pixels of the arm: far from grey, and not of the legend."""
    found = np.ptp(picture.astype(int), axis=-1) > 40
    found[-100:, : WIDTH // 2] = False
    return found


def test_a_still_shows_the_arm_where_it_is() -> None:
    """Two lengths of one arm: the lower end of what is coloured moves as the projection of the tip does."""
    arm = made.arm()
    (motion,) = motions_of(arm, [made.log()])
    still = Still(arm)
    pictures = [still.draw([motion.at(time)]) for time in (100.0, 101.0)]
    assert pictures[0].shape == (HEIGHT, WIDTH, 3)
    assert pictures[0].dtype == np.uint8
    rows = [np.flatnonzero(colored(picture).any(axis=1)) for picture in pictures]
    tips = [motion.at(time).heads[-1, 2] for time in (100.0, 101.0)]
    assert tips[1] - tips[0] > 0.02  # the arm hangs: longer is lower
    assert rows[1].max() > rows[0].max() + 5
    assert colored(pictures[0]).sum() > 5000
    np.testing.assert_array_equal(still.draw([motion.at(100.0)]), pictures[0])


def test_the_gap_is_drawn_where_heads_were_measured() -> None:
    arm = made.arm()
    (motion,) = motions_of(arm, [made.log()])
    still, moment = Still(arm, compared=True), motion.at(101.0)

    def orange(picture: np.ndarray) -> int:  # type: ignore[type-arg]
        return int((np.abs(picture.astype(int) - (213, 94, 0)).max(axis=-1) < 40).sum())

    little, much = (orange(still.draw([moment], magnify=m)) for m in (1.0, 20.0))
    assert 0 < little < much
    assert orange(still.draw([motion.at(99.0)])) == 0


@pytest.mark.filterwarnings("ignore::ResourceWarning")  # of imageio, which reads the video
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("ending", [".gif", ".webp", ".mp4"])
def test_videos_have_the_pictures_they_should(tmp_path: Path, ending: str) -> None:
    imageio = pytest.importorskip("imageio.v3")
    if ending == ".mp4":
        pytest.importorskip("imageio_ffmpeg")
    arm = made.arm()
    done: list[float] = []
    path = write_video(
        tmp_path / f"arm{ending}", arm, motions_of(arm, [made.log(seconds=1.0)]), rate=2.0, progress=done.append
    )
    pictures = list(imageio.imiter(path))
    assert len(pictures) == len(done) == 3
    assert done[-1] == 1.0
    assert pictures[0].shape[:2] == (HEIGHT, WIDTH)
    assert np.abs(pictures[0].astype(int) - pictures[1].astype(int)).max() > 60


def test_what_is_no_video_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = made.arm()
    motions = motions_of(arm, [made.log(seconds=0.5)])
    with pytest.raises(InputError, match=r"unknown extension \.avi; videos are written as \.mp4, \.gif, \.webp"):
        write_video(tmp_path / "arm.avi", arm, motions)
    with pytest.raises(InputError, match="nothing moves"):
        write_video(tmp_path / "arm.gif", arm, [])
    with pytest.raises(InputError, match="no_folder"):
        write_video(tmp_path / "no_folder" / "arm.gif", arm, motions)
    monkeypatch.setitem(sys.modules, "imageio.v2", None)
    with pytest.raises(MissingExtraError, match=r"bha\[view\]"):
        write_video(tmp_path / "arm.gif", arm, motions)
    assert list(tmp_path.iterdir()) == []
