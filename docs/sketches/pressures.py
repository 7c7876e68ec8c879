"""From command to force: what a pressure passes through, and where a log comes in."""

from __future__ import annotations

from _blocks import Box, sketch

from bha.plot import write_figure

with sketch(70, 35) as (figure, drawing):
    x = 37.0
    chain = [
        drawing.box(Box(x, 2.2, "command", "pc11 of a log, or a controller", "measured")),
        drawing.box(
            Box(
                x,
                7.2,
                "pneumatics",
                "ideal: as it is · lag: first order\nfull: valve, chamber, controller",
                "model",
            )
        ),
        drawing.box(Box(x, 12.7, "chamber", "pressure of the air, in its volume")),
        drawing.box(Box(x, 18.2, "effects on pressures", "delay, lag, dead band,\ngain, offset", "model")),
        drawing.box(Box(x, 23.4, "bellows", "force = area × (p − ambient)")),
        drawing.box(Box(x, 28.2, "arm", "M q'' + C q' + N = τ", "model")),
        drawing.box(Box(x, 33.2, "sensors", "q11 (lengths), x1 y1 z1 (heads)", "measured")),
    ]
    drawing.down(*chain)
    chamber, arm = chain[2], chain[5]
    # Measured pressures come in behind the pneumatics.
    measured = drawing.box(Box(8.2, 12.7, "p11 of a log", "measured", "measured", width=14))
    drawing.arrow((measured.x + measured.half_width, 12.7), (chamber.x - chamber.half_width, 12.7))
    # With full pneumatics the arm's motion moves the volume.
    right = 66.0
    drawing.arrow(
        (arm.x + arm.half_width, arm.y),
        (right, arm.y),
        (right, chamber.y),
        (chamber.x + chamber.half_width, chamber.y),
        linestyle=(0, (4, 2)),
    )
    drawing.text(right + 1.2, (arm.y + chamber.y) / 2, "volume (full pneumatics)", rotation=90)
    write_figure(figure, "pressures.svg")
