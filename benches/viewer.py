"""The viewer: what a picture costs, in time and in a page; folds as copies of one mesh, and tubes that are sent anew.

    python -m benches.viewer

Processor time on one core. Pages play 4 s at 25 pictures a second of each shipped arm under slow sines of pressure.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import bha
from bha.viewer import Motion, motions_of, page
from bha.viewer.app import serve, stop_serving
from bha.viewer.geometry import layout_of, picture
from bha.viewer.show import Show
from bha.viewer.solids import convolution
from bha.viewer.still import Still

RATE = 25.0


def motion_of(arm: bha.Arm) -> Motion:
    moments = np.linspace(0.0, 4.0, 101)
    low, high = (np.array([s.pressure_range[k] for s in arm.parameters.sections]) for k in (0, 1))
    base, top = 0.8 * low.max() + 0.2 * high.min(), 0.5 * (low.max() + high.min())
    waves = np.sin(moments[:, None] + np.arange(len(arm.inputs))) ** 2
    run = bha.simulate(arm, bha.Input(moments, base + (top - base) * waves), times=moments)
    return motions_of(arm, [run])[0]


def seconds(work: Callable[[], Any], times: int) -> float:
    work()
    start = time.process_time()
    for _ in range(times):
        work()
    return (time.process_time() - start) / times


def page_of_tubes(arm: bha.Arm, motion: Motion) -> int:
    """Size of a page in which the same surfaces are one mesh a picture, all of its vertices sent anew."""
    layout, fold = layout_of(arm), convolution()
    server = serve("127.0.0.1", 0)
    try:
        recorder = server.get_scene_serializer()
        for moment in np.arange(motion.time[0], motion.time[-1] + 1e-9, 1.0 / RATE):
            vertices = picture(layout, motion.at(float(moment)).lengths).folds.placed(fold)
            copies = len(fold.vertices) * np.arange(len(vertices))
            faces = (copies[:, None, None] + fold.faces).reshape(-1, 3)
            server.scene.add_mesh_simple("/arm", vertices.reshape(-1, 3), faces)
            recorder.insert_sleep(1.0 / RATE)
        return len(recorder.as_html())
    finally:
        stop_serving(server)


def main() -> None:
    table = Table("Arm", "Folds", "Picture [ms]", "Live, 1/30 s [ms]", "Still [ms]", "Page [MB]", "Tubes [MB]")
    for name in bha.robots.names():
        arm = bha.robots.load(name)
        motion, layout, still, live = motion_of(arm), layout_of(arm), Still(arm), Show(arm)
        moment = motion.at(2.0)
        live.command(motion.at(2.0).pressures)
        table.add_row(
            name,
            str(len(layout.fold_inputs)),
            f"{1e3 * seconds(lambda lay=layout, m=moment: picture(lay, m.lengths), 50):.2f}",  # type: ignore[misc]
            f"{1e3 * seconds(lambda show=live: show.advance(1.0 / 30.0), 60):.2f}",  # type: ignore[misc]
            f"{1e3 * seconds(lambda s=still, m=moment: s.draw([m]), 5):.0f}",  # type: ignore[misc]
            f"{len(page(arm, [motion], rate=RATE).content) / 1e6:.2f}",
            f"{page_of_tubes(arm, motion) / 1e6:.2f}",
        )
    Console().print(table)


if __name__ == "__main__":
    main()
