"""The camera's frame as something the logs tell: its place and turn among the plain coordinates of a model.

What: heads are measured in a frame that stands some millimetres beside the arm's base and is turned by some degrees,
whatever the file says. That is no physics of the arm; left out it passes for offsets of pressures, tilts and payloads.
Source: ``[sensors]`` of the parameter file, :mod:`bha.arm.geometry`.
Frame and signs: position of the camera's origin in the world, m; rotation vector of its axes there, rad.
Limits: one frame for all logs; a frame that is off by tens of degrees or mirrored is a fault, see ``bha check``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bha.diagnosis.model import Model, coordinate
from bha.parameters import paths
from bha.parameters.sensors import SensorsParameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bha.arm import Arm

Array = NDArray[np.float64]

#: Numbers of ``[sensors]`` that heads tell, with unit and from which distance to the file's value on they are said.
FREE = (("camera_position", "m", 1e-3), ("camera_rotation", "rad", 5e-3))


def with_camera(model: Model, arm: Arm) -> Model:
    """The model with the camera's frame free; values of it that the file calls published are known and stay."""
    sensors = arm.parameters.sensors or SensorsParameters()
    spreads = sensors.uncertain
    values = {"camera_position": sensors.camera_position, "camera_rotation": sensors.camera_rotation_rad}
    free = [
        coordinate(f"{key} {axis}", f"sensors.{key}.{axis}", unit, values[key][k], spreads[key], logarithmic=False)
        for key, unit, _ in FREE
        if key in spreads
        for k, axis in enumerate(paths.AXES)
    ]
    return model.with_plain((*model.plain, *free), sensors) if free else model


def moved(model: Model, uncertainty: Sequence[tuple[float, float]], x: Array) -> str | None:
    """What is to be said of a camera that is elsewhere than the file has it; None where it is not told to be.

    Args:
        model: the model.
        uncertainty: 95 % interval of each of its coordinates.
        x: its coordinates.
    """
    texts = []
    for key, unit, least in FREE:
        own = [(c, float(x[k]), uncertainty[k]) for k, c in enumerate(model.plain) if paths.key_of(c.path) == key]
        size = float(np.linalg.norm([c.value(v) - c.start for c, v, _ in own]))
        if size < least or all(low <= c.start <= high for c, _, (low, high) in own):
            continue
        how = f"stands {1e3 * size:.3g} mm beside" if unit == "m" else f"is turned by {np.degrees(size):.2g} deg from"
        values = ", ".join(f"{c.value(v):.4g}" for c, v, _ in own)
        texts.append(f"{how} where the file has it, {key} = [{values}]")
    return f"the camera that sees the heads {' and '.join(texts)}; estimated, no effect of the arm" if texts else None
