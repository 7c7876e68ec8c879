"""Pressures as colours: one scale for the whole arm, over what its inputs are permitted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bha.support.extras import import_extra

if TYPE_CHECKING:
    from bha.arm import Arm

Colors = NDArray[np.uint8]

#: Of matplotlib: even to the eye, also to colour-blind ones and in grey print.
COLORMAP = "viridis"
#: Where a pressure is not known; of rigid pieces, the base, measured heads and arrows of the gap.
UNKNOWN, RIGID, BASE, MEASURED = (150, 150, 150), (196, 199, 204), (88, 92, 100), (213, 94, 0)
#: Of arms beside the first one (Okabe-Ito).
BESIDE = ((86, 180, 233), (204, 121, 167), (230, 159, 0), (0, 158, 115))


@dataclass(frozen=True, eq=False)
class PressureScale:
    """Colours of pressures.

    Attributes:
        low: Pa absolute, of the first colour.
        high: Pa absolute, of the last one.
        table: the colours between them, shape (256, 3).
    """

    low: float
    high: float
    table: Colors

    @classmethod
    def of(cls, arm: Arm) -> PressureScale:
        """From the lowest to the highest pressure that any section permits.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        colormaps = import_extra("matplotlib", extra="view", purpose="Drawing arms").colormaps
        table = np.round(255.0 * colormaps[COLORMAP](np.linspace(0.0, 1.0, 256))[:, :3]).astype(np.uint8)
        ranges = [section.pressure_range for section in arm.parameters.sections]
        return cls(min(low for low, _ in ranges), max(high for _, high in ranges), table)

    def colors(self, pressures: ArrayLike) -> Colors:
        """Colours (k, 3) of pressures (k,), Pa absolute; those beyond the scale have its ends, NaN is grey."""
        given = np.asarray(pressures, dtype=np.float64)
        share = np.clip((np.nan_to_num(given) - self.low) / (self.high - self.low), 0.0, 1.0)
        found = self.table[np.round(share * (len(self.table) - 1)).astype(np.int64)]
        return np.where(np.isnan(given)[:, None], np.array(UNKNOWN, dtype=np.uint8), found)


def linear_light(colors: ArrayLike) -> Colors:
    """Colours of a screen (sRGB) as shares of light, 0 to 255: what viser takes the colours of copies of a mesh for."""
    shares = np.asarray(colors, dtype=np.float64) / 255.0
    light = np.where(shares <= 0.04045, shares / 12.92, ((shares + 0.055) / 1.055) ** 2.4)
    return np.round(255.0 * light).astype(np.uint8)
