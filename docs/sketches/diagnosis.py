"""From a file and logs to a name, or to the statement that there is none."""

from __future__ import annotations

from _blocks import Box, sketch

from bha.plot import write_figure

with sketch(72, 40) as (figure, drawing):
    x = 36.0
    given = drawing.box(Box(x, 2.2, "given", "the arm's file, training logs, held-out logs", "measured"))
    setup = drawing.box(Box(x, 7.2, "do they belong together?", "tubes, azimuth, camera, gauge, units", "model"))
    plain = drawing.box(Box(x, 12.2, "the plain model, re-identified", "what it cannot absorb is the gap", "model"))
    gap = drawing.box(
        Box(
            x,
            17.7,
            "is the gap more than noise?",
            "noise of sensors, of pressures,\nof uncertain parameters",
            "model",
        )
    )
    search = drawing.box(
        Box(
            x,
            23.7,
            "which effect, where?",
            "every kind in every place, ranked by score,\nthe best refitted together",
            "model",
        )
    )
    decide = drawing.box(
        Box(x, 29.7, "does it earn its place?", "held-out error, criterion,\nlook-alikes, simpler places", "model")
    )
    drawing.down(given, setup, plain, gap, search, decide)
    bottom = 37.0
    named = drawing.box(Box(13.0, bottom, "named", "effect, place, numbers,\nintervals", "outcome", width=24))
    classed = drawing.box(
        Box(37.0, bottom, "one of a class", "and the experiment\nthat splits it", "outcome", width=21)
    )
    unknown = drawing.box(Box(60.0, bottom, "unexplained", "with the shape\nof the gap", "outcome", width=19))
    for box, word in ((named, "yes"), (classed, "others act alike"), (unknown, "no")):
        start = x + (box.x - x) * 0.35
        drawing.arrow((start, decide.y + decide.half_height), (box.x, box.y - box.half_height), text=word)
    fault = drawing.box(Box(66.0, 7.2, "fault", "repair", "outcome", width=10))
    drawing.arrow((setup.x + setup.half_width, 7.2), (fault.x - fault.half_width, 7.2), text="no")
    nothing = drawing.box(Box(66.0, 17.7, "equivalent", "", "outcome", width=10))
    drawing.arrow((gap.x + gap.half_width, 17.7), (nothing.x - nothing.half_width, 17.7), text="no")
    write_figure(figure, "diagnosis.svg")
