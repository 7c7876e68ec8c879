"""A figure of matplotlib that notebooks show; imported where matplotlib is known to be there."""

from __future__ import annotations

import io

from matplotlib.figure import Figure

from bha.plot.settings import settings_in_force


class ShownFigure(Figure):
    """A figure made without ``pyplot``, which would else be text in a notebook."""

    def _repr_png_(self) -> bytes:
        """As a picture, with the settings under which it was drawn."""
        written = io.BytesIO()
        with settings_in_force():
            self.savefig(written, format="png")
        return written.getvalue()
