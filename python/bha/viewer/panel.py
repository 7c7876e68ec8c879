"""The controls beside the picture: time, pressures, gap, what is drawn."""

from __future__ import annotations

import html
from collections.abc import Callable
from itertools import cycle
from typing import TYPE_CHECKING, Any

import numpy as np

from bha.control import Limits
from bha.viewer.colors import BESIDE, MEASURED
from bha.viewer.motions import MAGNIFICATIONS, magnification

if TYPE_CHECKING:
    from bha.viewer.colors import PressureScale
    from bha.viewer.show import Show

PASCAL_PER_KILOPASCAL, MILLIMETRES_PER_METRE = 1e3, 1e3
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "5", "10", "50")
#: Of more inputs than this the sliders are folded away at first.
_MANY_INPUTS = 12
#: Rows of the chart of the gap: more than it has pixels across.
_MOST_CHART_ROWS = 600


class Panel:
    """The controls of a :class:`Show`. What a user does arrives by ``changed``, in a thread of viser's."""

    def __init__(
        self, gui: Any, show: Show, scale: PressureScale, reach: float, changed: Callable[[Callable[[], None]], None]
    ) -> None:
        """Put up the controls.

        Args:
            gui: of a ``viser.ViserServer``.
            show: what they control.
            scale: colours of the pressures.
            reach: length of the arm, m.
            changed: is called with what is to be done, and does it while nobody else uses the show.
        """
        self._show = show
        self.magnify = 1.0
        self.frames_wanted = True
        gui.configure_theme(show_logo=False, show_share_button=False)
        gui.add_html(legend(show, scale))
        if show.motions:
            self._add_time(gui, changed)
        self._add_pressures(gui, changed)
        self._gap = None
        if show.motions and show.motions[0].measured is not None:
            self._add_gap(gui, reach)
        frames = gui.add_checkbox("Frames of the heads", True)
        frames.on_update(lambda event: changed(lambda: setattr(self, "frames_wanted", event.target.value)))
        self._message = gui.add_markdown("", visible=False)

    def _add_time(self, gui: Any, changed: Callable[[Callable[[], None]], None]) -> None:
        show = self._show
        duration = max(show.end - show.start, 1e-3)
        with gui.add_folder("Time"):
            self._time = gui.add_slider("t [s]", min=0.0, max=duration, step=duration / 2000.0, initial_value=0.0)
            self._play = gui.add_button("Play", icon="player-play")
            speed = gui.add_dropdown("Speed", SPEEDS, initial_value="1")
            repeat = gui.add_checkbox("Repeat", show.repeat)

        def moved(event: Any) -> None:
            if event.client is not None:  # not moved by ourselves
                changed(lambda: show.go_to(show.start + event.target.value))

        def toggle(_: Any) -> None:
            def act() -> None:
                if show.live:
                    show.go_back()
                if not show.playing and show.time >= show.end:
                    show.go_to(show.start)
                show.playing = not show.playing

            changed(act)

        self._time.on_update(moved)
        self._play.on_click(toggle)
        speed.on_update(lambda event: changed(lambda: setattr(show, "speed", float(event.target.value))))
        repeat.on_update(lambda event: changed(lambda: setattr(show, "repeat", event.target.value)))

    def _add_pressures(self, gui: Any, changed: Callable[[Callable[[], None]], None]) -> None:
        show, limits = self._show, Limits.of(self._show.arm)
        self._live = None
        with gui.add_folder("Pressures [kPa]", expand_by_default=show.live and len(show.arm.inputs) <= _MANY_INPUTS):
            if show.motions:
                self._live = gui.add_checkbox("Live: set them by hand", False)
            self._pressures = [
                gui.add_slider(
                    name,
                    min=float(np.floor(low / PASCAL_PER_KILOPASCAL)),
                    max=float(np.ceil(high / PASCAL_PER_KILOPASCAL)),
                    step=1.0,
                    initial_value=float(np.round(value / PASCAL_PER_KILOPASCAL)),
                    disabled=not show.live,
                )
                for name, low, high, value in zip(show.arm.inputs, limits.low, limits.high, show.commands, strict=True)
            ]
            ambient = gui.add_button("All to ambient pressure")

        def set_one(k: int) -> Callable[[Any], None]:
            def act(event: Any) -> None:
                if event.client is not None:
                    changed(lambda: self._command(k, PASCAL_PER_KILOPASCAL * event.target.value))

            return act

        for k, slider in enumerate(self._pressures):
            slider.on_update(set_one(k))

        def relax() -> None:
            if show.motions and not show.live:
                show.go_live()
            show.command(show.relaxed)

        ambient.on_click(lambda _: changed(relax))
        if self._live is not None:

            def switch(event: Any) -> None:
                if event.client is not None:
                    changed(show.go_live if event.target.value else show.go_back)

            self._live.on_update(switch)

    def _command(self, k: int, pressure: float) -> None:
        if self._show.live:
            commands = self._show.commands.copy()
            commands[k] = pressure
            self._show.command(commands)

    def _add_gap(self, gui: Any, reach: float) -> None:
        self.magnify = float(magnification(self._show.motions, reach))
        with gui.add_folder("Gap, measured minus simulated"):
            drawn = gui.add_dropdown(
                "Arrows", tuple(f"{m} times" for m in MAGNIFICATIONS), initial_value=f"{self.magnify:.0f} times"
            )
            self._gap = gui.add_markdown("")
            self._add_gap_over_time(gui)
        drawn.on_update(lambda event: setattr(self, "magnify", float(event.target.value.split()[0])))

    def _add_gap_over_time(self, gui: Any) -> None:
        motion = self._show.motions[0]
        gaps, measured = motion.gaps(), motion.measured
        if gaps is None or measured is None:
            return
        rows = np.unique(np.linspace(0, len(gaps) - 1, _MOST_CHART_ROWS).round().astype(int))
        series: list[dict[str, Any]] = [{"label": "t [s]"}]
        series += [
            {"label": f"head {k + 1} [mm]", "stroke": f"rgb{color}", "width": 1.5}
            for k, color in zip(range(gaps.shape[1]), cycle((MEASURED, *BESIDE)))
        ]
        gui.add_uplot(
            (measured.time[rows] - self._show.start, *(MILLIMETRES_PER_METRE * gaps[rows].T)),
            tuple(series),
            scales={"x": {"time": False}},
            aspect=1.8,
        )

    def refresh(self, moment: Any) -> None:
        """Show what has become of time, pressures and gap; of a moment of the first arm."""
        show = self._show
        if show.motions:
            self._time.value = float(np.clip(show.time - show.start, self._time.min, self._time.max))
            # A button is told only what has changed.
            label, icon = ("Pause", "player-pause") if show.playing else ("Play", "player-play")
            if self._play.label != label:
                self._play.label, self._play.icon = label, icon
        if self._live is not None and self._live.value != show.live:
            self._live.value = show.live
        shown = show.commands if show.live else moment.pressures
        for slider, value in zip(self._pressures, shown, strict=True):
            if slider.disabled == show.live:
                slider.disabled = not show.live
            if np.isfinite(value):
                at = float(np.clip(np.round(value / PASCAL_PER_KILOPASCAL), slider.min, slider.max))
                slider.value = at
        if self._gap is not None:
            content = gap_in_words(np.linalg.norm(moment.gap, axis=-1))
            if self._gap.content != content:
                self._gap.content = content

    def say(self, text: str) -> None:
        """Show a line below the controls."""
        self._message.content, self._message.visible = f"**{text}**", True


