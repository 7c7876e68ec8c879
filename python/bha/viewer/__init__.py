"""An arm in the browser: live, or beside what was measured of it; as a page and as a video, too (extra ``view``)."""

from bha.viewer.app import Viewer
from bha.viewer.motions import Moment, Motion, motions_of, part
from bha.viewer.pages import Page, checked_page_path, page
from bha.viewer.start import view
from bha.viewer.still import draw_arm
from bha.viewer.videos import checked_video_path, write_video

__all__ = [
    "Moment",
    "Motion",
    "Page",
    "Viewer",
    "checked_page_path",
    "checked_video_path",
    "draw_arm",
    "motions_of",
    "page",
    "part",
    "view",
    "write_video",
]
