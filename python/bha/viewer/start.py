"""``bha.view``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bha.viewer.app import Viewer
from bha.viewer.motions import Source, motions_of

if TYPE_CHECKING:
    from bha.arm import Arm
    from bha.recordings import PressureSort


def view(
    arm: Arm,
    *sources: Source,
    pressures: PressureSort | None = None,
    missing: bool = False,
    host: str = "127.0.0.1",
    port: int | None = None,
) -> Viewer:
    """Show an arm in the browser, and what was measured or simulated of it.

    A log drives a simulation; the heads that it has measured are drawn beside it, with the gap as arrows. A trajectory
    is shown as it is. Without either the arm moves live under pressures that are set by hand.

    Args:
        arm: the arm.
        sources: logs, recordings, trajectories, or paths of files. The first is drawn in the colours of its pressures,
            others beside it as glass.
        pressures: which pressures of logs drive the arm, ``"measured"`` or ``"commanded"``; measured ones where a log
            has them if None.
        missing: whether samples of logs that are files may be missing.
        host: who may see it: ``"127.0.0.1"`` this computer, ``"0.0.0.0"`` every one that can reach it.
        port: where; 0 is any that is free, None 8080 or the next free one.

    Returns:
        The running viewer, which ends with :meth:`Viewer.stop` or the program. In a notebook it shows itself.

    Raises:
        InputError: the port is taken, or a trajectory is of another arm.
        LogError: a file cannot be read, or a log lacks a pressure of the arm.
        SimulationError: the simulation of a log could not go on.
        MissingExtraError: viser or matplotlib is not installed.
    """
    return Viewer(arm, motions_of(arm, sources, pressures=pressures, missing=missing), host=host, port=port)