def gap_in_words(gap: Any) -> str:
    """``head 1: 3.2 mm, head 2: not measured`` of distances, m, shape (n,)."""
    return ", ".join(
        f"head {k}: {MILLIMETRES_PER_METRE * value:.1f} mm" if np.isfinite(value) else f"head {k}: not measured"
        for k, value in enumerate(gap, start=1)
    )


def legend(show: Show, scale: PressureScale) -> str:
    """Name of the arm, what is drawn, and the colours of pressures, as HTML."""
    stops = ", ".join(f"rgb({r},{g},{b})" for r, g, b in scale.table[::17])
    low, high = (f"{pressure / PASCAL_PER_KILOPASCAL:.0f}" for pressure in (scale.low, scale.high))
    lines = [f"<b>{html.escape(show.arm.name)}</b>"]
    for k, motion in enumerate(show.motions):
        mark = "" if k == 0 else _mark(BESIDE[(k - 1) % len(BESIDE)])
        lines.append(f"{mark}{html.escape(motion.label)}")
    if show.motions and show.motions[0].measured is not None:
        lines.append(f"{_mark(MEASURED)}measured heads; arrows: the gap")
    bar = (
        f'<div style="height:0.8em;border-radius:3px;background:linear-gradient(to right,{stops})"></div>'
        f'<div style="display:flex;justify-content:space-between"><span>{low}</span><span>pressure [kPa, absolute]'
        f"</span><span>{high}</span></div>"
    )
    return f'<div style="padding:0 1em;font-size:0.875em;line-height:1.5">{"<br>".join(lines)}{bar}</div>'


def _mark(color: tuple[int, int, int]) -> str:
    return f'<span style="color:rgb{color}">&#9679;</span> '
