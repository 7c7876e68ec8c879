"""Blocks of a closed loop: what each part gets and gives."""

from __future__ import annotations

from _blocks import Box, sketch

from bha.plot import write_figure

with sketch(74, 31) as (figure, drawing):
    x = 42.0
    reference = drawing.box(Box(x, 2.2, "reference", "lengths, rates, accelerations", "measured"))
    law = drawing.box(
        Box(x, 8.4, "controller", "model along the reference,\nerrors corrected, limits kept", "model", width=34)
    )
    valves = drawing.box(Box(x, 15.2, "pneumatics of the plant", "ideal, lag, or valves and chambers", width=38))
    arm = drawing.box(Box(x, 20.6, "arm of the plant", "its own parameters and effects", width=38))
    sensors = drawing.box(Box(x, 26.4, "sensors", "noise, delay; lengths and pressures", "measured", width=38))
    observer = drawing.box(Box(9.0, 18.0, "observer", "Kalman filter\nor difference", "model", width=16))
    drawing.down(reference, law)
    drawing.arrow((x, law.y + law.half_height), (x, valves.y - valves.half_height), text="commanded\npressures")
    drawing.arrow((x, valves.y + valves.half_height), (x, arm.y - arm.half_height))
    drawing.down(arm, sensors)
    drawing.arrow(
        (sensors.x - sensors.half_width, sensors.y),
        (observer.x, sensors.y),
        (observer.x, observer.y + observer.half_height),
        text="measured",
        at=(observer.x, 23.5),
    )
    drawing.arrow(
        (observer.x, observer.y - observer.half_height),
        (observer.x, law.y),
        (law.x - law.half_width, law.y),
        text="state, and what\nthe model lacks",
        at=(observer.x, 12.2),
    )
    # With full pneumatics the arm moves the pressure in its chambers.
    right = 68.0
    drawing.arrow(
        (arm.x + arm.half_width, arm.y),
        (right, arm.y),
        (right, valves.y),
        (valves.x + valves.half_width, valves.y),
        linestyle=(0, (4, 2)),
        text="volume",
        at=(right, 17.9),
    )
    write_figure(figure, "control.svg")
