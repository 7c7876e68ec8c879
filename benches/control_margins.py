"""Stability margins of the controllers with the gains they come with, behind each level of pneumatics. ``python
benches/control_margins.py``.

The linear loop of :func:`bha.control.linear_loop` with the nominal arm at the middle of its lengths: the gains, the
peak of the sensitivity and where it is, and the rates of the lengths that sensor noise of 0.1 mm and 1 mbar keeps up.
"""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.table import Table

import bha
from bha.cli.control import CONTROLLERS
from bha.control import FeedbackLinearization, GravityPd, Sensors, linear_loop

SENSORS = Sensors(length_noise=1e-4, pressure_noise=100.0)


def main() -> None:
    out = Table(title="Margins")
    headings = ("Pneumatics", "Controller", "gains chosen", "sensitivity peak", "at [Hz]", "rates by noise [mm/s]")
    for heading in map(escape, headings):
        out.add_column(heading, justify="left" if heading in headings[:3] else "right")
    for level in ("ideal", "lag", "full"):
        arm = bha.robots.load("bha_nominal").with_changes(pneumatics=level)
        for name, law in CONTROLLERS.items():
            controller = law(arm)
            chosen = isinstance(controller, GravityPd | FeedbackLinearization)
            gains = ", ".join(f"{gain:.3g}" for gain in controller.gains) if chosen else "-"
            loop = linear_loop(controller)
            worst = loop.frequencies[loop.sensitivity.argmax()]
            noise = 1e3 * loop.rate_noise(SENSORS)
            out.add_row(level, name, gains, f"{loop.sensitivity_peak:.2f}", f"{worst:.1f}", f"{noise:.2f}")
    Console(width=120).print(out)


if __name__ == "__main__":
    main()
