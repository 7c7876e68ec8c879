"""The order in which parameters are found, and what each step is told by."""

from __future__ import annotations

from _blocks import Box, sketch

from bha.plot import write_figure

with sketch(72, 35) as (figure, drawing):
    x = 28.0
    steps = [
        drawing.box(Box(x, 2.2, "logs and the arm's file", "pressures; lengths or heads", "measured")),
        drawing.box(Box(x, 7.2, "do they belong together?", "tubes, azimuth, camera, gauge", "model")),
        drawing.box(
            Box(x, 12.7, "statics", "area / stiffness, weight / stiffness,\nbending, rest lengths, camera", "model")
        ),
        drawing.box(Box(x, 18.2, "dampings and lags", "over decades, one batch\nof simulations judges all", "model")),
        drawing.box(
            Box(
                x,
                24.2,
                "everything together",
                "short windows first, then long ones;\nnoise weighs each channel",
                "model",
            )
        ),
        drawing.box(
            Box(
                x,
                30.7,
                "result",
                "values with intervals; what the logs\ndo not tell; held-out logs predicted",
                "outcome",
            )
        ),
    ]
    drawing.down(*steps)
    for step, told in (
        (steps[2], "told by: poses that\npressures hold"),
        (steps[3], "told by: how far outputs\nlag behind pressures"),
        (steps[4], "told by: the motion itself,\nsimulated and compared"),
    ):
        drawing.text(51.0, step.y, told, ha="left", style="italic")
    write_figure(figure, "estimation.svg")
